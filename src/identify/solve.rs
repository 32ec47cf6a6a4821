//! One identification: reduced model, observation, noise, posterior, chains, residual.

use std::time::Instant;

use nalgebra::DVector;
use rayon::prelude::*;

use super::doubts::{Doubting, doubts};
use super::forward::forward;
use super::identification::Identification;
use super::inverse::{InverseProblem, inverse_problem_kept, start};
use super::misfit::AgainstNoise;
use super::patterns::Patterns;
use super::prepared::{Begun, Prepared, is_clear, prepare_from};
use super::residual::Residual;
use super::warnings::{NO_MODE, first_fit, warnings};
use crate::chain::Draws;
use crate::diagnose::{Rule, Verdict, diagnose};
use crate::error::{Blame, Error, Result};
use crate::files::KeptStages;
use crate::infer::Model;
use crate::linearise::Column;
use crate::posterior::{
    CompletedDraw, Full, FullModels, Importance, Inclusion, PosedDraws, PosteriorDensity, complete,
    linear,
};
use crate::progress::Progress;
use crate::sample::{
    self, Keeping, Key, Laplace, LogDensity, Monitor, Phase, PhaseReport, Regime, Sampler,
    Schedule, Start, Stopped, Stream,
};

/// How to identify.
pub struct Options<'a> {
    /// Sampler.
    pub sampler: &'a dyn Sampler,
    /// Seed, sizes.
    pub schedule: Schedule,
    /// When the draws are good enough.
    pub rule: Rule,
    /// Where the chains are kept while the run goes.
    pub keeping: Option<Keeping>,
    /// When to stop sampling in any case.
    pub deadline: Option<Instant>,
    /// What is done with doubts about the input.
    pub doubting: Doubting,
}

