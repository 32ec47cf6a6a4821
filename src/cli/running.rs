//! What `identify` and `loop` have in common: their arguments, and what is settled before the first draw.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::console::{Console, line};
use super::folder::{Folder, verb};
use super::samplers::SamplerOptions;
use super::{DEFAULT_MODEL, Global, print};
use crate::chain::{Draws, write_csv};
use crate::diagnose::{Rule, Verdict};
use crate::error::{Error, Result};
use crate::files::hex;
use crate::identify::Options;
use crate::identify::doubts::Doubting;
use crate::infer::Model;
use crate::progress::Progress;
use crate::report::Page;
use crate::report::manifest::{Manifest, hashes};
use crate::report::round::Convergence;
use crate::report::told::not_changed;
use crate::sample::{Keeping, Sampler, Schedule};
use crate::signals::on_termination;
use crate::study::Study;

/// Arguments of a run.
#[derive(Debug, Args)]
pub struct Running {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    model: PathBuf,
    /// Measured data in place of the model's: a folder of matrices, or a CSV file
    #[arg(long)]
    data: Option<PathBuf>,
    /// Run folder, which must not exist (default: the first free of runs/NAME, runs/NAME-2, ...)
    #[arg(long)]
    out: Option<PathBuf>,
    /// Continue the interrupted run in --out; the result is the same to the last bit
    #[arg(long, requires = "out")]
    resume: bool,
    #[command(flatten)]
    sampler: SamplerOptions,
    /// Exit with an error if the input is doubtful (before sampling), or if chains have not converged
    #[arg(long)]
    strict: bool,
    /// Write the draws as tables too: chain.csv beside each chain.zarr
    #[arg(long)]
    csv: bool,
    #[command(flatten)]
    limits: Limits,
}

/// A run before its first draw.
pub struct RunPlan {
    pub study: Study,
    /// Where everything is kept.
    pub folder: Folder,
    sampler: Box<dyn Sampler>,
    schedule: Schedule,
    rule: Rule,
    deadline: Option<Instant>,
    identity: Value,
    resume: bool,
    /// Whether draws are written as tables too, beside their stores.
    tables: bool,
    /// Whether doubts about the input, and chains that have not converged, are an error.
    strict: bool,
    /// Whether everything is printed.
    pub verbose: bool,
}

impl Running {
    /// The model file.
    pub fn model(&self) -> &Path {
        &self.model
    }

    /// Everything that can be refused is refused here.
    pub fn plan(&self, global: &Global) -> Result<RunPlan> {
        let study = Study::load_with(&self.model, self.data.as_ref())?;
        let study = study.settled()?;
        let data = hashes(study.files()?.iter())?;
        let file = study.json(false)?.to_string();
        let sampler = self.sampler.sampler()?;
        let mut schedule = Schedule {
            seed: global.seed,
            ..Schedule::default()
        };
        self.sampler.apply(&mut schedule)?;
        let mut rule = Rule::default();
        let deadline = self.limits.apply(&mut schedule, &mut rule)?;
        if let Some(said) = not_changed(&study.json(false)?).filter(|_| !global.quiet) {
            line(&format!("warning: {said}"));
        }
        let mut folder = Folder::open(self.out.as_deref(), study.name(), self.resume)?;
        if self.resume && folder.is_new() && !global.quiet {
            line("  there is nothing to go on with in --out: the run begins anew");
        }
        let data: Vec<String> = data.into_values().collect();
        let mut identity = identity_of((study.name(), &file, &data), &*sampler, &schedule);
        if let Some(chosen) = self.sampler.identity() {
            identity["sampling"] = chosen;
        }
        folder.begin(&identity)?;
        stoppable(folder.path())?;
        if let Some(before) = folder.interrupted().filter(|_| self.out.is_none()) {
            line(&format!(
                "  {} is a run that was interrupted: --out {} --resume goes on with it",
                before.display(),
                before.display()
            ));
        }
        Ok(RunPlan {
            study,
            folder,
            sampler,
            schedule,
            rule,
            deadline,
            identity,
            resume: self.resume,
            tables: self.csv,
            strict: self.strict,
            verbose: global.verbose,
        })
    }
}

impl RunPlan {
    pub fn seed(&self) -> u64 {
        self.schedule.seed
    }

