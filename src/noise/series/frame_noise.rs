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
//! where both had one (tests/series_noise.rs); two shapes are taken from [`SEPARATE`] nats on.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::contrasts::{Metric, beyond_laws, covariance_of_frames};
use super::family::{Family, RATIOS, Shape};
use super::frames::Frames;
use super::restricted::Restricted;
use super::scales::Scales;
use super::slices::Slices;
use crate::error::{Error, Result};
use crate::noise::estimate::smooth_columns;
use crate::noise::lattice::Quadratic;
use crate::noise::{BlockCovariance, Matern};

/// Log likelihood by which a shape for each component must beat one for both.
const SEPARATE: f64 = 5.0;

/// Log likelihood by which smooth patterns must beat noise of the subset alone: two parameters more.
const CORRELATED: f64 = 3.0;

/// The noise of one component in one frame of scale 1.
#[derive(Debug, Clone)]
pub struct SpatialNoise {
    /// Correlation length l of smooth patterns, mm; of no meaning where `ratio` is 0.
    pub length_mm: f64,
    /// Ratio rho of their variance to that of a point (with a subset) or of a block (without).
    pub ratio: f64,
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

/// The restricted likelihood of a shape: of each component under each metric.
struct Scored {
    shape: Shape,
    values: Vec<[f64; 2]>,
}

pub(super) struct Search<'a> {
    family: Family<'a>,
    contrasts: DMatrix<f64>,
    restricted: [Restricted; 2],
    by_contrasts: bool,
    step: &'a (dyn Fn() + Sync),
}

