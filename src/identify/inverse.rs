//! The question before it is answered: reduced model, observation, noise, posterior.

use crate::effect::amplitude_name;
use crate::effect::limit::alter_checked;
use crate::error::Result;
use crate::experiment::{Prediction, State, predict};
use crate::field::rigid::RigidMotion;
use crate::field::spec::OutlierRule;
use crate::field::{Field, Series};
use crate::files::KeptStages;
use crate::geometry::{Geometry, Morph};
use crate::infer::{
    Likelihood, Marginal, Model, Observation, Posterior, Statistics, TracedSeries, UnitColumns,
    drawn_in, problem_of, problem_within,
};
use crate::noise::{Hyperparameters, Noise};
use crate::numeric::add_scaled;
use crate::progress::Progress;
use crate::reduce::{Problem, ReducedModel, cache};
use crate::sample::{Laplace, laplace};

use super::fringes::{without_jumps, without_phase_error};
use super::of_frames::measured_by_frames;
use super::own_rotation::own_rotation;
use super::reduction::{Reduction, With};
use super::series::combined;
use super::size::check_size;

/// A reduced model and the measurement it is held against.
pub struct Prepared {
    /// The problem it solves.
    pub problem: Problem,
    pub reduced: ReducedModel,
    /// Whether it came from the cache.
    pub cached: bool,
    /// The measurement on the plate.
    pub observation: Observation,
    /// Structure that is to be counted as a discrepancy of the model.
    pub discrepancy: [Option<Hyperparameters>; 2],
    /// What tracing found of a series before: about that it is linear in the declared effects.
    pub traced: Option<TracedSeries>,
}

impl Prepared {
    /// What the finite elements predict at the measured points.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn predict(&self, state: &State) -> Result<Prediction> {
        predict(&*self.problem.experiment, state, &self.observation.sight)
    }

    /// The columns at the measured points, points x 2 each, mm a mm of coefficient. Modes are given at the nodes of the declared mesh. Where an
    /// effect moves the mesh (a larger hole), they are off between the nodes. So they are corrected by what makes them right in the middle of the
    /// design's box, which a refinement puts about the posterior. Without that, on a coarse mesh with a hole 4 % larger, constants were 30 % of an sd off.
    /// On the declared mesh nothing is corrected. There a reduced basis may answer, or the solver, which depends on what was solved before: a run
    /// that goes on would not find the same bits.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub(crate) fn columns(&self, model: &Model) -> Result<UnitColumns> {
        let problem = &self.problem;
        let mut columns = (self.observation).columns(&self.reduced, &*problem.experiment, model)?;
        let middle: Vec<f64> = problem.dimensions.iter().map(|d| d.at(0.5)).collect();
        let state = problem.state(&middle);
        let mut setup = problem.experiment.scene().setup.clone();
        alter_checked("reduced_model.doe", state.acting(), &mut setup)?;
        if setup.morph == Morph::NONE {
            return Ok(columns);
        }
        let mut off = self.predict(&state)?.loaded;
        add_scaled(&mut off, &self.reduced.field(&columns.modes, &middle), -1.0);
        let coefficients = self.reduced.surface.evaluate(&middle);
        let each = self.reduced.modes_per_component().max(1);
        let components = columns
            .modes
            .chunks_mut(each)
            .zip(coefficients.chunks(each));
        for (c, (modes, a)) in components.enumerate() {
            let square: f64 = a.iter().map(|a| a * a).sum();
            for (mode, a) in modes.iter_mut().zip(a) {
                for (u, off) in mode.iter_mut().zip(&off) {
                    u[c] += a * off[c] / square.max(f64::MIN_POSITIVE);
                }
            }
        }
        Ok(columns)
    }
}

/// A posterior with everything it was made of, not sampled yet.
pub struct InverseProblem {
    /// What is solved.
    pub prepared: Prepared,
    /// Columns at the measured points.
    pub columns: UnitColumns,
    pub noise: Noise,
    pub statistics: Statistics,
    pub posterior: Posterior,
}

/// Read the measurement and obtain the reduced model for it.
///
/// # Errors
/// Those of reading the measurement, of finite-element solutions and of `REDUCTIONS`.
pub fn prepare(
    model: &Model,
    cache_dir: &std::path::Path,
    progress: &dyn Progress,
) -> Result<Prepared> {
    prepare_traced(model, None, cache_dir, progress)
}

