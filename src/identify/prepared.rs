//! The measurement on the plate that is to be solved.

use std::sync::Arc;

use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::experiment::{FieldSolver, Prediction, State, predict};
use crate::field::rigid::RigidMotion;
use crate::field::spec::OutlierRule;
use crate::field::{Field, Series};
use crate::geometry::Geometry;
use crate::infer::{Model, Observation, drawn_in, problem_of, problem_within};
use crate::posterior::Weighing;
use crate::progress::Progress;
use crate::reduce::{Problem, design};

use super::fields::modes;
use super::fringes::{without_jumps, without_phase_error};
use super::own_rotation::own_rotation;
use super::reduction::{Reduction, ReductionInput};

/// The specimen that is to be solved and the measurement it is held against.
#[derive(Clone)]
pub struct Prepared {
    pub problem: Problem,
    /// States spread over the box of the constants.
    pub states: Vec<State>,
    /// The measurement on the plate.
    pub observation: Observation,
    /// What later rounds need not make again.
    pub workbench: Workbench,
    /// Where an earlier round left the test.
    pub begun: Option<Begun>,
}

/// What the rounds of a run share: the measurement as it was read, and the meshed specimen with all that was solved of it.
#[derive(Clone)]
pub struct Workbench {
    measurement: Arc<Measurement>,
    experiment: Arc<dyn FieldSolver>,
    /// How far the nominal load turns the specimen, rad.
    own_rotation: f64,
}

/// What the measurement's files hold.
enum Measurement {
    Field(Field),
    Series(Series),
}

impl Measurement {
    fn read(model: &Model, progress: &dyn Progress) -> Result<Self> {
        progress.begin("reading the measurement", None);
        let (measured, said) = match model.read_series()? {
            Some(series) if series.steps.len() > 1 => {
                let [steps, points] = [series.steps.len(), series.field.len()];
                progress.measured(points, steps);
                (
                    Self::Series(series),
                    format!("{steps} steps of {points} points"),
                )
            }
            series => {
                // one step is a field like any other
                let field = match series {
                    Some(single) => single.field,
                    None => model.read_field()?,
                };
                progress.measured(field.len(), 1);
                let said = format!("{} points", field.len());
                (Self::Field(field), said)
            }
        };
        progress.say(&said);
        progress.end();
        Ok(measured)
    }

    /// Locate what was measured on the plate that is to be solved, with how far the load turns it; on that of a workbench that is `known`.
    fn observed(&self, model: &Model, known: Option<&Workbench>) -> Result<OnPlate> {
        match self {
            Self::Field(field) => field_observed(model, field, known),
            Self::Series(series) => series_observed(model, series, known),
        }
    }
}

/// What was measured, on the plate that is to be solved.
struct OnPlate {
    problem: Problem,
    observation: Observation,
    own_rotation: f64,
}

/// Where a round begins that another one came before.
#[derive(Clone)]
pub struct Begun {
    /// The search for where to linearise the test begins there.
    pub state: SeriesState,
    /// What that round knew of the noise.
    pub weighing: Weighing,
    pub workbench: Workbench,
}

impl Prepared {
    /// What the finite elements predict at the measured points.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn predict(&self, state: &State) -> Result<Prediction> {
        predict(&*self.problem.experiment, state, &self.observation.sight)
    }

    /// Columns at the measured points, as those of [`modes`].
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn modes(&self) -> Result<Vec<Vec<[f64; 2]>>> {
        let experiment = &*self.problem.experiment;
        modes(experiment, &self.states, &self.observation.sight)
    }
}

/// Read the measurement, and span what the specimen can show of it.
///
/// # Errors
/// Those of reading the measurement, of finite-element solutions and of `REDUCTIONS`.
pub fn prepare(model: &Model, progress: &dyn Progress) -> Result<Prepared> {
    prepare_from(model, None, progress)
}

/// The same from where an earlier round left the test.
///
/// # Errors
/// Those of [`prepare`].
pub fn prepare_from(
    model: &Model,
    begun: Option<Begun>,
    progress: &dyn Progress,
) -> Result<Prepared> {
    let shared = begun.as_ref().map(|b| &b.workbench);
    let measurement = match shared {
        Some(shared) => Arc::clone(&shared.measurement),
        None => Arc::new(Measurement::read(model, progress)?),
    };
    let OnPlate {
        problem,
        observation,
        own_rotation,
    } = measurement.observed(model, shared)?;
    let workbench = Workbench {
        measurement,
        experiment: Arc::clone(&problem.experiment),
        own_rotation,
    };
    if let Some(sides) = drawn_in(model) {
        progress.begin(
            "box of the constants drawn in, because no ply is beyond nu12^2 = E1/E2",
            None,
        );
        progress.say(&sides);
        progress.end();
    }
    let experiment = &*problem.experiment;
    let rows = match problem.given() {
        Some(given) => given.rows.to_vec(),
        None => design(&problem),
    };
    let states: Vec<State> = rows.iter().map(|row| problem.state(row)).collect();
    progress.begin("reduced basis of the finite elements", None);
    experiment.span(&states)?;
    progress.end();
    let with = ReductionInput {
        model,
        experiment,
        states: &states,
        nominal: problem.state(&nominal_point(&problem, model)),
    };
    let mut steps = REDUCTIONS.iter();
    let observation = steps.try_fold(observation, |observation, step| step(&with, observation))?;
    Ok(Prepared {
        problem,
        states,
        observation,
        workbench,
        begun,
    })
}

