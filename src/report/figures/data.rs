//! What the figures of a round are drawn from beside `report.json`: tables, each kept as `figures/NAME-K.csv`, whose columns
//! are the fields of its rows. An empty cell is a missing value.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::files;

/// The tables of one round.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FigureData {
    /// Means over cells of the field, row by row from the lowest y.
    pub maps: Vec<MapCell>,
    /// What is left of each step of a series, at the blocks of the field.
    pub steps: Vec<StepCell>,
    /// The stiffness that would make what grows with the load of a series, where that is called for.
    pub stiffness: Vec<StiffnessCell>,
    /// The mesh of another program with edges and points; that of the first round alone.
    pub mesh: Vec<MeshPoint>,
    /// Posterior summary, prior, cut and truth of each parameter.
    pub parameters: Vec<ParameterLine>,
    pub marginals: Vec<MarginalBin>,
    /// Joint densities of each pair of parameters; where there is next to none, bins are left out.
    pub corner: Vec<JointBin>,
    /// One chain of each ensemble, thinned.
    pub trace: Vec<TracePoint>,
    /// Ranks of each ensemble's draws among all draws (Vehtari et al. 2021).
    pub rank: Vec<RankBin>,
    /// Autocorrelation of the walkers.
    pub autocorrelation: Vec<LagPoint>,
    /// Errors by number of modes.
    pub truncation: Vec<TruncationLine>,
    pub surfaces: Vec<SurfaceLine>,
}

impl FigureData {
    /// Write the tables of round `k`, or of another name, into the folder of figures.
    ///
    /// # Errors
    /// The input's fault if a file cannot be written.
    pub fn write(&self, folder: &Path, k: &str) -> Result<()> {
        let of = |table: &str| format!("{table}-{k}");
        write(folder, &of("maps"), &self.maps)?;
        write(folder, &of("steps"), &self.steps)?;
        write(folder, &of("stiffness"), &self.stiffness)?;
        write(folder, &of("mesh"), &self.mesh)?;
        write(folder, &of("parameters"), &self.parameters)?;
        write(folder, &of("marginals"), &self.marginals)?;
        write(folder, &of("corner"), &self.corner)?;
        write(folder, &of("trace"), &self.trace)?;
        write(folder, &of("rank"), &self.rank)?;
        write(folder, &of("autocorrelation"), &self.autocorrelation)?;
        write(folder, &of("truncation"), &self.truncation)?;
        write(folder, &of("surfaces"), &self.surfaces)
    }

    /// The tables of round `k`, or of another name; without rows where there is no file.
    ///
    /// # Errors
    /// The input's fault, with file and line, if a file cannot be read.
    pub fn read(folder: &Path, k: &str) -> Result<Self> {
        let of = |table: &str| format!("{table}-{k}");
        Ok(Self {
            maps: read(folder, &of("maps"))?,
            steps: read(folder, &of("steps"))?,
            stiffness: read(folder, &of("stiffness"))?,
            mesh: read(folder, &of("mesh"))?,
            parameters: read(folder, &of("parameters"))?,
            marginals: read(folder, &of("marginals"))?,
            corner: read(folder, &of("corner"))?,
            trace: read(folder, &of("trace"))?,
            rank: read(folder, &of("rank"))?,
            autocorrelation: read(folder, &of("autocorrelation"))?,
            truncation: read(folder, &of("truncation"))?,
            surfaces: read(folder, &of("surfaces"))?,
        })
    }
}

/// One cell of the maps, in the data's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MapCell {
    pub x_mm: f64,
    pub y_mm: f64,
    pub u1_measured_um: Option<f64>,
    pub u1_predicted_um: Option<f64>,
    pub u1_residual_nm: Option<f64>,
    pub u2_measured_um: Option<f64>,
    pub u2_predicted_um: Option<f64>,
    pub u2_residual_nm: Option<f64>,
}

/// One block of one step, in the data's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepCell {
    pub step: String,
    pub x_mm: f64,
    pub y_mm: f64,
    pub u1_residual_nm: Option<f64>,
    pub u2_residual_nm: Option<f64>,
}

/// What a line of the picture of a mesh is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StiffnessCell {
    pub x_mm: f64,
    pub y_mm: f64,
    pub change_percent: f64,
    pub sd_percent: f64,
}

/// One sampled parameter, border units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterLine {
    pub parameter: String,
    pub mean: f64,
    pub sd: f64,
    #[serde(rename = "q2.5")]
    pub low: f64,
    pub median: f64,
    #[serde(rename = "q97.5")]
    pub high: f64,
    pub prior_mean: Option<f64>,
    pub prior_sd: Option<f64>,
    pub cut_low: Option<f64>,
    pub cut_high: Option<f64>,
    pub truth: Option<f64>,
}

/// One bin of a marginal density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MarginalBin {
    pub parameter: String,
    pub value: f64,
    pub density: f64,
}

/// One bin of a joint density, relative to the largest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointBin {
    pub first: String,
    pub second: String,
    pub x: f64,
    pub y: f64,
    pub relative_density: f64,
}

/// One draw of a trace.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TracePoint {
    pub parameter: String,
    pub ensemble: usize,
    pub draw: usize,
    pub value: f64,
}

/// One twentieth of the ranks: the share of an ensemble's draws in it, 1 where it is as expected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RankBin {
    pub parameter: String,
    pub ensemble: usize,
    pub bin: usize,
    pub relative_count: f64,
}

/// One lag, in stored draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LagPoint {
    pub parameter: String,
    pub lag: usize,
    pub autocorrelation: Option<f64>,
}

/// Truncation error and leave-one-out error of a number of modes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruncationLine {
    pub modes: usize,
    pub component: String,
    pub eps: Option<f64>,
    pub cv_rms_mm: Option<f64>,
    pub cv_rms_percent: Option<f64>,
}

/// Errors of the response surface of one POD coefficient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceLine {
    pub coefficient: String,
    pub mean_mm: Option<f64>,
    pub sd_mm: Option<f64>,
    pub r2: Option<f64>,
    pub rms_mm: Option<f64>,
    pub press_mm: Option<f64>,
}

/// Write rows as `NAME.csv`; nothing if there are none.
///
/// # Errors
/// The input's fault if the file cannot be written.
pub fn write<T: Serialize>(folder: &Path, name: &str, rows: &[T]) -> Result<()> {
    if rows.is_empty() {
        return Ok(());
    }
    let failed =
        |e: &dyn std::fmt::Display| Error::program(name, "a table that CSV can hold").found(e);
    let mut out = csv::Writer::from_writer(Vec::new());
    for row in rows {
        out.serialize(row).map_err(|e| failed(&e))?;
    }
    let text = out.into_inner().map_err(|e| failed(&e))?;
    files::replace(&folder.join(format!("{name}.csv")), text)
}

fn read<T: DeserializeOwned>(folder: &Path, name: &str) -> Result<Vec<T>> {
    let path = folder.join(format!("{name}.csv"));
    if !path.exists() {
        return Ok(Vec::new());
    }
    let failed = |e: csv::Error| {
        let line = e.position().map_or(1, csv::Position::line);
        let place = format!("{}:{line}", path.display());
        Error::input(place, "a figure's table as CSV").found(e)
    };
    let mut reader = csv::Reader::from_path(&path).map_err(failed)?;
    reader
        .deserialize()
        .collect::<std::result::Result<_, _>>()
        .map_err(failed)
}
