//! The specimens of a campaign.

use std::collections::BTreeMap;

use super::specimen::Specimen;
use crate::campaign::manifest::{CampaignManifest, Entry};
use crate::campaign::status::{Places, State};
use crate::error::{Error, Result};
use crate::files::Keyed;

/// Specimens, and runs that are none, with the reason.
pub struct Gathered {
    pub name: String,
    pub specimens: Vec<Specimen>,
    pub left_out: Keyed<String>,
}

/// The specimens of a campaign: its runs that are done, one of each measurement, without those to be `left_out`.
///
/// # Errors
/// The input's fault: a folder that is no campaign's, runs to leave out that it does not have, chains that cannot be read, and a measurement
/// that several runs share, where nothing says which of them to take.
pub fn gather(places: &Places, left_out: &[String]) -> Result<Gathered> {
    let manifest = CampaignManifest::in_folder(places)?;
    let known = |name: &String| manifest.runs.iter().any(|e| e.run.name == *name);
    if let Some(unknown) = left_out.iter().find(|n| !known(n)) {
        return Err(Error::input("--leave-out", "a run of the campaign").found(unknown));
    }
    let mut gathered = Gathered {
        name: manifest.name.clone(),
        specimens: Vec::new(),
        left_out: Keyed::new(),
    };
    let mut measured: BTreeMap<Vec<String>, &str> = BTreeMap::new();
    for entry in &manifest.runs {
        let name = entry.run.name.as_str();
        if let Some(reason) = no_specimen(entry, left_out) {
            gathered.left_out.insert(name.into(), reason);
            continue;
        }
        if let Some(other) = measured.insert(measurement(entry), name) {
            return Err(Error::input(places.0.display(), "one run a specimen")
                .found(format!("{other} and {name}, of the same measurement"))
                .hint("--leave-out all but one of them: a specimen counts once"));
        }
        let folder = places.run(&entry.run);
        gathered.specimens.push(Specimen::of_run(name, &folder)?);
    }
    Ok(gathered)
}

fn no_specimen(entry: &Entry, left_out: &[String]) -> Option<String> {
    if left_out.contains(&entry.run.name) {
        return Some("left out as asked".into());
    }
    if entry.run.share.is_some() {
        return Some("a share of a calibration".into());
    }
    let state = entry.status.state;
    (state != State::Done).then(|| state.words().into())
}

/// What tells one measurement from another: the hashes of its data, or that of the model file in which they stand.
fn measurement(entry: &Entry) -> Vec<String> {
    let model = entry.run.model.display().to_string();
    let inputs = entry.run.inputs_sha256.iter();
    let data = inputs.clone().filter(|(file, _)| **file != model);
    let hashes: Vec<String> = data.map(|(_, hash)| hash.clone()).collect();
    match hashes.is_empty() {
        true => inputs.map(|(_, hash)| hash.clone()).collect(),
        false => hashes,
    }
}
