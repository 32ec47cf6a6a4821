//! An independence move whose proposal is fitted to the complementary half of the ensemble: affine invariant, and
//! close to independent sampling on a nearly Gaussian target.

use rand_distr::{ChiSquared, Distribution};

use super::gaussian::{add_lower, cholesky, scatter, whiten};
use super::moves::{Fit, Move, Others};
use super::stream::Stream;

/// Tails of the fitted proposal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tail {
    /// Gaussian of the walkers' mean and covariance.
    Gaussian,
    /// Student-t of that many degrees of freedom, the walkers' mean and their covariance as shape.
    StudentT(f64),
    /// The posterior predictive of a Gaussian with unknown mean and covariance under Jeffreys' prior: Student-t of
    /// m - d degrees of freedom and shape (1 + 1/m) S / (m - d), with S the scatter of m walkers (Gelman et al., BDA3,
    /// section 3.6). Its tails grow by themselves when walkers are few.
    Predictive,
}

/// y drawn from q fitted to the complementary half, regardless of x; the factor is q(x) / q(y).
#[derive(Debug, Clone, Copy)]
pub struct Independence {
    /// Tails of q.
    pub tail: Tail,
}

impl Default for Independence {
    /// t of 5 degrees of freedom: lighter tails are a little more efficient on a normal target, but on a heavy-tailed one
    /// the ensemble then confirms its own tails for long times and the standard errors are too small (measured:
    /// `measure_calibration` among the tests).
    fn default() -> Self {
        Self {
            tail: Tail::StudentT(5.0),
        }
    }
}

impl Move for Independence {
    fn name(&self) -> &'static str {
        "independence"
    }

    fn fewest(&self, dim: usize) -> usize {
        dim + 2
    }

    fn fit(&self, others: Others<'_>, fit: &mut Fit) -> bool {
        let (m, dim) = (others.count() as f64, others.dim());
        scatter(others.points(), dim, &mut fit.mean, &mut fit.lower);
        let scale = match self.tail {
            Tail::Gaussian | Tail::StudentT(_) => 1.0 / (m - 1.0),
            Tail::Predictive => (1.0 + 1.0 / m) / (m - dim as f64),
        };
        fit.dof = match self.tail {
            Tail::Gaussian => f64::INFINITY,
            Tail::StudentT(dof) => dof,
            Tail::Predictive => m - dim as f64,
        };
        fit.lower.iter_mut().for_each(|v| *v *= scale);
        cholesky(&mut fit.lower, dim)
    }

    fn propose(
        &self,
        x: &[f64],
        _others: Others<'_>,
        fit: &mut Fit,
        rng: &mut Stream,
        y: &mut [f64],
    ) -> f64 {
        for (k, r) in fit.work.iter_mut().enumerate() {
            *r = x[k] - fit.mean[k];
        }
        let old = whiten(&fit.lower, &mut fit.work);
        let stretch = if fit.dof.is_finite() {
            (fit.dof / chi_squared(fit.dof, rng)).sqrt()
        } else {
            1.0
        };
        let mut new = 0.0;
        for z in &mut fit.work {
            *z = rng.normal() * stretch;
            new += *z * *z;
        }
        y.copy_from_slice(&fit.mean);
        add_lower(&fit.lower, &fit.work, 1.0, y);
        log_ratio(old, new, fit.dof, x.len())
    }
}

/// log q at Mahalanobis distance squared `old` less that at `new`.
fn log_ratio(old: f64, new: f64, dof: f64, dim: usize) -> f64 {
    if dof.is_finite() {
        0.5 * (dof + dim as f64) * ((dof + new) / (dof + old)).ln()
    } else {
        0.5 * (new - old)
    }
}

/// Most degrees of freedom for which a product of uniforms is quicker than a gamma variate.
const FEW: f64 = 20.0;

/// A chi-squared number. For few whole degrees of freedom: -2 log of a product of uniforms has two for each, and a
/// squared normal has one.
fn chi_squared(dof: f64, rng: &mut Stream) -> f64 {
    if dof <= FEW && dof.fract() == 0.0 {
        let whole = dof as u32;
        // 1 - u is never 0.
        let product: f64 = (0..whole / 2).map(|_| 1.0 - rng.uniform()).product();
        let odd = if whole % 2 == 1 { rng.normal() } else { 0.0 };
        return odd * odd - 2.0 * product.ln();
    }
    match ChiSquared::new(dof) {
        Ok(chi2) => chi2.sample(rng),
        Err(_) => dof,
    }
}
