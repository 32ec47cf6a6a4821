//! One run of a campaign.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_with::skip_serializing_none;

use super::file::Verb;
use crate::files::Keyed;
use crate::report::manifest::hashes;

/// One run.
#[skip_serializing_none]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Names its folder, unless it is a share of something.
    pub name: String,
    pub verb: Verb,
    /// The model file that it reads: one in the campaign's folder where keys were set.
    pub model: PathBuf,
    pub data: Option<PathBuf>,
    pub seed: u64,
    /// Keys that were set in the model file.
    #[serde(default, skip_serializing_if = "Keyed::is_empty")]
    pub set: Keyed<Value>,
    /// Options of the verb.
    pub options: Vec<String>,
    /// Share K of N of a calibration, and the name of the folder that all shares have.
    pub share: Option<(String, [usize; 2])>,
    /// SHA-256 of every file that it reads.
    pub inputs_sha256: Keyed<String>,
}

impl Run {
    /// The name of its folder.
    pub fn folder(&self) -> &str {
        self.share.as_ref().map_or(&self.name, |(folder, _)| folder)
    }

    /// Arguments of the program that runs it in `folder`.
    pub fn arguments(&self, folder: &Path) -> Vec<String> {
        let mut all = self.whole(folder);
        match &self.share {
            None => all.push("--resume".into()),
            Some((_, [k, n])) => {
                let (k, n) = (k.to_string(), n.to_string());
                all.extend(["--task".into(), k, "--of".into(), n]);
            }
        }
        all.push("--quiet".into());
        all
    }

    /// The same of all shares, whose records it makes a table of.
    pub fn whole(&self, folder: &Path) -> Vec<String> {
        let mut all = vec![self.verb.name().into(), self.model.display().to_string()];
        if let Some(data) = &self.data {
            all.extend(["--data".into(), data.display().to_string()]);
        }
        all.extend(["--seed".into(), self.seed.to_string()]);
        all.extend(self.options.iter().cloned());
        all.extend(["--out".into(), folder.display().to_string()]);
        all
    }

    /// The first of its inputs that is no more what it was, if there is one.
    pub fn changed_input(&self) -> Option<String> {
        let differs = |(file, hash): (&String, &String)| {
            let now = hashes(std::iter::once(&PathBuf::from(file)));
            let same = now.is_ok_and(|now| now.values().eq(std::iter::once(hash)));
            (!same).then(|| file.clone())
        };
        self.inputs_sha256.iter().find_map(differs)
    }

    /// What of `other`, the same run as it is asked for now, differs.
    pub(super) fn difference(&self, other: &Self) -> Option<String> {
        if self == other {
            return None;
        }
        let files = self.inputs_sha256.iter();
        let changed = files
            .filter(|(file, hash)| other.inputs_sha256.get(*file) != Some(*hash))
            .map(|(file, _)| file.clone())
            .next();
        Some(changed.unwrap_or_else(|| "the campaign file, which defines the run".into()))
    }
}
