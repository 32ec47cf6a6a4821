//! What the figures of a round are drawn from beside `report.json`. Each figure has a file `figures/NAME-K.json`, in which every table is
//! an object of columns; `null` is a missing value.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::columns;
use crate::error::{Error, Result};
use crate::files;
use crate::report::json::{load, or_nan};

/// The tables of one round.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FigureData {
    /// Means over cells of the field, row by row from the lowest y.
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<MapCell>,
    /// What is left of each step of a series, at the blocks of the field.
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<StepCell>,
    /// The stiffness that would make what grows with the load of a series, where that is called for.
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub stiffness: Vec<StiffnessCell>,
    /// The mesh of another program with edges and points; that of the first round alone.
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub mesh: Vec<MeshPoint>,
    /// Posterior summary, prior, cut and truth of each parameter.
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<ParameterLine>,
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub marginals: Vec<MarginalBin>,
    /// Joint densities of each pair of parameters; where there is next to none, bins are left out.
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub corner: Vec<JointBin>,
    /// One chain of each ensemble, thinned.
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub trace: Vec<TracePoint>,
    /// Ranks of each ensemble's draws among all draws (Vehtari et al. 2021).
    #[serde(with = "columns", skip_serializing_if = "Vec::is_empty")]
    pub rank: Vec<RankBin>,
}

/// The tables of each figure.
const FIGURES: [(&str, &[&str]); 7] = [
    ("maps", &["maps"]),
    ("steps", &["steps"]),
    ("stiffness", &["stiffness"]),
    ("mesh", &["mesh"]),
    ("corner", &["parameters", "marginals", "corner"]),
    ("trace", &["trace"]),
    ("rank", &["rank"]),
];

/// Significant digits of a figure's numbers: more than any figure shows, and less room than all.
const DIGITS: usize = 7;

/// A number with [`DIGITS`] significant digits.
fn rounded(value: &mut Value) {
    match value {
        Value::Array(all) => all.iter_mut().for_each(rounded),
        Value::Object(all) => all.values_mut().for_each(rounded),
        Value::Number(number) if number.is_f64() => {
            let digits = number.as_f64().map(|x| format!("{x:.*e}", DIGITS - 1));
            let near = digits.and_then(|text| text.parse::<f64>().ok());
            *value = near.map_or(Value::Null, Value::from);
        }
        _ => {}
    }
}

impl FigureData {
    /// The same with rounded numbers, as files have them: a report made again from its files has the same figures.
    #[must_use]
    pub fn rounded(self) -> Self {
        let again = || {
            let mut all = serde_json::to_value(&self).ok()?;
            rounded(&mut all);
            serde_json::from_value(all).ok()
        };
        again().unwrap_or(self)
    }

    /// Write the tables of round `k`, or of another name, into the folder of figures.
    ///
    /// # Errors
    /// The input's fault if a file cannot be written.
    pub fn write(&self, folder: &Path, k: &str) -> Result<()> {
        let failed = |e| Error::program("figures", "numbers that JSON can hold").found(e);
        let mut all: Map<String, Value> = serde_json::to_value(self)
            .and_then(serde_json::from_value)
            .map_err(failed)?;
        for (figure, tables) in FIGURES {
            let own = tables.iter().filter_map(|name| all.remove_entry(*name));
            let own: Map<String, Value> = own.collect();
            if !own.is_empty() {
                write(folder, &format!("{figure}-{k}"), &Value::Object(own))?;
            }
        }
        Ok(())
    }

    /// The tables of round `k`, or of another name; without rows where there is no file.
    ///
    /// # Errors
    /// The input's fault, with the file, if one cannot be read.
    pub fn read(folder: &Path, k: &str) -> Result<Self> {
        let mut all = Map::new();
        for (figure, _) in FIGURES {
            let name = format!("{figure}-{k}.json");
            if folder.join(&name).exists() {
                all.extend(load::<Map<String, Value>>(folder, &name)?);
            }
        }
        serde_json::from_value(Value::Object(all)).map_err(|e| {
            let place = folder.join(format!("*-{k}.json"));
            Error::input(place.display(), "the numbers of a run's figures").found(e)
        })
    }
}

