//! Simulated measurements of a model.

use super::experiment::experiment_over;
use super::model::Model;
use crate::error::Result;
use crate::experiment::FieldSolver;
use crate::experiment::simulate::series::{SeriesTruth, SimulatedSeries, simulate_series};
use crate::experiment::simulate::{FINER, HALF_WINDOW, Truth, simulate};
use crate::field::Grid;
use std::sync::Arc;

/// Simulate a measurement of a model on a finer mesh, over a square about the hole that is nearly as wide as the plate.
///
/// # Errors
/// Those of [`simulate`]; a model of a load series.
pub fn simulated_field(model: &Model, truth: &Truth) -> Result<Grid> {
    model.refuse_series()?;
    let (experiment, half) = simulating(model, &truth.constants)?;
    simulate(&*experiment, truth, half)
}

/// The same of a load series, whose loads are over [`crate::experiment::ExperimentSpec::nominal_load`].
///
/// # Errors
/// Those of [`simulate_series`].
pub fn simulated_series(model: &Model, truth: &SeriesTruth) -> Result<SimulatedSeries> {
    let (experiment, half) = simulating(model, &truth.shared.constants)?;
    simulate_series(&*experiment, truth, half)
}

/// The experiment on a finer mesh, and half the side of the window.
fn simulating(model: &Model, constants: &[f64]) -> Result<(Arc<dyn FieldSolver>, f64)> {
    let spec = model.experiment();
    let [s, t] = spec.geometry().extents().map(|[low, high]| high - low);
    let narrow = if spec.mesh.is_some() { s.min(t) } else { t };
    let half = HALF_WINDOW * narrow;
    let model = &Model {
        nominal: Some(constants.to_vec()),
        ..model.clone()
    };
    let experiment = experiment_over(model, [[-half; 2], [half; 2]], FINER)?;
    Ok((experiment, half))
}
