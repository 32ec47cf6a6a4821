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
//! *A random walk* over the frames is what incremental correlation leaves, which follows every picture from the one before: noise adds up.
//! Contrasts tell it from independent frames; what every frame has more than the one before is then independent, and is what is weighed.
//!
//! *Both components share (l, rho)* unless the data ask for two: they are read from the same pictures by the same subsets, and every
//! covariance and its eigenvectors are then needed once; s2 is each component's own. Two shapes are taken where they beat one by 5
//! nats: so it was in one of 20 series whose components had the same (tests/unit/series_noise.rs).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use serde::{Deserialize, Serialize};

use super::contrasts::{Metric, beyond_laws, covariance_of_frames, covariance_of_walk};
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
    pub shape: CorrelationShape,
    /// s2, mm^2: with a subset, the variance of a point's noise that the subset correlates; else that of a typical block's white part.
    pub scale2: f64,
    /// K + rho M(l) with its factor.
    pub covariance: Arc<BlockCovariance>,
}

/// The noise of all frames.
#[derive(Debug, Clone)]
pub struct FrameNoise {
    /// Of u1 and u2.
    pub spatial: [SpatialNoise; 2],
    /// Scale d_s of each frame's variance, geometric mean 1; of a random walk, of what each frame adds.
    pub scales: Vec<f64>,
    /// Whether the noise of every frame is that of the frame before and its own.
    pub walks: bool,
    /// Whether frame contrasts knew it; else it is that of single fields.
    pub by_contrasts: bool,
    /// By how much smooth patterns raise the restricted log likelihood, nats; 0 where there are none.
    pub smooth_gain: f64,
}

/// What the search for the noise finds: the numbers of which the noise of all frames is made.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FoundNoise {
    shapes: [CorrelationShape; 2],
    /// s2 of u1 and of u2, mm^2.
    scales2: [f64; 2],
    /// Those of [`FrameNoise`].
    scales: Vec<f64>,
    walks: bool,
    by_contrasts: bool,
    /// Restricted log likelihood of both components at its maximum.
    log_likelihood: f64,
    smooth_gain: f64,
}

impl FoundNoise {
    /// The noise, with its covariances over the frames' blocks.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn over(&self, frames: &Frames<'_>) -> Result<FrameNoise> {
        let covariances = ShapeFamily::new(frames, self.by_contrasts).of_both(self.shapes)?;
        let spatial = [0, 1].map(|c: usize| SpatialNoise {
            shape: self.shapes[c],
            scale2: self.scales2[c],
            covariance: Arc::clone(&covariances[c]),
        });
        Ok(FrameNoise {
            spatial,
            scales: self.scales.clone(),
            walks: self.walks,
            by_contrasts: self.by_contrasts,
            smooth_gain: self.smooth_gain,
        })
    }
}

/// Log likelihood by which smooth patterns must beat noise of the subset alone to count: of nulls none came near it (prototype study).
const CLEAR: f64 = 20.0;

impl FrameNoise {
    /// Whether frame contrasts know of smooth patterns that are new in every frame.
    pub fn is_smooth(&self) -> bool {
        self.by_contrasts && self.smooth_gain > CLEAR
    }

    /// Whether both components have one shape.
    pub fn is_shared(&self) -> bool {
        Arc::ptr_eq(&self.spatial[0].covariance, &self.spatial[1].covariance)
    }

    /// The covariance of each component's averages over the blocks of other frames, at s = 1.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn over(&self, frames: &Frames<'_>) -> Result<[Arc<BlockCovariance>; 2]> {
        let shapes = self.spatial.each_ref().map(|s| s.shape);
        ShapeFamily::new(frames, self.by_contrasts).of_both(shapes)
    }

    /// The covariance of frames, diag(d) + r 1 1' under a reference's share r unless they are a random walk.
    pub fn of_frames(&self, reference: f64) -> DMatrix<f64> {
        if self.walks {
            covariance_of_walk(&self.scales)
        } else {
            covariance_of_frames(&self.scales, reference)
        }
    }

    /// What goes over the frames, as independent noise has it: of a random walk what every frame has more than the one before.
    pub(super) fn seen(&self, over: &DVector<f64>) -> DVector<f64> {
        let before = |s: usize| {
            if self.walks && s > 0 {
                over[s - 1]
            } else {
                0.0
            }
        };
        DVector::from_fn(over.len(), |s, _| over[s] - before(s))
    }

    /// Columns over the frames in the same way.
    pub(super) fn slices(&self, of: Slices) -> Slices {
        if self.walks { of.steps() } else { of }
    }
}

