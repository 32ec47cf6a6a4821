//! Restricted maximum likelihood of the covariance of block averages: on contrasts orthogonal to given columns, so
//! that what the columns explain does not pass for noise.

use nalgebra::{DMatrix, DVector};

use serde::{Deserialize, Serialize};

use super::covariance::{BlockCovariance, discrepancy_lengths_mm};
use super::normal::NormalEquations;
use crate::dense::gram;
use crate::error::{Error, Result};
use crate::field::Blocks;

/// Covariance hyperparameters of one component: C = s^2 [diag(nbar / n_b) + rho Matern(l)].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Hyperparameters {
    /// Correlation length l, mm.
    pub length_mm: f64,
    /// Ratio rho of the correlated to the white variance of a block.
    pub ratio: f64,
    /// Scale s^2 of the largest restricted likelihood, unit of the data squared.
    pub scale2: f64,
    /// Restricted log likelihood with s^2 at its maximum; comparable for the same columns.
    pub log_likelihood: f64,
}

impl Hyperparameters {
    /// Whether they describe a smooth discrepancy of the model rather than noise.
    pub fn is_discrepancy(&self, blocks: &Blocks) -> bool {
        self.ratio > 0.0 && self.length_mm >= discrepancy_lengths_mm(blocks)[0]
    }
}

/// Block averages of one component, of which only what is orthogonal to some columns counts.
pub struct Contrasts {
    y: DVector<f64>,
    basis: DMatrix<f64>,
    count: usize,
}

impl Contrasts {
    /// Block averages `y` without what the columns (blocks x p, of any rank, p may be zero) explain.
    ///
    /// # Errors
    /// Of the program: nothing left to estimate from (fewer than ten contrasts), a value that is not finite.
    pub fn new(blocks: &Blocks, y: DVector<f64>, columns: &DMatrix<f64>) -> Result<Self> {
        if !y
            .iter()
            .chain(columns.iter())
            .all(|value| value.is_finite())
        {
            return Err(Error::program(
                "noise::reml",
                "finite block averages and columns",
            ));
        }
        let basis = orthonormal(columns);
        let rank = basis.ncols();
        if blocks.len() < rank + 10 {
            let expected = format!("at least ten more blocks than the {rank} independent columns");
            return Err(
                Error::program("noise::reml", expected).found(format!("{} blocks", blocks.len()))
            );
        }
        Ok(Self {
            count: blocks.len() - rank,
            y,
            basis,
        })
    }

    /// Number of contrasts: blocks minus the rank of the columns.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The restricted likelihood (Patterson and Thompson 1971; Harville 1974) with s^2 profiled out.
    ///
    /// # Errors
    /// Of the program, if a factorisation fails.
    pub fn at(&self, c: &BlockCovariance) -> Result<Hyperparameters> {
        let white = c.whiten_vector(&self.y);
        let mut square = white.norm_squared();
        let mut log_det = c.log_det();
        if self.basis.ncols() > 0 {
            let columns = c.whiten(&self.basis);
            let explained = NormalEquations::new(gram(&columns), columns.tr_mul(&white))
                .ok_or_else(|| {
                    Error::program("noise::reml", "independent columns after whitening")
                        .found(format!("rho = {}", c.ratio))
                })?;
            square -= explained.quadratic();
            log_det += explained.log_det();
        }
        let m = self.count as f64;
        // data that the columns explain exactly have no noise; keep the logarithm finite
        let scale2 = (square / m).max(f64::MIN_POSITIVE);
        let log_likelihood =
            -0.5 * (m * (scale2.ln() + 1.0 + (2.0 * std::f64::consts::PI).ln()) + log_det);
        Ok(Hyperparameters {
            length_mm: c.length_mm,
            ratio: c.ratio,
            log_likelihood,
            scale2,
        })
    }
}

/// Orthonormal basis of the span of `columns` (n x p), n x rank: Gram-Schmidt with pivoting, twice for
/// orthogonality. Directions below 1e-8 of a column's own length count as dependent.
pub fn orthonormal(columns: &DMatrix<f64>) -> DMatrix<f64> {
    const DEPENDENT: f64 = 1e-8;
    let n = columns.nrows();
    let mut left: Vec<DVector<f64>> = columns
        .column_iter()
        .filter(|c| c.norm() > 0.0)
        .map(|c| c / c.norm())
        .collect();
    let mut basis: Vec<DVector<f64>> = Vec::new();
    while basis.len() < n {
        let longest = (0..left.len()).reduce(|a, b| {
            if left[b].norm_squared() > left[a].norm_squared() {
                b
            } else {
                a
            }
        });
        let Some(pivot) = longest.filter(|&p| left[p].norm() > DEPENDENT) else {
            break;
        };
        let mut next = left.swap_remove(pivot).normalize();
        for earlier in &basis {
            next.axpy(-earlier.dot(&next), earlier, 1.0);
        }
        next.normalize_mut();
        left.iter_mut()
            .for_each(|c| c.axpy(-next.dot(c), &next, 1.0));
        basis.push(next);
    }
    if basis.is_empty() {
        DMatrix::zeros(n, 0)
    } else {
        DMatrix::from_columns(&basis)
    }
}
