//! The density, which is linear in the amplitudes, held against the full model at its draws
//! (importance sampling: a draw weighs as much as the full model's density over its own).

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::complete::CompletedDraw;
use super::full::{DrawnState, Full};
use super::posed::Posed;
use super::space::{linear, stacked};
use crate::diagnose::weigh;
use crate::error::Result;
use crate::files::Keyed;
use crate::linearise::{Column, Sensitivities, StepStack};
use crate::quantity::NM_PER_MM;

/// How draws fare under the full nonlinear model with all effects.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Importance {
    /// Draws at which the full model was solved, and those that it cannot have.
    pub draws: usize,
    pub impossible: usize,
    /// Effective share of them.
    pub effective: f64,
    /// By how much the full model moves each constant, posterior sds: the mean over the draws of one Newton step.
    pub shift_sd: Keyed<f64>,
    /// Standard errors of that.
    pub shift_error_sd: Keyed<f64>,
    /// Whether the draws are moved by that.
    pub corrected: bool,
    /// Largest difference of the prediction at a block of points over all draws, nm.
    pub field_nm: f64,
    /// By how much the fine mesh changes the log weight of one draw, where what the full model adds to the answer is taken from a coarse mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_error: Option<f64>,
}

/// Errors of a shift beyond which the draws are moved by it, and posterior sds beyond which one Newton step no longer says how far.
const ERRORS: f64 = 2.0;
pub const FAR: f64 = 0.3;

/// Largest shift, posterior sds, that is not worth a word.
pub const TOLERANCE: f64 = 0.05;

impl Importance {
    /// The constant that moves farthest, with its shift and the error of that, posterior sds.
    pub fn largest(&self) -> Option<(&str, [f64; 2])> {
        let all = self.shift_sd.iter().zip(self.shift_error_sd.iter());
        let each = all.map(|((name, shift), (_, error))| (name.as_str(), [*shift, *error]));
        each.max_by(|a, b| a.1[0].abs().total_cmp(&b.1[0].abs()))
    }

    /// The constant that moves farthest, if that is beyond a limit.
    pub fn beyond(&self, limit: f64) -> Option<(&str, [f64; 2])> {
        self.largest().filter(|(_, [shift, _])| shift.abs() > limit)
    }
}

