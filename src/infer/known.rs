//! What other experiments say of the elastic constants, as a normal density about them.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use serde::{Deserialize, Serialize};

use super::prior::Marginal;
use super::tension::Moments;

/// A likelihood of the constants, normal, without their prior: exp(-d'A d / 2 + b'd) of distances d from the prior means in prior sds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConstantsLikelihood {
    /// A.
    pub precision: DMatrix<f64>,
    /// b.
    pub towards: DVector<f64>,
    /// Prior means and sds of the constants, border units.
    scales: Vec<[f64; 2]>,
}

impl ConstantsLikelihood {
    /// What a posterior of this mean and covariance (border units) says beyond the constants' prior: its precision less the prior's, where
    /// it is not smaller. An experiment that says nothing of a direction leaves the prior there.
    ///
    /// None of a covariance that is singular.
    pub fn beyond_prior(
        mean: &[f64],
        covariance: &DMatrix<f64>,
        priors: &[Marginal],
    ) -> Option<Self> {
        let n = priors.len();
        let distance = DVector::from_fn(n, |k, _| (mean[k] - priors[k].mean) / priors[k].sd);
        let scaled = DMatrix::from_fn(n, n, |i, j| {
            covariance[(i, j)] / (priors[i].sd * priors[j].sd)
        });
        let eigen = SymmetricEigen::new(scaled);
        if eigen.eigenvalues.iter().any(|v| v.is_nan() || *v <= 0.0) {
            return None;
        }
        let vectors = &eigen.eigenvectors;
        let along = vectors.tr_mul(&distance);
        let said = eigen.eigenvalues.map(|v| (1.0 / v - 1.0).max(0.0));
        // the posterior's precision times its mean is that of the likelihood: the prior's mean is the origin
        let right = DVector::from_fn(n, |k, _| {
            if said[k] > 0.0 {
                along[k] / eigen.eigenvalues[k]
            } else {
                0.0
            }
        });
        Some(Self {
            precision: vectors * DMatrix::from_diagonal(&said) * vectors.transpose(),
            towards: vectors * right,
            scales: priors.iter().map(|m| [m.mean, m.sd]).collect(),
        })
    }

    /// The same without what it says of a common factor of some constants, the `moduli`: an experiment with the same thickness, or the same error
    /// of the force, knows no more of that.
    #[must_use]
    pub fn without_common_factor(&self, moduli: &[bool]) -> Self {
        let each = self.scales.iter().zip(moduli);
        let along = each.map(|([mean, sd], is_modulus)| f64::from(*is_modulus) * mean / sd);
        let along = DVector::from_iterator(self.scales.len(), along);
        let pulled = &self.precision * &along;
        let size = along.dot(&pulled);
        if size <= 0.0 {
            return self.clone();
        }
        let towards = self.towards.dot(&along) / size;
        Self {
            precision: &self.precision - &pulled * pulled.transpose() / size,
            towards: &self.towards - &pulled * towards,
            scales: self.scales.clone(),
        }
    }

    /// What both say, of the same constants.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        Self {
            precision: &self.precision + &other.precision,
            towards: &self.towards + &other.towards,
            scales: self.scales.clone(),
        }
    }

    /// Mean and covariance with the prior, border units.
    pub fn moments(&self) -> Option<Moments> {
        let n = self.constants();
        let with_prior = (&self.precision + DMatrix::identity(n, n)).cholesky()?;
        let mean = with_prior.solve(&self.towards);
        let covariance = with_prior.inverse();
        let scale = |k: usize| self.scales[k];
        Some(Moments {
            mean: DVector::from_fn(n, |k, _| scale(k)[0] + scale(k)[1] * mean[k]),
            covariance: DMatrix::from_fn(n, n, |i, j| {
                scale(i)[1] * scale(j)[1] * covariance[(i, j)]
            }),
        })
    }

    /// How many constants it is about.
    pub fn constants(&self) -> usize {
        self.scales.len()
    }

    /// Log density of constants, border units, up to a constant.
    pub fn log_density(&self, constants: &[f64]) -> f64 {
        let each = constants.iter().zip(&self.scales);
        let d = DVector::from_iterator(self.scales.len(), each.map(|(x, [m, s])| (x - m) / s));
        self.towards.dot(&d) - 0.5 * d.dot(&(&self.precision * &d))
    }

    /// As rows of normal equations whose first columns are the constants in prior sds from their means: A, b, and the square b'A^-1 b over
    /// what is determined.
    pub fn equations(&self) -> (&DMatrix<f64>, &DVector<f64>, f64) {
        let eigen = SymmetricEigen::new(self.precision.clone());
        let along = eigen.eigenvectors.tr_mul(&self.towards);
        let largest = eigen.eigenvalues.amax();
        let each = along.iter().zip(eigen.eigenvalues.iter());
        let square = each
            .filter(|(_, v)| **v > 1e-9 * largest)
            .map(|(b, v)| b * b / v);
        (&self.precision, &self.towards, square.sum())
    }

    /// Add it to normal equations X'X (columns x columns), X'y of columns that begin with the constants in prior sds from their means.
    pub fn add_to(&self, gram: &mut DMatrix<f64>, right: &mut DVector<f64>) {
        let n = self.constants();
        let mut inside = gram.view_mut((0, 0), (n, n));
        inside += &self.precision;
        let mut own = right.rows_mut(0, n);
        own += &self.towards;
    }
}
