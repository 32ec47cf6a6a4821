//! The search for the shape of one frame's noise: the restricted likelihood over lengths, ratios and nuggets.

use rayon::prelude::*;

use super::contrasts::Metric;
use super::family::{CorrelationShape, RATIOS, ShapeFamily, SmoothKernel};
use super::restricted::{Restricted, WhitenedFrames};
use crate::error::Result;
use crate::noise::lattice::Quadratic;
use crate::noise::{BlockCovariance, Matern};

/// Log likelihood by which a shape for each component must beat one for both.
const SEPARATE: f64 = 5.0;

/// Log likelihood by which smooth patterns must beat noise of the subset alone: two parameters more.
const CORRELATED: f64 = 3.0;

/// Ratios end here, and at its inverse.
const LARGEST: f64 = 1000.0;

/// Steps of the lattices in log l and log rho: as far as a neighbour of the table, and half as far.
pub(super) const LATTICES: [[f64; 2]; 2] = [
    [std::f64::consts::LN_2, 0.5 * std::f64::consts::LN_10],
    [0.5 * std::f64::consts::LN_2, 0.25 * std::f64::consts::LN_10],
];

/// Lengths and ratios of the second kernel over those of the first, from which its search starts.
const OTHER_LENGTHS: [f64; 4] = [0.35, 0.5, 0.7, 1.0];
const OTHER_RATIOS: [f64; 3] = [0.1, 0.3, 1.0];

/// What the shapes are weighed by.
pub(super) struct Shapes<'a> {
    pub family: ShapeFamily<'a>,
    pub restricted: [Restricted; 2],
    pub step: &'a (dyn Fn() + Sync),
}

/// A shape with the restricted likelihood of each component under each metric.
pub(super) struct Scored {
    pub shape: CorrelationShape,
    pub values: Vec<[f64; 2]>,
}