/// Log odds by which a random walk must beat frames of independent noise. Their own scales are counted: those of five frames come within 5 nats
/// of a random walk that none of them has.
const WALKS: f64 = 5.0;

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
    pub fn best(&self, references: &[(f64, f64)]) -> Result<FoundNoise> {
        let (shapes, scales, metric) = self.likeliest(references, false)?;
        let free = self.freedom_of_scales(&scales);
        let found = self.noise(shapes, scales, &metric)?;
        let independent = found.log_likelihood - free;
        if !self.by_contrasts || self.contrasts.ncols() < 2 {
            return Ok(found);
        }
        let ones = vec![1.0; self.contrasts.nrows()];
        let whitened = self.shapes.whitened(shapes)?;
        let metric = self.metric(&ones, 0.0, true)?;
        let of = |c: usize| self.shapes.restricted[c].fit(&whitened[c], &metric);
        if of(0)?.log_likelihood + of(1)?.log_likelihood < independent {
            return Ok(found);
        }
        let (shapes, scales, metric) = self.likeliest(references, true)?;
        let walk = FoundNoise {
            walks: true,
            ..self.noise(shapes, scales, &metric)?
        };
        let walks = walk.log_likelihood > independent + WALKS;
        Ok(if walks { walk } else { found })
    }

    /// What scales of N(0, 1) logarithms that are fitted cost of the log evidence, nats; nothing where all are equal.
    fn freedom_of_scales(&self, scales: &[f64]) -> f64 {
        let square: f64 = scales.iter().map(|d| d.ln().powi(2)).sum();
        if square == 0.0 {
            return 0.0;
        }
        let values: usize = self.shapes.restricted.iter().map(|r| r.freedom()).sum();
        let each = 0.5 * values as f64 / scales.len() as f64;
        0.5 * square + 0.5 * (scales.len() - 1) as f64 * each.max(1.0).ln()
    }

    /// The shapes, the frames' scales and the metric of the largest restricted likelihood, of a random walk all steps of one scale.
    fn likeliest(
        &self,
        references: &[(f64, f64)],
        walks: bool,
    ) -> Result<([CorrelationShape; 2], Vec<f64>, Metric)> {
        let ones = vec![1.0; self.contrasts.nrows()];
        let none = [(0.0, 0.0)];
        let references = if self.by_contrasts {
            &none[..]
        } else {
            references
        };
        let search = &self.shapes;
        let metrics = references
            .iter()
            .map(|(r, _)| self.metric(&ones, *r, walks));
        let mut metrics: Vec<Metric> = metrics.collect::<Result<_>>()?;
        let white = search.with_nugget([search.family.white(); 2], &metrics[0])?;
        let table = search.table(white[0].nugget, &metrics)?;
        let best = likeliest_reference(&table, references);
        let mut metric = metrics.swap_remove(best);
        let mut shapes = search.with_nugget(choose(&table, best), &metric)?;
        let mut scales = ones;
        let rescaled = |shapes, scales: &[f64]| match walks {
            true => Ok(scales.to_vec()),
            false => self.scales(shapes, scales),
        };
        if self.by_contrasts {
            // the scales first, which the shapes hardly change, then both again
            for lattices in [&LATTICES[..], &LATTICES[1..]] {
                scales = rescaled(shapes, &scales)?;
                metric = self.metric(&scales, 0.0, walks)?;
                shapes = search.refined(shapes, &metric, lattices)?;
                shapes = search.with_nugget(shapes, &metric)?;
            }
            let first = shapes;
            shapes = search.with_kernel(shapes, &metric)?;
            if shapes != first {
                scales = rescaled(shapes, &scales)?;
                metric = self.metric(&scales, 0.0, walks)?;
                shapes = search.refined(shapes, &metric, &LATTICES[1..])?;
                shapes = search.with_nugget(shapes, &metric)?;
            }
        }
        Ok((shapes, scales, metric))
    }

    fn metric(&self, scales: &[f64], reference: f64, walks: bool) -> Result<Metric> {
        let covariance = match walks {
            true => covariance_of_walk(scales),
            false => covariance_of_frames(scales, reference),
        };
        Metric::new(&self.contrasts, &covariance)
    }

    /// The frames' scales at given shapes.
    fn scales(&self, shapes: [CorrelationShape; 2], start: &[f64]) -> Result<Vec<f64>> {
        let whitened = self.shapes.whitened(shapes)?;
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
    ) -> Result<FoundNoise> {
        let whitened = self.shapes.whitened(shapes)?;
        let restricted = &self.shapes.restricted;
        let fits = [
            restricted[0].fit(&whitened[0], metric)?,
            restricted[1].fit(&whitened[1], metric)?,
        ];
        let family = &self.shapes.family;
        let log_likelihood = fits[0].log_likelihood + fits[1].log_likelihood;
        let plain = shapes.map(|shape| CorrelationShape {
            ratio: 0.0,
            ..shape
        });
        let smooth_gain = match shapes.iter().any(|s| s.ratio > 0.0) {
            true => {
                let plain = self.shapes.with_nugget(plain, metric)?;
                let white = self.shapes.whitened(plain)?;
                let of = |c: usize| restricted[c].fit(&white[c], metric);
                log_likelihood - of(0)?.log_likelihood - of(1)?.log_likelihood
            }
            false => 0.0,
        };
        // what a discrepancy leaves white
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
        Ok(FoundNoise {
            shapes: left,
            scales2: fits.each_ref().map(|fit| fit.scale2),
            scales,
            walks: false,
            by_contrasts: self.by_contrasts,
            log_likelihood,
            smooth_gain,
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
