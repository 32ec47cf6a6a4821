//! One conditional answer: the density of the constants, with all amplitudes that enter linearly integrated out, and the choices of noise,
//! of acting effects and of the size of all others summed. The noise keeps the scale that its contrasts have, to which no effect
//! contributes: left free, an answer that does not describe the data took its misfit for noise and was 60 times as wide.

use nalgebra::DMatrix;

use super::quadratic::{At, Equations};
use super::space::Space;
use crate::infer::{LogDensity, Marginal};
use crate::laminate::Material;
use crate::trace::subsets::log_sum;

/// What distinguishes a part of the mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Which of the answer's choices of the noise.
    pub noise: usize,
    /// Candidates that act with their full prior sds.
    pub own: Vec<usize>,
    /// Size of the other candidates over their prior sds.
    pub size: f64,
    /// Stresses of the near-edge rival over the nominal one.
    pub rival: f64,
    /// Logarithm of prior probability and normalisation.
    pub log_weight: f64,
}

/// What a point means.
pub(super) struct Place {
    /// Distances of the constants from where the test was linearised, prior sds.
    pub distances: Vec<f64>,
}

/// A part of the mixture, in directions of unit prior.
struct Part {
    choice: Choice,
    equations: Equations,
}

/// The density of one answer.
pub struct Answer {
    names: Vec<String>,
    material: Material,
    /// Priors of the constants, and where the test was linearised, border units.
    constants: Vec<(Marginal, f64)>,
    pub(super) space: Space,
    /// The data under every choice of the noise.
    pub(super) noise: Vec<Equations>,
    parts: Vec<Part>,
}

impl Answer {
    /// `constants` come with where the test was linearised; `noise` are choices of the noise, `choices` the parts.
    pub(super) fn new(
        (material, constants): (Material, Vec<(Marginal, f64)>),
        space: Space,
        noise: Vec<Equations>,
        choices: Vec<Choice>,
    ) -> Self {
        let names = material.constants().iter();
        let names: Vec<String> = names.map(|n| (*n).to_string()).collect();
        let part = |choice: Choice| {
            let sds = space.sds(&choice.own, choice.size, choice.rival);
            Part {
                equations: noise[choice.noise].turned(&lower(&space.covariance(&sds))),
                choice,
            }
        };
        Self {
            parts: choices.into_iter().map(part).collect(),
            names,
            material,
            constants,
            space,
            noise,
        }
    }

    /// Number of constants.
    pub fn constants(&self) -> usize {
        self.constants.len()
    }

    pub(super) fn place(&self, x: &[f64]) -> Place {
        let distance = |(x, (m, at)): (&f64, &(Marginal, f64))| (x - at) / m.sd;
        Place {
            distances: x.iter().zip(&self.constants).map(distance).collect(),
        }
    }

    /// Log prior density of a point, -inf outside.
    fn log_prior(&self, x: &[f64]) -> f64 {
        if !self.material.ply(x).is_admissible() {
            return f64::NEG_INFINITY;
        }
        let of = |(x, (m, _)): (&f64, &(Marginal, f64))| m.log_density(*x);
        x.iter().zip(&self.constants).map(of).sum()
    }

    /// Log weight of every part at a point.
    pub(super) fn weights(&self, x: &[f64]) -> Vec<f64> {
        let place = self.place(x);
        let mut at = At::default();
        let of = |part: &Part| part.log_density(&place, &mut at);
        self.parts.iter().map(of).collect()
    }

    /// How much a density has to do.
    pub(super) fn size_in_words(&self) -> String {
        let [parts, directions] = [self.parts.len(), self.space.directions()];
        format!("{parts} choices of noise and effects, {directions} directions")
    }

    pub(super) fn choice(&self, part: usize) -> &Choice {
        &self.parts[part].choice
    }
}

impl LogDensity for Answer {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> f64 {
        let mut value = [0.0];
        self.log_density_batch(x, &mut value);
        value[0]
    }

    /// Part by part: the equations of one stay near the processor while all points have them.
    fn log_density_batch(&self, xs: &[f64], out: &mut [f64]) {
        let count = out.len();
        let point = |i: usize| -> Vec<f64> { (0..self.dim()).map(|k| xs[k * count + i]).collect() };
        let points: Vec<Vec<f64>> = (0..count).map(point).collect();
        let inside: Vec<usize> = (0..count)
            .filter(|&i| {
                out[i] = self.log_prior(&points[i]);
                out[i] > f64::NEG_INFINITY
            })
            .collect();
        let places: Vec<Place> = inside.iter().map(|&i| self.place(&points[i])).collect();
        let mut weights = vec![Vec::with_capacity(self.parts.len()); inside.len()];
        let mut at = At::default();
        for part in &self.parts {
            for (place, weights) in places.iter().zip(&mut weights) {
                weights.push(part.log_density(place, &mut at));
            }
        }
        for (i, weights) in inside.into_iter().zip(weights) {
            out[i] += log_sum(weights.into_iter());
        }
    }
}

impl Part {
    /// Log evidence of the data with everything linear integrated out, with the part's weight.
    fn log_density(&self, place: &Place, at: &mut At) -> f64 {
        self.equations.at(&place.distances, at);
        let Some([log_det, square]) = at.eliminate() else {
            return f64::NEG_INFINITY;
        };
        self.choice.log_weight - 0.5 * (at.rest - square) - log_det
    }
}

/// The lower factor of a covariance that may lack rank.
pub(super) fn lower(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    /// Part of the identity that gives it full rank.
    const JITTER: f64 = 1e-12;
    let n = covariance.nrows();
    let with = |more: f64| (covariance + DMatrix::identity(n, n) * more).cholesky();
    let factor = with(JITTER).or_else(|| with(1e4 * JITTER));
    factor.map_or_else(|| DMatrix::identity(n, n), |f| f.l())
}
