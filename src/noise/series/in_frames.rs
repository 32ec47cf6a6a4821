//! What every column does in each frame, and what each frame measured, under the noise of a series: from it follows what any choice of
//! the frames says. Here: all of them, or all but one.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::frame_noise::FrameNoise;
use super::frames::Frames;
use super::slices::Slices;
use crate::dense::{gram, product, tr_product};
use crate::noise::BlockCovariance;

/// Columns and data of both components, frame by frame.
#[derive(Debug)]
pub struct InFrames {
    pub(super) parts: [FrameColumns; 2],
    /// Whitening of either component: its noise at s = 1, and s.
    pub(super) noise: [(std::sync::Arc<BlockCovariance>, f64); 2],
    /// d of each frame.
    pub(super) scales: Vec<f64>,
    /// Force over the largest of each frame.
    pub loads: Vec<f64>,
    /// Whether frames stand for what they have more than the one before.
    pub(super) walks: bool,
}

/// One component's columns and, last, the data.
#[derive(Debug)]
pub(super) struct FrameColumns {
    /// T_s of each frame in the basis A.
    pub slices: Slices,
    /// s^-1 L^-1 A of N = s^2 L L': blocks x k.
    pub white: DMatrix<f64>,
    /// A' N^-1 A.
    pub inner: DMatrix<f64>,
}

/// What some frames know of all columns, both components together.
#[derive(Debug)]
pub struct FramesInformation {
    /// X' (diag(d)^-1 (x) N^-1) X of the columns and, last, the data.
    own: DMatrix<f64>,
    /// X' (D^-1 1 1' D^-1 (x) N^-1) X.
    common: DMatrix<f64>,
    /// 1' D^-1 1.
    square: f64,
    /// log det of diag(d) (x) N, and twice the number of blocks.
    log_det: f64,
    values: f64,
}

impl FramesInformation {
    /// X' C^-1 X of some `columns` and, last, the data, and log det C, under a share r of the reference's noise.
    pub fn equations(&self, columns: &[usize], reference: f64) -> (DMatrix<f64>, f64) {
        let last = self.own.nrows() - 1;
        let at = |k: usize| columns.get(k).copied().unwrap_or(last);
        let share = reference / (1.0 + reference * self.square);
        let n = columns.len() + 1;
        let gram = DMatrix::from_fn(n, n, |i, j| {
            let (i, j) = (at(i), at(j));
            self.own[(i, j)] - share * self.common[(i, j)]
        });
        let log_det = self.log_det + self.values * (reference * self.square).ln_1p();
        (gram, log_det)
    }

    /// Whether a column does nothing in these frames.
    pub fn lacks(&self, column: usize) -> bool {
        self.own[(column, column)] == 0.0
    }
}

impl InFrames {
    /// Of the columns and the data of both components.
    pub(super) fn new(frames: &Frames<'_>, noise: &FrameNoise, slices: [Slices; 2]) -> Self {
        let mut spatial = noise.spatial.iter();
        let parts = slices.map(|slices| {
            let slices = noise.slices(slices);
            let white = spatial.next().map_or_else(
                || slices.basis.clone(),
                |n| n.covariance.whiten(&slices.basis) / n.scale2.sqrt(),
            );
            FrameColumns {
                inner: gram(&white),
                white,
                slices,
            }
        });
        let whitening = |c: usize| {
            let n = &noise.spatial[c];
            (std::sync::Arc::clone(&n.covariance), n.scale2.sqrt())
        };
        Self {
            parts,
            noise: [whitening(0), whitening(1)],
            scales: noise.scales.clone(),
            loads: frames.loads.clone(),
            walks: noise.walks,
        }
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.scales.len()
    }

    /// Force over the largest of each frame.
    pub fn loads(&self) -> &[f64] {
        &self.loads
    }

    /// Number of blocks.
    fn blocks(&self) -> usize {
        self.parts[0].white.nrows()
    }

    /// What all frames know, and what all but each of them do.
    pub fn known(&self) -> (FramesInformation, Vec<FramesInformation>) {
        let one = |frame: usize| {
            let of = |part: &FrameColumns| {
                let t = &part.slices.frames[frame];
                tr_product(t, &product(&part.inner, t))
            };
            (of(&self.parts[0]) + of(&self.parts[1])) / self.scales[frame]
        };
        let own: Vec<DMatrix<f64>> = (0..self.count()).into_par_iter().map(one).collect();
        let without = (0..self.count()).into_par_iter();
        let without = without.map(|frame| self.of(&own, Some(frame)));
        (self.of(&own, None), without.collect())
    }

    /// What all frames but one know. Sums over the others, not differences: a motion of ten millimetres in the one leaves rounding of a
    /// prior sd in a difference.
    fn of(&self, own: &[DMatrix<f64>], but: Option<usize>) -> FramesInformation {
        let used: Vec<usize> = (0..self.count()).filter(|s| Some(*s) != but).collect();
        let weights = DVector::from_fn(self.count(), |s, _| {
            if Some(s) == but {
                0.0
            } else {
                1.0 / self.scales[s]
            }
        });
        let p = own.first().map_or(0, DMatrix::nrows);
        let (mut sum, mut common) = (DMatrix::zeros(p, p), DMatrix::zeros(p, p));
        used.iter().for_each(|&s| sum += &own[s]);
        let n = self.blocks() as f64;
        let mut log_det = 0.0;
        for (part, (covariance, sd)) in self.parts.iter().zip(&self.noise) {
            let together = part.slices.combined(&weights);
            common += tr_product(&together, &product(&part.inner, &together));
            let frame = covariance.log_det() + 2.0 * n * sd.ln();
            let scales: f64 = used.iter().map(|&s| self.scales[s].ln()).sum();
            log_det += used.len() as f64 * frame + n * scales;
        }
        FramesInformation {
            own: sum,
            common,
            square: weights.sum(),
            log_det,
            values: 2.0 * n,
        }
    }

    /// What the noise of the other frames says of that of one, which has the reference picture in common with them: their weights, 0 for
    /// itself, under a share r.
    pub fn shared(&self, frame: usize, reference: f64) -> Vec<f64> {
        let others = (0..self.count()).filter(|s| *s != frame);
        let square: f64 = others.map(|s| 1.0 / self.scales[s]).sum();
        let share = reference / (1.0 + reference * square);
        let weight = |s: usize| {
            if s == frame {
                0.0
            } else {
                share / self.scales[s]
            }
        };
        (0..self.count()).map(weight).collect()
    }
}
