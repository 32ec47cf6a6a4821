//! The density, which is linear in the amplitudes, held against the full model at its draws
//! (importance sampling: a draw weighs as much as the full model's density over its own).

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::complete::CompletedDraw;
use super::full::{DrawnState, Full};
use super::posed::Posed;
use super::space::{Whose, linear, stacked};
use crate::diagnose::{Weighed, weigh};
use crate::error::Result;
use crate::files::{Keyed, stored};
use crate::linearise::{Sensitivities, StepStack};
use crate::numeric::relative_weights;
use crate::sample::{Key, Stream};

/// How an answer's draws fare under the full nonlinear model with all effects, by which they are reweighted where it moves a mean by more
/// than a twentieth of an sd.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Importance {
    /// Draws at which the full model was solved, and those that it cannot have.
    pub draws: usize,
    pub impossible: usize,
    /// Effective share of them.
    pub effective: f64,
    /// By how much the mean of each constant moves, posterior sds.
    pub shift_sd: Keyed<f64>,
    /// Standard errors of that.
    pub shift_error_sd: Keyed<f64>,
    /// Whether the draws were reweighted for it.
    pub reweighted: bool,
    /// By how much the fine mesh changes the log weight of one draw, where what the full model adds to the answer is taken from a coarse mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh_error: Option<f64>,
}

stored!(Importance {
    draws,
    impossible,
    effective,
    shift_sd,
    shift_error_sd,
    reweighted,
    mesh_error
});

/// The density against the full model at some draws.
pub struct Compared {
    pub chosen: Vec<usize>,
    /// By how much the prediction of the full model differs, with the number of the draw, mm; of those that it can have.
    pub errors: Vec<(usize, StepStack)>,
    /// Log weights.
    pub logs: Vec<f64>,
}

/// The full model on the fine mesh, and on a coarse one where there is one.
#[derive(Clone, Copy)]
pub struct FullModels<'a> {
    pub fine: &'a Full<'a>,
    pub coarse: Option<&'a Full<'a>>,
}

/// The full model on a mesh with the answer's own columns there, and with what these leave where the test was linearised.
struct AnswerOnMesh<'a> {
    full: &'a Full<'a>,
    columns: Cow<'a, [DMatrix<f64>; 2]>,
    base: StepStack,
}

/// Completed draws of a posed answer.
#[derive(Clone, Copy)]
pub struct PosedDraws<'a> {
    pub posed: &'a Posed,
    pub points: &'a [Vec<f64>],
    pub drawn: &'a [CompletedDraw],
}

/// Effective shares of some draws: above the first, a dozen say that the full model moves nothing; below the second, six say that no number
/// of them will do.
const CALM: f64 = 0.9;
const HOPELESS: f64 = 0.3;
const DOZEN: usize = 12;

/// Change of a log weight from the coarse mesh to the fine one with which draws are solved on the fine one.
const TOO_COARSE: f64 = 0.1;

/// Fewest effective draws that say how all others weigh.
const ENOUGH: f64 = 40.0;

/// A shift of a mean that is corrected, posterior sds.
const WORTH: f64 = 0.05;

/// Stream that resamples, apart from those of ensembles and of completion.
const RESAMPLING: u64 = u64::MAX - 2;

