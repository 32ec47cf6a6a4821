//! An independence move whose proposal is fitted to the complementary half of the ensemble: affine invariant, and
//! close to independent sampling on a nearly Gaussian target.

use pulp::{Simd, WithSimd};

use super::gaussian::{cholesky, scatter};
use super::moves::{Fit, Move, Walkers};
use super::numbers::{Needs, Numbers};
use crate::infer::lanes::{Lanes, WIDTH, ln};

/// Tails of the fitted proposal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tail {
    /// Gaussian of the walkers' mean and covariance.
    Gaussian,
    /// Student-t of that many degrees of freedom, the walkers' mean and their covariance as shape.
    StudentT(usize),
    /// The posterior predictive of a Gaussian with unknown mean and covariance under Jeffreys' prior: Student-t of
    /// m - d degrees of freedom and shape (1 + 1/m) S / (m - d), with S the scatter of m walkers (Gelman et al., BDA3,
    /// section 3.6). Its tails grow by themselves when walkers are few.
    Predictive,
}

impl Tail {
    /// Degrees of freedom of a proposal fitted to `count` walkers, 0 for a Gaussian.
    fn dof(self, dim: usize, count: usize) -> usize {
        match self {
            Tail::Gaussian => 0,
            Tail::StudentT(dof) => dof,
            Tail::Predictive => count - dim,
        }
    }
}

/// y drawn from q fitted to the complementary half, regardless of x; the factor is q(x) / q(y).
#[derive(Debug, Clone, Copy)]
pub struct Independence {
    /// Tails of q.
    pub tail: Tail,
}

impl Default for Independence {
    /// t of 5 degrees of freedom: lighter tails are a little more efficient on a normal target, but on a heavy-tailed one
    /// the ensemble then confirms its own tails for long times and the standard errors are too small.
    fn default() -> Self {
        Self {
            tail: Tail::StudentT(5),
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

    /// A normal number a dimension; and for the chi-squared number of the Student-t, -2 log of a uniform has two degrees
    /// of freedom and a squared normal one.
    fn needs(&self, dim: usize, others: usize) -> Needs {
        let dof = self.tail.dof(dim, others);
        Needs {
            uniforms: dof / 2,
            normals: dim + dof % 2,
        }
    }

    fn fit(&self, others: Walkers<'_>, fit: &mut Fit) -> bool {
        let (m, dim) = (others.count() as f64, others.dim());
        scatter(others, &mut fit.mean, &mut fit.lower);
        let scale = match self.tail {
            Tail::Gaussian | Tail::StudentT(_) => 1.0 / (m - 1.0),
            Tail::Predictive => (1.0 + 1.0 / m) / (m - dim as f64),
        };
        fit.dof = self.tail.dof(dim, others.count());
        fit.lower.iter_mut().for_each(|v| *v *= scale);
        cholesky(&mut fit.lower, dim)
    }

    fn propose(
        &self,
        own: Walkers<'_>,
        _others: Walkers<'_>,
        fit: &Fit,
        numbers: &Numbers,
        y: &mut [f64],
        factor: &mut [f64],
    ) {
        pulp::Arch::new().dispatch(Proposal {
            own,
            fit,
            numbers,
            y,
            factor,
        });
    }
}

struct Proposal<'a> {
    own: Walkers<'a>,
    fit: &'a Fit,
    numbers: &'a Numbers,
    y: &'a mut [f64],
    factor: &'a mut [f64],
}

impl WithSimd for Proposal<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _simd: S) {
        for from in (0..self.own.count()).step_by(WIDTH) {
            let to = (from + WIDTH).min(self.own.count());
            // The last group may be short; a whole one has a length that the compiler knows.
            if to - from == WIDTH {
                self.group(from, WIDTH);
            } else {
                self.group(from, to - from);
            }
        }
    }
}

