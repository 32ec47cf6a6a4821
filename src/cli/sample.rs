//! `plychain sample`: the log density of any program, over HTTP.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::console::{Console, line};
use super::folder::Folder;
use super::running::{Limits, duration, named_range, not_converged, stoppable};
use super::samplers::{MOVES_HELP, SamplerOptions};
use super::{Global, print};
use crate::bridge::{Patience, RemoteDensity};
use crate::diagnose::{Row, Rule, Verdict, diagnose};
use crate::error::{Error, Result};
use crate::files::Keyed;
use crate::identify::Reporting;
use crate::numeric::diagonal;
use crate::progress::Progress;
use crate::report::chains;
use crate::sample::{Keeping, Regime, Schedule, Start, Stream, run_kept};
use crate::section::terminal;

/// Arguments of `sample`.
#[derive(Debug, Args)]
#[command(after_help = format!("{MOVES_HELP}

Examples:
  plychain sample --url http://localhost:4242 --model posterior --box a=0:1,b=-5:5
  plychain sample --url http://localhost:4242 --model likelihood --prior prior.json --out runs/beam
  plychain sample --url http://localhost:4242 --model likelihood --prior prior.json --out runs/beam --resume
where prior.json is {{ \"a\": {{ \"uniform\": [0, 1] }}, \"b\": {{ \"normal\": {{ \"mean\": 0, \"sd\": 5 }} }} }}"))]
pub struct SampleArguments {
    /// Where the program is served, in the UM-Bridge protocol: http://localhost:4242
    #[arg(long)]
    url: String,
    /// Name of the model on that server: a log density, of one list of numbers
    #[arg(long)]
    model: String,
    /// Parameters in the model's order, each with the interval that walkers start in
    #[arg(
        long = "box",
        value_name = "NAME=LOW:HIGH,...",
        conflicts_with = "prior",
        required_unless_present = "prior"
    )]
    start: Option<String>,
    /// The density is zero outside of the box
    #[arg(long, requires = "start")]
    bounded: bool,
    /// File of priors, which are added to the model's log density; walkers start in them
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// What the model is configured by, as JSON
    #[arg(long, value_name = "JSON", default_value = "{}")]
    config: String,
    /// Requests at a time
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=1024))]
    parallel: u16,
    /// Seconds to wait for one answer
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0)]
    timeout: f64,
    /// Seconds to ask a server again that does not answer
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    patience: f64,
    /// Run folder, which must not exist (default: the first free of runs/MODEL, runs/MODEL-2, ...)
    #[arg(long)]
    out: Option<PathBuf>,
    /// Go on with the run in --out where it was interrupted, to the same bits
    #[arg(long, requires = "out")]
    resume: bool,
    /// Exit with an error if chains have not converged
    #[arg(long)]
    strict: bool,
    #[command(flatten)]
    sampler: SamplerOptions,
    #[command(flatten)]
    limits: Limits,
}

impl SampleArguments {
    fn priors(&self) -> Result<Keyed<ParameterPrior>> {
        let priors = match (&self.start, &self.prior) {
            (Some(text), _) => read_box(text)?,
            (None, Some(path)) => read_priors(path)?,
            (None, None) => Keyed::new(),
        };
        let mut each = priors.iter();
        each.try_for_each(|(name, prior)| prior.check(name))?;
        Ok(priors)
    }

    fn patience(&self) -> Result<Patience> {
        Ok(Patience {
            answer: duration("--timeout", self.timeout)?,
            silence: duration("--patience", self.patience)?,
            requests: usize::from(self.parallel),
        })
    }
}

/// What is known of a parameter before it is sampled.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
enum ParameterPrior {
    Normal { mean: f64, sd: f64 },
    Uniform([f64; 2]),
}

impl ParameterPrior {
    fn check(&self, name: &str) -> Result<()> {
        let sound = match *self {
            Self::Normal { mean, sd } => mean.is_finite() && sd > 0.0 && sd.is_finite(),
            Self::Uniform([low, high]) => low < high && (high - low).is_finite(),
        };
        match sound {
            true => Ok(()),
            false => Err(Error::input(
                name,
                "a normal with an sd above 0, or a uniform with low < high",
            )
            .found(format!("{self:?}"))),
        }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        match *self {
            Self::Normal { mean, sd } => mean + sd * rng.normal(),
            Self::Uniform([low, high]) => low + (high - low) * rng.uniform(),
        }
    }

    fn variance(&self) -> f64 {
        match *self {
            Self::Normal { sd, .. } => sd * sd,
            Self::Uniform([low, high]) => (high - low).powi(2) / 12.0,
        }
    }

    fn log_density(&self, x: f64) -> f64 {
        match *self {
            Self::Normal { mean, sd } => {
                -0.5 * ((x - mean) / sd).powi(2) - sd.ln() - 0.5 * (2.0 * PI).ln()
            }
            Self::Uniform([low, high]) if (low..=high).contains(&x) => -(high - low).ln(),
            Self::Uniform(_) => f64::NEG_INFINITY,
        }
    }
}