/// The same of a model whose series was traced before.
///
/// # Errors
/// Those of [`prepare`].
pub fn prepare_traced(
    model: &Model,
    traced: Option<TracedSeries>,
    cache_dir: &std::path::Path,
    progress: &dyn Progress,
) -> Result<Prepared> {
    let (problem, observation) = observed(model, progress)?;
    if let Some(sides) = drawn_in(model) {
        progress.begin(
            "box of the reduced model drawn in, because no ply is beyond nu12^2 = E1/E2",
            None,
        );
        progress.say(&sides);
        progress.end();
    }
    let (reduced, cached) = cache::obtain(&problem, cache_dir, progress)?;
    let with = With {
        model,
        traced: traced.as_ref(),
        reduced: &reduced,
        experiment: &*problem.experiment,
        nominal: nominal_point(&problem, model),
    };
    let mut steps = REDUCTIONS.iter();
    let observation = steps.try_fold(observation, |observation, step| step(&with, observation))?;
    Ok(Prepared {
        problem,
        reduced,
        cached,
        observation,
        discrepancy: [None, None],
        traced,
    })
}

/// In this order: a region of miscounted orders would be taken for outliers, outliers for a ripple, and a series is combined last.
const REDUCTIONS: [Reduction; 4] = [
    without_jumps,
    without_deviant_points,
    without_phase_error,
    combined,
];

