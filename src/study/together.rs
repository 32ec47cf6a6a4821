//! The posterior of all experiments of a study, each alone and all together, and how far they disagree.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{ExperimentSection, Observed, SharedConstants, Study};
use crate::chain::Draws;
use crate::diagnose::{Rule, Verdict, diagnose, weigh};
use crate::error::{Error, Result};
use crate::identify::{Identification, Options, redrawn};
use crate::infer::{ConstantsLikelihood, Joint, Marginal, Member, Moments, Tension};
use crate::numeric::diagonal;
use crate::parameter::is_modulus;
use crate::progress::Progress;
use crate::sample::{self, LogDensity, Regime, Schedule, Start, Stopped};

/// An experiment without the others.
pub struct Alone {
    pub name: String,
    pub observed: Box<dyn Observed>,
    /// Of the constants.
    pub moments: Moments,
    /// The same without the constants' prior, as a normal likelihood.
    pub said: ConstantsLikelihood,
    /// The posterior, unless the experiment samples its own.
    pub sampled: Option<SampledStudy>,
}

/// How far an experiment disagrees with another, or with all others.
#[derive(Debug)]
pub struct PairTension {
    pub first: String,
    /// None for all others together.
    pub second: Option<String>,
    pub tension: Tension,
}

/// Draws of the posterior of some experiments, and what they are worth.
pub struct SampledStudy {
    pub draws: Draws,
    pub stopped: Stopped,
    pub verdict: Verdict,
    /// The sampled density against the exact one.
    pub exact: Exact,
    /// The draws of each experiment's own parameters, the constants first.
    pub parts: Vec<Draws>,
    pub sections: Vec<ExperimentSection>,
    pub warnings: Vec<String>,
}

/// What exact likelihoods say of draws, by importance.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Exact {
    pub draws: usize,
    /// Effective draws over draws.
    pub effective: f64,
    /// Largest shift of the mean of a parameter, posterior sds.
    pub shift_sd: f64,
}

/// Several experiments, alone and together.
pub struct Disagreement {
    /// Names and moments of the constants by each experiment alone.
    pub alone: Vec<(String, Moments)>,
    pub tensions: Vec<PairTension>,
    /// The first experiment against all others, and what those say together.
    pub first: Option<Tension>,
    pub others: Option<Moments>,
    pub sections: Vec<ExperimentSection>,
    pub warnings: Vec<String>,
}

/// Spread of the start about the likeliest top.
const SPREAD: f64 = 1.5;
/// Change of tau that ends the run, and steps between draws; see the posterior to quote.
const TAU_CHANGE: f64 = 0.1;
const THIN: usize = 4;
/// Windows of warm-up, and draws, at most: chains that have not settled then are said not to have converged.
const WARMUP: usize = 16;
const MOST_DRAWS: usize = 1 << 18;

/// The rule by which draws are enough.
pub fn patient_rule(given: &Rule) -> Rule {
    Rule {
        tau_change: given.tau_change.max(TAU_CHANGE),
        ..*given
    }
}

/// Identify the constants from each experiment by itself. `options` are those of a run kept under an experiment's name.
///
/// # Errors
/// Those of the experiments and of the samplers.
pub fn alone<'a>(
    study: &Study,
    options: &dyn Fn(&str) -> Options<'a>,
    progress: &dyn Progress,
) -> Result<Vec<Alone>> {
    let shared = study.shared();
    let one = |k: usize| {
        let experiment = &study.experiments[k];
        let options = options(experiment.name());
        let observed = experiment
            .observed(&shared, &options, progress)
            .map_err(|e| e.within(study.path.display()))?;
        Alone::new(experiment.name(), observed, (&shared, &options), progress)
    };
    (0..study.experiments.len()).map(one).collect()
}

impl Alone {
    /// Sample the posterior of one experiment, unless that was done on the way.
    ///
    /// # Errors
    /// Those of the samplers; draws that do not vary.
    pub fn new(
        name: &str,
        observed: Box<dyn Observed>,
        (shared, options): (&SharedConstants, &Options<'_>),
        progress: &dyn Progress,
    ) -> Result<Self> {
        let n = shared.constants.len();
        let sampled = match observed.draws() {
            Some(_) => None,
            None => Some(sampled(&[&*observed], None, (shared, options), progress)?),
        };
        let own = sampled.as_ref().map(|s| &s.draws).or(observed.draws());
        let own = own.ok_or_else(|| Error::program("study", "draws"))?;
        let moments = Moments::of(own.points(), n);
        Ok(Self {
            name: name.into(),
            said: likelihood_beyond_prior(&moments, &shared.priors())?,
            observed,
            moments,
            sampled,
        })
    }

    /// The draws of its posterior.
    ///
    /// # Errors
    /// Of the program: an experiment that was not sampled.
    pub fn draws(&self) -> Result<&Draws> {
        let own = self.sampled.as_ref().map(|s| &s.draws);
        own.or(self.observed.draws())
            .ok_or_else(|| Error::program("study", "draws"))
    }
}

impl SharedConstants {
    /// Priors of the constants.
    pub fn priors(&self) -> Vec<Marginal> {
        self.constants.iter().map(|c| c.1).collect()
    }

