//! Design of experiments: the box of parameters and a Latin hypercube in it.

use rand::RngExt;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Name of the thickness among the dimensions.
pub const THICKNESS: &str = "thickness_mm";

/// One side of the DoE box, in border units.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Dimension {
    /// Name with its unit (`E1_GPa`, `thickness_mm`, `load_misalignment.angle_deg`).
    pub name: String,
    pub low: f64,
    pub high: f64,
}

impl Dimension {
    /// The value at `fraction` of the way from the lower to the upper bound.
    pub fn at(&self, fraction: f64) -> f64 {
        self.low + fraction * (self.high - self.low)
    }
}

/// Latin hypercube of `n` points (each `dims` long) in the unit cube: every coordinate has one point in each of
/// its `n` equal strata. The same seed gives the same design.
pub fn latin_hypercube(n: usize, dims: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = Pcg64Dxsm::seed_from_u64(seed);
    let mut points = vec![vec![0.0; dims]; n];
    let mut strata: Vec<usize> = (0..n).collect();
    for dim in 0..dims {
        strata.shuffle(&mut rng);
        for (point, &stratum) in points.iter_mut().zip(&strata) {
            point[dim] = (stratum as f64 + rng.random::<f64>()) / n as f64;
        }
    }
    points
}

/// All exponents of `dims` variables up to total degree `degree`, ordered by degree.
pub fn exponents(dims: usize, degree: usize) -> Vec<Vec<u8>> {
    fn extend(prefix: &mut Vec<u8>, dims: usize, left: usize, out: &mut Vec<Vec<u8>>) {
        if prefix.len() + 1 == dims {
            prefix.push(left as u8);
            out.push(prefix.clone());
            prefix.pop();
            return;
        }
        for e in (0..=left).rev() {
            prefix.push(e as u8);
            extend(prefix, dims, left - e, out);
            prefix.pop();
        }
    }
    let mut out = Vec::new();
    for total in 0..=degree {
        extend(&mut Vec::new(), dims, total, &mut out);
    }
    out
}

/// Check that `samples` determine a polynomial of total degree `degree` in `dims` variables, with one to spare.
///
/// # Errors
/// Of the input, naming `reduced_model.snapshots`.
pub fn enough_samples(samples: usize, degree: usize, dims: usize) -> Result<()> {
    let least = exponents(dims, degree).len() + 1;
    if samples >= least {
        return Ok(());
    }
    Err(Error::input(
        "reduced_model.snapshots",
        format!("at least {least} for degree {degree} in {dims} variables"),
    )
    .found(samples)
    .hint("raise snapshots or lower degree"))
}

/// Value of a monomial.
pub fn monomial(exponents: &[u8], z: &[f64]) -> f64 {
    exponents
        .iter()
        .zip(z)
        .map(|(&e, &z)| z.powi(i32::from(e)))
        .product()
}