/// The density against the full model at some draws.
struct Compared {
    chosen: Vec<usize>,
    /// By how much the prediction of the full model differs, mm, at those that it can have.
    errors: Vec<StepStack>,
    /// By how much that moves the mode of the constants, posterior sds.
    shifts: Vec<DVector<f64>>,
    /// Log weights.
    logs: Vec<f64>,
    mesh_error: Option<f64>,
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

/// Draws at which the full model is solved.
pub const CHECKED_DRAWS: usize = 12;

/// Change of a log weight from the coarse mesh to the fine one with which draws are solved on the fine one.
const TOO_COARSE: f64 = 0.1;

impl PosedDraws<'_> {
    /// Hold the draws against the full model.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn importance(&self, models: FullModels<'_>) -> Result<Importance> {
        let compared = self.compared(models)?;
        let own = compared.chosen.iter().map(|&k| &*self.points[k]);
        let weighed = weigh(&own.collect::<Vec<_>>(), &compared.logs);
        let n = compared.shifts.len() as f64;
        let of = |k: usize| {
            let each = || compared.shifts.iter().map(|s| s[k]);
            let mean = each().sum::<f64>() / n;
            let squares: f64 = each().map(|s| (s - mean).powi(2)).sum();
            [mean, (squares / (n * (n - 1.0))).sqrt()]
        };
        let names = self.posed.density.constant_names();
        // one draw has no error
        let known = if n > 1.0 { names.len() } else { 0 };
        let shifts: Vec<[f64; 2]> = (0..known).map(of).collect();
        let keyed = |which: usize| {
            let pairs = names.iter().cloned().zip(&shifts);
            pairs.map(|(name, s)| (name, s[which])).collect()
        };
        let errors = compared.errors.iter().flatten();
        let field = errors.flat_map(|e| e.iter().map(|mm| mm.abs()));
        Ok(Importance {
            draws: compared.chosen.len(),
            impossible: weighed.impossible,
            effective: weighed.effective,
            shift_sd: keyed(0),
            shift_error_sd: keyed(1),
            corrected: false,
            field_nm: field.fold(0.0, f64::max) * NM_PER_MM,
            mesh_error: compared.mesh_error,
        })
    }

    /// By how much the full model moves each of the constants, border units: not where it is no more than its error, or farther than one
    /// Newton step can say.
    pub fn correction(&self, importance: &Importance) -> Vec<f64> {
        let is_near = importance.beyond(FAR).is_none();
        let sds = self.covariance().diagonal().map(f64::sqrt);
        let shifts = importance.shift_sd.values();
        let shifts = shifts.zip(importance.shift_error_sd.values());
        let correction = |((shift, error), sd): ((&f64, &f64), &f64)| {
            let moved = is_near && shift.abs() > ERRORS * error;
            if moved { shift * sd } else { 0.0 }
        };
        shifts.zip(sds.iter()).map(correction).collect()
    }

    /// The coarse mesh, if the fine one makes the same of the first draw, and how far the log weights of that are apart.
    fn on_a_mesh<'a>(&'a self, models: FullModels<'a>) -> Result<(AnswerOnMesh<'a>, Option<f64>)> {
        let posed = self.posed;
        let fine = AnswerOnMesh {
            full: models.fine,
            columns: Cow::Borrowed(&posed.columns),
            base: left_at_linearisation(posed, &posed.columns, models.fine.here),
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
            base: left_at_linearisation(posed, &columns, full.here),
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
                .filter(|(i, _)| drawn[chosen[*i]].choice.noise == noise)
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

    /// The density against the full model at some draws.
    fn compared(&self, models: FullModels<'_>) -> Result<Compared> {
        let (test, mesh_error) = self.on_a_mesh(models)?;
        let all = self.points.len();
        let count = CHECKED_DRAWS.min(all);
        let chosen: Vec<usize> = (0..count).map(|k| spread_out(k, all)).collect();
        let residuals = self.residuals(&test, &chosen)?;
        let logs = self.logs(&residuals, &chosen)?;
        let covariance = self.covariance();
        let error = |(k, r): (&usize, &Option<[StepStack; 2]>)| {
            let [density, full] = r.as_ref()?;
            Some((*k, [0, 1].map(|c| &density[c] - &full[c])))
        };
        let errors: Vec<(usize, StepStack)> =
            chosen.iter().zip(&residuals).filter_map(error).collect();
        let mut shifts = vec![DVector::zeros(0); errors.len()];
        for noise in 0..self.posed.pairs.len() {
            let of_noise = |&i: &usize| self.drawn[errors[i].0].choice.noise == noise;
            let own: Vec<usize> = (0..errors.len()).filter(of_noise).collect();
            if own.is_empty() {
                continue;
            }
            let fields: Vec<&StepStack> = own.iter().map(|&i| &errors[i].1).collect();
            let products = self.posed.products(&fields, noise)?;
            let shift = |(place, &i): (usize, &usize)| {
                let k = errors[i].0;
                let at = (&*self.points[k], &self.drawn[k].choice);
                let products = products.column(place).into_owned();
                (i, self.posed.shift_with(at, &products, &covariance))
            };
            let found: Vec<_> = own.par_iter().enumerate().map(shift).collect();
            for (i, shift) in found {
                shifts[i] = shift;
            }
        }
        Ok(Compared {
            chosen,
            errors: errors.into_iter().map(|(_, error)| error).collect(),
            shifts,
            logs,
            mesh_error,
        })
    }

    /// Covariance of the constants over all draws.
    fn covariance(&self) -> DMatrix<f64> {
        let d = self.posed.density.constants();
        let n = self.points.len() as f64;
        let of = |x: &Vec<f64>| DVector::from_column_slice(&x[..d]);
        let mean = self
            .points
            .iter()
            .fold(DVector::zeros(d), |m, x| m + of(x) / n);
        let outer = |x: &Vec<f64>| {
            let by = of(x) - &mean;
            &by * by.transpose() / n
        };
        let start = DMatrix::zeros(d, d);
        self.points.iter().fold(start, |sum, x| sum + outer(x))
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
}

/// What a density, by its columns on a mesh, leaves of the data where the test was linearised, with the amplitudes that it had there.
fn left_at_linearisation(
    posed: &Posed,
    columns: &[DMatrix<f64>; 2],
    here: &Sensitivities,
) -> StepStack {
    let at = |c: &Column| (c.at - c.mean) / c.sd;
    let all = linear(here);
    let own = posed.kept.iter();
    let own = own.map(|&k| all.get(k).map_or(0.0, |c| at(c)));
    let own = DVector::from_iterator(posed.kept.len(), own);
    posed.left_by(columns, &posed.density.start().0, &own)
}

/// The k-th of draws that lie evenly over all `count` of them, however many of them are taken (multiples of the golden ratio).
pub fn spread_out(k: usize, count: usize) -> usize {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let place = ((k as f64 + 0.5) * GOLDEN).fract() * count as f64;
    (place as usize).min(count - 1)
}