/// Drop points that lie far from what the reduced model can predict, where the measurement asks for it.
fn without_deviant_points(with: &With<'_>, mut observation: Observation) -> Result<Observation> {
    if with.model.experiment().measurement.outliers == OutlierRule::Reject {
        observation.drop_deviant_points(with.reduced, with.experiment);
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

/// Read the measurement, and locate it on the plate that is to be solved.
fn observed(model: &Model, progress: &dyn Progress) -> Result<(Problem, Observation)> {
    progress.begin("reading the measurement", None);
    match model.read_series()? {
        Some(series) if series.steps.len() > 1 => series_observed(model, &series, progress),
        // one step is a field like any other
        Some(single) => field_observed(model, single.field, progress),
        None => field_observed(model, model.read_field()?, progress),
    }
}

fn field_observed(
    model: &Model,
    field: Field,
    progress: &dyn Progress,
) -> Result<(Problem, Observation)> {
    progress.say(&format!("{} points", field.len()));
    progress.end();
    let problem = problem_of(model, &field, 0.0)?;
    let experiment = &*problem.experiment;
    let moved = turned_back(field.clone(), &experiment.motion());
    let observation = Observation::new(moved, experiment)?;
    let own = own_rotation(model, experiment, &observation, &observation.field)?;
    if own == 0.0 {
        return Ok((problem, observation));
    }
    let problem = problem_of(model, &field, own)?;
    let field = turned_back(field, &problem.experiment.motion());
    let observation = Observation::new(field, &*problem.experiment)?;
    Ok((problem, observation))
}

fn series_observed(
    model: &Model,
    series: &Series,
    progress: &dyn Progress,
) -> Result<(Problem, Observation)> {
    let (steps, points) = (series.steps.len(), series.field.len());
    progress.say(&format!("{steps} steps of {points} points"));
    progress.end();
    let problem = problem_within(model, series.field.measured_bounds())?;
    let forces = model.experiment().forces();
    let mut observation = Observation::of_series(series, forces, &*problem.experiment)?;
    let growing = |observation: &Observation| {
        let steps = observation.steps.as_ref();
        steps.map(|steps| Field {
            displacement: steps.combined(&observation.field.points),
            ..observation.field.clone()
        })
    };
    if let Some(field) = growing(&observation) {
        let own = own_rotation(model, &*problem.experiment, &observation, &field)?;
        if let Some(steps) = &mut observation.steps {
            steps.turn_by_the_load(own);
        }
        observation.field = growing(&observation).unwrap_or(field);
    }
    Ok((problem, observation))
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
fn nominal_point(problem: &Problem, model: &Model) -> Vec<f64> {
    let means: Vec<f64> = model.marginals().iter().map(|m| m.mean).collect();
    let mut point = problem.point(&means, problem.thickness_mm());
    for (value, side) in point.iter_mut().zip(&problem.dimensions) {
        *value = value.clamp(side.low, side.high);
    }
    point
}

/// Reduce the measurement to a posterior.
///
/// # Errors
/// Of the input: a field that cannot be the model's, too few points for the noise, effects that depend on each other.
pub fn inverse_problem(
    model: &Model,
    prepared: Prepared,
    progress: &dyn Progress,
) -> Result<InverseProblem> {
    inverse_problem_kept(model, prepared, &KeptStages::default(), progress)
}

/// The same with the noise as a stage that is kept.
///
/// # Errors
/// Those of [`inverse_problem`]; a folder that cannot be written.
pub(super) fn inverse_problem_kept(
    model: &Model,
    prepared: Prepared,
    kept: &KeptStages,
    progress: &dyn Progress,
) -> Result<InverseProblem> {
    let columns = prepared.columns(model)?;
    check_size(
        &prepared.observation.field,
        &prepared.reduced,
        &columns,
        &nominal_point(&prepared.problem, model),
    )?;
    progress.begin("noise of the measurement", None);
    let of = (&*columns.modes, &*columns.effects);
    let noise = Noise::estimate_kept(&prepared.observation.field, of, kept, progress)?;
    let (noise, smooth) = measured_by_frames(noise, &prepared.observation, &columns)?;
    let noise = noise.with(&prepared.discrepancy)?;
    let smooth = smooth.map(|mm| format!(", smooth over {mm:.1} mm in every picture"));
    progress.say(&format!(
        "{:.3} and {:.3} nm a point, n_eff {:.0}{}",
        noise.point_sd_nm(0),
        noise.point_sd_nm(1),
        noise.effective_points,
        smooth.unwrap_or_default()
    ));
    progress.end();
    let statistics = Statistics::new(&prepared.observation, &columns, &noise)?;
    let posterior = posterior(model, &prepared.reduced, &statistics, &noise)?;
    Ok(InverseProblem {
        prepared,
        columns,
        noise,
        statistics,
        posterior,
    })
}

/// The posterior of the constants, mechanical amplitudes and noise that a model declares, given the data's statistics.
///
/// # Errors
/// Of the program, if the eigendecomposition of the data's precision does not converge.
pub fn posterior(
    model: &Model,
    reduced: &ReducedModel,
    statistics: &Statistics,
    noise: &Noise,
) -> Result<Posterior> {
    let thickness = model.loaded_thickness_mm();
    let likelihood = Likelihood::new(
        statistics,
        reduced,
        model.file.likelihood.model_error_fraction,
        (thickness.mean, thickness.sd),
    )?;
    let mut names: Vec<String> = model.constants().iter().map(|n| (*n).to_string()).collect();
    let mut marginals = model.marginals();
    for effect in model.sampled() {
        for (k, parameter) in effect.parameters().iter().enumerate() {
            names.push(amplitude_name(effect, parameter));
            let sd = model.prior_sd(effect, k).unwrap_or(parameter.bound);
            marginals.push(Marginal {
                mean: 0.0,
                sd,
                truncate: parameter.positive.then_some([0.0, parameter.bound]),
            });
        }
    }
    let posterior = Posterior::new(
        names,
        model.material(),
        marginals,
        likelihood,
        noise.reference_nm(),
        model.file.likelihood.noise_nm,
    );
    Ok(match &model.known {
        Some(known) => posterior.beside(known),
        None => posterior,
    })
}

/// Where chains start: the mode without the priors' cuts, moved inside them.
///
/// # Errors
/// Those of [`laplace`].
pub fn start(posterior: &Posterior) -> Result<Laplace> {
    let (centre, sd) = posterior.start();
    let mut mode = laplace(&posterior.untruncated(), &centre, &sd)?;
    for (k, (x, m)) in mode.mode.iter_mut().zip(posterior.marginals()).enumerate() {
        let Some([low, high]) = m.truncate else {
            continue;
        };
        let room = (0.05 * (high - low)).min(sd[k]);
        *x = x.clamp(low + room, high - room);
    }
    Ok(mode)
}
