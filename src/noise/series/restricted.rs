//! Restricted likelihood of one component's noise on frame contrasts, and its slope with the frames' scales.
//!
//! On contrasts B the values have the covariance (B' Phi B) (x) N; of the columns, those count that the contrasts see and that do not
//! depend on others there. With S = B (B' Phi B)^-1 B', M = X' (S (x) N^-1) X and s^2 profiled out, up to a constant
//! -2 L = nu (log s^2 + 1) + m log |N| + n log |B' Phi B| + log |M_xx|, nu = m n - p, s^2 = (M_yy - M_yx M_xx^-1 M_xy) / nu.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::contrasts::Metric;
use super::slices::{SliceBasis, Slices};
use crate::dense::{gram, product, tr_product};
use crate::error::{Error, Result};
use crate::noise::{BlockCovariance, NormalEquations};

/// Columns of which contrasts see less than this part have none there: they follow a law.
const UNSEEN: f64 = 1e-7;

/// Columns of which less than this part is independent of the others depend on them.
const DEPENDENT: f64 = 1e-6;

/// Contrasts needed beside the columns, at least.
const FEWEST: usize = 20;

/// What frame contrasts know of one component's noise.
pub(super) struct Restricted {
    /// B, frames x m, orthonormal.
    contrasts: DMatrix<f64>,
    /// A: an orthonormal basis of the columns' slices, and what the data's contrasts have beside it: blocks x k.
    basis: DMatrix<f64>,
    /// Of each contrast, an orthonormal basis of the columns that it sees and, last, the data beside it, in A: those of one contrast
    /// below one another, (k (p + 1)) x m.
    stacked: DMatrix<f64>,
    /// Number of frame contrasts m and of blocks n.
    shape: [usize; 2],
    /// nu.
    freedom: usize,
}

/// A basis whitened by the noise N of one frame.
pub(super) struct WhitenedFrames {
    /// A' N^-1 A.
    gram: DMatrix<f64>,
    /// log det N.
    log_det: f64,
}

/// The restricted likelihood at one noise.
pub(super) struct RestrictedFit {
    /// Restricted log likelihood with s^2 at its maximum.
    pub log_likelihood: f64,
    /// That s^2, mm^2.
    pub scale2: f64,
    /// M_xx^-1, and the columns' amplitudes that fit best.
    inverse: DMatrix<f64>,
    amplitudes: DVector<f64>,
}

impl Restricted {
    /// Of the columns that `contrasts` (frames x m) see.
    ///
    /// # Errors
    /// Of the input: too few values left beside the columns.
    pub fn new(slices: &Slices, contrasts: &DMatrix<f64>) -> Result<Self> {
        let [n, m] = [slices.basis.nrows(), contrasts.ncols()];
        let parts = RestrictedParts::new(slices, contrasts);
        let columns = independent(&parts.columns, &parts.total);
        let p = columns.ncols();
        if m * n < p + FEWEST {
            let expected = "enough blocks in enough frames to tell the noise from the effects";
            return Err(Error::input("steps", expected)
                .found(format!(
                    "{n} blocks in {m} independent contrasts of frames for {p} columns"
                ))
                .hint("restrict the dictionary with \"candidates\", measure more densely, or more steps"));
        }
        // twice: data in which the specimen moves by a million sds leave a residual of few digits
        let mut data = parts.data;
        for _ in 0..2 {
            let fit = columns.tr_mul(&data);
            data.gemv(-1.0, &columns, &fit, 1.0);
        }
        let q = parts.spanned.ncols();
        let mut stacked = DMatrix::zeros((q + m) * (p + 1), m);
        for j in 0..m {
            let mut own = DMatrix::zeros(q + m, p + 1);
            own.view_mut((0, 0), (q, p))
                .copy_from(&columns.rows(j * q, q));
            own.view_mut((0, p), (q, 1)).copy_from(&data.rows(j * q, q));
            own[(q + j, p)] = 1.0;
            stacked.column_mut(j).copy_from_slice(own.as_slice());
        }
        let mut basis = parts.spanned.resize_horizontally(q + m, 0.0);
        basis.columns_mut(q, m).copy_from(&parts.beside);
        Ok(Self {
            contrasts: contrasts.clone(),
            basis,
            stacked,
            shape: [m, n],
            freedom: m * n - p,
        })
    }

    /// nu: contrasts beside the columns.
    pub fn freedom(&self) -> usize {
        self.freedom
    }

    /// The basis under one frame's noise.
    pub fn whitened(&self, noise: &BlockCovariance) -> WhitenedFrames {
        WhitenedFrames {
            gram: gram(&noise.whiten(&self.basis)),
            log_det: noise.log_det(),
        }
    }

