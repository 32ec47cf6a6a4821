//! The target of every sampler: an unnormalised log density over a real vector.

use crate::error::{Error, Result};

/// Why a log density has no finite value at a point.
#[derive(Debug, Clone, thiserror::Error)]
pub enum DensityError {
    /// Recoverable: the point lies outside the support, where the log density is -inf. Samplers reject it and go on.
    #[error("outside the support")]
    Outside,
    /// Recoverable after the start: NaN or +inf. Samplers refuse it at the start, and reject and count it later.
    #[error("log density {0}")]
    Undefined(f64),
    /// Fatal: no point can be evaluated any more. The run ends with this error.
    #[error(transparent)]
    Fatal(#[from] Error),
}

impl DensityError {
    /// Sorts a computed number: finite, outside the support, or undefined.
    ///
    /// # Errors
    /// [`DensityError::Outside`] for -inf, [`DensityError::Undefined`] for NaN and +inf.
    pub fn sort(value: f64) -> std::result::Result<f64, Self> {
        if value.is_finite() {
            Ok(value)
        } else if value == f64::NEG_INFINITY {
            Err(Self::Outside)
        } else {
            Err(Self::Undefined(value))
        }
    }
}

/// An unnormalised log density.
pub trait LogDensity: Sync {
    /// Names of the parameters with their units, in order (`E1_GPa`).
    fn names(&self) -> &[String];

    /// Number of parameters.
    fn dim(&self) -> usize {
        self.names().len()
    }

    /// Log density at one point, `x.len() == dim()`.
    ///
    /// # Errors
    /// See [`DensityError`].
    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError>;

    /// [`LogDensity::log_density`] with recoverable errors as numbers: -inf outside the support, NaN or +inf where it is
    /// undefined.
    ///
    /// # Errors
    /// Fatal ones.
    fn value(&self, x: &[f64]) -> Result<f64> {
        match self.log_density(x) {
            Ok(value) | Err(DensityError::Undefined(value)) => Ok(value),
            Err(DensityError::Outside) => Ok(f64::NEG_INFINITY),
            Err(DensityError::Fatal(error)) => Err(error),
        }
    }

    /// [`LogDensity::value`] at several points, parameter by parameter: parameter k of point i is `xs[k * out.len() + i]`.
    /// The result must not depend on how points are grouped into calls.
    ///
    /// # Errors
    /// Fatal ones.
    fn values(&self, xs: &[f64], out: &mut [f64]) -> Result<()> {
        let mut point = vec![0.0; self.dim()];
        let count = out.len();
        for (i, value) in out.iter_mut().enumerate() {
            for (k, x) in point.iter_mut().enumerate() {
                *x = xs[k * count + i];
            }
            *value = self.value(&point)?;
        }
        Ok(())
    }
}

/// A log density given as a function; made by [`density`].
pub struct FunctionDensity<F> {
    names: Vec<String>,
    log_density: F,
}

/// The log density that a function computes, -inf outside its support; `names` are those of its parameters, in order.
pub fn density<N: Into<String>, F: Fn(&[f64]) -> f64 + Sync>(
    names: impl IntoIterator<Item = N>,
    log_density: F,
) -> FunctionDensity<F> {
    FunctionDensity {
        names: names.into_iter().map(Into::into).collect(),
        log_density,
    }
}

impl<F: Fn(&[f64]) -> f64 + Sync> LogDensity for FunctionDensity<F> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        DensityError::sort((self.log_density)(x))
    }
}
