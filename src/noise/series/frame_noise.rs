//! The noise of the frames of a series, estimated where no law can reach.
//!
//! Frame contrasts orthogonal to (1, .., 1) and to the loads hold nothing that is the same in all frames or grows with the load, of
//! the model, the dictionary or anything unknown; of the columns that they do see, the likelihood is restricted to what is orthogonal
//! to them. What is left there is noise at any length. That takes three frames, or two of the same load.
//!
//! *One or two frames* without such a contrast are taken as a single field is: noise is what is correlated over short lengths
//! ([`noise_lengths_mm`](crate::noise::covariance::noise_lengths_mm)), orthogonal to all columns and to local quadratics in every frame;
//! what is longer is left to the rivals. All frames then have one scale, and of two the share of the reference is the likeliest.
//!
//! *Both components share (l, rho)* unless the data ask for two: they are read from the same pictures by the same subsets, and every
//! covariance and its eigenvectors are then needed once; s2 is each component's own. One shape for both was off by 0 to 3 nats
//! where both had one (tests/series_noise.rs); two shapes are taken from 5 nats on.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::contrasts::{Metric, beyond_laws, covariance_of_frames};
use super::family::{Family, Shape};
use super::frames::Frames;
use super::restricted::Restricted;
use super::scales::Scales;
use super::shapes::{Scored, Shapes, choose};
use super::slices::Slices;
use crate::error::Result;
use crate::noise::BlockCovariance;
use crate::noise::estimate::smooth_columns;

/// The noise of one component in one frame of scale 1.
#[derive(Debug, Clone)]
pub struct SpatialNoise {
    /// Correlation length l of smooth patterns, mm; of no meaning where `ratio` is 0.
    pub length_mm: f64,
    /// Ratio rho of their variance to that of a point (with a subset) or of a block (without).
    pub ratio: f64,
    /// Part of a block's noise that no subset correlates; of no meaning without a subset.
    pub nugget: f64,
    /// s2, mm^2: with a subset, the variance of a point's noise that the subset correlates; else that of a typical block's white part.
    pub scale2: f64,
    /// K + rho Matern(l) with its factor.
    pub covariance: Arc<BlockCovariance>,
}

/// The noise of all frames.
#[derive(Debug, Clone)]
pub struct FrameNoise {
    /// Of u1 and u2.
    pub spatial: [SpatialNoise; 2],
    /// Scale d_s of each frame's variance, geometric mean 1.
    pub scales: Vec<f64>,
    /// Whether frame contrasts knew it; else it is that of single fields.
    pub by_contrasts: bool,
    /// Degrees of freedom of each component's restricted likelihood.
    pub freedom: [usize; 2],
    /// Restricted log likelihood of both components at its maximum.
    pub log_likelihood: f64,
}

impl FrameNoise {
    /// Whether both components have one shape.
    pub fn is_shared(&self) -> bool {
        Arc::ptr_eq(&self.spatial[0].covariance, &self.spatial[1].covariance)
    }

    /// diag(d) + r 1 1': the covariance of frames under a reference's share r.
    pub fn of_frames(&self, reference: f64) -> DMatrix<f64> {
        covariance_of_frames(&self.scales, reference)
    }
}

/// What frame contrasts, or single fields, know of the noise.
pub(super) struct Search<'a> {
    shapes: Shapes<'a>,
    contrasts: DMatrix<f64>,
    by_contrasts: bool,
}

/// How often the estimate calls its `step` at most.
pub(super) fn steps(frames: &Frames<'_>) -> usize {
    let by_contrasts = beyond_laws(frames).ncols() > 0;
    let lengths = match (by_contrasts, frames.subset_mm) {
        (true, None) => 5,
        (true, Some(_)) => 4,
        (false, _) => 3,
    };
    Shapes::tabulated(lengths)
}

impl<'a> Search<'a> {
    /// Of `columns` ((frames n) x (p + 1), frame by frame, the data last) and their slices.
    ///
    /// # Errors
    /// Of the input: too few values beside the columns.
    pub fn new(
        frames: &Frames<'a>,
        columns: [&DMatrix<f64>; 2],
        slices: [&Slices; 2],
        step: &'a (dyn Fn() + Sync),
    ) -> Result<Self> {
        let contrasts = beyond_laws(frames);
        let by_contrasts = contrasts.ncols() > 0;
        let (contrasts, restricted) = if by_contrasts {
            let of = |c: usize| Restricted::new(slices[c], &contrasts);
            let restricted = [of(0)?, of(1)?];
            (contrasts, restricted)
        } else {
            let all = DMatrix::identity(frames.len(), frames.len());
            let of = |c: usize| {
                let without_smooth = beyond_smooth(frames, columns[c]);
                Restricted::new(&Slices::new(&without_smooth, frames.blocks.len()), &all)
            };
            let restricted = [of(0)?, of(1)?];
            (all, restricted)
        };
        Ok(Self {
            shapes: Shapes {
                family: Family::new(frames, by_contrasts),
                restricted,
                step,
            },
            contrasts,
            by_contrasts,
        })
    }