impl Proposal<'_> {
    /// Proposes for `length` walkers.
    #[inline(always)]
    fn group(&mut self, from: usize, length: usize) {
        let (dim, count) = (self.own.dim(), self.own.count());
        let old = self.whiten(from, length);
        let stretch = self.stretch(from, length);
        let mut new: Lanes = [0.0; WIDTH];
        for k in 0..dim {
            let (z, y) = (
                &self.numbers.normal(k)[from..][..length],
                &mut self.y[k * count + from..][..length],
            );
            for l in 0..length {
                y[l] = z[l] * stretch[l];
                new[l] += y[l] * y[l];
            }
        }
        // y = mean + L z, from the last row up, so that z is there as long as it is needed.
        for i in (0..dim).rev() {
            let (before, own) = self.y.split_at_mut(i * count);
            let own = &mut own[from..][..length];
            let row = &self.fit.lower[i * dim..=i * dim + i];
            for value in &mut *own {
                *value = self.fit.mean[i] + row[i] * *value;
            }
            for (k, lower) in row[..i].iter().enumerate() {
                let z = &before[k * count + from..][..length];
                for l in 0..length {
                    own[l] += lower * z[l];
                }
            }
        }
        let factor = &mut self.factor[from..][..length];
        for l in 0..length {
            factor[l] = log_ratio(old[l], new[l], self.fit.dof, dim);
        }
    }

    /// |L^-1 (x - mean)|^2 of the walkers; `y` serves as room.
    #[inline(always)]
    fn whiten(&mut self, from: usize, length: usize) -> Lanes {
        let (dim, count) = (self.own.dim(), self.own.count());
        let mut sum: Lanes = [0.0; WIDTH];
        for i in 0..dim {
            let (before, own) = self.y.split_at_mut(i * count);
            let own = &mut own[from..][..length];
            let x = &self.own.column(i)[from..][..length];
            for l in 0..length {
                own[l] = x[l] - self.fit.mean[i];
            }
            for k in 0..i {
                let lower = self.fit.lower[i * dim + k];
                let z = &before[k * count + from..][..length];
                for l in 0..length {
                    own[l] -= lower * z[l];
                }
            }
            let inverse = 1.0 / self.fit.lower[i * dim + i];
            for l in 0..length {
                own[l] *= inverse;
                sum[l] += own[l] * own[l];
            }
        }
        sum
    }

    /// sqrt(dof / chi^2) of the walkers, 1 for a Gaussian.
    #[inline(always)]
    fn stretch(&self, from: usize, length: usize) -> Lanes {
        /// Uniform numbers above 2^-53 whose product is a normal number.
        const MOST: usize = 16;
        let dof = self.fit.dof;
        let mut chi2: Lanes = [0.0; WIDTH];
        if dof == 0 {
            return [1.0; WIDTH];
        }
        if dof % 2 == 1 {
            let z = &self.numbers.normal(self.own.dim())[from..][..length];
            for l in 0..length {
                chi2[l] = z[l] * z[l];
            }
        }
        for first in (0..dof / 2).step_by(MOST) {
            let mut product: Lanes = [1.0; WIDTH];
            for k in first..(first + MOST).min(dof / 2) {
                let u = &self.numbers.uniform(k)[from..][..length];
                for l in 0..length {
                    product[l] *= u[l];
                }
            }
            for l in 0..length {
                chi2[l] -= 2.0 * ln(product[l]);
            }
        }
        for value in &mut chi2 {
            *value = (dof as f64 / *value).sqrt();
        }
        chi2
    }
}

/// log q at Mahalanobis distance squared `old` less that at `new`.
#[inline(always)]
fn log_ratio(old: f64, new: f64, dof: usize, dim: usize) -> f64 {
    if dof == 0 {
        0.5 * (new - old)
    } else {
        let (dof, dim) = (dof as f64, dim as f64);
        0.5 * (dof + dim) * ln((dof + new) / (dof + old))
    }
}
