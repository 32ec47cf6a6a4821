//! `manifest.json`: every run of a campaign with its state, made from the runs' own files whenever something is to be said.

use serde::{Deserialize, Serialize};

use super::engine::Campaign;
use super::plan::Plan;
use super::run::Run;
use super::status::{CampaignPlaces, RunState, RunStatus};
use crate::error::{Error, Result};
use crate::files::{self, Keyed};

/// The schema of `manifest.json`.
pub const SCHEMA: &str = "plychain-campaign-manifest/1";

/// `manifest.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct CampaignManifest {
    pub schema: String,
    pub name: String,
    /// Of the program that wrote it.
    pub version: String,
    /// Runs in each state.
    pub counts: Keyed<usize>,
    pub runs: Vec<ManifestEntry>,
}

/// A run in the manifest.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ManifestEntry {
    #[serde(flatten)]
    pub run: Run,
    #[serde(flatten)]
    pub status: RunStatus,
}

impl CampaignManifest {
    /// How a campaign stands.
    pub fn of(plan: &Plan, places: &CampaignPlaces) -> Self {
        let entry = |run: &Run| ManifestEntry {
            status: places.state(run),
            run: run.clone(),
        };
        let mut manifest = Self {
            schema: SCHEMA.into(),
            name: plan.name.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            counts: Keyed::new(),
            runs: plan.runs.iter().map(entry).collect(),
        };
        let counts = RunState::ALL.map(|s| (s.words().replace(' ', "_"), manifest.count(s)));
        manifest.counts = counts.into();
        manifest
    }

    /// How the campaign in a folder stands.
    ///
    /// # Errors
    /// The input's fault: a folder that is no campaign's.
    pub fn in_folder(places: &CampaignPlaces) -> Result<Self> {
        let plan = Plan::load(&places.0)?.ok_or_else(|| {
            Error::input(places.0.display(), "the folder of a campaign").found("no plan.json in it")
        })?;
        Ok(Self::of(&plan, places))
    }

    pub fn count(&self, state: RunState) -> usize {
        self.runs.iter().filter(|e| e.status.state == state).count()
    }

    /// A line for every run: its state, the time that it took, how often it was begun, and why it is not done.
    pub fn lines(&self) -> String {
        let longest = self.runs.iter().map(|e| e.run.name.len()).max();
        let width = longest.unwrap_or(0);
        let mut text = String::new();
        for ManifestEntry { run, status } in &self.runs {
            let (name, state) = (&run.name, status.state.words());
            let cause = status.cause.as_deref().unwrap_or_default();
            let line = format!(
                "  {name:width$}  {state:13}  {:8.1} s  begun {} times  {cause}",
                status.seconds, status.attempts
            );
            text += line.trim_end();
            text.push('\n');
        }
        text
    }

    /// In words: how many runs are in which state, and why some are not done.
    pub fn text(&self) -> String {
        let counts = RunState::ALL.map(|s| (s, self.count(s)));
        let counts = counts.iter().filter(|(_, n)| *n > 0);
        let counts: Vec<String> = counts.map(|(s, n)| format!("{n} {}", s.words())).collect();
        let mut text = format!(
            "{}: {} runs: {}\n",
            self.name,
            self.runs.len(),
            counts.join(", ")
        );
        let failed = |e: &&ManifestEntry| matches!(e.status.state, RunState::Failed);
        for entry in self.runs.iter().filter(failed) {
            let cause = entry.status.cause.as_deref().unwrap_or("no cause noted");
            text += &format!("  {} failed: {cause}\n", entry.run.name);
        }
        text
    }
}

/// Write how a campaign stands into its folder, and return it.
///
/// # Errors
/// Of the input: a folder that cannot be written.
pub fn write(campaign: &Campaign) -> Result<CampaignManifest> {
    let places = &campaign.places;
    let _alone = places.alone()?;
    let manifest = CampaignManifest::of(&campaign.plan, places);
    files::write_json(&places.0.join("manifest.json"), &manifest)?;
    Ok(manifest)
}
