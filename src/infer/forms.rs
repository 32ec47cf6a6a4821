//! The quadratic forms of a diagonal plus rank-one covariance, of one point or of many.

use pulp::Simd;

use super::lanes::{Columns, Lanes, Parameters};

/// Coordinates whose product of variances is taken before the logarithm.
pub(super) const GROUP: usize = 4;

/// Coordinates, or vectors of points, that are evaluated together.
pub(super) const PAIR: usize = 2;

/// r' V^-1 r, w' V^-1 w, w' V^-1 r and log det V.
#[derive(Debug, Clone, Copy)]
pub(super) struct Forms<T> {
    pub quad: T,
    pub ww: T,
    pub wr: T,
    pub log_det: T,
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

    /// Adds a coordinate of unit variance.
    #[inline(always)]
    pub(super) fn add<S: Simd<f64s = T>>(&mut self, simd: S, r: T, w: T) {
        self.quad = simd.mul_add_e_f64s(r, r, self.quad);
        self.ww = simd.mul_add_e_f64s(w, w, self.ww);
        self.wr = simd.mul_add_e_f64s(w, r, self.wr);
    }
}

impl Forms<f64> {
    /// The same for every lane.
    #[inline(always)]
    pub(super) fn splat<S: Simd>(&self, simd: S) -> Forms<S::f64s> {
        Forms {
            quad: simd.splat_f64s(self.quad),
            ww: simd.splat_f64s(self.ww),
            wr: simd.splat_f64s(self.wr),
            log_det: simd.splat_f64s(self.log_det),
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
        let zero = Lanes::splat(0.0);
        Self {
            quad: zero,
            ww: zero,
            wr: zero,
            log_det: zero,
        }
    }
}

/// What becomes of the forms while they are in registers.
pub(super) trait Finish {
    /// Noise scales of a vector of points with parameters `x`.
    fn scales<S: Simd>(&self, simd: S, x: &impl Parameters<S>) -> S::f64s;

    /// A number for each point.
    fn finish<S: Simd>(&self, simd: S, x: &impl Parameters<S>, forms: &Forms<S::f64s>) -> S::f64s;
}

/// A vector of points.
pub(super) struct Of<'a>(pub Columns<'a>, pub usize);

impl<S: Simd> Parameters<S> for Of<'_> {
    #[inline(always)]
    fn get(&self, _simd: S, k: usize) -> S::f64s {
        S::as_simd_f64s(self.0.column(k)).0[self.1]
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
