//! Miscounted fringe orders of an observation, corrected where a model declares them.

use super::jumps;
use crate::experiment::Experiment;
use crate::infer::{Model, Observation};
use crate::reduce::ReducedModel;

/// Name of the effect of miscounted orders.
pub const JUMP: &str = "fringe_order_jump";

/// Correct the miscounted orders of an observation, if the model declares them; the regions are kept with it.
///
/// `nominal` is the point of the reduced model's parameters whose prediction is subtracted.
pub fn correct_jumps(
    model: &Model,
    observation: &mut Observation,
    reduced: &ReducedModel,
    experiment: &dyn Experiment,
    nominal: &[f64],
) {
    let Some(order_mm) = order_mm(model) else {
        return;
    };
    if !model.effects.iter().any(|e| e.name() == JUMP) {
        return;
    }
    let columns = reduced.columns(experiment, &observation.sight);
    let predicted = reduced.field(&columns, nominal);
    let jumps = jumps::find(&observation.field, &predicted, order_mm);
    jumps.correct(&mut observation.field);
    let smeared = |i: usize| jumps.smeared.binary_search(&i).is_ok();
    observation.drop_outliers(|i| !smeared(i));
}

/// One fringe order, mm, where displacements are read from fringes.
pub fn order_mm(model: &Model) -> Option<f64> {
    let frequency = model.experiment().measurement.fringe_frequency_per_mm;
    frequency.map(|f| 1.0 / f)
}
