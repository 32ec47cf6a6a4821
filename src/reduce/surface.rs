//! Response surfaces: polynomials of bounded total degree in scaled variables, one a POD coefficient.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::design::{enough_samples, exponents, monomial};
use super::variables::Variables;
use crate::error::{Error, Result};

/// Response surfaces of several coefficients over the same variables.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Surface {
    /// From parameters in border units to scaled variables, and the common factor.
    pub variables: Variables,
    /// Exponents of each monomial, one a variable; the constant first, then by degree.
    pub exponents: Vec<Vec<u8>>,
    /// `coefficients[k][m]`: coefficient of monomial m in POD coefficient k, mm.
    pub coefficients: Vec<Vec<f64>>,
    /// Error measures, one a POD coefficient.
    pub quality: Vec<Quality>,
}

/// Error measures of one response surface (Gogu et al. 2013, Tables 9 and 10), mm but for R^2.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Quality {
    /// Mean of the coefficient over the design.
    pub mean: f64,
    /// Mean of its absolute value.
    pub mean_abs: f64,
    /// Standard deviation over the design.
    pub sd: f64,
    /// Coefficient of determination.
    pub r2: f64,
    /// Root mean square residual, with the fit's degrees of freedom.
    pub rms: f64,
    /// Root mean square leave-one-out residual, from the hat matrix.
    pub press: f64,
}

impl Surface {
    /// Fit to `values[k][i]`, POD coefficient k at DoE point i, by least squares.
    pub fn fit(
        variables: Variables,
        degree: usize,
        points: &[Vec<f64>],
        values: &[Vec<f64>],
    ) -> Result<Self> {
        let exponents = exponents(variables.count(), degree);
        let n = points.len();
        enough_samples(n, degree, variables.count())?;
        let z: Vec<Vec<f64>> = points.iter().map(|p| variables.scaled(p)).collect();
        let factor: Vec<f64> = points.iter().map(|p| variables.factor(p)).collect();
        let design = DMatrix::from_fn(n, exponents.len(), |i, m| monomial(&exponents[m], &z[i]));
        let qr = design.clone().qr();
        let (q, r) = (qr.q(), qr.r());
        let scale = r.diagonal().amax();
        if r.diagonal().iter().any(|d| d.abs() < 1e-10 * scale) {
            return Err(Error::input("reduced_model", "a design that determines every monomial")
                .found(format!("a rank-deficient design of {n} points for {} monomials", exponents.len()))
                .hint("raise snapshots, lower degree, or widen a DoE bound that has almost no length"));
        }
        let leverage: Vec<f64> = q.row_iter().map(|row| row.norm_squared()).collect();
        let mut coefficients = Vec::new();
        let mut quality = Vec::new();
        for alpha in values {
            let y = DVector::from_fn(n, |i, _| alpha[i] / factor[i]);
            let c = r
                .solve_upper_triangular(&(q.transpose() * &y))
                .ok_or_else(|| Error::program("response surface", "a triangular solve"))?;
            let residual = (&y - &design * &c).component_mul(&DVector::from_column_slice(&factor));
            quality.push(assess(
                alpha,
                residual.as_slice(),
                &leverage,
                exponents.len(),
            ));
            coefficients.push(c.as_slice().to_vec());
        }
        Ok(Self {
            variables,
            exponents,
            coefficients,
            quality,
        })
    }

    /// POD coefficients (mm) at a point of the parameter space, border units.
    pub fn evaluate(&self, point: &[f64]) -> Vec<f64> {
        let z = self.variables.scaled(point);
        let factor = self.variables.factor(point);
        let m: Vec<f64> = self.exponents.iter().map(|e| monomial(e, &z)).collect();
        self.coefficients
            .iter()
            .map(|c| factor * c.iter().zip(&m).map(|(c, m)| c * m).sum::<f64>())
            .collect()
    }
}

fn assess(alpha: &[f64], residual: &[f64], leverage: &[f64], monomials: usize) -> Quality {
    let n = alpha.len() as f64;
    let mean = alpha.iter().sum::<f64>() / n;
    let total: f64 = alpha.iter().map(|a| (a - mean).powi(2)).sum();
    let rss: f64 = residual.iter().map(|r| r * r).sum();
    let press: f64 = residual
        .iter()
        .zip(leverage)
        .map(|(r, h)| (r / (1.0 - h)).powi(2))
        .sum();
    Quality {
        mean,
        mean_abs: alpha.iter().map(|a| a.abs()).sum::<f64>() / n,
        sd: (total / (n - 1.0)).sqrt(),
        r2: 1.0 - rss / total.max(f64::MIN_POSITIVE),
        rms: (rss / (n - monomials as f64)).sqrt(),
        press: (press / n).sqrt(),
    }
}
