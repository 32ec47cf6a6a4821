//! What a change of one parameter does to a predicted field.

use super::{
    CameraField, FieldSolver, PointSet, Prediction, State, gauged, load_response, predict_near,
};
use crate::effect::{Effect, Kind, Scene, Seen, force_scale, one_unit};
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
            Direction::Load => state.shift(force_scale(), 0, by),
            Direction::Amplitude(effect, k) => state.shift(effect, k, by),
        }
        state
    }
}

/// A state with its prediction, gradient included, and what makes predictions near it cheap.
#[derive(Clone, Copy)]
pub struct Neighbourhood<'a> {
    pub at: &'a State,
    pub here: &'a Prediction,
    pub anchor: Option<&'a Anchor>,
}

/// Derivative of the predicted field (mm a border unit) at the sight's points about a state. Central differences reach `step` border units to either side; what is linear in the
/// parameter, or follows [`load_response`], needs none.
///
/// # Errors
/// Those of a prediction.
pub fn sensitivity(
    experiment: &dyn FieldSolver,
    about: &Neighbourhood<'_>,
    sight: &PointSet,
    direction: Direction,
    step: f64,
) -> Result<Vec<[f64; 2]>> {
    let Neighbourhood { at, here, anchor } = *about;
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
            experiment.added(effect, &one_unit(effect, k), sight)
        }
        Direction::Amplitude(effect, _) if effect.kind() == Kind::Optical => {
            Ok(optical(experiment, about, sight, direction, step))
        }
        _ => {
            let high = predict_near(experiment, anchor, &direction.moved(at, step), sight)?.field;
            let low = predict_near(experiment, anchor, &direction.moved(at, -step), sight)?.field;
            Ok(slope(&high, &low, step))
        }
    }
}

/// What an optical effect changes: the field's gradient moves the displacement with the true points, and the camera reports both anew.
fn optical(
    experiment: &dyn FieldSolver,
    about: &Neighbourhood<'_>,
    sight: &PointSet,
    direction: Direction,
    step: f64,
) -> Vec<[f64; 2]> {
    let scene = experiment.scene();
    let [high, low] = [step, -step].map(|by| {
        let state = direction.moved(about.at, by);
        pictured(experiment, about, sight, &state, scene)
    });
    gauged(experiment.gauge(), sight, &slope(&high, &low, step))
}

/// Central difference of two fields.
fn slope(high: &[[f64; 2]], low: &[[f64; 2]], step: f64) -> Vec<[f64; 2]> {
    let of = |(a, b): (&[f64; 2], &[f64; 2])| [0, 1].map(|i| (a[i] - b[i]) / (2.0 * step));
    high.iter().zip(low).map(of).collect()
}

/// What the camera of a scene reports, mm at all of a sight's points, of a state that differs by optical effects alone.
pub fn pictured(
    experiment: &dyn FieldSolver,
    about: &Neighbourhood<'_>,
    sight: &PointSet,
    state: &State,
    scene: &Scene,
) -> Vec<[f64; 2]> {
    let before = Seen::new(about.at.acting(), experiment.scene());
    let camera = Seen::new(state.acting(), scene).moved(experiment.motion());
    let CameraField {
        loaded, gradient, ..
    } = &about.here.look;
    let points = sight.all();
    let report = |k: usize| {
        let (p, u, g) = (points[k], loaded[k], gradient[k]);
        let (from, to) = (before.true_point(p), camera.true_point(p));
        let shift = [to[0] - from[0], to[1] - from[1]];
        let moved = [0, 1].map(|i| u[i] + g[i][0] * shift[0] + g[i][1] * shift[1]);
        camera.report_at_rest(p, moved)
    };
    (0..points.len()).map(report).collect()
}