    /// The restricted likelihood under a noise of frames and of blocks.
    ///
    /// # Errors
    /// Of the program: columns that are not independent after whitening.
    pub fn fit(&self, whitened: &WhitenedFrames, metric: &Metric) -> Result<RestrictedFit> {
        let mut sandwiches = self.sandwiches(whitened, &metric.root).into_iter();
        let first = sandwiches.next().unwrap_or_else(|| DMatrix::zeros(1, 1));
        let m = sandwiches.fold(first, |sum, more| sum + more);
        let last = m.nrows() - 1;
        let (xx, xy) = (
            m.view((0, 0), (last, last)).into_owned(),
            m.view((0, last), (last, 1)).column(0).into_owned(),
        );
        let explained = NormalEquations::new(xx, xy).ok_or_else(|| {
            Error::program("noise::series", "independent columns after whitening")
        })?;
        let nu = self.freedom as f64;
        // data that the columns explain exactly have no noise; keep the logarithm finite
        let scale2 = ((m[(last, last)] - explained.quadratic()) / nu).max(f64::MIN_POSITIVE);
        let [contrasts, blocks] = self.shape.map(|k| k as f64);
        let log_det = contrasts * whitened.log_det + blocks * metric.log_det + explained.log_det();
        Ok(RestrictedFit {
            log_likelihood: -0.5 * (nu * (scale2.ln() + 1.0 + TAU.ln()) + log_det),
            scale2,
            inverse: explained.covariance(),
            amplitudes: explained.mean(),
        })
    }

    /// Slope of the restricted likelihood with the noise of each frame.
    pub fn slope(
        &self,
        whitened: &WhitenedFrames,
        metric: &Metric,
        fit: &RestrictedFit,
    ) -> DVector<f64> {
        let last = fit.amplitudes.len();
        // d M / d Phi_ss = -X' (S e e' S (x) N^-1) X
        let sandwiches = self.sandwiches(whitened, &metric.s);
        let slopes = sandwiches.iter().enumerate().map(|(s, h)| {
            let (xx, xy) = (h.view((0, 0), (last, last)), h.view((0, last), (last, 1)));
            let a = &fit.amplitudes;
            let square = h[(last, last)] - 2.0 * a.dot(&xy.column(0)) + a.dot(&(xx * a));
            let columns: f64 = fit.inverse.dot(&xx);
            let blocks = self.shape[1] as f64;
            0.5 * (square / fit.scale2 - blocks * metric.s[(s, s)] + columns)
        });
        DVector::from_iterator(sandwiches.len(), slopes)
    }

    /// X' (w w' (x) N^-1) X of the columns and the data, for every column w of `weights` (frames x any) that the contrasts span.
    fn sandwiches(&self, whitened: &WhitenedFrames, weights: &DMatrix<f64>) -> Vec<DMatrix<f64>> {
        let k = self.basis.ncols();
        let all = product(&self.stacked, &self.contrasts.tr_mul(weights));
        let each = all.column_iter().map(|u| {
            let u = DMatrix::from_column_slice(k, u.len() / k, u.as_slice());
            tr_product(&u, &product(&whitened.gram, &u))
        });
        each.collect()
    }
}

/// The columns and the data on contrasts, one contrast below the other, in an orthonormal basis of the columns' slices.
struct RestrictedParts {
    spanned: DMatrix<f64>,
    /// (q m) x columns, and their squared lengths over all frames.
    columns: DMatrix<f64>,
    total: DVector<f64>,
    /// The data inside the basis, q m, and beside it, blocks x m.
    data: DVector<f64>,
    beside: DMatrix<f64>,
}

impl RestrictedParts {
    fn new(slices: &Slices, contrasts: &DMatrix<f64>) -> Self {
        let [count, m] = [slices.frames.len(), contrasts.ncols()];
        let q = slices.basis.ncols() - count;
        let last = slices.frames.first().map_or(0, |t| t.ncols() - 1);
        let spanned = slices.basis.columns(0, q).into_owned();
        let mut beside = slices.basis.columns(q, count) * contrasts;
        let mut inside = DMatrix::zeros(q, m);
        for _ in 0..2 {
            let part = tr_product(&spanned, &beside);
            beside -= product(&spanned, &part);
            inside += part;
        }
        let mut columns = DMatrix::zeros(q * m, last);
        for (j, b) in contrasts.column_iter().enumerate() {
            let own = slices.combined(&b.into_owned());
            let own = own.view((0, 0), (q, last));
            columns.view_mut((j * q, 0), (q, last)).copy_from(&own);
        }
        let squares = slices.frames.iter().flat_map(|t| {
            let own = (0..last).map(|j| t.view((0, j), (q, 1)).norm_squared());
            own.enumerate().collect::<Vec<_>>()
        });
        let mut total = DVector::zeros(last);
        squares.for_each(|(j, square)| total[j] += square);
        Self {
            spanned,
            columns,
            total,
            data: DVector::from_column_slice(inside.as_slice()),
            beside,
        }
    }
}

/// An orthonormal basis of the columns that contrasts see, given their squared lengths over all frames.
fn independent(columns: &DMatrix<f64>, total: &DVector<f64>) -> DMatrix<f64> {
    let seen = columns.column_iter().zip(total.iter());
    let seen = seen.filter(|(c, total)| c.norm_squared() > UNSEEN * UNSEEN * *total);
    let seen: Vec<DVector<f64>> = seen.map(|(c, _)| c.normalize()).collect();
    let mut spanned = SliceBasis::new(columns.nrows());
    if !seen.is_empty() {
        spanned.include(DMatrix::from_columns(&seen), DEPENDENT);
    }
    spanned.into_matrix()
}