/// In this order: a region of miscounted orders would be taken for outliers, and outliers for a ripple.
const REDUCTIONS: [Reduction; 3] = [without_jumps, without_deviant_points, without_phase_error];

/// Drop points that lie far from what the specimen can show, where the measurement asks for it.
fn without_deviant_points(
    with: &ReductionInput<'_>,
    mut observation: Observation,
) -> Result<Observation> {
    if with.model.experiment().measurement.outliers == OutlierRule::Reject {
        let modes = with.modes(&observation)?;
        observation.drop_deviant_points(&modes);
    }
    Ok(observation)
}

/// The field in the specimen's own axes, where the specimen moved in the plane; where it stands stays in it, to first order.
fn turned_back(field: Field, motion: &RigidMotion) -> Field {
    if motion.angle == 0.0 {
        return field;
    }
    let points = field.points.iter().zip(&field.displacement);
    let displacement = points.map(|(&p, &u)| {
        let (strained, rigid) = (motion.released(p, u), motion.at(p));
        [0, 1].map(|k| strained[k] + rigid[k])
    });
    Field {
        displacement: displacement.collect(),
        ..field
    }
}

fn field_observed(model: &Model, field: &Field, known: Option<&Workbench>) -> Result<OnPlate> {
    let mesh = known.map(|k| &*k.experiment);
    let on_plate = |own_rotation: f64| {
        let problem = problem_of(model, field, own_rotation, mesh)?;
        let moved = turned_back(field.clone(), &problem.experiment.motion());
        Ok(OnPlate {
            observation: Observation::new(moved, &*problem.experiment)?,
            problem,
            own_rotation,
        })
    };
    if let Some(known) = known {
        return on_plate(known.own_rotation);
    }
    let first = on_plate(0.0)?;
    let (experiment, observation) = (&*first.problem.experiment, &first.observation);
    let own = own_rotation(model, experiment, observation, &observation.field)?;
    if own == 0.0 {
        return Ok(first);
    }
    on_plate(own)
}

fn series_observed(model: &Model, series: &Series, known: Option<&Workbench>) -> Result<OnPlate> {
    let mesh = known.map(|k| &*k.experiment);
    let problem = problem_within(model, series.field.measured_bounds(), mesh)?;
    let forces = model.experiment().forces();
    let mut observation = Observation::of_series(series, forces, &*problem.experiment)?;
    let growing = |observation: &Observation| {
        let steps = observation.steps.as_ref();
        steps.map(|steps| Field {
            displacement: steps.combined(&observation.field.points),
            ..observation.field.clone()
        })
    };
    let mut own = 0.0;
    if let Some(field) = growing(&observation) {
        own = match known {
            Some(known) => known.own_rotation,
            None => own_rotation(model, &*problem.experiment, &observation, &field)?,
        };
        if let Some(steps) = &mut observation.steps {
            steps.turn_by_the_load(own);
        }
        observation.field = growing(&observation).unwrap_or(field);
    }
    Ok(OnPlate {
        problem,
        observation,
        own_rotation: own,
    })
}

/// What lies closer to the hole's centre than this many radii is not looked at for structure: the hole's edge is where
/// optics and meshes are worst. The recipe of the prototype study, which masked blocks and not the points of the fit.
const CLEAR_RADII: f64 = 1.2;

/// Whether residuals are looked at where a point lies.
pub fn is_clear(geometry: &dyn Geometry, point: [f64; 2]) -> bool {
    geometry
        .hole_radii(point)
        .is_none_or(|radii| radii >= CLEAR_RADII)
}

/// Prior means, mean thickness, no effect; as near to them as the design comes.
pub fn nominal_point(problem: &Problem, model: &Model) -> Vec<f64> {
    let means: Vec<f64> = model.marginals().iter().map(|m| m.mean).collect();
    let mut point = problem.point(&means, problem.thickness_mm());
    for (value, side) in point.iter_mut().zip(&problem.dimensions) {
        *value = value.clamp(side.low, side.high);
    }
    point
}
