//! The density of the constants, with all amplitudes that enter linearly integrated out, and the choices of noise, of acting effects and of the
//! size of all others summed. The scale of the noise is a parameter where the model is the declared one; of the posterior to quote it is that of
//! the contrasts, to which no effect contributes: left free, an answer that does not describe the data took its misfit for noise and was 60
//! times as wide.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::equations::Equations;
use super::evidence::{Compiled, PlacesOf, log_evidences};
use super::space::Space;
use super::surface::MeanSurface;
use crate::error::Result;
use crate::infer::{ConstantsLikelihood, Marginal};
use crate::laminate::Material;
use crate::numeric::log_sum_exp;
use crate::parameter;
use crate::sample::{DensityError, LogDensity};

/// Parameters farther from their priors' means, prior sds, are no finding: what the model lacks has driven them there.
pub const REASON_SDS: f64 = 6.0;

/// What distinguishes a part of the mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureChoice {
    /// Which of the choices of the noise.
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
#[derive(Clone)]
struct MixturePart {
    choice: MixtureChoice,
    equations: Compiled,
}

/// What is known of the constants beside the data.
#[derive(Clone)]
pub struct ConstantsPrior {
    pub material: Material,
    /// Border units.
    pub marginals: Vec<Marginal>,
    /// What other experiments say of them.
    pub known: Option<Arc<ConstantsLikelihood>>,
}

/// The noise of a point as a parameter, with the prior 1 / noise.
#[derive(Debug, Clone, Copy)]
pub struct NoiseScale {
    /// The noise of a point, nm, at the scale that its contrasts have.
    pub reference_nm: f64,
    /// Degrees of freedom of those contrasts.
    pub freedom: f64,
    /// Values that the model can follow beside them.
    pub followed: f64,
    /// Where it is declared.
    pub declared_nm: Option<f64>,
}

impl NoiseScale {
    /// What the contrasts and the prior say of a scale.
    fn log_density(&self, scale: f64) -> f64 {
        if self.declared_nm.is_some() {
            return 0.0;
        }
        if scale.is_nan() || scale <= 0.0 || scale.is_infinite() {
            return f64::NEG_INFINITY;
        }
        let log = (self.freedom + self.followed + 1.0) * scale.ln();
        -0.5 * self.freedom / (scale * scale) - log
    }
}

/// A mixture of parts, each with its noise and its prior of the amplitudes.
#[derive(Clone)]
pub struct PosteriorDensity {
    names: Vec<String>,
    prior: ConstantsPrior,
    surface: MeanSurface,
    pub space: Space,
    /// The data under every choice of the noise.
    pub noise: Vec<Equations>,
    parts: Vec<MixturePart>,
    scale: Option<NoiseScale>,
}

