//! What each effect would do to the constants where the model lacks it, and how much of it would show.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::subsets::SIZES;
use crate::effect::{Effect, amplitude_name};
use crate::error::{Error, Result};
use crate::experiment::series::{Law, with_law};
use crate::files::{Keyed, or_nan};
use crate::linearise::{Column, Sensitivities};
use crate::noise::NormalEquations;
use crate::parameter::Parameter;
use crate::posterior::Weighing;

/// What one effect would do to the constants if it acted with an amplitude of one prior sd and the model lacked it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BlindSpot {
    pub effect: String,
    /// How its amplitude goes over the steps of a series.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
    pub parameter: String,
    /// Prior sd, border units.
    pub plausible: f64,
    /// Unit of both sizes.
    pub unit: String,
    /// Shift of each constant, % of its value.
    pub shift_in_percent: Keyed<Option<f64>>,
    /// Constants whose shift is larger than sensitivities can say.
    #[serde(default)]
    pub beyond_linear: Vec<String>,
    /// Smallest amplitude that these data would show; `null` if none.
    #[serde(deserialize_with = "or_nan")]
    pub detectable: f64,
    /// Whether that is below the prior sd.
    pub would_be_seen: bool,
}

/// Shifts of more percent of a constant are beyond what sensitivities say.
pub const LINEAR_PERCENT: f64 = 20.0;

impl BlindSpot {
    /// Shift of a constant, % of its value, if it is finite.
    pub fn shift(&self, constant: &str) -> Option<f64> {
        self.shift_in_percent.get(constant).copied().flatten()
    }

    /// `effect.parameter`, with the law.
    pub fn name(&self) -> String {
        with_law(&format!("{}.{}", self.effect, self.parameter), self.law)
    }
}

/// Of what takes part in every test, and of each candidate's parameters. `pair` is the likeliest noise, `state` the constants.
///
/// # Errors
/// Of the program, for columns that are not finite.
pub fn blind_spots(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    pair: usize,
    state: &[f64],
) -> Result<Vec<BlindSpot>> {
    let gram = weighing.gram(&weighing.pairs[pair]);
    let odds = prior_odds(sensitivities.candidates.len());
    let p = sensitivities.base.len();
    let all: Vec<usize> = (0..p).collect();
    let spot = |own: &[usize],
                k: usize,
                (effect, law): (&dyn Effect, Option<Law>),
                column: &Column|
     -> Result<BlindSpot> {
        let (shift, information) = shift(&gram, own, k)?;
        let constants = sensitivities.base[..sensitivities.constants].iter();
        let percent =
            |((c, by), at): ((&Column, &f64), &f64)| (c.name.clone(), 100.0 * c.sd * by / at);
        // beyond the bound for which an effect is modelled it would be no finding of it
        let own = effect
            .parameters()
            .iter()
            .find(|p| amplitude_name(effect, p) == column.name);
        let mut detectable = column.sd * detectable(information, odds);
        if own.is_some_and(|p| detectable > p.bound) {
            detectable = f64::INFINITY;
        }
        let parameter = Parameter::read(&column.name).own;
        let shifts: Vec<(String, f64)> = constants.zip(&shift).zip(state).map(percent).collect();
        let shifts = shifts.iter();
        let beyond = shifts.clone().filter(|(_, s)| s.abs() > LINEAR_PERCENT);
        Ok(BlindSpot {
            effect: effect.name().into(),
            law,
            plausible: column.sd,
            unit: Parameter::read(&parameter).unit(),
            parameter,
            shift_in_percent: shifts
                .map(|(name, s)| (name.clone(), Some(*s).filter(|s| s.is_finite())))
                .collect(),
            beyond_linear: beyond.map(|(name, _)| name.clone()).collect(),
            detectable,
            would_be_seen: detectable < column.sd,
        })
    };
    let mut spots = Vec::new();
    for (k, column) in sensitivities.base.iter().enumerate() {
        if let Some(effect) = column.effect().filter(|e| e.is_of_every_test()) {
            let others: Vec<usize> = (0..p).filter(|j| *j != k).collect();
            spots.push(spot(&others, k, (effect, None), column)?);
        }
    }
    let candidates = sensitivities.candidates.iter();
    let columns = candidates.flat_map(|c| c.columns.iter().map(move |column| (c, column)));
    for (k, (c, column)) in columns.enumerate() {
        spots.push(spot(&all, p + k, (c.effect, c.law), column)?);
    }
    Ok(spots)
}

/// By how much the amplitudes of a model of the columns `own` are wrong where column `k` of its Gram matrix acts with its prior sd, prior
/// sds, and what the data say of `k` beside them: its precision over the prior's.
fn shift(gram: &DMatrix<f64>, own: &[usize], k: usize) -> Result<(DVector<f64>, f64)> {
    let unscaled: Vec<(usize, f64)> = own.iter().map(|k| (*k, 1.0)).collect();
    let fit =
        NormalEquations::of_columns(gram, |j| gram[(j, k)], &unscaled).ok_or_else(not_finite)?;
    let by = fit.mean();
    let left = gram[(k, k)]
        - own
            .iter()
            .zip(&by)
            .map(|(j, by)| by * gram[(*j, k)])
            .sum::<f64>();
    Ok((by, left))
}

pub fn not_finite() -> Error {
    Error::program("trace", "finite columns of model and effects")
}

/// Prior odds of one of so many candidates acting alone against none.
pub fn prior_odds(candidates: usize) -> f64 {
    SIZES[1] / candidates as f64 / SIZES[0]
}

/// Amplitude, in prior sds, whose expected evidence brings prior odds up to a probability of 0.95, for an amplitude known to 1/sqrt(g).
pub fn detectable(g: f64, prior_odds: f64) -> f64 {
    if g <= 0.0 {
        return f64::INFINITY;
    }
    let needed = (19.0 / prior_odds).ln() + 0.5 * (1.0 + g).ln();
    (2.0 * needed * (1.0 + g)).sqrt() / g
}