    /// Write draws as `chain.csv` in a folder, where that is asked for.
    pub fn table(&self, draws: &Draws, place: &Path) -> Result<()> {
        match self.tables {
            true => write_csv(draws, &place.join("chain.csv")),
            false => Ok(()),
        }
    }

    /// How one identification is run whose chains are kept at `place`.
    pub fn options(&self, place: &Path) -> Options<'_> {
        Options {
            schedule: self.schedule.clone(),
            rule: self.rule,
            keeping: Some(Keeping::within(place, self.identity.clone(), self.resume)),
            deadline: self.deadline,
            ..Options::new(&*self.sampler)
        }
    }

    /// The same of the model as it was given, whose input is doubted; with `--strict` that ends the run.
    pub fn doubting(&self, place: &Path) -> Options<'_> {
        Options {
            doubting: match self.strict {
                true => Doubting::Refused,
                false => Doubting::Said,
            },
            ..self.options(place)
        }
    }

    /// Write the page of a run that is done, and keep the run's folder.
    ///
    /// # Errors
    /// Of the input: a folder that cannot be written; with `--strict`, chains that have not converged.
    pub fn finish<'a>(
        self,
        page: &Page,
        verdicts: impl IntoIterator<Item = &'a Verdict>,
        console: &Console,
    ) -> Result<()> {
        console.begin("report and figures", None);
        page.write(self.folder.path())?;
        console.end();
        written_to(self.folder.path())?;
        self.complete(&page.manifest, verdicts)
    }

    /// Write the manifest and keep the run's folder; an error if `--strict` asks for convergence and one of `verdicts` denies it.
    ///
    /// # Errors
    /// Of the input: a folder that cannot be written, chains that have not converged.
    pub fn complete<'a>(
        self,
        manifest: &Manifest,
        verdicts: impl IntoIterator<Item = &'a Verdict>,
    ) -> Result<()> {
        self.folder.write_json("run.json", manifest)?;
        self.folder.keep();
        let unsettled = verdicts.into_iter().find(|v| !v.converged);
        match unsettled {
            Some(verdict) if self.strict => Err(not_converged(&verdict.line())),
            _ => Ok(()),
        }
    }

    /// Whether the folder has the results of this same run: all of its files, the same arguments and the same input files. A run that is
    /// limited in time may be meant to go on.
    ///
    /// # Errors
    /// Of the input: files that cannot be read.
    pub fn is_done(&self) -> Result<bool> {
        let folder = self.folder.path();
        let known = Manifest::load(folder).ok();
        // of what has no field, the report does not say whether chains have converged
        let tells = !self.strict || self.study.fields().next().is_some();
        let whole = tells && folder.join("report.html").is_file();
        let Some(known) = known.filter(|_| self.resume && whole && self.deadline.is_none()) else {
            return Ok(false);
        };
        let asked = |arguments: &[String]| -> Vec<String> {
            const NO_MATTER: [&str; 5] = ["--resume", "--strict", "--timings", "--quiet", "-q"];
            let all = arguments
                .iter()
                .filter(|a| !NO_MATTER.contains(&a.as_str()));
            all.cloned().collect()
        };
        let own: Vec<String> = std::env::args().skip(1).collect();
        let files = self.study.files()?;
        let now = hashes(std::iter::once(&self.study.path).chain(&files))?;
        let same = |hash: &String| known.inputs_sha256.values().any(|h| h == hash);
        Ok(known.version == env!("CARGO_PKG_VERSION")
            && asked(&known.command) == asked(&own)
            && now.values().all(same))
    }

    /// End a run that [is done](Self::is_done), of these reports; an error if `--strict` asks for convergence and one denies it.
    ///
    /// # Errors
    /// Of the input: chains that have not converged.
    pub fn done<'a>(self, rounds: impl IntoIterator<Item = &'a Convergence>) -> Result<()> {
        let path = self.folder.path().display();
        print(&format!("done before: {path}; open {path}/report.html\n"))?;
        let unsettled = rounds.into_iter().find(|c| !c.converged);
        match unsettled {
            Some(convergence) if self.strict => Err(not_converged(&convergence.text)),
            _ => Ok(()),
        }
    }
}

