//! One identification: the inverse problem, its draws, and what they are worth.

use std::path::PathBuf;

use super::inverse::InverseProblem;
use super::misfit::AgainstNoise;
use super::patterns::Patterns;
use super::residual::Residual;
use crate::chain::Draws;
use crate::diagnose::Verdict;
use crate::linearise::StepStack;
use crate::posterior::Importance;
use crate::sample::Stopped;

/// One identification: the inverse problem, its draws and what they are worth.
pub struct Identification {
    /// Reduced model, columns, noise, statistics of the data and the sampled density.
    pub inverse: InverseProblem,
    pub draws: Draws,
    pub stopped: Stopped,
    /// Convergence of the chains, and moments of every parameter.
    pub verdict: Verdict,
    /// How the draws fare under the finite elements.
    pub importance: Importance,
    /// Mean and sd of each declared effect's amplitudes, border units.
    pub effect_amplitudes: Vec<(String, f64, f64)>,
    /// What the posterior mean leaves unexplained.
    pub residual: Residual,
    /// The same of the block averages of all steps, mm.
    pub left: StepStack,
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

    /// The same identification, its misfit held against noise and effects that may act too: `p` is the probability of a larger one by both.
    #[must_use]
    pub fn with_effects(mut self, p: f64) -> Self {
        self.misfit = self.misfit.with_effects(p);
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
