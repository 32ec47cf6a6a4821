//! One identification: reduced model, observation, noise, posterior, chains, residual.

use std::path::PathBuf;
use std::time::Instant;

use nalgebra::{DMatrix, DVector};

use super::checks::{Judged, check_size, warnings};
use super::refine::{Refinement, enrich};
use super::residual::{Residual, effect_amplitudes};
use super::truth::{Identified, SurrogateError};
use crate::chain::Draws;
use crate::diagnose::{Rule, Verdict, diagnose};
use crate::effect::amplitude_name;
use crate::error::Result;
use crate::fem::Plate;
use crate::field::spec::OutlierRule;
use crate::infer::{
    Columns, Laplace, Likelihood, LogDensity, Marginal, Model, Noise, Observation, Posterior,
    Statistics, laplace,
};
use crate::progress::Watch;
use crate::reduce::{Problem, ReducedModel, cache};
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
    /// At most this many refinements of the reduced model about the posterior.
    pub refinements: usize,
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
    /// The reduced model against the finite elements at draws of the posterior.
    pub surrogate: SurrogateError,
    /// The reduced models used, the first and every refinement; the last is this round's.
    pub refinements: Vec<Refinement>,
    /// Mean and sd of each declared closed-form effect's amplitude, border units.
    pub effect_amplitudes: Vec<(String, f64, f64)>,
    /// What the posterior mean leaves unexplained.
    pub residual: Residual,
    /// Sentences about results that should not be trusted as they stand.
    pub warnings: Vec<String>,
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

/// Identify the constants of a model from its measurement. The reduced model is refined about the posterior, and the
/// posterior sampled again, while the finite elements ask for it and `options.refinements` allows it.
pub fn identify(model: &Model, options: &Options<'_>, watch: &dyn Watch) -> Result<Round> {
    let prepared = prepare(model, &options.cache, watch)?;
    let mut round = identify_prepared(model, prepared, options, watch)?;
    let mut history = vec![Refinement::of(&round)];
    for k in 1..=options.refinements {
        if history.last().is_some_and(Refinement::is_enough) {
            break;
        }
        let most = options.refinements;
        let what = format!("refinement {k} of at most {most}: a box about the posterior");
        watch.begin(&what, None);
        watch.end();
        let prepared = enrich(round, &options.cache, watch)?;
        if let Some(keeping) = &options.keeping {
            keeping.clear()?;
        }
        round = identify_prepared(model, prepared, options, watch)?;
        history.push(Refinement::of(&round));
    }
    round.refinements = history;
    Ok(round)
}

/// Identify with a given reduced model.
fn identify_prepared(
    model: &Model,
    prepared: Prepared,
    options: &Options<'_>,
    watch: &dyn Watch,
) -> Result<Round> {
    let gauge = model.file.gauge;
    let columns = prepared.observation.columns(
        &prepared.reduced,
        &prepared.plate.mesh,
        gauge,
        &model.additive(),
        &model.scene(),
    );
    check_size(
        &prepared,
        &columns,
        &nominal_point(&prepared.problem, model),
    )?;
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
    let surrogate = SurrogateError::measure(
        &Identified {
            prepared: &prepared,
            columns: &columns,
            noise: &noise,
            statistics: &statistics,
            posterior: &posterior,
            draws: &draws,
        },
        watch,
    )?;
    let warnings = warnings(&Judged {
        prepared: &prepared,
        posterior: &posterior,
        noise: &noise,
        residual: &residual,
        mean: &mean,
        outside_doe,
        surrogate: &surrogate,
        declared_noise_nm: model.file.likelihood.noise_nm,
    });
    Ok(Round {
        warnings,
        prepared,
        columns,
        noise,
        statistics,
        posterior,
        draws,
        stopped,
        verdict,
        outside_doe,
        surrogate,
        refinements: Vec::new(),
        effect_amplitudes,
        residual,
    })
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
    for effect in model.sampled() {
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

/// Where chains start: the mode without the priors' cuts, moved inside them.
fn start(posterior: &Posterior) -> Result<Laplace> {
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

/// Spread of the start about the mode, in units of its normal approximation.
const SPREAD: f64 = 3.0;

fn draw(
    posterior: &Posterior,
    options: &Options<'_>,
    watch: &dyn Watch,
) -> Result<(Draws, Stopped)> {
    let mode = start(posterior)?;
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
