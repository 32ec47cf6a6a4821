//! One identification: reduced model, observation, noise, posterior, chains, residual.

use std::path::PathBuf;
use std::time::Instant;

use nalgebra::{DMatrix, DVector};

use super::residual::{Residual, effect_amplitudes};
use crate::chain::Draws;
use crate::diagnose::{Rule, Verdict, diagnose};
use crate::effect::amplitude_name;
use crate::error::{Error, Result};
use crate::fem::Plate;
use crate::field::spec::OutlierRule;
use crate::infer::{
    Columns, Likelihood, LogDensity, Marginal, Model, Noise, Observation, Posterior, Statistics,
    laplace,
};
use crate::progress::Watch;
use crate::reduce::{Problem, ReducedModel, cache, fit_rigid_motion};
use crate::sample::{self, Keeping, Phase, Progress, Report, Sampler, Schedule, Start, Stopped};

/// How to identify.
pub struct Options<'a> {
    /// Sampler.
    pub sampler: &'a dyn Sampler,
    /// Seed, sizes.
    pub schedule: Schedule,
    /// When the draws are good enough.
    pub rule: Rule,
    /// Directory of cached reduced models.
    pub cache: PathBuf,
    /// Where the chains are kept while the run goes.
    pub keeping: Option<Keeping>,
    /// When to stop sampling in any case.
    pub deadline: Option<Instant>,
}

/// A reduced model with the plate it was made on.
pub struct Prepared {
    /// The problem it solves.
    pub problem: Problem,
    /// The meshed plate.
    pub plate: Plate,
    /// The reduced model.
    pub reduced: ReducedModel,
    /// Whether it came from the cache.
    pub cached: bool,
    /// The measurement on the plate.
    pub observation: Observation,
}

/// Everything one identification found.
pub struct Round {
    /// What was solved.
    pub prepared: Prepared,
    /// Columns at the measured points.
    pub columns: Columns,
    /// Noise of the measurement.
    pub noise: Noise,
    /// What the data say.
    pub statistics: Statistics,
    /// The sampled density.
    pub posterior: Posterior,
    /// The draws.
    pub draws: Draws,
    /// Why sampling ended.
    pub stopped: Stopped,
    /// What the draws are worth.
    pub verdict: Verdict,
    /// Draws whose constants lie outside the DoE box, as a fraction.
    pub outside_doe: f64,
    /// Mean and sd of each declared closed-form effect's amplitude, border units.
    pub effect_amplitudes: Vec<(String, f64, f64)>,
    /// What the posterior mean leaves unexplained.
    pub residual: Residual,
}

/// Read the measurement and obtain the reduced model for it.
pub fn prepare(model: &Model, cache_dir: &std::path::Path, watch: &dyn Watch) -> Result<Prepared> {
    watch.begin("reading the measurement", None);
    let field = model.read_field()?;
    watch.say(&format!("{} points", field.len()));
    watch.end();
    let problem = model.problem(&field)?;
    let nominal = nominal_point(&problem, model);
    let plate = Plate::new(problem.test_at(&nominal).0.outline, problem.density)?;
    let mut observation = Observation::new(field, &plate.mesh)?;
    let (reduced, cached) = cache::obtain(&problem, &plate, cache_dir, watch)?;
    if model.file.measurement.outliers == OutlierRule::Reject {
        observation.drop_strays(&reduced, &plate.mesh);
    }
    Ok(Prepared {
        problem,
        plate,
        reduced,
        cached,
        observation,
    })
}

/// Prior means, mean thickness, no effect.
fn nominal_point(problem: &Problem, model: &Model) -> Vec<f64> {
    let mut point: Vec<f64> = model.marginals().iter().map(|m| m.mean).collect();
    if problem.thickness_index().is_some() {
        point.push(model.file.specimen.thickness_mm.mean);
    }
    point.resize(problem.dimensions.len(), 0.0);
    point
}

