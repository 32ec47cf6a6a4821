//! The mean of the block averages as the constants move: POD modes, and response surfaces of their coefficients.

use faer::Mat;
use nalgebra::{DMatrix, DVector};

use serde::{Deserialize, Serialize};

use super::ratios::Ratios;
use crate::error::{Error, Result};
use crate::linearise::StepStack;
use crate::reduce::{exponents, monomial, pod};

/// The change of the mean from where all coordinates are zero: modes with coefficients of (1 + x_0) times polynomials of the ratios, and of what
/// does not go with the load, which follows them linearly.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct MeanSurface {
    pub ratios: Ratios,
    /// Exponents of the monomials in the ratios.
    exponents: Vec<Vec<u8>>,
    /// Half-widths of the ratios over the design.
    half: Vec<f64>,
    /// Modes x regressors, mm.
    coefficients: DMatrix<f64>,
    /// The same at zero coordinates, mm.
    origin: DVector<f64>,
    /// Block averages of (u1, u2), values x modes: orthonormal, both components together.
    pub modes: [DMatrix<f64>; 2],
}

/// What was solved for: coordinates of the constants, and what is seen there, mm.
pub struct BlockSnapshots {
    pub coordinates: Vec<Vec<f64>>,
    pub fields: Vec<StepStack>,
}

/// Modes are kept until what is left of the snapshots is this share of them: a tenth of the norm of 10 nm of noise at 15,000 points of a field
/// of 10 um is 1e-6.
const LEFT: f64 = 3e-7;

impl MeanSurface {
    /// Where nothing changes with the constants.
    pub fn flat(ratios: Ratios) -> Self {
        Self {
            ratios,
            exponents: Vec::new(),
            half: Vec::new(),
            coefficients: DMatrix::zeros(0, 1),
            origin: DVector::zeros(0),
            modes: [DMatrix::zeros(0, 0), DMatrix::zeros(0, 0)],
        }
    }

    /// How many numbers a surface of some degree has for each mode, of so many constants.
    pub fn regressors(constants: usize, degree: usize) -> usize {
        exponents(constants - 1, degree).len() + constants
    }

    /// Fit to snapshots.
    ///
    /// # Errors
    /// Of the program: a decomposition that does not converge, snapshots that do not determine the surface.
    pub fn fit(ratios: Ratios, degree: usize, snapshots: &BlockSnapshots) -> Result<Self> {
        let BlockSnapshots {
            coordinates,
            fields,
        } = snapshots;
        let ratio = |k: usize| coordinates.iter().map(move |x| x[k].abs());
        let count = coordinates.first().map_or(0, Vec::len);
        let half = (1..count).map(|k| ratio(k).fold(f64::MIN_POSITIVE, f64::max));
        let mut surface = Self {
            exponents: exponents(count.saturating_sub(1), degree),
            half: half.collect(),
            ..Self::flat(ratios)
        };
        let rows = fields.first().map_or(0, |f| f[0].len());
        let all = Mat::from_fn(2 * rows, fields.len(), |i, k| fields[k][i / rows][i % rows]);
        let found = pod::decompose(&all)?;
        let total: f64 = found.singular.iter().map(|s| s * s).sum();
        let mut tail = total;
        let enough = found.singular.iter().position(|s| {
            tail -= s * s;
            tail <= LEFT * LEFT * total
        });
        let modes = enough.map_or(found.singular.len(), |k| k + 1);
        surface.modes =
            [0, 1].map(|c| DMatrix::from_fn(rows, modes, |i, k| found.modes[(c * rows + i, k)]));
        let design: Vec<Vec<f64>> = coordinates.iter().map(|x| surface.regressed(x)).collect();
        let width = design.first().map_or(0, Vec::len);
        let design = DMatrix::from_fn(design.len(), width, |i, j| design[i][j]);
        let wanted = DMatrix::from_fn(fields.len(), modes, |i, k| {
            found.right[(i, k)] * found.singular[k]
        });
        let qr = design.qr();
        let solved = qr.r().solve_upper_triangular(&qr.q().tr_mul(&wanted));
        let solved = solved.filter(|s| s.iter().all(|v| v.is_finite()));
        let undetermined = || Error::program("posterior", "snapshots that determine a surface");
        surface.coefficients = solved.ok_or_else(undetermined)?.transpose();
        surface.origin = surface.whole(&vec![0.0; count]);
        Ok(surface)
    }

    /// What the coefficients are linear in.
    fn regressed(&self, coordinates: &[f64]) -> Vec<f64> {
        let Some((first, ratios)) = coordinates.split_first() else {
            return vec![1.0];
        };
        let z: Vec<f64> = ratios.iter().zip(&self.half).map(|(x, h)| x / h).collect();
        let loaded = self.exponents.iter();
        let loaded = loaded.map(|e| (1.0 + first) * monomial(e, &z));
        let still = std::iter::once(1.0).chain(z.iter().copied());
        loaded.chain(still).collect()
    }

    fn whole(&self, coordinates: &[f64]) -> DVector<f64> {
        &self.coefficients * DVector::from_vec(self.regressed(coordinates))
    }

    /// Change of the modes' coefficients from zero coordinates, mm.
    pub fn change(&self, coordinates: &[f64]) -> DVector<f64> {
        self.whole(coordinates) - &self.origin
    }

    /// By how much a field at some coordinates differs, mm.
    pub fn off(&self, coordinates: &[f64], field: &StepStack) -> StepStack {
        let change = self.change(coordinates);
        [0, 1].map(|c| &field[c] - &self.modes[c] * &change)
    }

    /// How fast the coefficients change along coordinate `j` there, mm.
    pub fn slope(&self, j: usize) -> DVector<f64> {
        let by = match j {
            0 => STEP,
            j => STEP * self.half.get(j - 1).copied().unwrap_or(1.0),
        };
        let moved = |by: f64| {
            let mut x = vec![0.0; self.half.len() + 1];
            x[j] = by;
            self.whole(&x)
        };
        (moved(by) - moved(-by)) / (2.0 * by)
    }
}

/// Step of the difference quotient of a polynomial, over its box.
const STEP: f64 = 1e-4;
