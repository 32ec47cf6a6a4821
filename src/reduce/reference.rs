//! The article's published error tables, and the problem they were made for.
//!
//! Gogu, Yin, Haftka, Ifju, Molimard, Le Riche, Vautrin, "Bayesian identification of elastic constants in multi-directional
//! laminate from moire interferometry displacement fields", Experimental Mechanics 53 (2013).

use serde::{Deserialize, Serialize};

/// A published reduced model that a model file names with `reduced_model.reference`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub enum Reference {
    #[serde(rename = "gogu-2013")]
    Gogu2013,
}

/// Published figures; index 0 of each pair is U (u1), 1 is V (u2).
#[derive(Debug, Clone, Copy)]
pub struct Published {
    /// Bounds of E1, E2, nu12, G12 (GPa) and of one ply's thickness (mm): Table 2.
    pub bounds: [[f64; 2]; 5],
    /// Truncation error eps for K = 2..=5: Table 3.
    pub truncation: [[f64; 4]; 2],
    /// CV_RMS in mm for K = 2..=5: Table 8.
    pub cv_mm: [[f64; 4]; 2],
    /// CV_RMS in % for K = 2..=5: Table 8.
    pub cv_percent: [[f64; 4]; 2],
    /// Mean, sd, R^2, RMS and PRESS of the coefficients 1..=4 (mm but for R^2): Tables 9 and 10.
    pub surfaces: [[[f64; 5]; 4]; 2],
    /// Nodes on which a field was given.
    pub nodes: usize,
    pub snapshots: usize,
}

/// The truncations of Tables 3 and 8.
pub const TRUNCATIONS: [usize; 4] = [2, 3, 4, 5];

/// Gogu et al. 2013.
pub const GOGU_2013: Published = Published {
    bounds: [
        [126.0, 234.0],
        [7.0, 13.0],
        [0.189, 0.351],
        [3.5, 6.5],
        [0.12, 0.18],
    ],
    truncation: [
        [2.439e-7, 4.701e-9, 7.280e-11, 1.211e-11],
        [1.054e-6, 2.900e-9, 4.136e-10, 3.517e-11],
    ],
    cv_mm: [
        [9.35e-6, 1.05e-6, 1.65e-7, 7.83e-8],
        [1.00e-5, 6.30e-7, 3.05e-7, 7.32e-8],
    ],
    cv_percent: [
        [9.96e-2, 1.13e-2, 2.37e-3, 9.49e-4],
        [1.10e-1, 4.71e-2, 3.71e-3, 1.84e-3],
    ],
    surfaces: [
        [
            [-4.04e-1, 8.19e-2, 0.99999, 2.77e-4, 3.61e-4],
            [-3.40e-5, 6.92e-4, 0.99993, 6.32e-6, 7.92e-6],
            [-2.20e-5, 2.01e-4, 0.99992, 2.01e-6, 2.67e-6],
            [-8.35e-7, 2.80e-5, 0.99951, 6.75e-7, 9.33e-7],
        ],
        [
            [-2.97e-1, 5.40e-2, 0.99999, 1.69e-4, 2.45e-4],
            [-9.51e-5, 2.26e-3, 0.99992, 2.26e-5, 3.05e-6],
            [-2.14e-5, 3.10e-4, 0.99987, 3.88e-6, 5.27e-6],
            [9.76e-7, 1.50e-5, 0.99830, 6.89e-7, 1.04e-6],
        ],
    ],
    nodes: 4569,
    snapshots: 200,
};

impl Reference {
    pub fn published(self) -> &'static Published {
        match self {
            Reference::Gogu2013 => &GOGU_2013,
        }
    }
}
