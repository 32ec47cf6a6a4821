//! The answer, which is linear in the amplitudes and follows the constants to second order, held against the full model at its draws
//! (importance sampling: a draw weighs as much as the full model's density over the answer's).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::complete::CompletedDraw;
use super::full::Full;
use super::pose::PosedAnswer;
use super::space::{Whose, linear, monomials, values};
use crate::diagnose::{Weighed, weigh};
use crate::error::Result;
use crate::files::Keyed;
use crate::numeric::relative_weights;
use crate::sample::LogDensity;
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
}

/// Effective share of the first draws below which more are asked.
const FEW: f64 = 0.5;

/// Fewest effective draws that say how all others weigh.
const ENOUGH: f64 = 40.0;

/// A shift of a mean that is corrected, posterior sds.
const WORTH: f64 = 0.05;

/// Stream that resamples, apart from those of ensembles and of completion.
const RESAMPLING: u64 = u64::MAX - 2;

impl PosedAnswer<'_> {
    /// Hold draws against the full model. Where it shifts a mean by more than a twentieth of an sd, an order of draws that has them as
    /// often as they weigh comes with it.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub(super) fn importance(
        &self,
        full: &Full<'_>,
        points: &[Vec<f64>],
        drawn: &[CompletedDraw],
        seed: u64,
    ) -> Result<(Importance, Option<Vec<usize>>)> {
        let [first, most] = full.draws().map(|n| n.min(points.len()));
        let mut count = first;
        loop {
            let chosen: Vec<usize> = (0..count)
                .map(|k| (2 * k + 1) * points.len() / (2 * count))
                .collect();
            let logs = self.log_weights(full, points, drawn, &chosen)?;
            let own: Vec<&[f64]> = chosen.iter().map(|&k| &*points[k]).collect();
            let weighed = weigh(&own, &logs);
            let shifts = in_sds(&weighed, points);
            let beyond = |by: f64| move |s: &[f64; 2]| s[0].abs() > WORTH.max(by * s[1]);
            let unsure = shifts.iter().any(beyond(1.0)) || weighed.effective < FEW;
            if unsure && count < most {
                count = most;
                continue;
            }
            let known = weighed.effective * count as f64 > ENOUGH;
            let wanted = known && shifts.iter().any(beyond(2.0));
            let fitted = wanted.then(|| {
                let logs = regressed(&self.features(points, drawn), &chosen, &logs);
                relative_weights(&logs)
            });
            let fitted = fitted.filter(|weights| is_sound(weights, points, &weighed, &shifts));
            let reweighted = fitted.is_some();
            let of = |which: usize| {
                let named = self.answer.names().iter().cloned().zip(&shifts);
                named.map(|(name, shift)| (name, shift[which])).collect()
            };
            let found = Importance {
                draws: count,
                impossible: weighed.impossible,
                effective: weighed.effective,
                shift_sd: of(0),
                shift_error_sd: of(1),
                reweighted,
            };
            let Some(fitted) = fitted else {
                return Ok((found, None));
            };
            let key = Key {
                seed,
                ensemble: RESAMPLING,
            };
            let order = resampled(&fitted, Stream::at(key, 0, 0).uniform());
            return Ok((found, Some(order)));
        }
    }

    /// Log density of the full model over the answer's at some draws; -inf where the full model cannot be.
    fn log_weights(
        &self,
        full: &Full<'_>,
        points: &[Vec<f64>],
        drawn: &[CompletedDraw],
        chosen: &[usize],
    ) -> Result<Vec<f64>> {
        let evidence = &self.traced.evidence;
        let base = self.left_at_linearisation();
        let residuals: Vec<Option<[[DVector<f64>; 2]; 2]>> = chosen
            .par_iter()
            .map(|&k| {
                let amplitudes = self.amplitudes(&drawn[k]);
                let change = full.change(&points[k], &amplitudes).ok()?;
                let linear = self.left(&points[k], &drawn[k]);
                let own = [0, 1].map(|c| &base[c] - &change[c] - self.rival(&drawn[k], c));
                Some([linear, own])
            })
            .collect();
        let mut logs = vec![f64::NEG_INFINITY; chosen.len()];
        for (noise, pair) in self.pairs.iter().enumerate() {
            let own: Vec<(usize, &[[DVector<f64>; 2]; 2])> = residuals
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
            let measured = &evidence.measured;
            let grams = self.weighing().noise.grams(
                &measured.blocks,
                [&columns[0], &columns[1]],
                &[*pair],
            )?;
            for (k, (i, _)) in own.iter().enumerate() {
                let square = |j: usize| grams[0][(2 * k + j, 2 * k + j)];
                logs[*i] = 0.5 * (square(0) - square(1));
            }
        }
        Ok(logs)
    }

    /// What the answer leaves of the data at a draw.
    fn left(&self, x: &[f64], drawn: &CompletedDraw) -> [DVector<f64>; 2] {
        let space = &self.answer.space;
        let gamma = space
            .seen
            .tr_mul(&drawn.amplitudes.component_div(&space.largest));
        self.residual(&self.answer.distances(x), &gamma)
    }

    /// The same where the test was linearised, with the amplitudes that it had there.
    fn left_at_linearisation(&self) -> [DVector<f64>; 2] {
        let space = &self.answer.space;
        let all = linear(&self.expanded.here);
        let at = self.kept.iter().zip(space.largest.iter());
        let at =
            at.map(|(&k, largest)| all.get(k).map_or(0.0, |c| (c.at - c.mean) / c.sd / largest));
        let at = DVector::from_iterator(self.kept.len(), at);
        self.residual(&vec![0.0; self.answer.constants()], &space.seen.tr_mul(&at))
    }

    fn residual(&self, distances: &[f64], gamma: &DVector<f64>) -> [DVector<f64>; 2] {
        let d: Vec<f64> = std::iter::once(1.0)
            .chain(distances.iter().copied())
            .collect();
        let left = values(&monomials(distances.len()), &d);
        let directions = d.iter().flat_map(|d| gamma.iter().map(move |g| -d * g));
        let coefficients: Vec<f64> = directions.chain(left).collect();
        let coefficients = DVector::from_vec(coefficients);
        [0, 1].map(|c| &self.columns[c] * &coefficients)
    }

    /// What the near-edge rival does at a draw, which enters linearly in the full model too.
    fn rival(&self, drawn: &CompletedDraw, c: usize) -> DVector<f64> {
        let here = &self.expanded.here;
        let before = linear(here).len();
        let mut sum = DVector::zeros(here.predicted[c].len());
        for (&k, a) in self.kept.iter().zip(drawn.amplitudes.iter()) {
            if let Some(fields) = k.checked_sub(before).and_then(|k| here.near_edge.get(k)) {
                sum.axpy(*a, &fields[c], 1.0);
            }
        }
        sum
    }

    /// What a draw's weight may depend on, each of unit variance: constants, and amplitudes that take part in every draw.
    fn features(&self, points: &[Vec<f64>], drawn: &[CompletedDraw]) -> Vec<Vec<f64>> {
        let always = |k: &usize| self.answer.space.whose[*k] == Whose::Always;
        let own: Vec<usize> = (0..self.kept.len()).filter(always).collect();
        let raw: Vec<Vec<f64>> = points
            .iter()
            .zip(drawn)
            .map(|(x, d)| {
                let amplitudes = own.iter().map(|&k| d.amplitudes[k]);
                x.iter().copied().chain(amplitudes).collect()
            })
            .collect();
        standardised(raw)
    }
}

/// Each of zero mean and unit variance; what does not vary stays 0.
fn standardised(mut raw: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
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
fn is_sound(weights: &[f64], points: &[Vec<f64>], known: &Weighed, shifts: &[[f64; 2]]) -> bool {
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
fn in_sds(weighed: &Weighed, points: &[Vec<f64>]) -> Vec<[f64; 2]> {
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
fn regressed(features: &[Vec<f64>], chosen: &[usize], logs: &[f64]) -> Vec<f64> {
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
fn resampled(weights: &[f64], start: f64) -> Vec<usize> {
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

#[cfg(test)]
#[path = "../../../tests/unit/importance.rs"]
mod tests;
