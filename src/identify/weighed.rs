//! The noise under which a test that was linearised is weighed, as a stage that is kept.

use std::sync::Arc;

use serde::Serialize;

use crate::error::Result;
use crate::files::KeptStages;
use crate::infer::Model;
use crate::linearise::{Forward, Measured, Sensitivities};
use crate::noise::series::{found_noise, settings_under};
use crate::posterior::{ComponentNoise, Weighing, with_data};
use crate::progress::Progress;

/// A point about which a test was linearised.
pub struct NumberedPoint<'a> {
    pub sensitivities: &'a Sensitivities,
    /// Its number among the stages of a run.
    pub number: &'a str,
    /// What was weighed about another one.
    pub before: Option<&'a Weighing>,
}

/// The choices of the noise for sensitivities that have a number among the stages of a run: those that were weighed about another point
/// `before`, where they hold here too.
///
/// # Errors
/// Too few blocks for the dictionary; a folder that cannot be written.
pub fn weighed(
    (forward, measured): (&Forward<'_>, &Measured),
    of: NumberedPoint<'_>,
    (kept, progress): (&KeptStages, &dyn Progress),
) -> Result<Weighing> {
    let NumberedPoint {
        sensitivities,
        number,
        before,
    } = of;
    let steps = Weighing::steps(measured);
    let step = || progress.step();
    let begin = || progress.begin("noise of the measurement", Some(steps as u64));
    if let Some(before) = before {
        begin();
        if let Some(noise) = before.noise.again(measured, sensitivities, &step)? {
            return Ok(Weighing::by(noise, sensitivities));
        }
    }
    let of = (made_of(forward.model, measured), sensitivities);
    let Some(frames) = measured.frames() else {
        let by_component = || {
            begin();
            ComponentNoise::new(measured, sensitivities, &step)
        };
        let name = format!("evidence-{number}");
        let noise = kept.stage(&name, &of, by_component, progress)?;
        return Ok(Weighing::by(Arc::new(noise), sensitivities));
    };
    let [first, second] = [0, 1].map(|c| with_data(measured, sensitivities, c));
    let columns = [&first, &second];
    // the search is nearly all of it, and its numbers are few
    let search = || {
        begin();
        found_noise(&frames, columns, &step)
    };
    let name = format!("noise-{number}");
    let noise = kept.stage(&name, &of, search, progress)?.over(&frames)?;
    let settings = settings_under(&frames, columns, noise, &step)?;
    Ok(Weighing::by(Arc::new(settings), sensitivities))
}

/// A model and what was measured of it.
pub fn made_of<'a>(model: &'a Model, measured: &'a Measured) -> impl Serialize + 'a {
    let file = model.file.to_json().unwrap_or_default();
    (
        file.to_string(),
        &model.known,
        &model.nominal,
        &measured.averages,
    )
}
