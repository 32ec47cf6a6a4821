//! One identification: reduced model, observation, noise, posterior, chains, residual.

use std::path::PathBuf;
use std::time::Instant;

use super::doubts::{Doubting, doubts};
use super::identification::{Identification, Refinement};
use super::inverse::{
    InverseProblem, Prepared, inverse_problem_kept, is_clear, prepare_traced, start,
};
use super::misfit::AgainstNoise;
use super::patterns::Patterns;
use super::refine::enrich;
use super::residual::{Residual, effect_amplitudes};
use super::structure::Structure;
use super::surrogate::SurrogateError;
use super::warnings::{NO_MODE, first_fit, warnings};
use crate::chain::Draws;
use crate::diagnose::{Rule, Verdict, diagnose};
use crate::error::{Blame, Error, Result};
use crate::files::{KeptStages, Stored};
use crate::infer::{Model, Posterior, TracedSeries};
use crate::noise::Hyperparameters;
use crate::progress::Progress;
use crate::sample::{
    self, Keeping, Monitor, Phase, PhaseReport, Regime, Sampler, Schedule, Start, Stopped,
};
use crate::sample::{Laplace, LogDensity};

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
    /// Structure that is to be counted as a discrepancy of the model.
    pub discrepancy: [Option<Hyperparameters>; 2],
    /// When to stop sampling in any case.
    pub deadline: Option<Instant>,
    /// What is done with doubts about the input.
    pub doubting: Doubting,
}

impl<'a> Options<'a> {
    /// The defaults of the program, with this sampler; reduced models are kept in the directory `cache` and used again.
    pub fn new(sampler: &'a dyn Sampler, cache: impl Into<PathBuf>) -> Self {
        Self {
            sampler,
            schedule: Schedule::default(),
            rule: Rule::default(),
            cache: cache.into(),
            refinements: 0,
            keeping: None,
            discrepancy: [None, None],
            deadline: None,
            doubting: Doubting::Unasked,
        }
    }

    /// What tells `progress` of a sampler, and ends it in time.
    pub fn reporting<'b>(&self, progress: &'b dyn Progress) -> Reporting<'b> {
        Reporting {
            progress,
            deadline: self.deadline,
        }
    }

    /// Where finished stages beside the chains are kept.
    pub fn stages(&self) -> KeptStages {
        let keeping = self.keeping.as_ref();
        keeping.map(Keeping::stages).unwrap_or_default()
    }
}

