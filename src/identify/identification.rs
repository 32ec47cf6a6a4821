//! One identification: the inverse problem, its draws, and what they are worth.

use std::path::PathBuf;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::inverse::InverseProblem;
use super::misfit::AgainstNoise;
use super::patterns::Patterns;
use super::residual::Residual;
use super::structure::Structure;
use super::surrogate::{SurrogateError, TOLERANCE};
use crate::chain::Draws;
use crate::diagnose::Verdict;
use crate::files::Keyed;
use crate::sample::Stopped;

/// One identification: the inverse problem, its draws and what they are worth.
pub struct Identification {
    /// Reduced model, columns, noise, statistics of the data and the sampled density.
    pub inverse: InverseProblem,
    pub draws: Draws,
    pub stopped: Stopped,
    /// Convergence of the chains, and moments of every parameter.
    pub verdict: Verdict,
    /// Draws whose constants lie outside the DoE box, as a fraction.
    pub outside_doe: f64,
    /// The reduced model against the finite elements at draws of the posterior.
    pub surrogate: SurrogateError,
    /// The reduced models used, the first and every refinement; the last is this identification's.
    pub refinements: Vec<Refinement>,
    /// Mean and sd of each declared closed-form effect's amplitude, border units.
    pub effect_amplitudes: Vec<(String, f64, f64)>,
    /// What the posterior mean leaves unexplained.
    pub residual: Residual,
    /// Autocorrelation of the residual, and where it lies.
    pub structure: Structure,
    /// What stationary noise does not do.
    pub patterns: Patterns,
    /// Whether the posterior has a mode that is not absurd; if not, its constants were held within reason.
    pub determined: bool,
    /// Whether noise explains what is left: the one account of it that verdict and warnings have.
    pub misfit: AgainstNoise,
    /// What was doubtful of the input before anything was sampled.
    pub doubts: Vec<String>,
    /// Other sentences about results that should not be trusted as they stand.
    pub warnings: Vec<String>,
}

impl Identification {
    /// The files of the measurement.
    pub fn files(&self) -> &[PathBuf] {
        &self.inverse.prepared.observation.field.files
    }

    /// All sentences about results that should not be trusted as they stand.
    pub fn all_warnings(&self) -> Vec<String> {
        let misfit = self.misfit.warnings.iter();
        misfit.chain(&self.warnings).cloned().collect()
    }

    /// The same identification, its residual held against noise that the frames of a series have measured: `p` is the probability of a
    /// misfit as large by that. The noise of one field is short, and smooth noise of frames would pass for structure.
    #[must_use]
    pub fn held_against(mut self, p: f64) -> Self {
        self.misfit = AgainstNoise::of_series(&self.inverse, &self.residual, p);
        self
    }

    /// The same identification, its misfit held against noise and effects that may act too: of each, what one prior sd of every
    /// amplitude does to the block averages of (u1, u2) at all measured points, mm.
    #[must_use]
    pub fn with_effects(mut self, columns: &[[DVector<f64>; 2]]) -> Self {
        let mean: Vec<f64> = self.verdict.rows.iter().map(|row| row.mean).collect();
        let of = (&self.inverse, &self.residual);
        self.misfit = self.misfit.with_effects(of, &mean, columns);
        self
    }

    /// Posterior mean and sd of a constant or an amplitude, border units.
    pub fn moments(&self, name: &str) -> Option<(f64, f64)> {
        let sampled = self.verdict.rows.iter().find(|r| r.name == name);
        let closed = || self.effect_amplitudes.iter().find(|a| a.0 == name);
        sampled
            .map(|r| (r.mean, r.sd))
            .or_else(|| closed().map(|a| (a.1, a.2)))
    }
}

/// One reduced model on the way: what it worked with and how far it got.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Refinement {
    /// Largest shift of any parameter, posterior sds.
    pub max_error_in_posterior_sd: f64,
    /// Largest error of the field at a measured point, nm.
    pub max_field_error_nm: f64,
    /// Draws outside the DoE box, as a fraction.
    pub draws_outside_doe: f64,
    pub snapshots: usize,
    /// Modes kept for each component.
    pub modes: usize,
    /// Low and high side of the box.
    pub doe: Keyed<[f64; 2]>,
}

impl Refinement {
    /// Where an identification stands.
    pub fn of(found: &Identification) -> Self {
        let reduced = &found.inverse.prepared.reduced;
        Self {
            max_error_in_posterior_sd: found.surrogate.max_sd(),
            max_field_error_nm: found.surrogate.max_field_nm,
            draws_outside_doe: found.outside_doe,
            snapshots: reduced.snapshots,
            modes: reduced.modes_per_component(),
            doe: reduced.sides(),
        }
    }

    /// Whether the reduced model needs no refinement: its error is within the tolerance, and no draw extrapolates.
    pub fn is_enough(&self) -> bool {
        self.max_error_in_posterior_sd <= TOLERANCE && self.draws_outside_doe == 0.0
    }
}