impl PosedDraws<'_> {
    /// Hold the draws against the full model. Where it shifts a mean by more than a twentieth of an sd, an order of draws that has them as
    /// often as they weigh comes with it.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn importance(
        &self,
        models: FullModels<'_>,
        seed: u64,
    ) -> Result<(Importance, Option<Vec<usize>>)> {
        let points = self.points;
        let (test, mesh_error) = self.on_a_mesh(models)?;
        let (mut chosen, mut logs) = (Vec::new(), Vec::new());
        let mut weighed = weigh(&[], &[]);
        let mut shifts = Vec::new();
        for &count in test.full.draws() {
            let more: Vec<usize> = (chosen.len()..count.min(points.len()))
                .map(|k| spread_out(k, points.len()))
                .collect();
            logs.extend(self.log_weights(&test, &more)?);
            chosen.extend(more);
            let own: Vec<&[f64]> = chosen.iter().map(|&k| &*points[k]).collect();
            weighed = weigh(&own, &logs);
            shifts = in_sds(&weighed, points);
            if is_told(&weighed, &shifts, chosen.len()) {
                break;
            }
        }
        let known = weighed.effective * chosen.len() as f64 > ENOUGH;
        let wanted = known && shifts.iter().any(beyond(2.0));
        let fitted = wanted.then(|| {
            let logs = regressed(&self.features(), &chosen, &logs);
            relative_weights(&logs)
        });
        let fitted = fitted.filter(|weights| is_sound(weights, points, &weighed, &shifts));
        let of = |which: usize| {
            let named = self
                .posed
                .density
                .constant_names()
                .iter()
                .cloned()
                .zip(&shifts);
            named.map(|(name, shift)| (name, shift[which])).collect()
        };
        let found = Importance {
            draws: chosen.len(),
            impossible: weighed.impossible,
            effective: weighed.effective,
            shift_sd: of(0),
            shift_error_sd: of(1),
            reweighted: fitted.is_some(),
            mesh_error,
        };
        let key = Key {
            seed,
            ensemble: RESAMPLING,
        };
        let start = || Stream::at(key, 0, 0).uniform();
        let order = fitted.map(|weights| resampled(&weights, start()));
        Ok((found, order))
    }

    /// The coarse mesh, if the fine one makes the same of the first draw, and how far the log weights of that are apart.
    fn on_a_mesh<'a>(&'a self, models: FullModels<'a>) -> Result<(AnswerOnMesh<'a>, Option<f64>)> {
        let posed = self.posed;
        let fine = AnswerOnMesh {
            full: models.fine,
            columns: Cow::Borrowed(&posed.columns),
            base: left_at_linearisation(posed, &posed.columns),
        };
        let Some(full) = models.coarse.filter(|_| !self.points.is_empty()) else {
            return Ok((fine, None));
        };
        let columns = [0, 1].map(|c| {
            let measured = &posed.measured;
            let space = &posed.density.space;
            stacked(full.here, &posed.expanded, measured, space, &posed.kept, c)
        });
        let coarse = AnswerOnMesh {
            full,
            base: left_at_linearisation(posed, &columns),
            columns: Cow::Owned(columns),
        };
        let first = [spread_out(0, self.points.len())];
        let (a, b) = rayon::join(
            || self.log_weights(&coarse, &first),
            || self.log_weights(&fine, &first),
        );
        let error = (a?[0] - b?[0]).abs();
        // a draw that neither can have has no difference
        Ok(match error < TOO_COARSE {
            true => (coarse, Some(error)),
            false => (fine, None),
        })
    }

    /// Log density of the full model over the density's at some draws; -inf where the full model cannot be.
    fn log_weights(&self, test: &AnswerOnMesh<'_>, chosen: &[usize]) -> Result<Vec<f64>> {
        let residuals = self.residuals(test, chosen)?;
        self.logs(&residuals, chosen)
    }

    /// What the density, and what the full model, leaves at some draws; none where the full model cannot be. What the full model differs by
    /// from the density's columns is a difference on one mesh, whichever that is.
    fn residuals(
        &self,
        test: &AnswerOnMesh<'_>,
        chosen: &[usize],
    ) -> Result<Vec<Option<[StepStack; 2]>>> {
        let Self {
            posed,
            points,
            drawn,
        } = *self;
        let constants = posed.density.constants();
        let state = |k: usize| {
            let amplitudes = posed.amplitudes(&drawn[k].amplitudes);
            test.full.drawn(&points[k][..constants], &amplitudes)
        };
        let states: Vec<DrawnState<'_>> = chosen.iter().map(|&k| state(k)).collect();
        let origin = test.full.origin()?;
        let residual = |(&k, state): (&usize, &DrawnState<'_>)| {
            let change = test.full.change(state, &origin).ok()?;
            let linear = self.left(&posed.columns, k);
            let there = self.left(&test.columns, k);
            let own = [0, 1].map(|c| {
                let beyond =
                    &change[c] + self.rival(test.full.here, k, c) - &test.base[c] + &there[c];
                &linear[c] - beyond
            });
            Some([linear, own])
        };
        Ok(chosen.par_iter().zip(&states).map(residual).collect())
    }

    /// Log weights by what is left.
    fn logs(&self, residuals: &[Option<[StepStack; 2]>], chosen: &[usize]) -> Result<Vec<f64>> {
        let Self {
            posed,
            points,
            drawn,
        } = *self;
        let mut logs = vec![f64::NEG_INFINITY; chosen.len()];
        for (noise, pair) in posed.pairs.iter().enumerate() {
            let own: Vec<(usize, &[StepStack; 2])> = residuals
                .iter()
                .enumerate()
                .filter(|(i, _)| drawn[chosen[*i]].noise == noise)
                .filter_map(|(i, r)| Some((i, r.as_ref()?)))
                .collect();
            if own.is_empty() {
                continue;
            }
            let columns = [0, 1].map(|c| {
                let both = own
                    .iter()
                    .flat_map(|(_, r)| [r[0][c].clone(), r[1][c].clone()]);
                DMatrix::from_columns(&both.collect::<Vec<_>>())
            });
            let blocks = &posed.measured.blocks;
            let both = [&columns[0], &columns[1]];
            let grams = posed.noise.grams(blocks, both, &[*pair])?;
            for (k, (i, _)) in own.iter().enumerate() {
                let square = |j: usize| grams[0][(2 * k + j, 2 * k + j)];
                let precision = posed.density.noise_scale(&points[chosen[*i]]).powi(-2);
                logs[*i] = 0.5 * precision * (square(0) - square(1));
            }
        }
        Ok(logs)
    }

    /// The density against the full model at so many draws.
    ///
    /// # Errors
    /// Those of a finite-element solution where the test was linearised.
    pub fn compared(&self, models: FullModels<'_>, count: usize) -> Result<Compared> {
        let (test, _) = self.on_a_mesh(models)?;
        let all = self.points.len();
        let chosen: Vec<usize> = (0..count.min(all)).map(|k| spread_out(k, all)).collect();
        let residuals = self.residuals(&test, &chosen)?;
        let logs = self.logs(&residuals, &chosen)?;
        let error = |[density, full]: &[StepStack; 2]| [0, 1].map(|c| &density[c] - &full[c]);
        let known = chosen.iter().zip(&residuals);
        let errors = known.filter_map(|(k, r)| Some((*k, error(r.as_ref()?))));
        Ok(Compared {
            errors: errors.collect(),
            chosen,
            logs,
        })
    }

    /// What the answer, by its columns on a mesh, leaves of the data at a draw.
    fn left(&self, columns: &[DMatrix<f64>; 2], k: usize) -> StepStack {
        let amplitudes = &self.drawn[k].amplitudes;
        self.posed.left_by(columns, &self.points[k], amplitudes)
    }

    /// What the near-edge rival does at a draw, which enters linearly in the full model too.
    fn rival(&self, here: &Sensitivities, draw: usize, c: usize) -> DVector<f64> {
        let before = linear(here).len();
        let mut sum = DVector::zeros(here.predicted[c].len());
        let amplitudes = &self.drawn[draw].amplitudes;
        for (&k, a) in self.posed.kept.iter().zip(amplitudes.iter()) {
            if let Some(fields) = k.checked_sub(before).and_then(|k| here.near_edge.get(k)) {
                sum.axpy(*a, &fields[c], 1.0);
            }
        }
        sum
    }

    /// What a draw's weight may depend on, each of unit variance: constants, and amplitudes that take part in every draw.
    fn features(&self) -> Vec<Vec<f64>> {
        let posed = self.posed;
        let always = |k: &usize| posed.density.space.whose[*k] == Whose::Always;
        let own: Vec<usize> = (0..posed.kept.len()).filter(always).collect();
        let raw: Vec<Vec<f64>> = self
            .points
            .iter()
            .zip(self.drawn)
            .map(|(x, d)| {
                let amplitudes = own.iter().map(|&k| d.amplitudes[k]);
                x.iter().copied().chain(amplitudes).collect()
            })
            .collect();
        standardised(raw)
    }
}

