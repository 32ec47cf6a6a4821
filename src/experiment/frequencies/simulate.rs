//! Peaks as a plate would show them.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::spec::{FrequenciesSpec, Parity};
use crate::error::Result;
use crate::laminate::Ply;

impl FrequenciesSpec {
    /// The same experiment with the lowest modes of a plate of a ply, at the means of all that is known of it, in place of its peaks: as
    /// many, each read with the stated sd; with their parities where it states any. No mode is missing.
    ///
    /// # Errors
    /// The input's fault: a plate that cannot be.
    pub fn simulated(&self, ply: Ply, seed: u64) -> Result<Self> {
        let plate = self.plate(ply);
        let modes = self
            .ritz(&plate)?
            .modes(&plate.coefficients(), self.frequencies_hz.len())?;
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let mut read = |f: f64| {
            let z: f64 = StandardNormal.sample(&mut rng);
            round(f * (1.0 + self.sd_percent / 100.0 * z))
        };
        let parities = modes.iter().map(|m| m.odd.map(Parity::of)).collect();
        Ok(Self {
            frequencies_hz: modes.iter().map(|m| read(m.frequency_hz())).collect(),
            parity: self.parity.as_ref().map(|_| parities),
            ..self.clone()
        })
    }
}

/// To a hundredth of a hertz, as a spectrum is read.
fn round(f: f64) -> f64 {
    (100.0 * f).round() / 100.0
}