/// Identify the constants of a model from its measurement. The reduced model is refined about the posterior, and the
/// posterior sampled again, while the finite elements ask for it and `options.refinements` allows it.
pub fn identify(
    model: &Model,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Identification> {
    identify_traced(model, None, options, progress)
}

/// The same of a model whose series was traced before.
///
/// # Errors
/// Those of [`identify`].
pub fn identify_traced(
    model: &Model,
    traced: Option<TracedSeries>,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Identification> {
    let prepared = Prepared {
        discrepancy: options.discrepancy,
        ..prepare_traced(model, traced, &options.cache, progress)?
    };
    let doubts = doubted(model, &prepared, (options.doubting, progress))?;
    let hint = |e: Error| match doubts.first() {
        Some(doubt) if e.blame() == Blame::Input => e.hint(doubt),
        _ => e,
    };
    let mut found = identify_prepared(model, prepared, options, progress).map_err(hint)?;
    found.doubts = doubts;
    found.refinements = vec![Refinement::of(&found)];
    if !found.determined {
        return Ok(found);
    }
    let refined = refine(model, &found, options, progress)?;
    Ok(refined.unwrap_or(found))
}

/// Refine the reduced model about the posterior, and sample that again, while the finite elements ask for it and `options.refinements`
/// allows it; nothing where they do not.
///
/// # Errors
/// Those of [`identify`].
pub fn refine(
    model: &Model,
    found: &Identification,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Option<Identification>> {
    let mut history = found.refinements.clone();
    let mut newest: Option<Identification> = None;
    for k in 1..=options.refinements {
        if history.last().is_some_and(Refinement::is_enough) {
            break;
        }
        let most = options.refinements;
        let what = format!("refinement {k} of at most {most}: a box about the posterior");
        progress.begin(&what, None);
        progress.end();
        let prepared = enrich(newest.as_ref().unwrap_or(found), &options.cache, progress)?;
        if let Some(keeping) = &options.keeping {
            keeping.clear()?;
        }
        let next = identify_prepared(model, prepared, options, progress)?;
        history.push(Refinement::of(&next));
        newest = Some(next);
    }
    let doubts = &found.doubts;
    Ok(newest.map(|newest| Identification {
        refinements: history,
        doubts: doubts.clone(),
        ..newest
    }))
}

/// Doubts about the input, as they are asked for: said at once, or an error.
fn doubted(
    model: &Model,
    prepared: &Prepared,
    (doubting, progress): (Doubting, &dyn Progress),
) -> Result<Vec<String>> {
    if doubting == Doubting::Unasked {
        return Ok(Vec::new());
    }
    progress.begin("looking for mistakes in the input", None);
    let doubts = doubts(model, prepared);
    progress.say(match doubts.len() {
        0 => "none found",
        _ => "see the warning",
    });
    progress.end();
    match doubts.first() {
        Some(first) if doubting == Doubting::Refused => {
            let place = model.path.display();
            Err(Error::input(format!("{place} (--strict)"), "an input without doubts").hint(first))
        }
        _ => {
            doubts.iter().for_each(|doubt| progress.warn(doubt));
            Ok(doubts)
        }
    }
}

/// Identify with a given reduced model.
fn identify_prepared(
    model: &Model,
    prepared: Prepared,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Identification> {
    let mut inverse = inverse_problem_kept(model, prepared, &options.stages(), progress)?;
    let mode = start(&inverse.posterior).ok();
    let mode = mode.filter(|mode| inverse.posterior.is_credible(&mode.mode));
    let determined = mode.is_some();
    if !determined {
        inverse.posterior = inverse.posterior.within_reason();
    }
    let mode = match mode {
        Some(mode) => mode,
        None => from_prior(&inverse.posterior)?,
    };
    if options.doubting != Doubting::Unasked {
        let said = match determined {
            true => first_fit(&inverse, &mode.mode),
            false => Some(NO_MODE.to_string()),
        };
        said.iter().for_each(|said| progress.warn(said));
    }
    let (draws, stopped) = draw(&inverse.posterior, &mode, options, progress)?;
    let verdict = diagnose(&draws, &options.rule);
    let drawn = DrawnPosterior {
        draws,
        stopped,
        verdict,
    };
    assessed(model, (inverse, determined), drawn, (options, progress))
}

/// Draws of a posterior, and what they are worth.
struct DrawnPosterior {
    draws: Draws,
    stopped: Stopped,
    verdict: Verdict,
}

/// A field's identification by other draws of its parameters: those of its posterior with other experiments.
///
/// # Errors
/// Those of a finite-element solution.
pub fn redrawn(
    model: &Model,
    found: Identification,
    (draws, stopped): (Draws, Stopped),
    (options, progress): (&Options<'_>, &dyn Progress),
) -> Result<Identification> {
    let drawn = DrawnPosterior {
        verdict: diagnose(&draws, &options.rule),
        draws,
        stopped,
    };
    let (misfit, refinements) = (found.misfit, found.refinements);
    let inverse = (found.inverse, found.determined);
    let again = assessed(model, inverse, drawn, (options, progress))?;
    let again = match misfit.of_series {
        true => again.held_against(misfit.p),
        false => again,
    };
    Ok(Identification {
        refinements,
        ..again
    })
}

/// What draws of an inverse problem are worth, and what they leave of the data.
fn assessed(
    model: &Model,
    (inverse, determined): (InverseProblem, bool),
    drawn: DrawnPosterior,
    (options, progress): (&Options<'_>, &dyn Progress),
) -> Result<Identification> {
    let DrawnPosterior {
        draws,
        stopped,
        verdict,
    } = drawn;
    let mean: Vec<f64> = verdict.rows.iter().map(|row| row.mean).collect();
    let residual = Residual::at(&inverse, &mean);
    let misfit = AgainstNoise::of_field(
        &inverse,
        &residual,
        &mean,
        model.file.likelihood.noise_nm.is_some(),
    );
    let mut of = Vec::new();
    draws.lp().to_vec().put(&mut of);
    let measure = || SurrogateError::measure(&inverse, &draws, progress);
    let surrogate = options
        .stages()
        .stage("reduced-model", &of, measure, progress)?;
    let field = &inverse.prepared.observation.field;
    let geometry = &*inverse.prepared.problem.experiment.scene().setup.geometry;
    let clear = |point: [f64; 2]| is_clear(geometry, point);
    let mut found = Identification {
        outside_doe: outside(&inverse, &draws),
        effect_amplitudes: amplitudes(&inverse, &draws),
        patterns: Patterns::of(field, &residual.field, &inverse.noise, &clear),
        structure: Structure::of(&residual.field, &inverse.noise, options.schedule.seed),
        doubts: Vec::new(),
        warnings: Vec::new(),
        refinements: Vec::new(),
        determined,
        misfit,
        inverse,
        draws,
        stopped,
        verdict,
        surrogate,
        residual,
    };
    found.warnings = warnings(model, &found);
    Ok(found)
}

/// Draws of each chain below which nothing can be said, not even how uncertain it is.
const FEWEST_DRAWS: usize = 4;

/// Spread of the start about the mode, in units of its normal approximation.
const SPREAD: f64 = 3.0;

/// Spread of a start from the prior, prior sds.
const PRIOR_SPREAD: f64 = 0.1;

/// Where chains start that have no mode: about the prior's mean.
fn from_prior(posterior: &Posterior) -> Result<Laplace> {
    let (mode, sd) = posterior.start();
    let mut covariance = vec![0.0; sd.len() * sd.len()];
    for (k, sd) in sd.iter().enumerate() {
        covariance[k * (mode.len() + 1)] = (PRIOR_SPREAD * sd / SPREAD).powi(2);
    }
    Ok(Laplace {
        log_density: posterior.value(&mode)?,
        mode,
        covariance,
    })
}

fn draw(
    posterior: &Posterior,
    mode: &Laplace,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<(Draws, Stopped)> {
    let start = Start::Ball {
        centre: &mode.mode,
        covariance: &mode.covariance,
        spread: SPREAD,
    };
    progress.begin(
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
        &Regime {
            schedule: &options.schedule,
            stop: &options.rule,
            monitor: &options.reporting(progress),
        },
        keeping.as_ref(),
    )?;
    progress.end();
    if outcome.draws.draws() < FEWEST_DRAWS {
        return Err(Error::limit(
            "--time-limit",
            format!("time for at least {FEWEST_DRAWS} draws of each chain"),
        )
        .found(format!("{} draws when it was over", outcome.draws.draws()))
        .hint("allow more seconds: the limit counts from the start, the building of the reduced model and the warm-up of the chains included"));
    }
    Ok((outcome.draws, outcome.stopped))
}

/// Passes a sampler's reports on, and ends it in time.
pub struct Reporting<'a> {
    /// What hears of every report.
    pub progress: &'a dyn Progress,
    /// When the sampler is ended in any case.
    pub deadline: Option<Instant>,
}

impl Monitor for Reporting<'_> {
    fn report(&self, report: &PhaseReport) -> bool {
        let phase = match report.phase {
            Phase::Warmup => "warm-up",
            Phase::Sampling => "sampling",
        };
        self.progress.say(&format!(
            "{phase}: step {}, {} draws, acceptance {:.2}",
            report.steps, report.draws, report.acceptance
        ));
        self.deadline.is_none_or(|end| Instant::now() < end)
    }
}

/// Draws used for the amplitudes of closed-form effects.
const AMPLITUDE_DRAWS: usize = 1000;

/// Name, mean and sd of the amplitude of each closed-form effect: given the coefficients of every draw, and as estimated
/// from the recording.
fn amplitudes(inverse: &InverseProblem, draws: &Draws) -> Vec<(String, f64, f64)> {
    let posterior = &inverse.posterior;
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
    let (beta, covariance) = effect_amplitudes(&inverse.statistics, &expected);
    let names = inverse.columns.names.iter().enumerate();
    let recorded = &inverse.prepared.observation.recorded;
    names
        .map(|(k, name)| (name.clone(), beta[k], covariance[(k, k)].sqrt()))
        .chain(recorded.iter().map(|r| (r.name.clone(), r.mean, r.sd)))
        .collect()
}

/// Share of the draws outside the box in which the reduced model was built.
fn outside(inverse: &InverseProblem, draws: &Draws) -> f64 {
    let sides = &inverse.prepared.reduced.dimensions[..inverse.posterior.structural()];
    let is_out = |x: &&[f64]| !sides.iter().zip(*x).all(|(side, &x)| side.contains(x));
    let count = draws.points().filter(is_out).count();
    count as f64 / draws.len().max(1) as f64
}