    /// The noise of the largest restricted likelihood; where frame contrasts do not know it, under the best of the `references`' shares
    /// and their log prior probabilities.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn best(&self, references: &[(f64, f64)]) -> Result<FrameNoise> {
        let ones = vec![1.0; self.contrasts.nrows()];
        let none = [(0.0, 0.0)];
        let references = if self.by_contrasts {
            &none[..]
        } else {
            references
        };
        let search = &self.shapes;
        let metrics = references.iter().map(|(r, _)| self.metric(&ones, *r));
        let mut metrics: Vec<Metric> = metrics.collect::<Result<_>>()?;
        let white = search.with_nugget([search.family.white(); 2], &metrics[0])?;
        let table = search.table(white[0].nugget, &metrics)?;
        let best = likeliest_reference(&table, references);
        let mut metric = metrics.swap_remove(best);
        let mut shapes = search.with_nugget(choose(&table, best), &metric)?;
        let mut scales = ones;
        // the scales first, which the shapes hardly change, then both again
        for _ in 0..2 {
            if self.by_contrasts {
                scales = self.scales(shapes, &scales)?;
                metric = self.metric(&scales, 0.0)?;
                shapes = search.with_nugget(search.refined(shapes, &metric)?, &metric)?;
            }
        }
        self.noise(shapes, scales, &metric)
    }

    fn metric(&self, scales: &[f64], reference: f64) -> Result<Metric> {
        Metric::new(&self.contrasts, &covariance_of_frames(scales, reference))
    }

    /// The frames' scales at given shapes.
    fn scales(&self, shapes: [Shape; 2], start: &[f64]) -> Result<Vec<f64>> {
        let (_, whitened) = self.shapes.whitened(shapes)?;
        Scales {
            contrasts: &self.contrasts,
            restricted: self.shapes.restricted.each_ref(),
            whitened: whitened.each_ref(),
        }
        .best(start)
    }

    fn noise(&self, shapes: [Shape; 2], scales: Vec<f64>, metric: &Metric) -> Result<FrameNoise> {
        let (covariances, whitened) = self.shapes.whitened(shapes)?;
        let restricted = &self.shapes.restricted;
        let fits = [
            restricted[0].fit(&whitened[0], metric)?,
            restricted[1].fit(&whitened[1], metric)?,
        ];
        Ok(FrameNoise {
            spatial: [0, 1].map(|c: usize| SpatialNoise {
                length_mm: shapes[c].length_mm,
                ratio: shapes[c].ratio,
                nugget: shapes[c].nugget,
                scale2: fits[c].scale2,
                covariance: Arc::clone(&covariances[c]),
            }),
            scales,
            by_contrasts: self.by_contrasts,
            freedom: [0, 1].map(|c: usize| restricted[c].freedom()),
            log_likelihood: fits[0].log_likelihood + fits[1].log_likelihood,
        })
    }
}

/// The metric, of those of the references' shares, under which a table is the likeliest.
fn likeliest_reference(table: &[Scored], references: &[(f64, f64)]) -> usize {
    let highest = |k: usize| {
        let totals = table.iter().map(|s| s.values[k].iter().sum::<f64>());
        references[k].1 + totals.fold(f64::NEG_INFINITY, f64::max)
    };
    (1..references.len()).fold(0, |a, b| if highest(b) > highest(a) { b } else { a })
}

/// The columns with local polynomials in every frame put before the data, so that what is smooth over several noise lengths does not
/// pass for noise.
fn beyond_smooth(frames: &Frames<'_>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, last) = (frames.blocks.len(), columns.ncols() - 1);
    let smooth = smooth_columns(frames.blocks, last);
    let count = frames.len();
    let own = DMatrix::<f64>::identity(count, count).kronecker(&smooth);
    let more = own.ncols();
    let data: DVector<f64> = columns.column(last).into_owned();
    let mut all = columns.clone().resize_horizontally(last + more + 1, 0.0);
    if more > 0 {
        all.view_mut((0, last), (count * n, more)).copy_from(&own);
    }
    all.set_column(last + more, &data);
    all
}
