//! Where walkers start, and which starts are refused.

use super::density::{DensityError, LogDensity};
use super::gaussian::{add_lower, cholesky};
use super::stream::{Key, Stream};
use super::{EnsembleState, Sampler};
use crate::error::{Error, Result};

/// Times a walker of a ball is drawn again when it falls outside the support.
const REDRAWS: usize = 100;

/// Lane of the stream that places ensembles and walkers; walkers' own lanes count from 0.
const LANE: u64 = u64::MAX;

/// A function that places walker `.1` of ensemble `.0` with numbers of the given stream.
pub type Place<'a> = &'a (dyn Fn(usize, usize, &mut Stream) -> Vec<f64> + Sync);

/// Where the walkers of every ensemble start.
pub enum Start<'a> {
    /// Overdispersed balls: each ensemble has its own centre, `centre` + `spread` L z, and its walkers lie about that
    /// centre as `spread` L z, with L L^T = `covariance` (dim x dim, row-major): a run of independent ensembles starts
    /// sqrt(2) `spread` times as wide as the guess. Walkers outside the support are drawn again, up to 100 times.
    Ball {
        /// Guess of the target's location, length dim.
        centre: &'a [f64],
        /// Guess of the target's covariance, dim x dim, row-major.
        covariance: &'a [f64],
        /// Spread in units of the guess; 1 to 3.
        spread: f64,
    },
    /// Walkers from a function, as given; `covariance` is the first proposal of samplers that need one.
    Walkers {
        /// Places each walker.
        place: Place<'a>,
        /// Guess of the target's covariance, dim x dim, row-major.
        covariance: &'a [f64],
    },
}

impl Start<'_> {
    fn covariance(&self) -> &[f64] {
        match self {
            Start::Ball { covariance, .. } | Start::Walkers { covariance, .. } => covariance,
        }
    }

    /// Places and checks one ensemble.
    ///
    /// # Errors
    /// The input's fault: a covariance that is not positive definite, a start of the wrong length, NaN at a
    /// walker, every walker outside the support, or what the sampler itself refuses.
    pub(crate) fn begin(
        &self,
        target: &dyn LogDensity,
        sampler: &dyn Sampler,
        key: Key,
    ) -> Result<EnsembleState> {
        let (dim, group) = (target.dim(), key.ensemble as usize);
        let walkers = sampler.walkers(dim);
        let mut rng = Stream::at(key, LANE, 0);
        let mut x = Vec::with_capacity(walkers * dim);
        let mut lp = Vec::with_capacity(walkers);
        if dim == 0 || self.covariance().len() != dim * dim {
            return Err(Error::input(
                "start covariance",
                format!("{dim} x {dim} values, and at least one parameter"),
            )
            .found(self.covariance().len()));
        }
        let ball = Ball::new(self, dim, &mut rng)?;
        for walker in 0..walkers {
            let (point, value) = match (self, &ball) {
                (Start::Walkers { place, .. }, _) => {
                    let point = place(group, walker, &mut rng);
                    let value = evaluate(target, &point, group, walker)?;
                    (point, value)
                }
                (_, Some(ball)) => ball.draw(target, group, walker, &mut rng)?,
                (_, None) => return Err(Error::program("start", "a ball or a function")),
            };
            x.extend(point);
            lp.push(value);
        }
        if lp.iter().all(|v| *v == f64::NEG_INFINITY) {
            return Err(Error::input(
                format!("start of ensemble {group}"),
                "at least one walker inside the support of the posterior",
            )
            .found(format!("log density -inf at all {walkers} walkers"))
            .hint("start closer to admissible values, or check the bounds of the prior"));
        }
        sampler
            .begin(dim, x, lp, self.covariance())
            .map_err(|e| e.within(format!("ensemble {group}")))
    }
}

/// A ball with its ensemble's own centre.
struct Ball {
    centre: Vec<f64>,
    lower: Vec<f64>,
    spread: f64,
}

impl Ball {
    fn new(start: &Start<'_>, dim: usize, rng: &mut Stream) -> Result<Option<Self>> {
        let Start::Ball {
            centre,
            covariance,
            spread,
        } = start
        else {
            return Ok(None);
        };
        let mut lower = covariance.to_vec();
        if centre.len() != dim || !cholesky(&mut lower, dim) {
            return Err(Error::input(
                "start",
                format!("a centre of {dim} values and a positive definite covariance"),
            ));
        }
        let mut ball = Self {
            centre: centre.to_vec(),
            lower,
            spread: *spread,
        };
        ball.centre = ball.point(rng);
        Ok(Some(ball))
    }

    fn point(&self, rng: &mut Stream) -> Vec<f64> {
        let z: Vec<f64> = self.centre.iter().map(|_| rng.normal()).collect();
        let mut point = self.centre.clone();
        add_lower(&self.lower, &z, self.spread, &mut point);
        point
    }

    fn draw(
        &self,
        target: &dyn LogDensity,
        group: usize,
        walker: usize,
        rng: &mut Stream,
    ) -> Result<(Vec<f64>, f64)> {
        let mut point = self.point(rng);
        let mut value = evaluate(target, &point, group, walker)?;
        for _ in 0..REDRAWS {
            if value > f64::NEG_INFINITY {
                break;
            }
            point = self.point(rng);
            value = evaluate(target, &point, group, walker)?;
        }
        Ok((point, value))
    }
}

fn evaluate(target: &dyn LogDensity, point: &[f64], group: usize, walker: usize) -> Result<f64> {
    let place = || format!("start of walker {walker} of ensemble {group}");
    if point.len() != target.dim() || point.iter().any(|v| !v.is_finite()) {
        return Err(
            Error::input(place(), format!("{} finite values", target.dim()))
                .found(format!("{point:?}")),
        );
    }
    match target.log_density(point) {
        Ok(value) => Ok(value),
        Err(DensityError::Outside) => Ok(f64::NEG_INFINITY),
        Err(DensityError::Undefined(value)) => Err(Error::input(
            place(),
            "a log density that is a number or -inf",
        )
        .found(format!("{value} at {point:?}"))
        .hint("the posterior is not defined where the walkers start")),
        Err(DensityError::Fatal(error)) => Err(error.within(place())),
    }
}