impl PosteriorDensity {
    /// `noise` are choices of the noise, `choices` the parts.
    pub fn new(
        prior: ConstantsPrior,
        surface: MeanSurface,
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
            scale: None,
        }
    }

    /// The same with the noise of a point as a last parameter, unless it is declared.
    #[must_use]
    pub fn with_noise(mut self, scale: NoiseScale) -> Self {
        if scale.declared_nm.is_none() {
            self.names.push(parameter::NOISE.into());
        }
        self.scale = Some(scale);
        self
    }

    /// Take some of the data's square, which no parameter changes, out of every part.
    pub(super) fn take_from_rest(&mut self, square: f64) {
        for noise in &mut self.noise {
            noise.rest[(0, 0)] -= square;
        }
        for part in &mut self.parts {
            let sds = (self.space).sds(&part.choice.own, part.choice.size, part.choice.rival);
            let root = lower(&self.space.covariance(&sds));
            part.equations = Compiled::new(&self.noise[part.choice.noise].turned(&root));
        }
    }

    /// Number of constants.
    pub fn constants(&self) -> usize {
        self.prior.marginals.len()
    }

    /// Names of the constants.
    pub fn constant_names(&self) -> &[String] {
        &self.names[..self.constants()]
    }

    /// Priors of the constants.
    pub fn marginals(&self) -> &[Marginal] {
        &self.prior.marginals
    }

    /// The same density with other priors of the constants, in their order.
    #[must_use]
    pub fn with_marginals(&self, marginals: Vec<Marginal>) -> Self {
        let mut other = self.clone();
        other.prior.marginals = marginals;
        other
    }

    /// The same density without the priors' cuts.
    #[must_use]
    pub fn untruncated(&self) -> Self {
        let whole = |m: &Marginal| Marginal {
            truncate: None,
            ..*m
        };
        self.with_marginals(self.marginals().iter().map(whole).collect())
    }

    /// Whether a point's constants lie within [`REASON_SDS`] of their priors' means.
    pub fn is_credible(&self, x: &[f64]) -> bool {
        let mut pairs = self.marginals().iter().zip(x);
        pairs.all(|(m, x)| (x - m.mean).abs() <= REASON_SDS * m.sd)
    }

    /// The same density, cut off [`REASON_SDS`] from the priors' means and a tenth of the constants' from zero.
    #[must_use]
    pub fn within_reason(&self) -> Self {
        let cut = |m: &Marginal| {
            let [low, high] = m.bounds();
            let reach = REASON_SDS * m.sd;
            let low = low.max(m.mean - reach).max(0.1 * m.mean);
            Marginal {
                truncate: Some([low, high.min(m.mean + reach)]),
                ..*m
            }
        };
        self.with_marginals(self.marginals().iter().map(cut).collect())
    }

    /// Whether constants are those of a material.
    pub fn is_admissible(&self, constants: &[f64]) -> bool {
        self.prior.material.ply(constants).is_admissible()
    }

    /// Scale of the noise at a point of the parameters.
    pub fn noise_scale(&self, x: &[f64]) -> f64 {
        let own = |scale: NoiseScale| {
            let noise = scale.declared_nm.unwrap_or_else(|| x[self.constants()]);
            noise / scale.reference_nm
        };
        self.scale.map_or(1.0, own)
    }

    /// A point to start from and the sd to start with: where the test was linearised, and the noise as it was estimated.
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let mut centre = self.surface.ratios.constants(&vec![0.0; self.constants()]);
        let mut sd: Vec<f64> = self.marginals().iter().map(|m| m.sd).collect();
        if let Some(scale) = self.scale.filter(|s| s.declared_nm.is_none()) {
            centre.push(scale.reference_nm);
            sd.push(0.05 * scale.reference_nm);
        }
        (centre, sd)
    }

    /// Coordinates of the constants, 1 first, and the factors of what the data leave there: 1, of the modes, the coordinates again.
    pub fn place(&self, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let own = self.surface.ratios.of(&x[..self.constants()]);
        let modes = self.surface.change(&own);
        let one = || std::iter::once(1.0);
        let factors = one()
            .chain(modes.iter().copied())
            .chain(own.iter().copied());
        let factors = factors.collect();
        (one().chain(own).collect(), factors)
    }

    /// Log prior density of a point with what other experiments and contrasts say of it, -inf outside.
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
        let noise = self
            .scale
            .map_or(0.0, |s| s.log_density(self.noise_scale(x)));
        prior
            + noise
            + known
                .as_ref()
                .map_or(0.0, |k| k.log_density(&x[..k.constants()]))
    }

    /// Log weight of every part at some points, part by part.
    fn weights_at(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let parts: Vec<&Compiled> = self.parts.iter().map(|p| &p.equations).collect();
        let places: Vec<(Vec<f64>, Vec<f64>)> = points.iter().map(|x| self.place(x)).collect();
        let precision = |x: &Vec<f64>| self.noise_scale(x).powi(-2);
        let precisions = points.iter().map(precision).collect();
        let mut weights = log_evidences(&parts, &PlacesOf::new(&places, precisions));
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

impl LogDensity for PosteriorDensity {
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