/// Say where the report is.
pub(super) fn written_to(folder: &Path) -> Result<()> {
    let path = folder.display();
    print(&format!("written to {path}; open {path}/report.html\n"))
}

pub(super) fn not_converged(found: &str) -> Error {
    let error = Error::input("--strict", "converged chains").found(found);
    error.hint("run longer")
}

/// When sampling ends.
#[derive(Debug, Args)]
pub(super) struct Limits {
    /// Maximum number of draws, all chains together
    #[arg(long, value_name = "N")]
    max_draws: Option<usize>,
    /// Minimum effective sample size of every parameter, bulk and tail (default: 100 per ensemble)
    #[arg(long, value_name = "N")]
    min_ess: Option<f64>,
    /// Maximum time, seconds. Sampling stops then, and a loop ends with the effects that it has added
    #[arg(long, value_name = "SECONDS")]
    time_limit: Option<f64>,
}

impl Limits {
    /// Put the limits into a schedule and a rule; when to stop in any case.
    pub(super) fn apply(
        &self,
        schedule: &mut Schedule,
        rule: &mut Rule,
    ) -> Result<Option<Instant>> {
        if let Some(most) = self.max_draws {
            if most == 0 {
                return Err(Error::input("--max-draws", "a number above 0").found(most));
            }
            schedule.max_draws = most;
        }
        if let Some(ess) = self.min_ess {
            if !(ess > 0.0 && ess.is_finite()) {
                return Err(Error::input("--min-ess", "a number above 0").found(ess));
            }
            rule.ess = ess / schedule.ensembles as f64;
        }
        let Some(seconds) = self.time_limit else {
            return Ok(None);
        };
        let end = Instant::now().checked_add(duration("--time-limit", seconds)?);
        end.map(Some)
            .ok_or_else(|| not_seconds("--time-limit", seconds))
    }
}

/// A name and its range, of `NAME=LOW:HIGH`; none where the text is not of this form.
pub(super) fn named_range(text: &str) -> Option<(&str, [f64; 2])> {
    let (name, range) = text.split_once('=')?;
    let (low, high) = range.split_once(':')?;
    let number = |text: &str| text.trim().parse().ok();
    Some((name.trim(), [number(low)?, number(high)?]))
}

/// A time that is stated in seconds.
pub(super) fn duration(option: &str, seconds: f64) -> Result<Duration> {
    let duration = Duration::try_from_secs_f64(seconds).ok();
    let duration = duration.filter(|d| !d.is_zero());
    duration.ok_or_else(|| not_seconds(option, seconds))
}

fn not_seconds(option: &str, seconds: f64) -> Error {
    Error::input(option, "a number of seconds above 0").found(seconds)
}

/// What SIGTERM ends from now on is gone on with from its last checkpoint, which is about a second old: files are written so that a process
/// may end at any moment.
pub(super) fn stoppable(folder: &Path) -> Result<()> {
    let stopped = Error::stopped(folder.display(), "a run that comes to its end")
        .found("SIGTERM")
        .hint("the same command with --out and --resume goes on from the last checkpoint");
    on_termination(move || {
        line(&format!("error: {stopped}"));
        line(&format!(
            "hint: {}",
            stopped.hint_text().unwrap_or_default()
        ));
        std::process::exit(i32::from(stopped.exit_code()))
    })
}

/// What a resumed run must share with the one that was interrupted.
pub fn identity(model: &Model, sampler: &dyn Sampler, schedule: &Schedule) -> Result<Value> {
    let data = hashes(model.measurement_files()?.iter())?;
    let data: Vec<String> = data.into_values().collect();
    let file = model.file.to_json()?.to_string();
    Ok(identity_of(
        (&model.file.name, &file, &data),
        sampler,
        schedule,
    ))
}

fn identity_of(
    (name, file, data): (&str, &str, &[String]),
    sampler: &dyn Sampler,
    schedule: &Schedule,
) -> Value {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let verb = verb(arguments.iter().map(String::as_str));
    json!({
        "verb": verb,
        "version": env!("CARGO_PKG_VERSION"),
        "model": name,
        "model_sha256": hex(&Sha256::digest(file)),
        "data_sha256": data,
        "seed": schedule.seed,
        "sampler": sampler.name(),
        "ensembles": schedule.ensembles,
    })
}