/// What a density, by its columns on a mesh, leaves of the data where the test was linearised, with the amplitudes that it had there.
fn left_at_linearisation(posed: &Posed, columns: &[DMatrix<f64>; 2]) -> StepStack {
    let all = linear(&posed.expanded.here);
    let at = posed.kept.iter();
    let at = at.map(|&k| all.get(k).map_or(0.0, |c| (c.at - c.mean) / c.sd));
    let at = DVector::from_iterator(posed.kept.len(), at);
    posed.left_by(columns, &posed.density.start().0, &at)
}

/// The k-th of draws that lie evenly over all `count` of them, however many of them are taken (multiples of the golden ratio).
pub fn spread_out(k: usize, count: usize) -> usize {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let place = ((k as f64 + 0.5) * GOLDEN).fract() * count as f64;
    (place as usize).min(count - 1)
}

/// Whether a shift and its error, sds, are worth a correction: beyond a twentieth of an sd, and beyond so many errors.
fn beyond(errors: f64) -> impl Fn(&[f64; 2]) -> bool {
    move |s| s[0].abs() > WORTH.max(errors * s[1])
}

/// Whether more draws than so many would say nothing else.
pub fn is_told(weighed: &Weighed, shifts: &[[f64; 2]], draws: usize) -> bool {
    match draws {
        0..DOZEN => weighed.effective < HOPELESS,
        DOZEN => weighed.effective > CALM && !shifts.iter().any(beyond(1.0)),
        _ => !shifts.iter().any(beyond(2.0)),
    }
}