    /// Which of the constants are moduli.
    pub fn moduli(&self) -> Vec<bool> {
        self.constants.iter().map(|c| is_modulus(&c.0)).collect()
    }
}

/// Priors of some constants, and which of them are moduli.
pub type PriorsOf<'a> = (&'a [Marginal], &'a [bool]);

/// What moments say beyond the constants' prior.
///
/// # Errors
/// Of the program: draws that do not vary.
pub fn likelihood_beyond_prior(
    moments: &Moments,
    priors: &[Marginal],
) -> Result<ConstantsLikelihood> {
    let mean: Vec<f64> = moments.mean.iter().copied().collect();
    let known = ConstantsLikelihood::beyond_prior(&mean, &moments.covariance, priors);
    known.ok_or_else(|| Error::program("study", "draws that vary"))
}

/// What all experiments but one say together.
pub fn others(said: &[&ConstantsLikelihood], except: Option<usize>) -> Option<ConstantsLikelihood> {
    let all = said.iter().enumerate().filter(|(k, _)| Some(*k) != except);
    all.map(|(_, known)| (*known).clone())
        .reduce(|sum, known| sum.and(&known))
}

/// How far every two experiments disagree, and, where there are more than two, each and all others.
pub fn tensions(
    alone: &[(String, Moments)],
    said: &[&ConstantsLikelihood],
    (priors, moduli): PriorsOf<'_>,
) -> Vec<PairTension> {
    let mut all = Vec::new();
    for (i, (first, own)) in alone.iter().enumerate() {
        for (second, other) in &alone[i + 1..] {
            let tension = Tension::between(own, other, priors, moduli);
            all.extend(tension.map(|tension| PairTension {
                first: first.clone(),
                second: Some(second.clone()),
                tension,
            }));
        }
    }
    if alone.len() > 2 {
        for (k, (first, own)) in alone.iter().enumerate() {
            let rest = others(said, Some(k)).and_then(|known| known.moments());
            let tension = rest.and_then(|rest| Tension::between(own, &rest, priors, moduli));
            all.extend(tension.map(|tension| PairTension {
                first: first.clone(),
                second: None,
                tension,
            }));
        }
    }
    all
}

impl Disagreement {
    /// What some experiments say alone and how far they disagree; of sections nothing yet.
    pub fn new(
        alone: Vec<(String, Moments)>,
        said: &[&ConstantsLikelihood],
        of: PriorsOf<'_>,
    ) -> Self {
        let rest = others(said, Some(0)).and_then(|known| known.moments());
        let first = alone.first().zip(rest.as_ref());
        Self {
            tensions: tensions(&alone, said, of),
            first: first.and_then(|((_, own), rest)| Tension::between(own, rest, of.0, of.1)),
            others: rest,
            alone,
            sections: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// The same with what draws of all experiments together say of each.
    #[must_use]
    pub fn with_sections(self, sampled: &SampledStudy) -> Self {
        Self {
            sections: sampled.sections.clone(),
            warnings: sampled.warnings.clone(),
            ..self
        }
    }
}

/// Sample the posterior of some experiments together, exactly; `about` is where their constants are about.
///
/// # Errors
/// Those of the samplers; names of parameters that collide.
pub fn sampled(
    experiments: &[&dyn Observed],
    about: Option<&Moments>,
    (shared, options): (&SharedConstants, &Options<'_>),
    progress: &dyn Progress,
) -> Result<SampledStudy> {
    let (target, outcome) = drawn(experiments, about, (shared, options), progress)?;
    let draws = outcome.draws;
    let verdict = diagnose(&draws, &patient_rule(&options.rule));
    progress.begin("what each experiment says over the posterior", None);
    let exact = Exact::of(experiments, &target, (&draws, &verdict));
    let parts = (0..experiments.len()).map(|e| part(&target, e, &draws));
    let parts: Vec<Draws> = parts.collect::<Result<_>>()?;
    let each = experiments.iter().zip(&parts);
    let sections: Vec<ExperimentSection> = each
        .map(|(experiment, part)| experiment.section(part))
        .collect::<Result<_>>()?;
    progress.end();
    let said = sections.iter().flat_map(|s| s.warnings.iter().cloned());
    let warnings = said.chain(exact.warning()).collect();
    Ok(SampledStudy {
        draws,
        stopped: outcome.stopped,
        verdict,
        exact,
        parts,
        sections,
        warnings,
    })
}

fn drawn(
    experiments: &[&dyn Observed],
    about: Option<&Moments>,
    (shared, options): (&SharedConstants, &Options<'_>),
    progress: &dyn Progress,
) -> Result<(Joint, sample::Outcome)> {
    let members: Vec<Member> = experiments.iter().map(|e| e.member(shared)).collect();
    let target = Joint::new(shared.constants.clone(), members)?;
    let dim = target.dim();
    let what = format!(
        "sampling {dim} parameters with 4 x {}",
        options.sampler.name()
    );
    progress.begin(&what, None);
    let (mut centre, sd) = target.start();
    let mut covariance = diagonal(sd.iter().map(|sd| sd * sd));
    if let Some(about) = about {
        for i in 0..about.mean.len() {
            centre[i] = about.mean[i];
            for j in 0..about.mean.len() {
                covariance[i * dim + j] = about.covariance[(i, j)];
            }
        }
    }
    let start = Start::Ball {
        centre: &centre,
        covariance: &covariance,
        spread: SPREAD,
    };
    let given = &options.schedule;
    let schedule = Schedule {
        warmup_windows: given.warmup_windows.min(WARMUP),
        max_draws: given.max_draws.min(MOST_DRAWS),
        thin: given.thin.or(Some(THIN)),
        ..given.clone()
    };
    let outcome = sample::run_kept(
        &target,
        options.sampler,
        &start,
        &Regime {
            schedule: &schedule,
            stop: &patient_rule(&options.rule),
            monitor: &options.reporting(progress),
        },
        options.keeping.as_ref(),
    )?;
    progress.end();
    if outcome.draws.is_empty() {
        return Err(Error::limit("--time-limit", "time for draws").found("none"));
    }
    Ok((target, outcome))
}

/// The draws of one experiment's parameters.
fn part(target: &Joint, e: usize, draws: &Draws) -> Result<Draws> {
    let values = draws.points().flat_map(|x| target.own(e, x)).collect();
    let names = target.names_of(e).to_vec();
    let ensemble = draws.ensemble().to_vec();
    let mut part = Draws::new(names, ensemble, values, draws.lp().to_vec())?;
    part.info = draws.info.clone();
    Ok(part)
}

/// Some of the draws, evenly spread.
pub(super) fn some(draws: &Draws, count: usize) -> impl Iterator<Item = &[f64]> {
    let total = draws.chains() * draws.draws();
    let count = count.min(total);
    (0..count).map(move |k| {
        let place = k * total / count;
        draws.point(place / draws.draws(), place % draws.draws())
    })
}

impl Exact {
    /// Weigh draws by exact likelihoods.
    fn of(
        experiments: &[&dyn Observed],
        target: &Joint,
        (draws, verdict): (&Draws, &Verdict),
    ) -> Self {
        /// Draws that are weighed.
        const WEIGHED: usize = 1000;
        let points: Vec<&[f64]> = some(draws, WEIGHED).collect();
        let correction = |x: &&[f64]| -> f64 {
            let each = experiments.iter().enumerate();
            each.map(|(e, one)| one.correction(&target.own(e, x))).sum()
        };
        let corrections: Vec<f64> = points.par_iter().map(correction).collect();
        let weighed = weigh(&points, &corrections);
        let shifts = weighed.shifts.iter().zip(&verdict.rows);
        Self {
            draws: points.len(),
            effective: weighed.effective,
            shift_sd: shifts
                .map(|([shift, _], row)| shift.abs() / row.sd)
                .fold(0.0, f64::max),
        }
    }

    fn warning(&self) -> Option<String> {
        /// Shift of a mean, posterior sds, and effective share of the draws that are worth a word.
        const MOST: f64 = 0.3;
        const LEAST: f64 = 0.3;
        (self.shift_sd > MOST || self.effective < LEAST).then(|| {
            format!(
                "The likelihood that was sampled is not exact enough over the whole posterior: the exact one moves the means by up to {:.2} sd, \
                 and {:.0} % of the draws are effective. Measure more, or tighten the priors",
                self.shift_sd,
                100.0 * self.effective
            )
        })
    }
}

/// What experiments of which none is a field say over draws of them all.
///
/// # Errors
/// Those of the experiments; draws of other parameters.
pub fn sections(
    study: &Study,
    draws: &Draws,
    options: &Options<'_>,
) -> Result<Vec<ExperimentSection>> {
    let shared = study.shared();
    let observed = study.experiments.iter();
    let observed = observed.map(|e| e.observed(&shared, options, &crate::progress::Silent));
    let observed = observed.collect::<Result<Vec<_>>>()?;
    let members = observed.iter().map(|o| o.member(&shared)).collect();
    let target = Joint::new(shared.constants.clone(), members)?;
    if target.names() != draws.names() {
        let expected = format!("draws of {}", target.names().join(", "));
        return Err(Error::input("chain.zarr", expected).found(draws.names().join(", ")));
    }
    let each = observed.iter().enumerate();
    each.map(|(e, one)| one.section(&part(&target, e, draws)?))
        .collect()
}

/// The identifications of a study's fields by the draws of all experiments together, each with its place.
///
/// # Errors
/// Those of a finite-element solution.
pub fn identified(
    study: &Study,
    alone: Vec<Alone>,
    sampled: &SampledStudy,
    (options, progress): (&Options<'_>, &dyn Progress),
) -> Result<Vec<(usize, Identification)>> {
    let mut all = Vec::new();
    for (k, one) in alone.into_iter().enumerate() {
        let (Some(model), Some(found)) = (study.experiments[k].field(), one.observed.into_field())
        else {
            continue;
        };
        let draws = sampled.parts[k].clone();
        let again = redrawn(model, found, (draws, sampled.stopped), (options, progress))?;
        all.push((k, again));
    }
    Ok(all)
}