/// Identify the constants of a model from its measurement.
pub fn identify(model: &Model, options: &Options<'_>, watch: &dyn Watch) -> Result<Round> {
    let prepared = prepare(model, &options.cache, watch)?;
    let gauge = model.file.gauge;
    let columns = prepared.observation.columns(
        &prepared.reduced,
        &prepared.plate.mesh,
        gauge,
        &model.additive(),
    );
    check_size(model, &prepared, &columns)?;
    watch.begin("noise of the measurement", None);
    let noise = Noise::estimate(&prepared.observation, &columns)?;
    watch.say(&format!(
        "{:.3} and {:.3} nm a point, n_eff {:.0}",
        noise.point_sd_nm(0),
        noise.point_sd_nm(1),
        noise.effective_points
    ));
    watch.end();
    let statistics = Statistics::new(&prepared.observation, &columns, &noise)?;
    let posterior = posterior(model, &prepared, &statistics, &noise)?;
    let (draws, stopped) = draw(&posterior, options, watch)?;
    let verdict = diagnose(&draws, &options.rule);
    let mean: Vec<f64> = verdict.rows.iter().map(|row| row.mean).collect();
    let theta = &mean[..posterior.structural()];
    let likelihood = posterior.likelihood();
    let alpha = likelihood.expected(theta, posterior.scale(&mean));
    let (beta, covariance) = amplitudes(&posterior, &statistics, &draws);
    let at_mean = &statistics.effect_offset - &statistics.effect_slope * &alpha;
    let residual = Residual::new(
        &prepared.observation,
        &columns,
        &noise,
        &statistics,
        &alpha,
        &at_mean,
    );
    let effect_amplitudes = columns
        .names
        .iter()
        .enumerate()
        .map(|(k, name)| (name.clone(), beta[k], covariance[(k, k)].sqrt()))
        .collect();
    let outside_doe = outside(&prepared, &posterior, &draws);
    Ok(Round {
        prepared,
        columns,
        noise,
        statistics,
        posterior,
        draws,
        stopped,
        verdict,
        outside_doe,
        effect_amplitudes,
        residual,
    })
}

/// Largest ratio of the measured displacements to the model's that is not a mistake in the units.
const MOST_RATIO: f64 = 5.0;

/// A field many times too large, too small, or of the wrong sign for the model's own constants is a mistake in the
/// units, the axes or the load, and no posterior should come of it.
fn check_size(model: &Model, prepared: &Prepared, columns: &Columns) -> Result<()> {
    let nominal = nominal_point(&prepared.problem, model);
    let alpha = prepared.reduced.surface.evaluate(&nominal);
    let field = &prepared.observation.field;
    let without_rigid = |mut field_values: Vec<[f64; 2]>| {
        let motion = fit_rigid_motion(&field.points, &field_values);
        for (u, &p) in field_values.iter_mut().zip(&field.points) {
            let m = motion.at(p);
            *u = [u[0] - m[0], u[1] - m[1]];
        }
        field_values
    };
    let mut predicted = vec![[0.0; 2]; field.len()];
    for (column, a) in columns.modes.iter().zip(&alpha) {
        for (sum, u) in predicted.iter_mut().zip(column) {
            *sum = [sum[0] + a * u[0], sum[1] + a * u[1]];
        }
    }
    let (predicted, measured) = (
        without_rigid(predicted),
        without_rigid(field.displacement.clone()),
    );
    let dot = |a: &[[f64; 2]], b: &[[f64; 2]]| {
        a.iter()
            .zip(b)
            .map(|(a, b)| a[0] * b[0] + a[1] * b[1])
            .sum::<f64>()
    };
    let ratio = dot(&predicted, &measured) / dot(&predicted, &predicted);
    if (1.0 / MOST_RATIO..MOST_RATIO).contains(&ratio) {
        return Ok(());
    }
    let place = field
        .files
        .first()
        .map_or_else(|| "measurement".into(), |f| f.display().to_string());
    let hint = if ratio < 0.0 {
        "the measured field has the opposite sign: check which file or column is which, the axes' directions and the loading axis"
    } else {
        "check the units of the displacements and coordinates, the load and the thickness"
    };
    Err(Error::input(
        place,
        format!(
            "displacements of about the model's size (ratio {:.1} to {MOST_RATIO})",
            1.0 / MOST_RATIO
        ),
    )
    .found(format!(
        "displacements {ratio:.4} times those that the model predicts for its prior means"
    ))
    .hint(hint))
}

