//! The noise of the frames of a series, estimated where no law can reach.
//!
//! Frame contrasts orthogonal to (1, .., 1) and to the loads hold nothing that is the same in all frames or grows with the load, of
//! the model, the dictionary or anything unknown; of the columns that they do see, the likelihood is restricted to what is orthogonal
//! to them. What is left there is noise at any length. That takes three frames, or two of the same load.
//!
//! *One or two frames* without such a contrast are taken as a single field is: of all values orthogonal to the columns, what is
//! correlated over short lengths ([`noise_lengths_mm`](crate::noise::covariance::noise_lengths_mm)) is noise and what is correlated over
//! longer ones a discrepancy. Where the likeliest length is one of the latter, noise is what it leaves white, and the rest is left to
//! the rivals. All frames then have one scale, and of two the share of the reference is the likeliest.
//!
//! *Both components share (l, rho)* unless the data ask for two: they are read from the same pictures by the same subsets, and every
//! covariance and its eigenvectors are then needed once; s2 is each component's own. Two shapes are taken where they beat one by 5
//! nats: so it was in one of 20 series whose components had the same (tests/series_noise.rs).

use std::sync::Arc;

use nalgebra::DMatrix;

use super::contrasts::{Metric, beyond_laws, covariance_of_frames};
use super::family::{CorrelationShape, ShapeFamily};
use super::frames::Frames;
use super::restricted::Restricted;
use super::scales::FrameScales;
use super::shapes::{LATTICES, Scored, Shapes, choose};
use super::slices::Slices;
use crate::error::Result;
use crate::noise::BlockCovariance;

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
        (false, _) => 6,
    };
    Shapes::tabulated(lengths)
}

impl<'a> Search<'a> {
    /// Of the columns and the data of both components.
    ///
    /// # Errors
    /// Of the input: too few values beside the columns.
    pub fn new(
        frames: &Frames<'a>,
        slices: [&Slices; 2],
        step: &'a (dyn Fn() + Sync),
    ) -> Result<Self> {
        let mut contrasts = beyond_laws(frames);
        let by_contrasts = contrasts.ncols() > 0;
        if !by_contrasts {
            contrasts = DMatrix::identity(frames.len(), frames.len());
        }
        let of = |c: usize| Restricted::new(slices[c], &contrasts);
        let restricted = [of(0)?, of(1)?];
        Ok(Self {
            shapes: Shapes {
                family: ShapeFamily::new(frames, by_contrasts),
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
        if self.by_contrasts {
            // the scales first, which the shapes hardly change, then both again
            for lattices in [&LATTICES[..], &LATTICES[1..]] {
                scales = self.scales(shapes, &scales)?;
                metric = self.metric(&scales, 0.0)?;
                shapes = search.refined(shapes, &metric, lattices)?;
                shapes = search.with_nugget(shapes, &metric)?;
            }
        }
        self.noise(shapes, scales, &metric)
    }

    fn metric(&self, scales: &[f64], reference: f64) -> Result<Metric> {
        Metric::new(&self.contrasts, &covariance_of_frames(scales, reference))
    }

    /// The frames' scales at given shapes.
    fn scales(&self, shapes: [CorrelationShape; 2], start: &[f64]) -> Result<Vec<f64>> {
        let (_, whitened) = self.shapes.whitened(shapes)?;
        FrameScales {
            contrasts: &self.contrasts,
            restricted: self.shapes.restricted.each_ref(),
            whitened: whitened.each_ref(),
        }
        .best(start)
    }

    fn noise(
        &self,
        shapes: [CorrelationShape; 2],
        scales: Vec<f64>,
        metric: &Metric,
    ) -> Result<FrameNoise> {
        let (covariances, whitened) = self.shapes.whitened(shapes)?;
        let restricted = &self.shapes.restricted;
        let fits = [
            restricted[0].fit(&whitened[0], metric)?,
            restricted[1].fit(&whitened[1], metric)?,
        ];
        // what a discrepancy leaves white
        let family = &self.shapes.family;
        let left = shapes.map(|shape| {
            let nugget = shape.nugget;
            let white = CorrelationShape {
                nugget,
                ..family.white()
            };
            if family.is_discrepancy(shape) {
                white
            } else {
                shape
            }
        });
        let covariances = if left == shapes {
            covariances
        } else {
            self.shapes.whitened(left)?.0
        };
        Ok(FrameNoise {
            spatial: [0, 1].map(|c: usize| SpatialNoise {
                length_mm: left[c].length_mm,
                ratio: left[c].ratio,
                nugget: left[c].nugget,
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