/// How often the estimate calls its `step` at most.
pub(super) fn steps(frames: &Frames<'_>) -> usize {
    let by_contrasts = beyond_laws(frames).ncols() > 0;
    let lengths = match (by_contrasts, frames.subset_mm) {
        (true, None) => 5,
        (true, Some(_)) => 4,
        (false, _) => 3,
    };
    1 + lengths * RATIOS.len()
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
            family: Family::new(frames, by_contrasts),
            contrasts,
            restricted,
            by_contrasts,
            step,
        })
    }

    /// The noise of the largest restricted likelihood; where frame contrasts do not know it, under the best of the `references`' shares
    /// and their log prior probabilities.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn best(&self, references: &[(f64, f64)]) -> Result<FrameNoise> {
        let count = self.contrasts.nrows();
        let ones = vec![1.0; count];
        let none = [(0.0, 0.0)];
        let references = if self.by_contrasts {
            &none[..]
        } else {
            references
        };
        let metrics = references.iter().map(|(r, _)| self.metric(&ones, *r));
        let metrics: Vec<Metric> = metrics.collect::<Result<_>>()?;
        let table = self.table(&metrics)?;
        let total =
            |scored: &Scored, k: usize| references[k].1 + scored.values[k].iter().sum::<f64>();
        let (mut best, mut highest) = (0, f64::NEG_INFINITY);
        for k in 0..metrics.len() {
            let here = table
                .iter()
                .map(|s| total(s, k))
                .fold(f64::NEG_INFINITY, f64::max);
            if here > highest {
                (best, highest) = (k, here);
            }
        }
        let mut shapes = choose(&table, best);
        let mut scales = ones;
        let Some(mut metric) = metrics.into_iter().nth(best) else {
            return Err(Error::program("noise::series", "a share of the reference"));
        };
        if self.by_contrasts {
            scales = self.scales(shapes, &scales)?;
            metric = self.metric(&scales, 0.0)?;
        }
        shapes = self.refine(shapes, &metric)?;
        if self.by_contrasts {
            scales = self.scales(shapes, &scales)?;
            metric = self.metric(&scales, 0.0)?;
        }
        self.noise(shapes, scales, &metric)
    }

    fn metric(&self, scales: &[f64], reference: f64) -> Result<Metric> {
        Metric::new(&self.contrasts, &covariance_of_frames(scales, reference))
    }

    /// The likelihood of all tabulated shapes, white noise first.
    fn table(&self, metrics: &[Metric]) -> Result<Vec<Scored>> {
        let lengths = &self.family.lengths_mm;
        let materns = lengths
            .par_iter()
            .map(|&l| Matern::new(self.family.blocks, l));
        let materns: Vec<Matern> = materns.collect();
        let mut places = vec![(&materns[0], 0.0)];
        places.extend(materns.iter().flat_map(|m| RATIOS.map(|ratio| (m, ratio))));
        let scored = places.into_par_iter().map(|(matern, ratio)| {
            let values = self.values(&self.family.with(matern, ratio)?, metrics);
            (self.step)();
            let shape = Shape {
                length_mm: matern.length_mm,
                ratio,
            };
            Ok(Scored {
                shape,
                values: values?,
            })
        });
        // collected in full first, so that the error reported is the first one for any number of threads
        let scored: Vec<Result<Scored>> = scored.collect();
        scored.into_iter().collect()
    }

    fn values(&self, covariance: &BlockCovariance, metrics: &[Metric]) -> Result<Vec<[f64; 2]>> {
        let whitened = [0, 1].map(|c: usize| self.restricted[c].whitened(covariance));
        let at = |metric: &Metric, c: usize| {
            let fit = self.restricted[c].fit(&whitened[c], metric)?;
            Ok::<f64, Error>(fit.log_likelihood)
        };
        let both = |metric| Ok([at(metric, 0)?, at(metric, 1)?]);
        metrics.iter().map(both).collect()
    }

    /// The frames' scales at given shapes.
    fn scales(&self, shapes: [Shape; 2], start: &[f64]) -> Result<Vec<f64>> {
        let covariances = self.covariances(shapes)?;
        let whitened = [0, 1].map(|c: usize| self.restricted[c].whitened(&covariances[c]));
        Scales {
            contrasts: &self.contrasts,
            restricted: [&self.restricted[0], &self.restricted[1]],
            whitened: [&whitened[0], &whitened[1]],
        }
        .best(start)
    }

    /// Factorised once where both components have one shape.
    fn covariances(&self, shapes: [Shape; 2]) -> Result<[Arc<BlockCovariance>; 2]> {
        let first = Arc::new(self.family.at(shapes[0])?);
        let second = if shapes[0] == shapes[1] {
            Arc::clone(&first)
        } else {
            Arc::new(self.family.at(shapes[1])?)
        };
        Ok([first, second])
    }

    /// Shapes between the tabulated ones.
    fn refine(&self, shapes: [Shape; 2], metric: &Metric) -> Result<[Shape; 2]> {
        if shapes[0] == shapes[1] {
            let both = self.refined(shapes[0], metric, &[0, 1])?;
            return Ok([both; 2]);
        }
        Ok([
            self.refined(shapes[0], metric, &[0])?,
            self.refined(shapes[1], metric, &[1])?,
        ])
    }

    /// The best of two lattices about a shape and of the tops of the quadratics through them; `of` the components' sum.
    fn refined(&self, start: Shape, metric: &Metric, of: &[usize]) -> Result<Shape> {
        if start.ratio == 0.0 {
            return Ok(start);
        }
        let score = |shapes: &[Shape]| -> Result<Vec<f64>> {
            let scored = shapes.par_iter().map(|&shape| {
                let values = self.values(&self.family.at(shape)?, std::slice::from_ref(metric))?;
                Ok(of.iter().map(|&c| values[0][c]).sum())
            });
            let scored: Vec<Result<f64>> = scored.collect();
            scored.into_iter().collect()
        };
        let mut best = start;
        for step in LATTICES {
            let about = best;
            let moved = |by: [f64; 2]| self.moved(about, [by[0] * step[0], by[1] * step[1]]);
            let lattice: Vec<Shape> = (0..9)
                .map(|k| moved([(k / 3) as f64 - 1.0, (k % 3) as f64 - 1.0]))
                .collect();
            let found = score(&lattice)?;
            let mut nine = [0.0; 9];
            nine.copy_from_slice(&found);
            let (to, _) = Quadratic::new(&nine).newton();
            let top = moved(to.map(|x| x.clamp(-1.5, 1.5)));
            let at_top = score(&[top])?[0];
            let mut highest = f64::NEG_INFINITY;
            for (shape, value) in lattice.into_iter().zip(found).chain([(top, at_top)]) {
                if value > highest {
                    (best, highest) = (shape, value);
                }
            }
        }
        Ok(best)
    }

    /// A shape some logarithms of length and ratio away, inside their range.
    fn moved(&self, from: Shape, by: [f64; 2]) -> Shape {
        let [shortest, longest] = self.family.range_mm;
        Shape {
            length_mm: (from.length_mm * by[0].exp()).clamp(shortest, longest),
            ratio: (from.ratio * by[1].exp()).clamp(LARGEST.recip(), LARGEST),
        }
    }

    fn noise(&self, shapes: [Shape; 2], scales: Vec<f64>, metric: &Metric) -> Result<FrameNoise> {
        let covariances = self.covariances(shapes)?;
        let fit = |c: usize| {
            let restricted = &self.restricted[c];
            restricted.fit(&restricted.whitened(&covariances[c]), metric)
        };
        let fits = [fit(0)?, fit(1)?];
        Ok(FrameNoise {
            spatial: [0, 1].map(|c: usize| SpatialNoise {
                length_mm: shapes[c].length_mm,
                ratio: shapes[c].ratio,
                scale2: fits[c].scale2,
                covariance: Arc::clone(&covariances[c]),
            }),
            scales,
            by_contrasts: self.by_contrasts,
            freedom: [0, 1].map(|c: usize| self.restricted[c].freedom()),
            log_likelihood: fits[0].log_likelihood + fits[1].log_likelihood,
        })
    }
}

/// Ratios end here, and at its inverse.
const LARGEST: f64 = 1000.0;

/// Steps of the lattices in log l and log rho: as far as a neighbour of the table, and half as far.
const LATTICES: [[f64; 2]; 2] = [
    [std::f64::consts::LN_2, 0.5 * std::f64::consts::LN_10],
    [0.5 * std::f64::consts::LN_2, 0.25 * std::f64::consts::LN_10],
];

/// The shapes of both components: one for both, or one each.
fn choose(table: &[Scored], metric: usize) -> [Shape; 2] {
    let (both, of_both) = likeliest(table, |s| s.values[metric].iter().sum());
    let (first, of_first) = likeliest(table, |s| s.values[metric][0]);
    let (second, of_second) = likeliest(table, |s| s.values[metric][1]);
    if of_first + of_second > of_both + SEPARATE {
        [first, second]
    } else {
        [both; 2]
    }
}

/// The likeliest shape of a table whose first is white, which it is unless another is clearly better.
fn likeliest(table: &[Scored], value: impl Fn(&Scored) -> f64) -> (Shape, f64) {
    let mut best = (table[0].shape, value(&table[0]));
    let white = best.1;
    for scored in &table[1..] {
        let here = value(scored);
        if here > best.1.max(white + CORRELATED) {
            best = (scored.shape, here);
        }
    }
    best
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
