//! What is settled before a campaign's first run: its folder, its plan, and what became of its inputs since.

use std::path::{Path, PathBuf};

use super::engine::{Campaign, Resources};
use super::file::CampaignFile;
use super::plan::Plan;
use super::run::Run;
use super::status::{CampaignPlaces, RunState};
use crate::error::{Error, Result};
use crate::files::{absolute, make_folder};

/// What a campaign's folder always has.
const FOLDERS: [&str; 3] = ["runs", "status", "log"];

/// How a campaign is asked for.
#[derive(Debug)]
pub struct Asked {
    pub file: PathBuf,
    /// Its folder.
    pub out: PathBuf,
    pub resume: bool,
    /// Run those again whose inputs changed.
    pub rerun_changed: bool,
    pub retry: bool,
    /// Say what would be run, and leave nothing behind.
    pub dry_run: bool,
    /// Share K of N, which goes on with what it finds.
    pub share: Option<[usize; 2]>,
    /// Seed of runs that name none.
    pub seed: u64,
    pub resources: Resources,
}

/// The name in a campaign file, which names its folder.
///
/// # Errors
/// Those of the file.
pub fn name_of(file: &Path) -> Result<String> {
    CampaignFile::load(file).map(|file| file.name)
}

/// Make the folder and the plan, or take up those that are there. Nothing is run; a dry run makes nothing that stays.
///
/// # Errors
/// The input's fault: a folder that is there and not to be gone on with, inputs that changed, what a plan is refused for.
pub fn settle(asked: &Asked) -> Result<Campaign> {
    let places = CampaignPlaces(absolute(&asked.out)?);
    let known = Plan::load(&places.0)?;
    check_folder(asked, &places, known.is_some())?;
    let plan = match asked.dry_run {
        true => rehearsed(asked, &places, known)?,
        false => {
            for folder in FOLDERS {
                make_folder(&places.0.join(folder))?;
            }
            planned(asked, &places).inspect_err(|_| tidy(&places))?
        }
    };
    Ok(Campaign {
        file: absolute(&asked.file)?,
        places,
        plan,
        resources: asked.resources.clone(),
        retry: asked.retry,
        share: asked.share,
    })
}

/// The plan as it would be. Models with keys set are read, so they are written for a moment where nobody looks.
fn rehearsed(asked: &Asked, places: &CampaignPlaces, known: Option<Plan>) -> Result<Plan> {
    if let Some(known) = known.clone().filter(|_| asked.share.is_some()) {
        return Ok(known);
    }
    let scratch = std::env::temp_dir().join(format!("plychain-dry-run-{}", std::process::id()));
    let plan = Plan::make(&asked.file, &scratch, asked.seed);
    // what stays of it is the system's to clear
    let _ = std::fs::remove_dir_all(&scratch);
    let plan = plan?.moved(&scratch, &places.0);
    if let Some(known) = &known {
        changes(asked, places, &plan, known)?;
    }
    Ok(plan)
}

/// The plan that is there, if it still holds, or else a new one.
fn planned(asked: &Asked, places: &CampaignPlaces) -> Result<Plan> {
    let _alone = places.alone()?;
    // another share may have made it meanwhile
    let known = Plan::load(&places.0)?;
    match known {
        // a share takes the plan as it is: many of them begin at one moment
        Some(plan) if asked.share.is_some() => Ok(plan),
        known => {
            let plan = Plan::make(&asked.file, &places.0, asked.seed)?;
            if let Some(known) = &known {
                changes(asked, places, &plan, known)?;
            }
            if known.as_ref() != Some(&plan) {
                plan.write(&places.0)?;
            }
            Ok(plan)
        }
    }
}

/// A campaign that never had a plan leaves nothing behind: folders go that are empty.
fn tidy(places: &CampaignPlaces) {
    if places.0.join("plan.json").exists() {
        return;
    }
    // what stays is in nobody's way, and the error that led here is what counts
    let _ = std::fs::remove_file(places.0.join("campaign.lock"));
    for folder in FOLDERS {
        let _ = std::fs::remove_dir(places.0.join(folder));
    }
    let _ = std::fs::remove_dir(&places.0);
}

fn check_folder(asked: &Asked, places: &CampaignPlaces, is_ours: bool) -> Result<()> {
    let path = &places.0;
    let wanted = |expected: &str| {
        Error::input(
            format!("--out {}", asked.out.display()),
            expected.to_string(),
        )
    };
    if is_ours {
        return match asked.resume || asked.share.is_some() {
            true => Ok(()),
            false => Err(wanted("a folder that does not exist yet")
                .found("that of a campaign")
                .hint("--resume goes on with it, and runs what is missing only")),
        };
    }
    let mut entries = std::fs::read_dir(path).into_iter().flatten().flatten();
    // a campaign that was killed before it had a plan has made these
    let made = |name: &std::ffi::OsStr| {
        const OTHERS: [&str; 4] = ["models", "slurm", "campaign.lock", "submit.lock"];
        let plan = name.to_string_lossy();
        // another that goes on at the same moment may have made the plan meanwhile
        let is_plan = plan.starts_with("plan.json") && (asked.resume || plan != "plan.json");
        FOLDERS.iter().chain(&OTHERS).any(|n| name == *n) || is_plan
    };
    match entries.any(|e| !made(&e.file_name())) {
        true => Err(wanted("an empty folder, or one that does not exist yet")
            .found("one with other files")
            .hint("nothing was changed")),
        false => Ok(()),
    }
}

/// Runs that were begun and are no more what they were: an error, or, if they are to be run again, put aside.
fn changes(asked: &Asked, places: &CampaignPlaces, plan: &Plan, known: &Plan) -> Result<()> {
    for (run, what) in plan.changed_since(known) {
        if places.state(run).state == RunState::Waiting {
            continue;
        }
        if !asked.rerun_changed {
            return Err(
                Error::input(what, format!("what run {} was begun with", run.name))
                    .found("something else")
                    .hint("--rerun-changed runs it again and keeps what there was in replaced/"),
            );
        }
        if !asked.dry_run {
            put_aside(places, run)?;
        }
    }
    Ok(())
}

/// Move what there is of a run to the next free `replaced/NAME-K`.
fn put_aside(places: &CampaignPlaces, run: &Run) -> Result<()> {
    let name = &run.name;
    let Some(lock) = places.take(name)? else {
        return Err(Error::input(name, "a run that ended").found("one that is running"));
    };
    let folder = places.0.join("replaced");
    make_folder(&folder)?;
    let free = (1..).map(|k| folder.join(format!("{}-{k}", run.folder())));
    let free = free.into_iter().find(|p| !p.exists()).unwrap_or_default();
    let run = places.run(run);
    let failed = |e| Error::input(run.display(), "a folder that can be moved").found(e);
    if run.exists() {
        std::fs::rename(&run, free).map_err(failed)?;
    }
    match std::fs::remove_file(places.status(name)) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(failed(e)),
        _ => {
            drop(lock);
            Ok(())
        }
    }
}
