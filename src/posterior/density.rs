//! The density of the constants, with all amplitudes that enter linearly integrated out, and the choices of noise, of acting effects and of the
//! size of all others summed. The noise keeps the scale that its contrasts have, to which no effect contributes: left free, an answer that does
//! not describe the data took its misfit for noise and was 60 times as wide.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::equations::Equations;
use super::evidence::{Compiled, PlacesOf, log_evidences};
use super::space::Space;
use super::surface::Surface;
use crate::error::Result;
use crate::infer::{Known, Marginal};
use crate::laminate::Material;
use crate::numeric::log_sum_exp;
use crate::sample::{DensityError, LogDensity};

/// What distinguishes a part of the mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureChoice {
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

/// A part of the mixture, in directions of unit prior.
struct MixturePart {
    choice: MixtureChoice,
    equations: Compiled,
}

/// What is known of the constants beside the data.
pub struct ConstantsPrior {
    pub material: Material,
    /// Border units.
    pub marginals: Vec<Marginal>,
    /// What other experiments say of them.
    pub known: Option<Arc<Known>>,
}

/// A mixture of parts, each with its noise and its prior of the amplitudes.
pub struct Density {
    names: Vec<String>,
    prior: ConstantsPrior,
    surface: Surface,
    pub space: Space,
    /// The data under every choice of the noise.
    pub noise: Vec<Equations>,
    parts: Vec<MixturePart>,
}

impl Density {
    /// `noise` are choices of the noise, `choices` the parts.
    pub fn new(
        prior: ConstantsPrior,
        surface: Surface,
        space: Space,
        noise: Vec<Equations>,
        choices: Vec<MixtureChoice>,
    ) -> Self {
        let names = prior.material.constants().iter();
        let names: Vec<String> = names.map(|n| (*n).to_string()).collect();
        let part = |choice: MixtureChoice| {
            let sds = space.sds(&choice.own, choice.size, choice.rival);
            MixturePart {
                equations: Compiled::new(
                    &noise[choice.noise].turned(&lower(&space.covariance(&sds))),
                ),
                choice,
            }
        };
        Self {
            parts: choices.into_iter().map(part).collect(),
            names,
            prior,
            surface,
            space,
            noise,
        }
    }

    /// Number of constants.
    pub fn constants(&self) -> usize {
        self.prior.marginals.len()
    }

    /// Coordinates of the constants, 1 first, and the factors of what the data leave there: 1, of the modes, the coordinates again.
    pub fn place(&self, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let own = self.surface.ratios.of(x);
        let modes = self.surface.change(&own);
        let one = || std::iter::once(1.0);
        let factors = one()
            .chain(modes.iter().copied())
            .chain(own.iter().copied());
        let factors = factors.collect();
        (one().chain(own).collect(), factors)
    }

    /// Log prior density of a point with what other experiments say of it, -inf outside.
    fn log_prior(&self, x: &[f64]) -> f64 {
        let ConstantsPrior {
            material,
            marginals,
            known,
        } = &self.prior;
        if !material.ply(x).is_admissible() {
            return f64::NEG_INFINITY;
        }
        let of = |(x, m): (&f64, &Marginal)| m.log_density(*x);
        let prior: f64 = x.iter().zip(marginals).map(of).sum();
        prior + known.as_ref().map_or(0.0, |k| k.log_density(x))
    }

    /// Log weight of every part at some points, part by part.
    fn weights_at(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let parts: Vec<&Compiled> = self.parts.iter().map(|p| &p.equations).collect();
        let places: Vec<(Vec<f64>, Vec<f64>)> = points.iter().map(|x| self.place(x)).collect();
        let mut weights = log_evidences(&parts, &PlacesOf::new(&places));
        for (part, weights) in self
            .parts
            .iter()
            .zip(weights.chunks_mut(points.len().max(1)))
        {
            weights
                .iter_mut()
                .for_each(|w| *w += part.choice.log_weight);
        }
        weights
    }

    /// Log weights of all parts at each of some points.
    pub fn weights(&self, points: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let all = self.weights_at(points);
        let own = |k: usize| all.iter().skip(k).step_by(points.len()).copied().collect();
        (0..points.len()).map(own).collect()
    }

    /// How much a density has to do.
    pub fn size_in_words(&self) -> String {
        let [parts, directions] = [self.parts.len(), self.space.directions()];
        format!("{parts} choices of noise and effects, {directions} directions")
    }

    pub fn choice(&self, part: usize) -> &MixtureChoice {
        &self.parts[part].choice
    }
}

impl LogDensity for Density {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        let mut value = [0.0];
        self.values(x, &mut value)?;
        DensityError::sort(value[0])
    }

    fn values(&self, xs: &[f64], out: &mut [f64]) -> Result<()> {
        let count = out.len();
        let mut inside = Vec::new();
        let mut points = Vec::new();
        for (i, out) in out.iter_mut().enumerate() {
            let x: Vec<f64> = (0..self.dim()).map(|k| xs[k * count + i]).collect();
            *out = self.log_prior(&x);
            if *out > f64::NEG_INFINITY {
                inside.push(i);
                points.push(x);
            }
        }
        let weights = self.weights_at(&points);
        for (k, i) in inside.into_iter().enumerate() {
            let own = weights.iter().skip(k).step_by(points.len());
            out[i] += log_sum_exp(own.copied());
        }
        Ok(())
    }
}

/// The lower factor of a covariance that may lack rank.
pub fn lower(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    /// Part of the identity that gives it full rank.
    const JITTER: f64 = 1e-12;
    let n = covariance.nrows();
    let with = |more: f64| (covariance + DMatrix::identity(n, n) * more).cholesky();
    let factor = with(JITTER).or_else(|| with(1e4 * JITTER));
    factor.map_or_else(|| DMatrix::identity(n, n), |f| f.l())
}
