//! A series of which no force is known.

use crate::error::Result;
use crate::experiment::{Gauge, PointSet, gauged, predict};
use crate::infer::{Model, experiment_over};

/// Where no force of a series is known, take that of its reference step for the one at which displacements have the size that the priors'
/// means predict: constants then are where their priors are, times the common factor that only a force would tell. (To sample that factor
/// as well, with a load of 30 %, left the reduced model of a real series 6 posterior sds off: no box about so long a ridge is small.)
///
/// # Errors
/// Those of reading the series and of a finite-element solution.
pub fn settle_force(model: &mut Model) -> Result<()> {
    if !model.experiment().lacks_force() {
        return Ok(());
    }
    let Some(series) = model.read_series()? else {
        return Ok(());
    };
    let points = &series.field.points;
    let sight = PointSet::anywhere(points, &[]);
    let experiment = experiment_over(model, series.field.measured_bounds(), 1.0)?;
    let state = model.state(&|_| None);
    let predicted = predict(&*experiment, &state, &experiment.sight(points))?.field;
    let measured = &series.steps[series.reference].displacement;
    let [predicted, measured] = [&predicted, measured].map(|u| gauged(Gauge::Window, &sight, u));
    let dot = |a: &[[f64; 2]]| -> f64 {
        let pairs = a.iter().zip(&predicted);
        pairs.map(|(a, b)| a[0] * b[0] + a[1] * b[1]).sum()
    };
    let ratio = dot(&measured) / dot(&predicted);
    // a field of the wrong sign, or none, is refused where it is compared with its model
    if ratio.is_finite() && ratio > 0.0 {
        let nominal = model.experiment().nominal_load().force_n;
        model.experiment_mut().fitted_n = Some(nominal * ratio);
    }
    Ok(())
}
