//! The specimens of a campaign.

use std::collections::BTreeMap;
use std::path::Path;

use super::copies::copied;
use super::specimen::Specimen;
use crate::campaign::manifest::{CampaignManifest, ManifestEntry};
use crate::campaign::status::{CampaignPlaces, RunState};
use crate::error::{Error, Result};
use crate::field::Field;
use crate::files::Keyed;
use crate::infer::Model;
use crate::study::Study;

/// Specimens, and runs that are none, with the reason.
pub struct Gathered {
    pub name: String,
    pub specimens: Vec<Specimen>,
    pub left_out: Keyed<String>,
    /// What is to be said of how they were told apart.
    pub notes: Vec<String>,
}

/// The specimens of a campaign: its runs that are done, one of each measurement (see [`copied`] for what is one), without those to be `left_out`.
///
/// # Errors
/// The input's fault: a folder that is no campaign's, runs to leave out that it does not have, chains that cannot be read, and a measurement
/// that several runs share, where nothing says which of them to take.
pub fn gather(places: &CampaignPlaces, left_out: &[String]) -> Result<Gathered> {
    let manifest = CampaignManifest::in_folder(places)?;
    let known = |name: &String| manifest.runs.iter().any(|e| e.run.name == *name);
    if let Some(unknown) = left_out.iter().find(|n| !known(n)) {
        return Err(Error::input("--leave-out", "a run of the campaign").found(unknown));
    }
    let mut gathered = Gathered {
        name: manifest.name.clone(),
        specimens: Vec::new(),
        left_out: Keyed::new(),
        notes: Vec::new(),
    };
    let mut measured: BTreeMap<Vec<String>, &str> = BTreeMap::new();
    let mut fields: Vec<(&str, Vec<Field>)> = Vec::new();
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
        match read_fields(&folder) {
            Ok(own) => {
                if let Some((other, how)) = copy_of(&own, &fields) {
                    let reason = format!("the measurement of {other} once more: {how}");
                    gathered.left_out.insert(name.into(), reason);
                    continue;
                }
                fields.push((name, own));
            }
            Err(e) => gathered.notes.push(format!(
                "the measurement of {name} is not compared with the others: {e}"
            )),
        }
        gathered.specimens.push(Specimen::of_run(name, &folder)?);
    }
    Ok(gathered)
}

/// What a run measured: the field of every experiment that has one, of a series that of its reference step.
fn read_fields(folder: &Path) -> Result<Vec<Field>> {
    let study = Study::load(&folder.join("model.json"))?;
    let read = |model: &Model| match model.read_series()? {
        Some(series) => Ok(series.field),
        None => model.read_field(),
    };
    study.fields().map(|(_, model)| read(model)).collect()
}

/// The specimen that has a field of some run, and how it differs there.
fn copy_of<'a>(own: &[Field], others: &[(&'a str, Vec<Field>)]) -> Option<(&'a str, String)> {
    others.iter().find_map(|(name, theirs)| {
        let mut pairs = theirs.iter().flat_map(|a| own.iter().map(move |b| (a, b)));
        pairs.find_map(|(a, b)| Some((*name, copied(a, b)?)))
    })
}

fn no_specimen(entry: &ManifestEntry, left_out: &[String]) -> Option<String> {
    if left_out.contains(&entry.run.name) {
        return Some("left out as asked".into());
    }
    if entry.run.share.is_some() {
        return Some("a share of a calibration".into());
    }
    let state = entry.status.state;
    (state != RunState::Done).then(|| state.words().into())
}

/// What tells one measurement from another: the hashes of its data, or that of the model file in which they stand.
fn measurement(entry: &ManifestEntry) -> Vec<String> {
    let model = entry.run.model.display().to_string();
    let inputs = entry.run.inputs_sha256.iter();
    let data = inputs.clone().filter(|(file, _)| **file != model);
    let hashes: Vec<String> = data.map(|(_, hash)| hash.clone()).collect();
    match hashes.is_empty() {
        true => inputs.map(|(_, hash)| hash.clone()).collect(),
        false => hashes,
    }
}
