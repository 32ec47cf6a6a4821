//! One step of a load series as a model file declares it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize};

use crate::error::{Error, Result};

/// An entry of `steps`, in the order in which they were taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StepKeys")]
pub struct StepSpec {
    /// The step's file, or its directory where the format has one.
    pub file: PathBuf,
    /// Force along direction 1, N; `None` (`null`) where it is not known.
    #[serde(rename = "force_N")]
    pub force_n: Option<f64>,
}

/// The keys as they are written. `null` and no key are told apart: an unknown force is declared, not forgotten.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StepKeys {
    file: PathBuf,
    #[serde(rename = "force_N", default, deserialize_with = "written")]
    force_n: Option<Option<f64>>,
}

fn written<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<Option<Option<f64>>, D::Error> {
    Option::deserialize(deserializer).map(Some)
}

impl TryFrom<StepKeys> for StepSpec {
    type Error = Error;

    fn try_from(StepKeys { file, force_n }: StepKeys) -> Result<Self> {
        let force_n = force_n.ok_or_else(|| {
            Error::input(
                "force_N",
                "the force in N, 0 without load, or null where it is not known",
            )
            .found("no such key")
        })?;
        Ok(Self { file, force_n })
    }
}

/// Sd of the error of a force that a testing machine of class 1 (ISO 7500-1) reads, percent of it: the class allows 1 % either way.
pub const CLASS_1_SD_PERCENT: f64 = 0.5;

/// Refuse an sd of declared forces, percent, that none can have. 0 takes the forces to be exact.
///
/// # Errors
/// Of the input, at `force_sd_percent`.
pub fn check_sd(percent: f64) -> Result<()> {
    /// A force of which half is not known is not known: it is `null`.
    const LARGEST: f64 = 50.0;
    if (0.0..=LARGEST).contains(&percent) {
        return Ok(());
    }
    let expected = format!("a number from 0 to {LARGEST}, in percent of each force");
    Err(Error::input("force_sd_percent", expected)
        .found(percent)
        .hint("the force of a step that is not known is null"))
}

/// Force of a model of which no force is known, N: fields then give ratios of constants.
const NOMINAL_N: f64 = 1000.0;

/// Refuse a list that can be no series.
///
/// # Errors
/// Of the input: no step, a force that is none, a file that stands twice.
pub fn check(steps: &[StepSpec]) -> Result<()> {
    if steps.is_empty() {
        return Err(Error::input("steps", "at least one step").found("[]"));
    }
    if steps.iter().all(|s| s.force_n == Some(0.0)) {
        return Err(Error::input(
            "steps[].force_N",
            "a force above 0 in some step, or null where it is not known",
        )
        .found("0 in all of them")
        .hint(
            "a step without load says what is not mechanics; the constants need one with a load",
        ));
    }
    for (k, step) in steps.iter().enumerate() {
        if let Some(force) = step.force_n.filter(|f| !f.is_finite()) {
            let place = format!("steps[{k}].force_N");
            return Err(Error::input(place, "a finite force in N, or null").found(force));
        }
        if let Some(other) = steps[..k].iter().position(|s| s.file == step.file) {
            return Err(twice([other, k], [&step.file, &step.file]));
        }
    }
    Ok(())
}

/// Two steps are the same file.
pub(super) fn twice([first, second]: [usize; 2], files: [&Path; 2]) -> Error {
    Error::input(format!("steps[{second}].file"), "every file once").found(format!(
        "{}, which is steps[{first}].file, {}, again",
        files[1].display(),
        files[0].display()
    ))
}

/// The force of which a model's prediction is in proportion, N: the largest that is known, without its sign.
pub fn nominal_n(steps: &[StepSpec]) -> f64 {
    let known = steps.iter().filter_map(|s| s.force_n).map(f64::abs);
    let largest = known.fold(0.0, f64::max);
    if largest > 0.0 { largest } else { NOMINAL_N }
}

/// The step to which the others are compared: that of the largest known force, or else the last that is not declared to be
/// without load.
pub fn reference(steps: &[StepSpec]) -> usize {
    let size = |k: &usize| steps[*k].force_n.map_or(0.0, f64::abs);
    let largest = (0..steps.len())
        .rev()
        .max_by(|a, b| size(a).total_cmp(&size(b)));
    let known = largest.filter(|k| size(k) > 0.0);
    known
        .or_else(|| (0..steps.len()).rfind(|&k| steps[k].force_n.is_none()))
        .unwrap_or(steps.len().saturating_sub(1))
}
