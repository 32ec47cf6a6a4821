//! What one run found.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::campaign::manifest::ManifestEntry;
use crate::campaign::status::{CampaignPlaces, RunState};
use crate::chain::check_stores;
use crate::error::Result;
use crate::files::Keyed;
use crate::report::Report;
use crate::report::json::{Versioned, load};
use crate::report::learned::Learned;
use crate::report::study;

/// A run in the table.
#[derive(Debug)]
pub struct CampaignRow {
    pub entry: ManifestEntry,
    pub verdict: String,
    /// Effects that were added.
    pub effects: Vec<String>,
    /// None of a run that is not done.
    pub converged: Option<bool>,
    pub warnings: Vec<String>,
    pub constants: Keyed<Found>,
}

/// A constant, in the unit of its name, with its 95 % interval.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Found {
    pub mean: f64,
    pub sd: f64,
    pub low: f64,
    pub high: f64,
    /// Distance from the other runs'; see [`super::robust_z`].
    #[serde(skip_deserializing)]
    pub robust_z: Option<f64>,
    /// What the data added to the prior, where the report says it.
    pub learned: Option<Learned>,
}

/// What is read of the report of a model of plates.
#[derive(Deserialize)]
struct Plates {
    posterior: Keyed<FoundOfPlates>,
    converged: bool,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
struct FoundOfPlates {
    #[serde(flatten)]
    found: Found,
    /// Of constants alone.
    variance_left: Option<f64>,
}

impl CampaignRow {
    /// # Errors
    /// The input's fault, with the file: a report that cannot be read.
    pub fn of(entry: &ManifestEntry, places: &CampaignPlaces) -> Result<Self> {
        let row = Self {
            entry: entry.clone(),
            verdict: String::new(),
            effects: Vec::new(),
            converged: None,
            warnings: Vec::new(),
            constants: Keyed::new(),
        };
        if entry.status.state != RunState::Done || entry.run.share.is_some() {
            return Ok(row);
        }
        let folder = places.run(&entry.run);
        let Versioned { schema } = load(&folder, "report.json")?;
        let mut row = match schema == study::SCHEMA {
            true => row.of_plates(load(&folder, "report.json")?),
            false => row.of_a_field(&folder),
        }?;
        if let Err(changed) = check_stores(&folder) {
            row.warnings.push(format!("chains: {changed}"));
            row.verdict = format!("{} (chains: {changed})", row.verdict);
        }
        Ok(row)
    }

    fn of_plates(mut self, plates: Plates) -> Result<Self> {
        self.converged = Some(plates.converged);
        self.warnings = plates.warnings;
        let all = plates.posterior.into_iter();
        let constants = all.filter(|(_, f)| f.variance_left.is_some());
        self.constants = constants.map(|(name, f)| (name, f.found)).collect();
        Ok(self)
    }

    /// The quoted constants of a loop, those of the round otherwise.
    fn of_a_field(mut self, folder: &Path) -> Result<Self> {
        let report = Report::load(folder)?;
        let Some(last) = report.last() else {
            return Ok(self);
        };
        self.converged = Some(report.rounds.iter().all(|r| r.convergence.converged));
        let doubts = report.rounds.first().into_iter().flat_map(|r| &r.doubts);
        self.warnings = doubts.chain(&last.warnings).cloned().collect();
        if let Some(closing) = &report.closing {
            self.verdict = closing.verdict.status.words().into();
            self.effects = closing.verdict.effects.clone();
        }
        let found = |name: &str| {
            let [mean, sd, low, high] = match (report.averaged(name), last.posterior.get(name)) {
                (Some(a), _) => [a.mean, a.sd, a.low, a.high],
                (None, Some(p)) => [p.mean, p.sd, p.low, p.high],
                (None, None) => return None,
            };
            let found = Found {
                mean,
                sd,
                low,
                high,
                robust_z: None,
                learned: report.learned.get(name).copied(),
            };
            Some((name.to_string(), found))
        };
        self.constants = last.constants().filter_map(found).collect();
        Ok(self)
    }
}
