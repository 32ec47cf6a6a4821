//! The mode of a log density and the normal approximation about it: where chains start, and a quick second opinion.

use nalgebra::{DMatrix, DVector};

use super::density::LogDensity;
use crate::error::{Error, Result};

/// Normal approximation of a density about its mode.
#[derive(Debug, Clone)]
pub struct Laplace {
    pub mode: Vec<f64>,
    /// Inverse of the negative Hessian there, dim x dim, row-major.
    pub covariance: Vec<f64>,
    pub log_density: f64,
}

/// Newton steps, at most: a start far off takes many, none longer than the scale the climb began with.
const STEPS: usize = 300;

/// Climb from `start` by damped Newton steps on finite differences; `sd` is the scale of each parameter at first,
/// and the curvature gives it from then on.
///
/// # Errors
/// Of the input: a start outside the support; a density without a proper maximum nearby.
pub fn laplace(target: &dyn LogDensity, start: &[f64], sd: &[f64]) -> Result<Laplace> {
    let place = "the posterior's mode";
    let mut x = DVector::from_column_slice(start);
    let mut scale = DVector::from_iterator(sd.len(), sd.iter().map(|s| 0.1 * s));
    let mut value = target.value(start)?;
    if !value.is_finite() {
        return Err(Error::input(place, "a finite density at the prior's centre").found(value));
    }
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let (gradient, hessian) = differences(target, &x, &scale, value)?;
        let n = x.len();
        let mut moved = 0.0;
        for _ in 0..30 {
            let mut damped = -&hessian;
            for k in 0..n {
                damped[(k, k)] += damping * damped[(k, k)].abs().max(1e-12);
            }
            let step = damped.cholesky().map(|c| c.solve(&gradient));
            if let Some(step) = step {
                let mut step = step.component_mul(&scale);
                // A quadratic is not to be trusted further than the scale the climb began with.
                let longest = step
                    .iter()
                    .zip(sd)
                    .fold(1.0, |a: f64, (d, s)| a.max(d.abs() / s));
                step /= longest;
                let next = &x + step;
                let higher = target.value(next.as_slice())?;
                if higher >= value - 1e-9 && higher.is_finite() {
                    moved = higher - value;
                    (x, value) = (next, higher);
                    damping = (damping * 0.2).max(1e-12);
                    break;
                }
            }
            damping = (damping * 5.0).max(1e-9);
        }
        for k in 0..n {
            if hessian[(k, k)] < 0.0 {
                // Differences over a tenth of the local width: small against the curvature, large against rounding.
                scale[k] *= 0.1 / (-hessian[(k, k)]).sqrt();
            }
        }
        if moved.abs() < 1e-7 && damping < 1e-2 {
            break;
        }
    }
    let (_, hessian) = differences(target, &x, &scale, value)?;
    let inverse = (-hessian)
        .cholesky()
        .ok_or_else(|| {
            let at = target.names().iter().zip(x.iter());
            let at: Vec<String> = at.map(|(name, v)| format!("{name} = {v:.4}")).collect();
            Error::input(place, "a maximum")
                .found(format!("no curvature in some direction near {}", at.join(", ")))
                .hint("some constant is fixed neither by the data nor by its prior: narrow the widest priors, or declare fewer effects")
        })?
        .inverse();
    let covariance = DMatrix::from_fn(x.len(), x.len(), |i, j| {
        inverse[(i, j)] * scale[i] * scale[j]
    });
    Ok(Laplace {
        mode: x.as_slice().to_vec(),
        covariance: covariance.transpose().as_slice().to_vec(),
        log_density: value,
    })
}

/// Gradient and Hessian in units of `scale`, by central differences.
fn differences(
    target: &dyn LogDensity,
    x: &DVector<f64>,
    scale: &DVector<f64>,
    value: f64,
) -> Result<(DVector<f64>, DMatrix<f64>)> {
    let n = x.len();
    let at = |moves: &[(usize, f64)]| {
        let mut y = x.clone();
        for &(k, step) in moves {
            y[k] += step * scale[k];
        }
        target.value(y.as_slice())
    };
    let mut gradient = DVector::zeros(n);
    let mut hessian = DMatrix::zeros(n, n);
    for i in 0..n {
        let (up, down) = (at(&[(i, 1.0)])?, at(&[(i, -1.0)])?);
        gradient[i] = 0.5 * (up - down);
        hessian[(i, i)] = up + down - 2.0 * value;
        for j in 0..i {
            let cross = at(&[(i, 1.0), (j, 1.0)])? + at(&[(i, -1.0), (j, -1.0)])?
                - at(&[(i, 1.0), (j, -1.0)])?
                - at(&[(i, -1.0), (j, 1.0)])?;
            hessian[(i, j)] = 0.25 * cross;
            hessian[(j, i)] = hessian[(i, j)];
        }
    }
    Ok((gradient, hessian))
}
