//! An independence move whose proposal is fitted to the complementary half of the ensemble: affine invariant, and
//! close to independent sampling on a nearly Gaussian target.

use pulp::{Simd, WithSimd};

use super::gaussian::{cholesky, scatter};
use super::moves::{Fit, Move, Proposal, Walkers};
use super::numbers::Needs;
use crate::lanes::{Lanes, WIDTH, each, ln};

/// y drawn from q fitted to the complementary half, regardless of x; the factor is q(x) / q(y).
#[derive(Debug, Clone, Copy)]
pub struct Independence {
    /// Degrees of freedom of q, a Student-t about the walkers' mean with their covariance as shape.
    pub dof: usize,
}

impl Default for Independence {
    /// t of 5 degrees of freedom: lighter tails are a little more efficient on a normal target, but on a heavy-tailed one
    /// the ensemble then confirms its own tails for long times and the standard errors are too small.
    fn default() -> Self {
        Self { dof: 5 }
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
    fn needs(&self, dim: usize, _others: usize) -> Needs {
        Needs {
            uniforms: self.dof / 2,
            normals: dim + self.dof % 2,
        }
    }

    fn fit(&self, others: Walkers<'_>, fit: &mut Fit) -> bool {
        let (m, dim) = (others.count() as f64, others.dim());
        scatter(others, &mut fit.mean, &mut fit.lower);
        fit.dof = self.dof;
        fit.lower.iter_mut().for_each(|v| *v /= m - 1.0);
        cholesky(&mut fit.lower, dim)
    }

    fn propose(&self, proposal: Proposal<'_>) {
        pulp::Arch::new().dispatch(proposal);
    }
}

impl WithSimd for Proposal<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _simd: S) {
        for from in (0..self.own.count()).step_by(WIDTH) {
            self.group(from);
        }
    }
}

impl Proposal<'_> {
    /// Proposes for the walkers from `from` on.
    #[inline(always)]
    fn group(&mut self, from: usize) {
        let (dim, count) = (self.own.dim(), self.own.count());
        let old = self.whiten(from);
        let stretch = self.stretch(from);
        let mut new = Lanes::splat(0.0);
        for (k, y) in self.y.chunks_exact_mut(count).enumerate() {
            let z = Lanes::of(&self.numbers.normal(k)[from..]);
            let z = each(|l| z[l] * stretch[l]);
            new = each(|l| new[l] + z[l] * z[l]);
            z.put(&mut y[from..]);
        }
        // y = mean + L z, from the last row up, so that z is there as long as it is needed.
        for i in (0..dim).rev() {
            let row = &self.fit.lower[i * dim..=i * dim + i];
            let mut sum = Lanes::splat(self.fit.mean[i]);
            for (lower, z) in row.iter().zip(self.y.chunks_exact(count)) {
                let z = Lanes::of(&z[from..]);
                sum = each(|l| sum[l] + lower * z[l]);
            }
            sum.put(&mut self.y[i * count + from..(i + 1) * count]);
        }
        let (dof, half) = (self.fit.dof, 0.5 * (self.fit.dof + dim) as f64);
        // log q(x) / q(y) from the Mahalanobis distances squared
        let dof = dof as f64;
        let factor = each(|l| half * ln((dof + new[l]) / (dof + old[l])));
        factor.put(&mut self.factor[from..]);
    }

    /// |L^-1 (x - mean)|^2 of the walkers; `y` serves as room.
    #[inline(always)]
    fn whiten(&mut self, from: usize) -> Lanes {
        let (dim, count) = (self.own.dim(), self.own.count());
        let mut square = Lanes::splat(0.0);
        for i in 0..dim {
            let row = &self.fit.lower[i * dim..=i * dim + i];
            let (x, mean) = (Lanes::of(&self.own.column(i)[from..]), self.fit.mean[i]);
            let mut rest = each(|l| x[l] - mean);
            for (lower, z) in row[..i].iter().zip(self.y.chunks_exact(count)) {
                let z = Lanes::of(&z[from..]);
                rest = each(|l| rest[l] - lower * z[l]);
            }
            let inverse = 1.0 / row[i];
            let z = each(|l| rest[l] * inverse);
            square = each(|l| square[l] + z[l] * z[l]);
            z.put(&mut self.y[i * count + from..(i + 1) * count]);
        }
        square
    }

    /// sqrt(dof / chi^2) of the walkers, 1 for a Gaussian.
    #[inline(always)]
    fn stretch(&self, from: usize) -> Lanes {
        /// Uniform numbers above 2^-53 whose product is a normal number.
        const MOST: usize = 16;
        let dof = self.fit.dof;
        let mut chi2 = Lanes::splat(0.0);
        if dof == 0 {
            return Lanes::splat(1.0);
        }
        if dof % 2 == 1 {
            let z = Lanes::of(&self.numbers.normal(self.own.dim())[from..]);
            chi2 = each(|l| z[l] * z[l]);
        }
        for first in (0..dof / 2).step_by(MOST) {
            let mut product = Lanes::splat(1.0);
            for k in first..(first + MOST).min(dof / 2) {
                let u = Lanes::of(&self.numbers.uniform(k)[from..]);
                product = each(|l| product[l] * u[l]);
            }
            chi2 = each(|l| chi2[l] - 2.0 * ln(product[l]));
        }
        each(|l| (dof as f64 / chi2[l]).sqrt())
    }
}
