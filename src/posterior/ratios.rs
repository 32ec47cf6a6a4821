//! The coordinates of the constants in which a field under a prescribed force is simple.

use serde::{Deserialize, Serialize};

/// A field under a prescribed force is 1 / E1 times a function of the moduli's ratios and of Poisson's ratio. The coordinates of some constants
/// say how these differ from those they are `about`: E1(about) / E1 - 1, then the differences of ln E2/E1, nu12 and ln G12/E1; of an isotropic
/// material that of nu. With plain ratios in place of their logarithms the surfaces of a unidirectional laminate 30 degrees off its axis
/// were 57 noise norms off in place of 0.3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ratios {
    about: Vec<f64>,
}

/// Index of Poisson's ratio of a ply.
const NU12: usize = 2;

impl Ratios {
    /// About some constants, border units.
    pub fn about(constants: &[f64]) -> Self {
        Self {
            about: constants.to_vec(),
        }
    }

    /// Whether constant `k` is a modulus, which counts by its logarithm.
    pub(super) fn is_modulus(&self, k: usize) -> bool {
        match self.about.len() {
            2 => k == 0,
            _ => k != NU12,
        }
    }

    /// The coordinates of some constants: as many as there are constants. Not numbers where a modulus is not positive.
    pub fn of(&self, constants: &[f64]) -> Vec<f64> {
        let first = |all: &[f64]| all.first().copied().unwrap_or(1.0);
        let scale = first(constants) / first(&self.about);
        let each = constants.iter().zip(&self.about).enumerate();
        each.map(|(k, (x, about))| match self.is_modulus(k) {
            _ if k == 0 => 1.0 / scale - 1.0,
            true => (x / about / scale).ln(),
            false => x - about,
        })
        .collect()
    }

    /// The constants at some coordinates.
    pub fn constants(&self, coordinates: &[f64]) -> Vec<f64> {
        let scale = 1.0 / (1.0 + coordinates.first().copied().unwrap_or(0.0));
        let each = coordinates.iter().zip(&self.about).enumerate();
        each.map(|(k, (x, about))| match self.is_modulus(k) {
            _ if k == 0 => about * scale,
            true => about * scale * x.exp(),
            false => about + x,
        })
        .collect()
    }

    /// How fast the constants change along coordinate `j` where all are zero.
    pub fn slope(&self, j: usize) -> Vec<f64> {
        let each = self.about.iter().enumerate();
        each.map(|(k, about)| match (self.is_modulus(k), k == j) {
            (true, _) if j == 0 => -about,
            (true, true) => *about,
            (false, true) => 1.0,
            _ => 0.0,
        })
        .collect()
    }

    /// Steps along the coordinates that are as far as steps of the constants, border units.
    pub fn steps(&self, of_constants: &[f64]) -> Vec<f64> {
        let each = of_constants.iter().zip(&self.about).enumerate();
        each.map(|(k, (by, about))| match self.is_modulus(k) {
            true => by / about,
            false => *by,
        })
        .collect()
    }
}