/// Each of zero mean and unit variance; what does not vary stays 0.
pub fn standardised(mut raw: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = raw.len() as f64;
    for k in 0..raw.first().map_or(0, Vec::len) {
        let mean = raw.iter().map(|x| x[k]).sum::<f64>() / n;
        let sd = (raw.iter().map(|x| (x[k] - mean).powi(2)).sum::<f64>() / n).sqrt();
        for x in &mut raw {
            x[k] = if sd > 0.0 { (x[k] - mean) / sd } else { 0.0 };
        }
    }
    raw
}

/// Whether weights of all draws say what was found at the draws where they are known: as many are effective, and the means move as far.
/// (A regression that was quadratic in twelve features of 192 draws put all weight on a single draw in 5 of 200 calibrated loops.)
pub fn is_sound(
    weights: &[f64],
    points: &[Vec<f64>],
    known: &Weighed,
    shifts: &[[f64; 2]],
) -> bool {
    /// Share of the effective draws that must be left, and of a shift that may be missed.
    const LEFT: f64 = 0.5;
    let logs: Vec<f64> = weights.iter().map(|w| w.ln()).collect();
    let all: Vec<&[f64]> = points.iter().map(|x| &x[..]).collect();
    let fitted = weigh(&all, &logs);
    let moved = in_sds(&fitted, points);
    let agree = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).abs() < WORTH.max(2.0 * b[1]);
    fitted.effective > LEFT * known.effective && moved.iter().zip(shifts).all(agree)
}

/// Shifts of means and their errors in sds of some points.
pub fn in_sds(weighed: &Weighed, points: &[Vec<f64>]) -> Vec<[f64; 2]> {
    let n = points.len() as f64;
    let sd = |k: usize| {
        let mean = points.iter().map(|x| x[k]).sum::<f64>() / n;
        let variance = points.iter().map(|x| (x[k] - mean).powi(2)).sum::<f64>() / n;
        variance.sqrt().max(f64::MIN_POSITIVE)
    };
    let shifts = weighed.shifts.iter().enumerate();
    shifts.map(|(k, shift)| shift.map(|s| s / sd(k))).collect()
}

/// Log weights of all draws by a ridge regression on their features, within the range of those draws of which they are known: what moves
/// means is linear in them.
pub fn regressed(features: &[Vec<f64>], chosen: &[usize], logs: &[f64]) -> Vec<f64> {
    let row =
        |x: &Vec<f64>| -> Vec<f64> { std::iter::once(1.0).chain(x.iter().copied()).collect() };
    let known: Vec<(Vec<f64>, f64)> = chosen
        .iter()
        .zip(logs)
        .filter(|(_, l)| l.is_finite())
        .map(|(&k, l)| (row(&features[k]), *l))
        .collect();
    let width = row(&features[0]).len();
    let x = DMatrix::from_fn(known.len(), width, |i, j| known[i].0[j]);
    let y = DVector::from_iterator(known.len(), known.iter().map(|k| k.1));
    let mut normal = x.tr_mul(&x);
    for k in 1..width {
        normal[(k, k)] += 1.0;
    }
    let solved = normal.lu().solve(&x.tr_mul(&y));
    let Some(slope) = solved else {
        return vec![0.0; features.len()];
    };
    let [least, most] = [y.min(), y.max()];
    let of = |x: &Vec<f64>| {
        let fitted: f64 = row(x).iter().zip(slope.iter()).map(|(a, b)| a * b).sum();
        fitted.clamp(least, most)
    };
    features.iter().map(of).collect()
}

/// Systematic resampling: every draw as often as it weighs, in their order.
pub fn resampled(weights: &[f64], start: f64) -> Vec<usize> {
    let n = weights.len();
    let step = weights.iter().sum::<f64>() / n as f64;
    let (mut order, mut sum) = (Vec::with_capacity(n), 0.0);
    for (k, w) in weights.iter().enumerate() {
        sum += w;
        while order.len() < n && (order.len() as f64 + start) * step < sum {
            order.push(k);
        }
    }
    order.resize(n, n - 1);
    order
}
