//! The noise under which a test that was linearised is weighed, as a stage that is kept.

use std::sync::Arc;

use serde::Serialize;

use crate::error::Result;
use crate::files::KeptStages;
use crate::infer::Model;
use crate::linearise::{Forward, Measured, Sensitivities};
use crate::noise::series::{FrameNoise, Frames, found_noise, settings_under};
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

/// The choices of the noise for sensitivities that have a number among the stages of a run. What frame contrasts knew about another point
/// `before` holds here too: no model reaches them.
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
    let of = (made_of(forward.model, measured), sensitivities);
    let step = || progress.step();
    let begin = || progress.begin("noise of the measurement", Some(steps as u64));
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
    let noise = match before.and_then(|b| known(b, &frames)) {
        Some(known) => {
            begin();
            known
        }
        None => {
            // the search is nearly all of it, and its numbers are few
            let search = || {
                begin();
                found_noise(&frames, columns, &step)
            };
            let name = format!("noise-{number}");
            kept.stage(&name, &of, search, progress)?.over(&frames)?
        }
    };
    let settings = settings_under(&frames, columns, noise, &step)?;
    Ok(Weighing::by(Arc::new(settings), sensitivities))
}

/// The noise of the same frames that was found by contrasts.
fn known(before: &Weighing, frames: &Frames<'_>) -> Option<FrameNoise> {
    let noise = &before.noise.by_frames()?.noise;
    let blocks = noise.spatial[0].covariance.variances().len();
    let is_same = noise.scales.len() == frames.len() && blocks == frames.blocks.len();
    (noise.by_contrasts && is_same).then(|| noise.clone())
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
