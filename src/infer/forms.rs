//! The quadratic forms of a diagonal plus rank-one covariance, of one point or of many.

use pulp::Simd;

use super::lanes::{Lanes, Parameters, WIDTH, ln_vector};

/// Coordinates whose product of variances is taken before the logarithm.
pub(super) const GROUP: usize = 4;

/// r' V^-1 r, w' V^-1 w, w' V^-1 r and log det V.
#[derive(Debug, Clone, Copy)]
pub(super) struct Forms<T> {
    pub quad: T,
    pub ww: T,
    pub wr: T,
    pub log_det: T,
}

/// What `G` coordinates add to the forms, and their variances.
pub(super) struct Residual<T, const G: usize> {
    pub terms: [[T; G]; 3],
    pub variance: [T; G],
}

impl<T: Copy> Forms<T> {
    #[inline(always)]
    pub(super) fn zero<S: Simd<f64s = T>>(simd: S) -> Self {
        let zero = simd.splat_f64s(0.0);
        Self {
            quad: zero,
            ww: zero,
            wr: zero,
            log_det: zero,
        }
    }

    /// Adds coordinates, always four and four, in pairs.
    #[inline(always)]
    pub(super) fn add<S, const G: usize>(&mut self, simd: S, residual: &Residual<T, G>, unit: bool)
    where
        S: Simd<f64s = T>,
    {
        for k in 0..G / GROUP {
            let sums = [&mut self.quad, &mut self.ww, &mut self.wr];
            for (sum, terms) in sums.into_iter().zip(&residual.terms) {
                let t = &terms[GROUP * k..];
                let pairs = (simd.add_f64s(t[0], t[1]), simd.add_f64s(t[2], t[3]));
                *sum = simd.add_f64s(*sum, simd.add_f64s(pairs.0, pairs.1));
            }
            if !unit {
                let v = &residual.variance[GROUP * k..];
                let product = simd.mul_f64s(simd.mul_f64s(v[0], v[1]), simd.mul_f64s(v[2], v[3]));
                self.log_det = simd.add_f64s(self.log_det, ln_vector(simd, product));
            }
        }
    }
}

impl Forms<Lanes> {
    /// Vector `v`.
    #[inline(always)]
    pub(super) fn vector<S: Simd>(&self, _simd: S, v: usize) -> Forms<S::f64s> {
        Forms {
            quad: S::as_simd_f64s(&self.quad).0[v],
            ww: S::as_simd_f64s(&self.ww).0[v],
            wr: S::as_simd_f64s(&self.wr).0[v],
            log_det: S::as_simd_f64s(&self.log_det).0[v],
        }
    }
}

impl Default for Forms<Lanes> {
    fn default() -> Self {
        let zero = [0.0; WIDTH];
        Self {
            quad: zero,
            ww: zero,
            wr: zero,
            log_det: zero,
        }
    }
}

/// What becomes of the forms while they are in registers.
pub(super) trait Finish<S: Simd> {
    /// A number for each point of a vector with parameters `x` and noise scales `scale`.
    fn finish(
        &self,
        simd: S,
        x: &impl Parameters<S>,
        scale: S::f64s,
        forms: &Forms<S::f64s>,
    ) -> S::f64s;
}

/// One vector of the parameters of [`WIDTH`] points.
pub(super) struct Of<'a>(pub &'a [Lanes], pub usize);

impl<S: Simd> Parameters<S> for Of<'_> {
    #[inline(always)]
    fn get(&self, _simd: S, k: usize) -> S::f64s {
        S::as_simd_f64s(&self.0[k]).0[self.1]
    }
}

/// One point, in every lane.
pub(super) struct Alone<'a>(pub &'a [f64]);

impl<S: Simd> Parameters<S> for Alone<'_> {
    #[inline(always)]
    fn get(&self, simd: S, k: usize) -> S::f64s {
        simd.splat_f64s(self.0[k])
    }
}
