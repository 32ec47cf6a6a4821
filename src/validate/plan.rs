//! What a calibration is of.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Dxsm;
use serde::Serialize;

/// What is calibrated, over how many replicates.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationPlan {
    pub replicates: usize,
    /// Correlation length of the noise, mm; 0 for white noise.
    pub correlation_mm: f64,
    pub seed: u64,
    /// Points along a side of the lattice.
    pub grid: usize,
    /// Whether effects act that the model does not declare, and the loop is closed; else the model is identified as it is.
    #[serde(rename = "loop")]
    pub closes_loop: bool,
    /// Whether one of the effects that act is withheld from the dictionary.
    pub withheld: bool,
    /// Up to how many effects act, any number equally often, each amplitude of one to two plausible sizes; without it as many as the loop
    /// expects, with amplitudes from their priors.
    pub effects: Option<usize>,
    /// Share K of N of the replicates, counted from 1, every N-th of which is run; the others may be done elsewhere. All are share 1 of 1.
    #[serde(skip)]
    pub share: [usize; 2],
}

impl CalibrationPlan {
    /// Replicates of the share.
    pub fn own(&self) -> impl Iterator<Item = usize> {
        let [task, of] = self.share;
        (0..self.replicates).filter(move |k| k % of == task - 1)
    }

    /// The seed of a replicate, for a purpose.
    pub fn seed_of(&self, replicate: usize, purpose: u64) -> u64 {
        let mut rng = Pcg64Dxsm::seed_from_u64(self.seed);
        let base: u64 = rng.random();
        base.wrapping_add((replicate as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15))
            .wrapping_add(purpose.wrapping_mul(0xd1b5_4a32_d192_ed03))
    }
}
