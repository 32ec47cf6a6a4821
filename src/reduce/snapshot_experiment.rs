//! A field experiment whose mechanics another program solved: it answers from the surfaces through that program's snapshots.

use std::sync::Arc;

use super::design::{Dimension, THICKNESS};
use super::model::ReducedModel;
use super::modes::Modes;
use super::problem::{Problem, ReducedSpec};
use super::snapshots::Snapshots;
use super::supplied::{Supplied, Weights, weights};
use crate::effect::{Effect, Kind, Scene, Seen};
use crate::error::{Error, Result};
use crate::experiment::{
    CameraField, FieldSolver, Gauge, Given, Mechanics, Places, PointSet, Spanning, State,
};
use crate::field::rigid::RigidMotion;

/// The specimen, camera and gauge of the own experiment, and fields of another program.
pub struct SnapshotExperiment {
    own: Arc<dyn FieldSolver>,
    dimensions: Vec<Dimension>,
    rows: Vec<Vec<f64>>,
    /// The rows' fields at the own experiment's support, mm.
    fields: Vec<Vec<[f64; 2]>>,
    /// Of more modes than a posterior is sampled with.
    model: ReducedModel,
}

/// Modes of a component that a prediction is made of: beyond them there is the rounding of the files.
const MODES: usize = 12;

/// Step of the differences that give a field's gradient, mm.
const DIFFERENCE_MM: f64 = 5e-3;

impl SnapshotExperiment {
    /// The same specimen under the same camera; `origin_mm` is where the own origin lies in the fields' coordinates.
    ///
    /// # Errors
    /// Of the input: fields that do not cover the window, a gauge that snapshots do not know, too few rows for the surfaces.
    pub fn new(
        own: Arc<dyn FieldSolver>,
        supplied: &Supplied,
        origin_mm: [f64; 2],
        degree: usize,
    ) -> Result<Self> {
        if own.gauge() != Gauge::Window {
            let expected =
                "\"window\": where the fields of another program stand still is its own affair";
            return Err(Error::input("gauge", expected).found("a point that stands still"));
        }
        let fields = on_support(&*own, supplied, origin_mm)?;
        let modes = MODES.min(supplied.rows.len());
        let problem = Problem {
            experiment: Arc::clone(&own),
            dimensions: supplied.dimensions.clone(),
            spec: ReducedSpec::of(supplied.rows.len(), Modes::Count(modes), degree),
        };
        problem.validate()?;
        let snapshots = Snapshots::of(&problem, supplied.rows.clone(), &fields);
        let model = ReducedModel::build(&problem, &snapshots)?;
        Ok(Self {
            own,
            dimensions: supplied.dimensions.clone(),
            rows: supplied.rows.clone(),
            fields,
            model,
        })
    }

    /// The field of a state at the support, mm.
    fn at_support(&self, state: &State) -> Result<Vec<[f64; 2]>> {
        let mut load = 1.0;
        for a in state.acting() {
            if a.effect.is_force_scale() {
                load += 0.01 * a.amplitude[0];
            } else if matches!(a.effect.kind(), Kind::Mechanical | Kind::Averaged) {
                let expected = "effects that act on the fields of another program";
                return Err(Error::input("effects", expected).found(a.effect.name()));
            }
        }
        let mut point = state.constants.clone();
        if self.dimensions.iter().any(|d| d.name == THICKNESS) {
            point.push(state.thickness_mm);
        }
        let modes = self.model.modes.iter().flatten();
        let first = self.model.modes_per_component();
        let mut field = vec![[0.0; 2]; self.model.points()];
        for (k, (mode, a)) in modes.zip(self.model.surface.evaluate(&point)).enumerate() {
            let c = usize::from(k >= first);
            for (u, value) in field.iter_mut().zip(mode) {
                u[c] += load * a * value;
            }
        }
        Ok(field)
    }

    /// A field's gradient at some places.
    fn gradient(&self, at_support: &[[f64; 2]], places: &[[f64; 2]]) -> Vec<[[f64; 2]; 2]> {
        let mut gradient = vec![[[0.0; 2]; 2]; places.len()];
        for k in 0..2 {
            let at = |by: f64| {
                let moved: Vec<[f64; 2]> = places
                    .iter()
                    .map(|p| std::array::from_fn(|i| if i == k { p[i] + by } else { p[i] }))
                    .collect();
                self.own.spread(at_support, &self.own.sight(&moved))
            };
            let (high, low) = (at(DIFFERENCE_MM), at(-DIFFERENCE_MM));
            for (g, (a, b)) in gradient.iter_mut().zip(high.iter().zip(&low)) {
                for i in 0..2 {
                    g[i][k] = (a[i] - b[i]) / (2.0 * DIFFERENCE_MM);
                }
            }
        }
        gradient
    }
}

