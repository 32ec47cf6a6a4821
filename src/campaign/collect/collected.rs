//! What all runs of a campaign found, gathered from their folders.

use indexmap::IndexSet;
use serde_json::{Value, json};

use super::outlying::{MOST_Z, mark};
use super::row::CampaignRow;
use crate::campaign::manifest::{CampaignManifest, ManifestEntry};
use crate::campaign::status::CampaignPlaces;
use crate::error::Result;

/// What all runs found.
#[derive(Debug)]
pub struct Collected {
    pub name: String,
    /// How the campaign stands, in words.
    pub standing: String,
    /// Names of the constants, in the order in which runs have them.
    pub constants: Vec<String>,
    pub rows: Vec<CampaignRow>,
}

impl Collected {
    /// Gather what the runs in a campaign's folder found; those that are not done have a line too.
    ///
    /// # Errors
    /// The input's fault: a folder that is no campaign's, a report that cannot be read.
    pub fn gather(places: &CampaignPlaces) -> Result<Self> {
        let manifest = CampaignManifest::in_folder(places)?;
        let row = |entry: &ManifestEntry| CampaignRow::of(entry, places);
        let mut rows: Vec<CampaignRow> = manifest.runs.iter().map(row).collect::<Result<_>>()?;
        let constants = rows.iter().flat_map(|r| r.constants.keys());
        let constants: IndexSet<String> = constants.cloned().collect();
        for name in &constants {
            mark(&mut rows, name);
        }
        Ok(Self {
            name: manifest.name.clone(),
            standing: manifest.text(),
            constants: constants.into_iter().collect(),
            rows,
        })
    }

    /// Runs with a constant that is unlike the others', with the constant and its robust z.
    pub fn outlying(&self) -> impl Iterator<Item = (&CampaignRow, &str, f64)> {
        self.rows.iter().flat_map(|row| {
            let all = row.constants.iter();
            let far = all.filter_map(|(name, c)| Some((name.as_str(), c.robust_z?)));
            far.filter(|(_, z)| z.abs() > MOST_Z)
                .map(move |(name, z)| (row, name, z))
        })
    }

    /// What all runs found, for programs.
    pub fn numbers(&self) -> Value {
        let of = |row: &CampaignRow| {
            json!({
                "run": row.entry.run.name, "state": row.entry.status.state.words(), "verdict": row.verdict, "effects": row.effects,
                "converged": row.converged, "warnings": row.warnings, "constants": row.constants,
            })
        };
        let runs: Vec<Value> = self.rows.iter().map(of).collect();
        json!({ "name": self.name, "runs": runs })
    }
}