/// Reads `a=0:1,b=-5:5`.
fn read_box(text: &str) -> Result<Keyed<ParameterPrior>> {
    let mut all = Keyed::new();
    for item in text.split(',').map(str::trim) {
        let Some((name, sides)) = named_range(item).filter(|(name, _)| !name.is_empty()) else {
            return Err(Error::input("--box", "NAME=LOW:HIGH for each parameter").found(item));
        };
        if all
            .insert(name.to_string(), ParameterPrior::Uniform(sides))
            .is_some()
        {
            return Err(Error::input("--box", "each name once").found(name));
        }
    }
    Ok(all)
}

fn read_priors(path: &Path) -> Result<Keyed<ParameterPrior>> {
    let place = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::input(place, "a readable file of priors").found(e))?;
    let expected =
        "{ \"NAME\": { \"normal\": { \"mean\": 0, \"sd\": 1 } } } or { \"uniform\": [0, 1] }";
    serde_json::from_str(&text).map_err(|e| Error::input(path.display(), expected).found(e))
}

/// What a resumed run must share with the one that was interrupted.
fn identity(
    arguments: &SampleArguments,
    schedule: &Schedule,
    priors: &Keyed<ParameterPrior>,
) -> Value {
    json!({
        "verb": "sample",
        "version": env!("CARGO_PKG_VERSION"),
        "model": arguments.model,
        "config": arguments.config,
        "priors": priors,
        "bounded": arguments.bounded,
        "added": arguments.prior.is_some(),
        "seed": schedule.seed,
        "sampling": format!("{:?}", arguments.sampler),
    })
}

pub fn run(arguments: &SampleArguments, global: &Global, console: &Console) -> Result<()> {
    let priors = arguments.priors()?;
    let config: Value = serde_json::from_str(&arguments.config)
        .map_err(|e| Error::input("--config", "JSON").found(e))?;
    let patience = arguments.patience()?;
    let sampler = arguments.sampler.sampler()?;
    let mut schedule = Schedule {
        seed: global.seed,
        ..Schedule::default()
    };
    arguments.sampler.apply(&mut schedule)?;
    let mut rule = Rule::default();
    let deadline = arguments.limits.apply(&mut schedule, &mut rule)?;
    let known: Vec<ParameterPrior> = priors.values().copied().collect();
    let counts = arguments.bounded || arguments.prior.is_some();
    let log_prior = |x: &[f64]| match counts {
        true => known
            .iter()
            .zip(x)
            .map(|(p, x)| p.log_density(*x))
            .sum::<f64>(),
        false => 0.0,
    };
    let names: Vec<String> = priors.keys().cloned().collect();
    let place = (&*arguments.url, &*arguments.model);
    let target = RemoteDensity::connect(place, names, config, patience, &log_prior)?;
    let mut folder = Folder::open(arguments.out.as_deref(), &arguments.model, arguments.resume)?;
    let identity = identity(arguments, &schedule, &priors);
    folder.begin(&identity)?;
    stoppable(folder.path())?;
    let covariance = diagonal(known.iter().map(ParameterPrior::variance));
    let start = Start::Walkers {
        place: &|_, _, rng| known.iter().map(|p| p.draw(rng)).collect(),
        covariance: &covariance,
    };
    let keeping = Keeping::within(folder.path(), identity, arguments.resume);
    console.begin(
        &format!("sampling {} at {}", arguments.model, arguments.url),
        None,
    );
    let regime = Regime {
        schedule: &schedule,
        stop: &rule,
        monitor: &Reporting {
            progress: console,
            deadline,
        },
    };
    let outcome = run_kept(&target, &*sampler, &start, &regime, Some(&keeping));
    console.end();
    let outcome = outcome?;
    let verdict = diagnose(&outcome.draws, &rule);
    print(&terminal(&[chains::section(&verdict)]))?;
    if outcome.draws.info.nan > 0 {
        line(&format!(
            "  {} evaluations gave no number",
            outcome.draws.info.nan
        ));
    }
    if sampler.walkers(known.len()) == 1 {
        far_modes(&known, &verdict)
            .iter()
            .for_each(|said| line(said));
    }
    let manifest = folder.manifest(arguments.prior.as_ref(), &[], global.seed, console.costs())?;
    folder.write_json("run.json", &manifest)?;
    print(&format!("written to {}\n", folder.path().display()))?;
    folder.keep();
    match verdict.converged || !arguments.strict {
        true => Ok(()),
        false => Err(not_converged(&verdict.line())),
    }
}

/// Chains that walk alone may all have ended in one of several modes, where they began over much more than that one.
fn far_modes(starts: &[ParameterPrior], verdict: &Verdict) -> Option<String> {
    let over = |(start, row): (&ParameterPrior, &Row)| start.variance().sqrt() / row.sd;
    let widest = starts
        .iter()
        .zip(&verdict.rows)
        .map(over)
        .fold(0.0, f64::max);
    (verdict.converged && widest > NARROW).then(|| {
        format!(
            "  The chains started over an interval {widest:.0} times as wide as their result. Another mode, far away, can be missed. Check it with --sampler ensemble --move de:0.9,stretch:0.1."
        )
    })
}

/// A result narrower than its start by this factor may be one mode of several.
const NARROW: f64 = 20.0;
