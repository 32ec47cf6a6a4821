//! The mode of a log density and the normal approximation about it: where chains start, and a quick second opinion.

use super::density::LogDensity;
use super::gaussian::{cholesky, solve};
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
    let n = start.len();
    let mut x = start.to_vec();
    let mut scale: Vec<f64> = sd.iter().map(|s| 0.1 * s).collect();
    let mut value = target.value(start)?;
    if !value.is_finite() {
        return Err(Error::input(place, "a finite density at the prior's centre").found(value));
    }
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let (gradient, hessian) = differences(target, &x, &scale, value)?;
        let mut moved = 0.0;
        for _ in 0..30 {
            if let Some(mut step) = newton_step(&gradient, &hessian, damping) {
                step.iter_mut().zip(&scale).for_each(|(d, s)| *d *= s);
                // A quadratic is not to be trusted further than the scale the climb began with.
                let longest = step
                    .iter()
                    .zip(sd)
                    .fold(1.0, |a: f64, (d, s)| a.max(d.abs() / s));
                let next: Vec<f64> = x.iter().zip(&step).map(|(x, d)| x + d / longest).collect();
                let higher = target.value(&next)?;
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
            if hessian[k * n + k] < 0.0 {
                // Differences over a tenth of the local width: small against the curvature, large against rounding.
                scale[k] *= 0.1 / (-hessian[k * n + k]).sqrt();
            }
        }
        if moved.abs() < 1e-7 && damping < 1e-2 {
            break;
        }
    }
    let (_, hessian) = differences(target, &x, &scale, value)?;
    let covariance = negative_inverse(&hessian, &scale).ok_or_else(|| {
        let at = target.names().iter().zip(x.iter());
        let at: Vec<String> = at.map(|(name, v)| format!("{name} = {v:.4}")).collect();
        Error::input(place, "a maximum")
            .found(format!("no curvature in some direction near {}", at.join(", ")))
            .hint("some constant is fixed neither by the data nor by its prior: narrow the widest priors, or declare fewer effects")
    })?;
    Ok(Laplace {
        mode: x,
        covariance,
        log_density: value,
    })
}

/// The step to the maximum of the quadratic whose negative curvature is raised by a part of its diagonal; none where that has no maximum.
fn newton_step(gradient: &[f64], hessian: &[f64], damping: f64) -> Option<Vec<f64>> {
    let n = gradient.len();
    let mut lower: Vec<f64> = hessian.iter().map(|h| -h).collect();
    for k in 0..n {
        lower[k * n + k] += damping * lower[k * n + k].abs().max(1e-12);
    }
    let mut step = gradient.to_vec();
    cholesky(&mut lower, n).then(|| solve(&lower, &mut step))?;
    Some(step)
}

/// The inverse of a negative Hessian in units of `scale`; none if that is not positive definite.
fn negative_inverse(hessian: &[f64], scale: &[f64]) -> Option<Vec<f64>> {
    let n = scale.len();
    let mut lower: Vec<f64> = hessian.iter().map(|h| -h).collect();
    if !cholesky(&mut lower, n) {
        return None;
    }
    let mut covariance = vec![0.0; n * n];
    for (i, row) in covariance.chunks_exact_mut(n).enumerate() {
        row[i] = 1.0;
        solve(&lower, row);
        row.iter_mut()
            .zip(scale)
            .for_each(|(c, s)| *c *= s * scale[i]);
    }
    // symmetric to the last bit
    for i in 0..n {
        for j in 0..i {
            covariance[j * n + i] = covariance[i * n + j];
        }
    }
    Some(covariance)
}

/// Gradient and Hessian (row-major) in units of `scale`, by central differences.
fn differences(
    target: &dyn LogDensity,
    x: &[f64],
    scale: &[f64],
    value: f64,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let n = x.len();
    let at = |moves: &[(usize, f64)]| {
        let mut y = x.to_vec();
        for &(k, step) in moves {
            y[k] += step * scale[k];
        }
        target.value(&y)
    };
    let mut gradient = vec![0.0; n];
    let mut hessian = vec![0.0; n * n];
    for i in 0..n {
        let (up, down) = (at(&[(i, 1.0)])?, at(&[(i, -1.0)])?);
        gradient[i] = 0.5 * (up - down);
        hessian[i * n + i] = up + down - 2.0 * value;
        for j in 0..i {
            let cross = at(&[(i, 1.0), (j, 1.0)])? + at(&[(i, -1.0), (j, -1.0)])?
                - at(&[(i, 1.0), (j, -1.0)])?
                - at(&[(i, -1.0), (j, 1.0)])?;
            hessian[i * n + j] = 0.25 * cross;
            hessian[j * n + i] = hessian[i * n + j];
        }
    }
    Ok((gradient, hessian))
}