fn posterior(
    model: &Model,
    prepared: &Prepared,
    statistics: &Statistics,
    noise: &Noise,
) -> Result<Posterior> {
    let thickness = model.file.specimen.thickness_mm;
    let likelihood = Likelihood::new(
        statistics,
        &prepared.reduced,
        model.file.likelihood.model_error_fraction,
        (thickness.mean, thickness.sd),
    )?;
    let mut names: Vec<String> = model.constants().iter().map(|n| (*n).to_string()).collect();
    let mut marginals = model.marginals();
    for effect in model.mechanical() {
        for parameter in effect.parameters() {
            names.push(amplitude_name(effect, parameter));
            let sd = parameter.plausible.unwrap_or(parameter.bound);
            marginals.push(Marginal {
                mean: 0.0,
                sd,
                truncate: None,
            });
        }
    }
    Ok(Posterior::new(
        names,
        model.file.specimen.material,
        marginals,
        likelihood,
        noise.reference_nm(),
        model.file.likelihood.noise_nm,
    ))
}

/// Spread of the start about the mode, in units of its normal approximation.
const SPREAD: f64 = 3.0;

fn draw(
    posterior: &Posterior,
    options: &Options<'_>,
    watch: &dyn Watch,
) -> Result<(Draws, Stopped)> {
    let (centre, sd) = posterior.start();
    let mode = laplace(posterior, &centre, &sd)?;
    let start = Start::Ball {
        centre: &mode.mode,
        covariance: &mode.covariance,
        spread: SPREAD,
    };
    watch.begin(
        &format!(
            "sampling {} parameters with {} x {}",
            posterior.dim(),
            options.schedule.ensembles,
            options.sampler.name()
        ),
        None,
    );
    let measured = posterior.likelihood().measured();
    let keeping = options.keeping.clone().map(|keeping| Keeping {
        observed: vec![("alpha_mm".into(), measured.as_slice().to_vec())],
        ..keeping
    });
    let outcome = sample::run_kept(
        posterior,
        options.sampler,
        &start,
        &options.schedule,
        &options.rule,
        &Telling {
            watch,
            deadline: options.deadline,
        },
        keeping.as_ref(),
    )?;
    watch.end();
    Ok((outcome.draws, outcome.stopped))
}

/// Passes a sampler's reports on, and ends it in time.
struct Telling<'a> {
    watch: &'a dyn Watch,
    deadline: Option<Instant>,
}

impl Progress for Telling<'_> {
    fn report(&self, report: &Report) -> bool {
        let phase = match report.phase {
            Phase::Warmup => "warm-up",
            Phase::Sampling => "sampling",
        };
        self.watch.say(&format!(
            "{phase}: step {}, {} draws, acceptance {:.2}",
            report.steps, report.draws, report.acceptance
        ));
        self.deadline.is_none_or(|end| Instant::now() < end)
    }
}

/// Draws used for the amplitudes of closed-form effects.
const AMPLITUDE_DRAWS: usize = 1000;

fn amplitudes(
    posterior: &Posterior,
    statistics: &Statistics,
    draws: &Draws,
) -> (DVector<f64>, DMatrix<f64>) {
    let stride = (draws.len() / AMPLITUDE_DRAWS).max(1);
    let expected: Vec<_> = draws
        .points()
        .step_by(stride)
        .map(|x| {
            let scale = posterior.scale(x);
            let theta = &x[..posterior.structural()];
            let (alpha, covariance) = posterior
                .likelihood()
                .expected_with_covariance(theta, scale);
            (alpha, covariance, scale)
        })
        .collect();
    effect_amplitudes(statistics, &expected)
}

fn outside(prepared: &Prepared, posterior: &Posterior, draws: &Draws) -> f64 {
    let constants = prepared.problem.constants();
    let thickness = usize::from(prepared.problem.thickness_index().is_some());
    let mut count = 0;
    for x in draws.points() {
        let constants_out = (0..constants).any(|k| !prepared.reduced.dimensions[k].contains(x[k]));
        let amplitudes_out = (constants..posterior.structural())
            .any(|k| !prepared.reduced.dimensions[k + thickness].contains(x[k]));
        count += usize::from(constants_out || amplitudes_out);
    }
    count as f64 / draws.len().max(1) as f64
}
