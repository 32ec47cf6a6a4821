//! Snapshots of other programs: fields of Abaqus, CalculiX or any other solver at the rows of a design, in place of the own finite
//! elements.

mod doe;
mod files;
mod nodes;
pub mod spread;
mod vtu;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::design::{Dimension, THICKNESS};
use crate::error::{Error, Result};
use crate::files::absolute;
pub use doe::text as doe_text;
pub(super) use spread::{Weights, weights};

/// `reduced_model.snapshots` in place of a number: a design and what another program solved of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuppliedSpec {
    /// The design, as `plychain design-of-experiments` writes it.
    pub doe: PathBuf,
    /// The fields of its rows: a path with one `*` in the file's name, which stands for the number of the row.
    pub fields: PathBuf,
    /// The point of the fields' x and y, mm, that lies at `hole_center_in_data_mm` in the data; that of an imported mesh, or (0, 0), if it
    /// is not given. The fields' axes are parallel to the data's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin_mm: Option<[f64; 2]>,
}

/// A design and its fields, in the fields' own coordinates.
pub struct Supplied {
    /// The design's parameters with the range of its rows, in the order of the constants, the thickness last.
    pub dimensions: Vec<Dimension>,
    /// One row a snapshot, border units, in the order of `dimensions`.
    pub rows: Vec<Vec<f64>>,
    /// Points (x, y), mm.
    pub points: Vec<[f64; 2]>,
    /// Displacement (ux, uy) of each row at the points, mm.
    pub fields: Vec<Vec<[f64; 2]>>,
}

impl SuppliedSpec {
    /// The same with absolute paths; `base_dir` is where relative ones start.
    ///
    /// # Errors
    /// Of the input: a current directory that is gone.
    pub fn below(&self, base_dir: &Path) -> Result<Self> {
        Ok(Self {
            doe: absolute(&base_dir.join(&self.doe))?,
            fields: absolute(&base_dir.join(&self.fields))?,
            ..self.clone()
        })
    }

    /// The files there are of the design and its fields; they are not read.
    ///
    /// # Errors
    /// Of the input: a pattern without one `*`, or of which there are no files.
    pub fn files(&self, base_dir: &Path) -> Result<Vec<PathBuf>> {
        let spec = self.below(base_dir)?;
        let found = files::of_rows(&spec.fields)?;
        Ok(std::iter::once(spec.doe)
            .chain(found.into_values())
            .collect())
    }

    /// Read the design of the parameters `names` (constants, and the thickness where it is uncertain) and all its fields.
    ///
    /// # Errors
    /// Of the input, with the file: columns that are not those parameters, a row without a field or a field without a row, fields of
    /// different points, numbers that are none.
    pub fn read(&self, base_dir: &Path, names: &[&str]) -> Result<Supplied> {
        let spec = self.below(base_dir)?;
        let design = doe::read(&spec.doe, names)?;
        let paths = files::of_rows(&spec.fields)?;
        let known: Vec<u64> = design.iter().map(|(number, _)| *number).collect();
        if let Some((number, path)) = paths.iter().find(|(n, _)| !known.contains(n)) {
            return Err(
                Error::input(path.display(), format!("a row {number} of the design"))
                    .found(format!("{} rows in {}", design.len(), spec.doe.display()))
                    .hint("the * of the pattern stands for the number in the column row"),
            );
        }
        let (mut rows, mut fields) = (Vec::new(), Vec::new());
        let mut points: Vec<[f64; 2]> = Vec::new();
        for (number, row) in design {
            let path = paths.get(&number).ok_or_else(|| {
                Error::input(spec.fields.display(), format!("the field of row {number}"))
                    .found("no such file")
                    .hint("solve that row, or take it out of the design: a row that is left out costs little")
            })?;
            let field = files::read(path)?;
            if points.is_empty() {
                points.clone_from(&field.points);
            }
            check_points(path, &points, &field.points)?;
            rows.push(row);
            fields.push(field.displacement);
        }
        Ok(Supplied {
            dimensions: ranges(names, &rows),
            rows,
            points,
            fields,
        })
    }
}

/// The range of every column of a design, border units, in the order of `names`.
pub fn ranges(names: &[&str], rows: &[Vec<f64>]) -> Vec<Dimension> {
    let range = |(k, name): (usize, &&str)| {
        let values = rows.iter().map(|row| row[k]);
        Dimension {
            name: (*name).into(),
            low: values.clone().fold(f64::INFINITY, f64::min),
            high: values.fold(f64::NEG_INFINITY, f64::max),
        }
    };
    names.iter().enumerate().map(range).collect()
}

/// All rows must be given at the same points.
fn check_points(path: &Path, first: &[[f64; 2]], own: &[[f64; 2]]) -> Result<()> {
    const SAME_MM: f64 = 1e-6;
    let differs = |(a, b): (&[f64; 2], &[f64; 2])| (0..2).any(|k| (a[k] - b[k]).abs() > SAME_MM);
    let place = first.iter().zip(own).position(differs);
    if first.len() == own.len() && place.is_none() {
        return Ok(());
    }
    let found = match place {
        Some(k) => format!("point {} at {:?}, not {:?} mm", k + 1, own[k], first[k]),
        None => format!("{} points, not {}", own.len(), first.len()),
    };
    Err(Error::input(
        path.display(),
        "the points of the first row's field, in its order",
    )
    .found(found))
}

/// The parameters of a design that another program solves: the constants, and the thickness where it is uncertain.
pub fn is_solved_for(constants: &[&str], dimension: &Dimension) -> bool {
    dimension.name == THICKNESS || constants.contains(&&*dimension.name)
}