/// The supplied fields at the support of an experiment.
fn on_support(
    own: &dyn FieldSolver,
    supplied: &Supplied,
    origin_mm: [f64; 2],
) -> Result<Vec<Vec<[f64; 2]>>> {
    let frame = own.scene().frame;
    let model_point = |p: &[f64; 2]| frame.vector([p[0] - origin_mm[0], p[1] - origin_mm[1]]);
    let points: Vec<[f64; 2]> = supplied.points.iter().map(model_point).collect();
    let weights = weights(&points, own.support().points()).map_err(|(place, gap)| {
        let [x, y] = frame.vector(place);
        let expected = "points all over the measured window, and a mesh size beyond it";
        let found = format!("none nearer than {gap:.3} mm to ({x:.3}, {y:.3}) mm from the origin");
        Error::input("reduced_model.snapshots.fields", expected)
            .found(found)
            .hint("lengths are in mm, the axes are parallel to the data's, and origin_mm is where hole_center_in_data_mm lies")
    })?;
    let field = |values: &Vec<[f64; 2]>| -> Vec<[f64; 2]> {
        let sum = |weights: &Weights| {
            let mut u = [0.0; 2];
            for (node, w) in weights {
                let value = values[*node as usize];
                u = [u[0] + w * value[0], u[1] + w * value[1]];
            }
            frame.vector(u)
        };
        weights.iter().map(sum).collect()
    };
    Ok(supplied.fields.iter().map(field).collect())
}

impl Mechanics for SnapshotExperiment {
    fn scene(&self) -> &Scene {
        self.own.scene()
    }

    fn gauge(&self) -> Gauge {
        self.own.gauge()
    }

    fn motion(&self) -> RigidMotion {
        self.own.motion()
    }

    fn shows(&self, state: &State, points: &[[f64; 2]]) -> Result<Vec<bool>> {
        self.own.shows(state, points)
    }

    fn added(&self, of: &dyn Effect, amplitude: &[f64], sight: &PointSet) -> Result<Vec<[f64; 2]>> {
        self.own.added(of, amplitude, sight)
    }

    fn off_axis(
        &self,
        effect: &dyn Effect,
        amplitude: &[f64],
        sight: &PointSet,
    ) -> Result<Option<Vec<f64>>> {
        self.own.off_axis(effect, amplitude, sight)
    }

    fn look(&self, state: &State, sight: &PointSet, gradient: bool) -> Result<CameraField> {
        let at_support = self.at_support(state)?;
        let camera = Seen::new(state.acting(), self.scene()).moved(self.motion());
        let places: Vec<[f64; 2]> = sight.all().iter().map(|&p| camera.true_point(p)).collect();
        let loaded = match camera.is_plain() {
            true => self.own.spread(&at_support, sight),
            false => self.own.spread(&at_support, &self.own.sight(&places)),
        };
        let displacement = match camera.is_plain() {
            true => loaded.clone(),
            false => {
                let all = loaded.iter().zip(sight.all());
                all.map(|(u, &p)| camera.report_at_rest(p, *u)).collect()
            }
        };
        let gradient = match gradient {
            true => self.gradient(&at_support, &places),
            false => Vec::new(),
        };
        Ok(CameraField {
            displacement,
            loaded,
            gradient,
        })
    }
}

impl Places for SnapshotExperiment {
    fn window(&self) -> [[f64; 2]; 2] {
        self.own.window()
    }

    fn support(&self) -> &PointSet {
        self.own.support()
    }

    fn spread(&self, at_support: &[[f64; 2]], sight: &PointSet) -> Vec<[f64; 2]> {
        self.own.spread(at_support, sight)
    }

    fn locate(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> (PointSet, Vec<bool>) {
        self.own.locate(points, further)
    }

    fn sight(&self, points: &[[f64; 2]]) -> PointSet {
        self.own.sight(points)
    }
}

impl Spanning for SnapshotExperiment {
    fn mesh_size(&self) -> [usize; 2] {
        [0, 0]
    }

    fn given(&self) -> Option<Given<'_>> {
        Some(Given {
            rows: &self.rows,
            fields: &self.fields,
        })
    }
}