impl<'a> Options<'a> {
    /// The defaults of the program, with this sampler.
    pub fn new(sampler: &'a dyn Sampler) -> Self {
        Self {
            sampler,
            schedule: Schedule::default(),
            rule: Rule::default(),
            keeping: None,
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

/// Identify the constants of a model from its measurement.
///
/// # Errors
/// Those of reading the measurement, of finite-element solutions and of the samplers.
pub fn identify(
    model: &Model,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Identification> {
    identify_from(model, None, options, progress)
}

/// The same from where an earlier round left the test.
///
/// # Errors
/// Those of [`identify`].
pub fn identify_from(
    model: &Model,
    begun: Option<Begun>,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Identification> {
    let prepared = prepare_from(model, begun, progress)?;
    let doubts = doubted(model, &prepared, (options.doubting, progress))?;
    let hint = |e: Error| match doubts.first() {
        Some(doubt) if e.blame() == Blame::Input => e.hint(doubt),
        _ => e,
    };
    let mut found = identify_prepared(model, prepared, options, progress).map_err(hint)?;
    found.doubts = doubts;
    Ok(found)
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

fn identify_prepared(
    model: &Model,
    prepared: Prepared,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Identification> {
    let kept = options.stages();
    let mut inverse = inverse_problem_kept(model, prepared, &kept, progress)?;
    let mode = start(&inverse.posed.density).ok();
    let mode = mode.filter(|mode| inverse.posed.density.is_credible(&mode.mode));
    let determined = mode.is_some();
    if !determined {
        inverse.posed.density = inverse.posed.density.within_reason();
    }
    let mode = match mode {
        Some(mode) => mode,
        None => from_prior(&inverse.posed.density)?,
    };
    if options.doubting != Doubting::Unasked {
        let said = match determined {
            true => first_fit(&inverse, &mode.mode),
            false => Some(NO_MODE.to_string()),
        };
        said.iter().for_each(|said| progress.warn(said));
    }
    let (draws, stopped) = draw(&inverse.posed.density, &mode, options, progress)?;
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
    let misfit = found.misfit;
    let inverse = (found.inverse, found.determined);
    let again = assessed(model, inverse, drawn, (options, progress))?;
    Ok(match misfit.of_series {
        true => again.held_against(misfit.p),
        false => again,
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
    let completed = completed(&inverse, &draws, options.schedule.seed)?;
    let fine = forward(model, &inverse.prepared, &inverse.measured, &|| ());
    // those that go with the constants' means: the gain and the moduli know of each other to a ten-thousandth
    let (own, _) = inverse.posed.amplitudes_at(&mean);
    let residual = Residual::at(&inverse, &fine, &mean, &own)?;
    drop(fine);
    let misfit = AgainstNoise::of(
        &inverse,
        &residual,
        &mean,
        model.file.likelihood.noise_nm.is_some(),
    );
    let drawn = (&*completed.0, &*completed.1);
    let measure = || against_elements(model, &inverse, drawn, progress);
    let importance = options
        .stages()
        .stage("finite-elements", &draws.lp(), measure, progress)?;
    let field = &inverse.prepared.observation.field;
    let geometry = &*inverse.prepared.problem.experiment.scene().setup.geometry;
    let clear = |point: [f64; 2]| is_clear(geometry, point);
    let left = inverse.posed.left(&mean, &own);
    let amplitudes = moments(&inverse, &completed.0);
    let mut found = Identification {
        left,
        effect_amplitudes: of_effects(model, &inverse, amplitudes),
        patterns: Patterns::of(field, &residual.field, &inverse.noise, &clear),
        doubts: Vec::new(),
        warnings: Vec::new(),
        determined,
        misfit,
        inverse,
        draws,
        stopped,
        verdict,
        importance,
        residual,
    };
    found.warnings = warnings(model, &found);
    Ok(found)
}

/// Draws that are completed.
const COMPLETED: usize = 1000;

/// Streams with which draws are completed, apart from those of any ensemble.
const COMPLETION: u64 = u64::MAX - 4;

/// Some of the draws, with the amplitudes that were integrated out.
fn completed(
    inverse: &InverseProblem,
    draws: &Draws,
    seed: u64,
) -> Result<(Vec<Vec<f64>>, Vec<CompletedDraw>)> {
    let some = draws.every(draws.len().div_ceil(COMPLETED))?;
    let points: Vec<Vec<f64>> = some.points().map(<[f64]>::to_vec).collect();
    let inclusion = Inclusion {
        candidates: 0,
        log_prior: &|_| None,
        excludes: &|_, _| false,
    };
    let key = Key {
        seed,
        ensemble: COMPLETION,
    };
    let stream = |k: usize| Stream::at(key, k as u64, 0);
    let found = complete(&inverse.posed.density, &points, &inclusion, &stream);
    Ok((points, found))
}

/// Mean and sd of the amplitudes of the linear columns over some points, prior sds from their means: at each their normal distribution is known.
fn moments(inverse: &InverseProblem, points: &[Vec<f64>]) -> (DVector<f64>, DVector<f64>) {
    let all: Vec<(DVector<f64>, DVector<f64>)> = points
        .par_iter()
        .map(|x| {
            let (mean, covariance) = inverse.posed.amplitudes_at(x);
            (mean, covariance.diagonal())
        })
        .collect();
    let n = all.len().max(1) as f64;
    let count = inverse.posed.kept.len();
    let mean = all
        .iter()
        .fold(DVector::zeros(count), |sum, (m, _)| sum + m / n);
    let spread = |(m, v): &(DVector<f64>, DVector<f64>)| (m - &mean).map(|d| d * d) + v;
    let variance = all
        .iter()
        .fold(DVector::zeros(count), |sum, one| sum + spread(one) / n);
    (mean, variance.map(f64::sqrt))
}

/// Name, mean and sd of the amplitudes of the declared effects, border units: of those that enter linearly, and as estimated from the
/// recording.
fn of_effects(
    model: &Model,
    inverse: &InverseProblem,
    (mean, sd): (DVector<f64>, DVector<f64>),
) -> Vec<(String, f64, f64)> {
    let columns = linear(&inverse.posed.expanded.here);
    let is_declared = |c: &Column| {
        let own = c.effect().map(|own| own.name());
        model.effects.iter().any(|e| Some(e.name()) == own)
    };
    let each = columns.into_iter().zip(mean.iter().zip(sd.iter()));
    let declared = each.filter(|(c, _)| is_declared(c));
    let recorded = &inverse.prepared.observation.recorded;
    declared
        .map(|(c, (mean, sd))| (c.name.clone(), c.mean + c.sd * mean, c.sd * sd))
        .chain(recorded.iter().map(|r| (r.name.clone(), r.mean, r.sd)))
        .collect()
}

/// How draws of the density fare under the finite elements.
///
/// # Errors
/// Those of a finite-element solution; draws of another density.
pub fn checked(
    model: &Model,
    (inverse, draws): (&InverseProblem, &Draws),
    seed: u64,
    progress: &dyn Progress,
) -> Result<Importance> {
    let (points, drawn) = completed(inverse, draws, seed)?;
    against_elements(model, inverse, (&points, &drawn), progress)
}

/// The same at completed draws.
fn against_elements(
    model: &Model,
    inverse: &InverseProblem,
    (points, drawn): (&[Vec<f64>], &[CompletedDraw]),
    progress: &dyn Progress,
) -> Result<Importance> {
    progress.begin("finite elements at posterior draws", None);
    let InverseProblem {
        prepared,
        measured,
        coarse,
        ..
    } = inverse;
    let fine = forward(model, prepared, measured, &|| ());
    let coarse = coarse
        .as_ref()
        .map(|c| c.at_few_points(model, prepared, measured));
    let expanded = &inverse.posed.expanded;
    let full = |forward, here| Full {
        forward,
        point: &inverse.about,
        here,
    };
    let rough = coarse
        .as_ref()
        .map(|forward| full(forward, &expanded.about));
    let models = FullModels {
        fine: &full(&fine, &expanded.here),
        coarse: rough.as_ref(),
    };
    let posed = &inverse.posed;
    let importance = PosedDraws {
        posed,
        points,
        drawn,
    }
    .importance(models)?;
    if let Some((name, [shift, error])) = importance.largest() {
        progress.say(&format!("{name} {shift:+.2} +- {error:.2} sd"));
    }
    progress.end();
    prepared.problem.experiment.drop_caches();
    Ok(importance)
}

/// Draws of each chain below which nothing can be said, not even how uncertain it is.
const FEWEST_DRAWS: usize = 4;

/// Spread of the start about the mode, in units of its normal approximation.
const SPREAD: f64 = 3.0;

/// Spread of a start from the prior, prior sds.
const PRIOR_SPREAD: f64 = 0.1;

/// Where chains start that have no mode: about the prior's mean.
fn from_prior(posterior: &PosteriorDensity) -> Result<Laplace> {
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
    posterior: &PosteriorDensity,
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
    let outcome = sample::run_kept(
        posterior,
        options.sampler,
        &start,
        &Regime {
            schedule: &options.schedule,
            stop: &options.rule,
            monitor: &options.reporting(progress),
        },
        options.keeping.as_ref(),
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
