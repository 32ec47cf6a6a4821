//! What a change of one parameter does to a predicted field.

use super::{Experiment, Prediction, Sight, State, gauged, load_response, predict_near};
use crate::effect::{Effect, Kind, LOAD_SCALE};
use crate::error::Result;
use crate::fem::Anchor;

#[derive(Clone, Copy)]
pub enum Direction {
    /// An elastic constant, by its index.
    Constant(usize),
    /// The thickness, mm.
    Thickness,
    /// The load, percent.
    Load,
    /// Parameter `1` of an effect.
    Amplitude(&'static dyn Effect, usize),
}

impl Direction {
    /// The state moved along the direction by some border units.
    fn moved(self, at: &State, by: f64) -> State {
        let mut state = at.clone();
        match self {
            Direction::Constant(k) => state.constants[k] += by,
            Direction::Thickness => state.thickness_mm += by,
            Direction::Load => state.shift(LOAD_SCALE, 0, by),
            Direction::Amplitude(effect, k) => state.shift(effect, k, by),
        }
        state
    }
}

/// Derivative of the predicted field (mm a border unit) at the sight's points about the state `at`, whose prediction,
/// with its gradient, is `here`, and whose anchor is `about`. Central differences reach `step` border units to either side; what is linear in the
/// parameter, or follows [`load_response`], needs none.
///
/// # Errors
/// Those of a prediction.
pub fn sensitivity(
    experiment: &dyn Experiment,
    (at, about): (&State, Option<&Anchor>),
    here: &Prediction,
    sight: &Sight,
    direction: Direction,
    step: f64,
) -> Result<Vec<[f64; 2]>> {
    let scales = at.acting().iter().all(|a| a.effect.scales());
    let times = |factor: f64| here.loaded.iter().map(|u| u.map(|u| factor * u)).collect();
    match direction {
        Direction::Thickness if scales => {
            // d ln(1 / (h E1)) / dh
            let (h, e1) = (at.thickness_mm, at.constants[0]);
            let up = load_response(e1, h + step) - load_response(e1, h - step);
            Ok(times(up / (2.0 * step * load_response(e1, h))))
        }
        Direction::Load if scales => Ok(times(0.01)),
        Direction::Amplitude(effect, k) if effect.kind() == Kind::Additive => {
            let mut unit = vec![0.0; effect.parameters().len()];
            unit[k] = 1.0;
            experiment.added(effect, &unit, sight)
        }
        Direction::Amplitude(effect, _) if effect.kind() == Kind::Optical => {
            let [high, low] = [step, -step].map(|by| direction.moved(at, by).amplitude(effect));
            Ok(optical(
                experiment,
                here,
                sight,
                effect,
                [&high, &low],
                step,
            ))
        }
        _ => {
            let high = predict_near(experiment, about, &direction.moved(at, step), sight)?.field;
            let low = predict_near(experiment, about, &direction.moved(at, -step), sight)?.field;
            let slope =
                |(a, b): (&[f64; 2], &[f64; 2])| [0, 1].map(|i| (a[i] - b[i]) / (2.0 * step));
            Ok(high.iter().zip(&low).map(slope).collect())
        }
    }
}

/// What an optical effect changes: the field's gradient times the shift of the true points, and the components.
fn optical(
    experiment: &dyn Experiment,
    here: &Prediction,
    sight: &Sight,
    effect: &dyn Effect,
    [high, low]: [&[f64]; 2],
    step: f64,
) -> Vec<[f64; 2]> {
    let scene = experiment.scene();
    let change = |p: [f64; 2], u: [f64; 2], g: [[f64; 2]; 2]| {
        let [a, b] = [high, low].map(|amplitude| effect.true_point(amplitude, scene, p));
        let [ua, ub] = [high, low].map(|amplitude| effect.components(amplitude, scene, p, u));
        let shift = [a[0] - b[0], a[1] - b[1]];
        [0, 1].map(|i| (g[i][0] * shift[0] + g[i][1] * shift[1] + ua[i] - ub[i]) / (2.0 * step))
    };
    let look = here.look.displacement.iter().zip(&here.look.gradient);
    let all: Vec<[f64; 2]> = sight
        .all()
        .iter()
        .zip(look)
        .map(|(&p, (&u, &g))| change(p, u, g))
        .collect();
    gauged(experiment.gauge(), sight, &all)
}