/// Write the numbers of a figure.
///
/// # Errors
/// The input's fault if the file cannot be written.
pub fn write(folder: &Path, figure: &str, numbers: &Value) -> Result<()> {
    files::replace(
        &folder.join(format!("{figure}.json")),
        numbers.to_string() + "\n",
    )
}

/// One cell of the maps, in the data's frame.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct MapCell {
    pub x_mm: f64,
    pub y_mm: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u1_measured_um: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u1_predicted_um: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u1_residual_nm: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u2_measured_um: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u2_predicted_um: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u2_residual_nm: f64,
}

/// One block of one step, in the data's frame.
#[derive(Debug, Serialize, Deserialize)]
pub struct StepCell {
    pub step: String,
    pub x_mm: f64,
    pub y_mm: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u1_residual_nm: f64,
    #[serde(deserialize_with = "or_nan")]
    pub u2_residual_nm: f64,
}

/// What a line of the picture of a mesh is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MeshPart {
    /// Sides between elements.
    Element,
    /// A side of one element.
    Boundary,
    /// A side between elements of different stacks.
    Joint,
    /// A part of a named edge.
    Edge,
    /// From the middle of a named edge along the force on it.
    Force,
    /// A point of a named edge that is held.
    Held,
    /// A measured point on the mesh.
    On,
    /// A measured point off the mesh.
    Off,
}

/// A point of a line of the picture of a mesh, in the data's frame.
#[derive(Debug, Serialize, Deserialize)]
pub struct MeshPoint {
    pub part: MeshPart,
    /// The edge's name.
    pub name: String,
    /// Number of the line.
    pub line: usize,
    pub x_mm: f64,
    pub y_mm: f64,
}

/// The relative change of the membrane stiffness at a block, percent, and its sd.
#[derive(Debug, Serialize, Deserialize)]
pub struct StiffnessCell {
    pub x_mm: f64,
    pub y_mm: f64,
    pub change_percent: f64,
    pub sd_percent: f64,
}

/// One sampled parameter, border units.
#[derive(Debug, Serialize, Deserialize)]
pub struct ParameterLine {
    pub parameter: String,
    pub mean: f64,
    pub sd: f64,
    #[serde(rename = "q2.5")]
    pub low: f64,
    pub median: f64,
    #[serde(rename = "q97.5")]
    pub high: f64,
    #[serde(deserialize_with = "or_nan")]
    pub prior_mean: f64,
    #[serde(deserialize_with = "or_nan")]
    pub prior_sd: f64,
    #[serde(deserialize_with = "or_nan")]
    pub cut_low: f64,
    #[serde(deserialize_with = "or_nan")]
    pub cut_high: f64,
    #[serde(deserialize_with = "or_nan")]
    pub truth: f64,
}

/// One bin of a marginal density.
#[derive(Debug, Serialize, Deserialize)]
pub struct MarginalBin {
    pub parameter: String,
    pub value: f64,
    pub density: f64,
}

/// One bin of a joint density, relative to the largest.
#[derive(Debug, Serialize, Deserialize)]
pub struct JointBin {
    pub first: String,
    pub second: String,
    pub x: f64,
    pub y: f64,
    pub relative_density: f64,
}

/// One draw of a trace.
#[derive(Debug, Serialize, Deserialize)]
pub struct TracePoint {
    pub parameter: String,
    pub ensemble: usize,
    pub draw: usize,
    pub value: f64,
}

/// One twentieth of the ranks: the share of an ensemble's draws in it, 1 where it is as expected.
#[derive(Debug, Serialize, Deserialize)]
pub struct RankBin {
    pub parameter: String,
    pub ensemble: usize,
    pub bin: usize,
    pub relative_count: f64,
}
