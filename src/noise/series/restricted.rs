//! Restricted likelihood of one component's noise on frame contrasts, and its slope with the frames' scales.
//!
//! On contrasts B the values have the covariance (B' Phi B) (x) N; of the columns, those count that the contrasts see and that do not
//! depend on others there. With S = B (B' Phi B)^-1 B', M = X' (S (x) N^-1) X and s^2 profiled out, up to a constant
//! -2 L = nu (log s^2 + 1) + m log |N| + n log |B' Phi B| + log |M_xx|, nu = m n - p, s^2 = (M_yy - M_yx M_xx^-1 M_xy) / nu.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::contrasts::Metric;
use super::dense::{gram, product, tr_product};
use super::slices::{Slices, combined};
use crate::error::{Error, Result};
use crate::noise::{BlockCovariance, NormalEquations};

/// Columns of which contrasts see less than this part have none there: they follow a law.
const UNSEEN: f64 = 1e-8;

/// Columns of which less than the root of this is independent of the others depend on them.
const DEPENDENT: f64 = 1e-11;

/// Contrasts needed beside the columns, at least.
const FEWEST: usize = 20;

/// What frame contrasts know of one component's noise.
pub(super) struct Restricted {
    basis: DMatrix<f64>,
    /// Independent columns and, last, the data, in each frame.
    frames: Vec<DMatrix<f64>>,
    /// Number of frame contrasts m and of blocks n.
    shape: [usize; 2],
    /// nu.
    freedom: usize,
}

/// A basis whitened by the noise N of one frame.
pub(super) struct Whitened {
    /// A' N^-1 A.
    gram: DMatrix<f64>,
    /// log det N.
    log_det: f64,
}

/// The restricted likelihood at one noise.
pub(super) struct Fit {
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
        let inner = gram(&slices.basis);
        let n = slices.basis.nrows();
        let last = slices.frames.first().map_or(0, |t| t.ncols() - 1);
        let squares = |u: &DMatrix<f64>| {
            let image = product(&inner, u);
            DVector::from_fn(last, |j, _| u.column(j).dot(&image.column(j)))
        };
        let mut seen = DMatrix::zeros(last, last);
        for b in contrasts.column_iter() {
            let u = slices
                .combined(&b.into_owned())
                .columns(0, last)
                .into_owned();
            seen += tr_product(&u, &product(&inner, &u));
        }
        let total = slices.frames.iter().map(squares);
        let total = total.fold(DVector::zeros(last), |sum, more| sum + more);
        let kept = independent(&seen, &total);
        let m = contrasts.ncols();
        if m * n < kept.len() + FEWEST {
            let expected = "enough blocks in enough frames to tell the noise from the effects";
            return Err(Error::input("steps", expected)
                .found(format!(
                    "{n} blocks in {m} independent contrasts of frames for {} columns",
                    kept.len()
                ))
                .hint("restrict the dictionary with \"candidates\", measure more densely, or more steps"));
        }
        Ok(Self {
            frames: slices.of(&kept),
            basis: slices.basis.clone(),
            shape: [m, n],
            freedom: m * n - kept.len(),
        })
    }

    /// nu: contrasts beside the columns.
    pub fn freedom(&self) -> usize {
        self.freedom
    }

    /// The basis under one frame's noise.
    pub fn whitened(&self, noise: &BlockCovariance) -> Whitened {
        Whitened {
            gram: gram(&noise.whiten(&self.basis)),
            log_det: noise.log_det(),
        }
    }

    /// The restricted likelihood under a noise of frames and of blocks.
    ///
    /// # Errors
    /// Of the program: columns that are not independent after whitening.
    pub fn fit(&self, whitened: &Whitened, metric: &Metric) -> Result<Fit> {
        let mut m = self.sandwich(whitened, metric.root.column(0).into_owned());
        for root in metric.root.column_iter().skip(1) {
            m += self.sandwich(whitened, root.into_owned());
        }
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
        Ok(Fit {
            log_likelihood: -0.5 * (nu * (scale2.ln() + 1.0 + TAU.ln()) + log_det),
            scale2,
            inverse: explained.covariance(),
            amplitudes: explained.mean(),
        })
    }

    /// Slope of the restricted likelihood with the noise of each frame.
    pub fn slope(&self, whitened: &Whitened, metric: &Metric, fit: &Fit) -> DVector<f64> {
        let last = fit.amplitudes.len();
        DVector::from_fn(self.frames.len(), |s, _| {
            // d M / d Phi_ss = -X' (S e e' S (x) N^-1) X
            let h = self.sandwich(whitened, metric.s.column(s).into_owned());
            let (xx, xy) = (h.view((0, 0), (last, last)), h.view((0, last), (last, 1)));
            let a = &fit.amplitudes;
            let square = h[(last, last)] - 2.0 * a.dot(&xy.column(0)) + a.dot(&(xx * a));
            let columns: f64 = fit.inverse.dot(&xx);
            let blocks = self.shape[1] as f64;
            0.5 * (square / fit.scale2 - blocks * metric.s[(s, s)] + columns)
        })
    }

    /// X' (w w' (x) N^-1) X of the columns and the data.
    fn sandwich(&self, whitened: &Whitened, weights: DVector<f64>) -> DMatrix<f64> {
        let u = combined(&self.frames, &weights);
        tr_product(&u, &product(&whitened.gram, &u))
    }
}

/// Columns, in order of how much of them is left, of which contrasts see something that the earlier ones do not have:
/// Cholesky's factorisation with pivoting of the gram matrix `seen`, scaled to a unit diagonal.
fn independent(seen: &DMatrix<f64>, total: &DVector<f64>) -> Vec<usize> {
    let p = seen.nrows();
    let visible = |k: usize| seen[(k, k)] > UNSEEN * UNSEEN * total[k];
    let mut open: Vec<usize> = (0..p).filter(|&k| visible(k)).collect();
    let length = |k: usize| seen[(k, k)].sqrt();
    let mut left: Vec<f64> = vec![1.0; p];
    let mut factor: Vec<Vec<f64>> = vec![Vec::new(); p];
    let mut kept = Vec::new();
    while !open.is_empty() {
        let longest =
            (1..open.len()).fold(0, |a, b| if left[open[b]] > left[open[a]] { b } else { a });
        let pivot = open[longest];
        if left[pivot] <= DEPENDENT {
            break;
        }
        open.remove(longest);
        let (of_pivot, root) = (factor[pivot].clone(), left[pivot].sqrt());
        for &k in &open {
            let before: f64 = factor[k].iter().zip(&of_pivot).map(|(a, b)| a * b).sum();
            let scaled = seen[(pivot, k)] / (length(pivot) * length(k));
            let value = (scaled - before) / root;
            factor[k].push(value);
            left[k] -= value * value;
        }
        kept.push(pivot);
    }
    kept.sort_unstable();
    kept
}
