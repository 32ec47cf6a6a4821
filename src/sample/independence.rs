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
        let stretch = match ChiSquared::new(fit.dof) {
            Ok(chi2) if fit.dof.is_finite() => (fit.dof / chi2.sample(rng)).sqrt(),
            _ => 1.0,
        };
        let mut new = 0.0;
        for z in &mut fit.work {
            *z = rng.normal() * stretch;
            new += *z * *z;
        }
        y.copy_from_slice(&fit.mean);
        add_lower(&fit.lower, &fit.work, 1.0, y);
        log_kernel(old, fit.dof, x.len()) - log_kernel(new, fit.dof, x.len())
    }
}

/// Log density up to a constant at Mahalanobis distance squared `quad`.
fn log_kernel(quad: f64, dof: f64, dim: usize) -> f64 {
    if dof.is_finite() {
        -0.5 * (dof + dim as f64) * (quad / dof).ln_1p()
    } else {
        -0.5 * quad
    }
}