impl Shapes<'_> {
    /// How many shapes [`Shapes::table`] has for `lengths`.
    pub fn tabulated(lengths: usize) -> usize {
        1 + lengths * RATIOS.len()
    }

    /// All tabulated shapes, noise without smooth patterns first; `step` is called for each.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn table(&self, nugget: f64, metrics: &[Metric]) -> Result<Vec<Scored>> {
        let of = |length_mm, ratio| CorrelationShape {
            kernel: SmoothKernel::Matern,
            length_mm,
            ratio,
            nugget,
        };
        let lengths = &self.family.lengths_mm;
        let mut shapes = vec![of(lengths[0], 0.0)];
        shapes.extend(
            lengths
                .iter()
                .flat_map(|&l| RATIOS.map(|ratio| of(l, ratio))),
        );
        self.scored(&shapes, metrics, self.step)
    }

    fn scored(
        &self,
        shapes: &[CorrelationShape],
        metrics: &[Metric],
        step: &(dyn Fn() + Sync),
    ) -> Result<Vec<Scored>> {
        let correlated = shapes.iter().filter(|s| s.ratio > 0.0);
        let mut smooth: Vec<(SmoothKernel, f64)> = Vec::new();
        for shape in correlated.map(|s| (s.kernel, s.length_mm)) {
            if !smooth.contains(&shape) {
                smooth.push(shape);
            }
        }
        let of = |&(kernel, length_mm): &(SmoothKernel, f64)| {
            kernel.correlation(self.family.blocks, length_mm)
        };
        let correlations: Vec<Matern> = smooth.par_iter().map(of).collect();
        let scored = shapes.par_iter().map(|&shape| {
            let at = (shape.kernel, shape.length_mm);
            let known = smooth.iter().position(|s| *s == at && shape.ratio > 0.0);
            let correlation = known.map(|k| &correlations[k]);
            let values = self.values(&self.family.with(correlation, shape)?, metrics);
            step();
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
        let whitened = self.restricted.each_ref().map(|r| r.whitened(covariance));
        let at = |metric: &Metric, c: usize| -> Result<f64> {
            let fit = self.restricted[c].fit(&whitened[c], metric)?;
            Ok(fit.log_likelihood)
        };
        let both = |metric| Ok([at(metric, 0)?, at(metric, 1)?]);
        metrics.iter().map(both).collect()
    }

    /// The bases under the noise of given shapes.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn whitened(&self, shapes: [CorrelationShape; 2]) -> Result<[WhitenedFrames; 2]> {
        let covariances = self.family.of_both(shapes)?;
        Ok([0, 1].map(|c: usize| self.restricted[c].whitened(&covariances[c])))
    }

    /// The likeliest nugget of given shapes.
    ///
    /// # Errors
    /// Those of [`Shapes::table`].
    pub fn with_nugget(
        &self,
        shapes: [CorrelationShape; 2],
        metric: &Metric,
    ) -> Result<[CorrelationShape; 2]> {
        self.of_each(shapes, |start, of| {
            let nuggets = self.family.nuggets().iter();
            let shapes: Vec<CorrelationShape> = nuggets
                .map(|&nugget| CorrelationShape { nugget, ..start })
                .collect();
            Ok(self.highest(&shapes, metric, of)?.0.0)
        })
    }

    /// The same shapes with the likelier of two kernels, each at its own best: patterns of one look like longer and weaker ones of the
    /// other. One kernel alone made false patches in 2.3 % of nulls in place of 1.7 % (prototype study).
    ///
    /// # Errors
    /// Those of [`Shapes::table`].
    pub fn with_kernel(
        &self,
        shapes: [CorrelationShape; 2],
        metric: &Metric,
    ) -> Result<[CorrelationShape; 2]> {
        self.of_each(shapes, |start, of| {
            if start.ratio == 0.0 {
                return Ok(start);
            }
            let from = CorrelationShape {
                kernel: SmoothKernel::SquaredExponential,
                ..start
            };
            let ratios = OTHER_RATIOS.into_iter();
            let about = ratios.flat_map(|ratio| OTHER_LENGTHS.map(|l: f64| [l.ln(), ratio]));
            let others: Vec<CorrelationShape> = about
                .map(|[length, ratio]| self.moved(from, [length, ratio.ln()]))
                .collect();
            let ((other, _), _) = self.highest(&others, metric, of)?;
            let other = self.about(other, metric, (&LATTICES[..], of))?;
            Ok(self.highest(&[start, other], metric, of)?.0.0)
        })
    }

    /// Shapes between the tabulated ones: the best of two lattices about each and of the tops of the quadratics through them.
    ///
    /// # Errors
    /// Those of [`Shapes::table`].
    pub fn refined(
        &self,
        shapes: [CorrelationShape; 2],
        metric: &Metric,
        lattices: &[[f64; 2]],
    ) -> Result<[CorrelationShape; 2]> {
        self.of_each(shapes, |start, of| {
            self.about(start, metric, (lattices, of))
        })
    }

    /// The best of lattices about a shape, one after the other, for the components `of` together.
    fn about(
        &self,
        start: CorrelationShape,
        metric: &Metric,
        (lattices, of): (&[[f64; 2]], &[usize]),
    ) -> Result<CorrelationShape> {
        let mut best = start;
        let lattices = if start.ratio > 0.0 { lattices } else { &[] };
        for step in lattices {
            let about = best;
            let moved = |by: [f64; 2]| self.moved(about, [by[0] * step[0], by[1] * step[1]]);
            let lattice = (0..9).map(|k| moved([(k / 3) as f64 - 1.0, (k % 3) as f64 - 1.0]));
            let lattice: Vec<CorrelationShape> = lattice.collect();
            let (highest, values) = self.highest(&lattice, metric, of)?;
            let mut nine = [0.0; 9];
            nine.copy_from_slice(&values);
            let (to, _) = Quadratic::new(&nine).newton();
            let top = moved(to.map(|x| x.clamp(-1.5, 1.5)));
            let (top, _) = self.highest(&[top], metric, of)?;
            best = if top.1 > highest.1 { top.0 } else { highest.0 };
        }
        Ok(best)
    }

    /// Something found for both components together, or for each where their shapes differ.
    fn of_each(
        &self,
        shapes: [CorrelationShape; 2],
        find: impl Fn(CorrelationShape, &[usize]) -> Result<CorrelationShape>,
    ) -> Result<[CorrelationShape; 2]> {
        if shapes[0] == shapes[1] {
            return Ok([find(shapes[0], &[0, 1])?; 2]);
        }
        Ok([find(shapes[0], &[0])?, find(shapes[1], &[1])?])
    }

    /// The likeliest of some shapes for the components `of` together, the first of equals, and the likelihood of all.
    fn highest(
        &self,
        shapes: &[CorrelationShape],
        metric: &Metric,
        of: &[usize],
    ) -> Result<((CorrelationShape, f64), Vec<f64>)> {
        let scored = self.scored(shapes, std::slice::from_ref(metric), &|| {})?;
        let total = |s: &Scored| of.iter().map(|&c| s.values[0][c]).sum();
        let values: Vec<f64> = scored.iter().map(total).collect();
        let higher = |a: usize, b: usize| if values[b] > values[a] { b } else { a };
        let best = (1..values.len()).fold(0, higher);
        Ok(((shapes[best], values[best]), values))
    }

    /// A shape some logarithms of length and ratio away, inside their range.
    fn moved(&self, from: CorrelationShape, by: [f64; 2]) -> CorrelationShape {
        let [shortest, longest] = self.family.range_mm;
        CorrelationShape {
            length_mm: (from.length_mm * by[0].exp()).clamp(shortest, longest),
            ratio: (from.ratio * by[1].exp()).clamp(LARGEST.recip(), LARGEST),
            ..from
        }
    }
}

/// The shapes of both components from a table: one for both, or one each.
pub(super) fn choose(table: &[Scored], metric: usize) -> [CorrelationShape; 2] {
    let (both, of_both) = likeliest(table, |s| s.values[metric].iter().sum());
    let (first, of_first) = likeliest(table, |s| s.values[metric][0]);
    let (second, of_second) = likeliest(table, |s| s.values[metric][1]);
    if of_first + of_second > of_both + SEPARATE {
        [first, second]
    } else {
        [both; 2]
    }
}

/// The likeliest shape of a table whose first has no smooth patterns, which it is unless another is clearly better.
fn likeliest(table: &[Scored], value: impl Fn(&Scored) -> f64) -> (CorrelationShape, f64) {
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
