//! The `measurement` object of a model file: what was measured, in which units, axes and origin.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::frame::{Axis, Frame};
use super::matrices::Matrices;
use super::measured::Field;
use super::outliers;
use super::reader::{ColumnMap, Columns, Reader, Units};
use super::table::Csv;
use crate::error::{Error, Result};
use crate::quantity::Length;

/// A declared measurement. In JSON its fields lie flat beside `format`; an unknown key is an error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct MeasurementSpec {
    /// Where the numbers are and how they are written.
    pub source: Source,
    /// The declared axes and origin.
    pub frame: Frame,
    /// Frequency f_s of a moire grating in lines per mm of displacement (a fringe order is 1/f_s), if it is one.
    pub fringe_frequency_per_mm: Option<f64>,
    /// How images were correlated, if they were.
    pub image_correlation: Option<ImageCorrelation>,
    /// What happens to outliers.
    pub outliers: OutlierRule,
}

/// The formats of measurements.
pub const READERS: &[&dyn Reader] = &[&Matrices, &Csv];

/// The file or files of a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    pub reader: &'static dyn Reader,
    pub path: PathBuf,
    /// What is declared of the columns, where the format has some.
    pub columns: Option<ColumnMap>,
}

/// The `image_correlation` object of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageCorrelation {
    /// Side of a subset, mm: over about as much the noise is correlated.
    pub subset_mm: f64,
    /// Distance of neighbouring points, mm, where it is declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step_mm: Option<f64>,
    /// Shape function of the subsets, where it is declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<SubsetShape>,
    /// Distance of the camera from the specimen, mm, where it is declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_distance_mm: Option<f64>,
}

/// How the displacement varies over a subset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SubsetShape {
    Full,
    Affine,
    Quadratic,
}

impl ImageCorrelation {
    fn check(&self) -> Result<()> {
        let given = [
            ("subset_mm", Some(self.subset_mm)),
            ("step_mm", self.step_mm),
            ("camera_distance_mm", self.camera_distance_mm),
        ];
        for (key, value) in given {
            let value = value.unwrap_or(1.0);
            if !(value.is_finite() && value > 0.0) {
                let place = format!("image_correlation.{key}");
                return Err(Error::input(place, "a positive length in mm").found(value));
            }
        }
        Ok(())
    }
}

/// What happens to points that [`outliers::outliers`] finds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutlierRule {
    /// They are dropped and counted.
    #[default]
    Reject,
    /// They stay.
    Keep,
}

/// The keys as they are written: serde's internally tagged enums let unknown keys pass, so one flat set of keys is
/// read and then sorted by format.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    format: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dir: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    file: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    columns: Option<Columns>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    units: Option<Units>,
    loading_axis: Axis,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hole_center_in_data_mm: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fringe_frequency_per_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    image_correlation: Option<ImageCorrelation>,
    #[serde(default)]
    outliers: OutlierRule,
}

fn needed<T>(value: Option<T>, format: &str, key: &str) -> Result<T> {
    value.ok_or_else(|| {
        Error::input(
            key,
            format!("this key in a measurement of format \"{format}\""),
        )
    })
}

/// A key that the format does not know.
fn foreign<T>(value: &Option<T>, format: &str, key: &str) -> Result<()> {
    match value {
        None => Ok(()),
        Some(_) => Err(Error::input(
            key,
            format!("no such key in a measurement of format \"{format}\""),
        )),
    }
}

impl TryFrom<Keys> for MeasurementSpec {
    type Error = Error;

    fn try_from(keys: Keys) -> Result<Self> {
        let reader = *READERS
            .iter()
            .find(|reader| reader.format() == keys.format)
            .ok_or_else(|| {
                let known: Vec<_> = READERS.iter().map(|reader| reader.format()).collect();
                Error::input("format", format!("one of {}", known.join(", "))).found(&keys.format)
            })?;
        let format = reader.format();
        let path = if reader.is_directory() {
            foreign(&keys.file, format, "file")?;
            needed(keys.dir, format, "dir")?
        } else {
            foreign(&keys.dir, format, "dir")?;
            needed(keys.file, format, "file")?
        };
        let (columns, hole_center_mm) = if reader.has_columns() {
            let map = ColumnMap {
                columns: needed(keys.columns, format, "columns")?,
                units: needed(keys.units, format, "units")?,
            };
            let center = needed(
                keys.hole_center_in_data_mm,
                format,
                "hole_center_in_data_mm",
            )?;
            (Some(map), center)
        } else {
            foreign(&keys.columns, format, "columns")?;
            foreign(&keys.units, format, "units")?;
            (None, keys.hole_center_in_data_mm.unwrap_or([0.0; 2]))
        };
        let spec = Self {
            source: Source {
                reader,
                path,
                columns,
            },
            frame: Frame {
                loading_axis: keys.loading_axis,
                hole_center_mm,
            },
            fringe_frequency_per_mm: keys.fringe_frequency_per_mm,
            image_correlation: keys.image_correlation,
            outliers: keys.outliers,
        };
        spec.check()?;
        Ok(spec)
    }
}

impl From<MeasurementSpec> for Keys {
    fn from(spec: MeasurementSpec) -> Self {
        let Source {
            reader,
            path,
            columns,
        } = spec.source;
        let (dir, file) = if reader.is_directory() {
            (Some(path), None)
        } else {
            (None, Some(path))
        };
        let (columns, units) = columns.map(|map| (map.columns, map.units)).unzip();
        Self {
            format: reader.format().into(),
            dir,
            file,
            columns,
            units,
            loading_axis: spec.frame.loading_axis,
            hole_center_in_data_mm: Some(spec.frame.hole_center_mm),
            fringe_frequency_per_mm: spec.fringe_frequency_per_mm,
            image_correlation: spec.image_correlation,
            outliers: spec.outliers,
        }
    }
}

impl MeasurementSpec {
    /// Refuse values no measurement can have.
    fn check(&self) -> Result<()> {
        let [cx, cy] = self.frame.hole_center_mm;
        if !(cx.is_finite() && cy.is_finite()) {
            return Err(Error::input("hole_center_in_data_mm", "two finite numbers")
                .found(format!("[{cx}, {cy}]")));
        }
        if let Some(f) = self
            .fringe_frequency_per_mm
            .filter(|f| !(f.is_finite() && *f > 0.0))
        {
            return Err(Error::input(
                "fringe_frequency_per_mm",
                "a positive number of lines per mm",
            )
            .found(f));
        }
        if let Some(correlation) = &self.image_correlation {
            correlation.check()?;
        }
        if let Some(ColumnMap { columns, units }) = &self.source.columns {
            Length::parse("units.coordinates", &units.coordinates)?;
            Length::parse("units.displacements", &units.displacements)?;
            let names = [
                ("x", &columns.x),
                ("y", &columns.y),
                ("ux", &columns.ux),
                ("uy", &columns.uy),
            ];
            for (i, (key, name)) in names.iter().enumerate() {
                if let Some((other, _)) = names[..i].iter().find(|(_, earlier)| earlier == name) {
                    let expected = format!("another column than that of columns.{other}");
                    return Err(Error::input(format!("columns.{key}"), expected).found(name));
                }
            }
        }
        Ok(())
    }

    /// The same measurement at another place: the directory of the matrices or the file of the table.
    #[must_use]
    pub fn with_path(mut self, path: PathBuf) -> Self {
        self.source.path = path;
        self
    }

    /// The same measurement with an absolute path: `base_dir` is where relative ones start.
    ///
    /// # Errors
    /// Of the input: a current directory that is gone.
    pub fn below(self, base_dir: &Path) -> Result<Self> {
        let path = base_dir.join(&self.source.path);
        let absolute = std::path::absolute(&path).map_err(|e| {
            Error::input(path.display(), "a path that can be made absolute").found(e)
        })?;
        Ok(self.with_path(absolute))
    }

    /// The files of the measurement, which are not read. Relative paths start at `base_dir`.
    ///
    /// # Errors
    /// Of the input: a directory where the format has a file, or a file where it has a directory.
    pub fn files(&self, base_dir: &Path) -> Result<Vec<PathBuf>> {
        let Source { reader, path, .. } = &self.source;
        let path = base_dir.join(path);
        let files = reader.files(&path);
        let format = reader.format();
        let wrong = |expected: String, found: &str| {
            let expected = format!("{expected}, because the model's format is \"{format}\"");
            Err(Error::input(path.display(), expected).found(found))
        };
        if reader.is_directory() && path.is_file() {
            let names: Vec<_> = files
                .iter()
                .filter_map(|f| f.file_name()?.to_str())
                .collect();
            return wrong(format!("a directory with {}", names.join(", ")), "a file");
        }
        if !reader.is_directory() && path.is_dir() {
            return wrong("a file".into(), "a directory");
        }
        Ok(files)
    }

    /// Read the field. Relative paths start at `base_dir`, the model file's directory; `window_mm`
    /// `[[x0, y0], [x1, y1]]` in the data's coordinates restricts the points used. Outliers are dropped unless they
    /// are declared to be kept.
    ///
    /// # Errors
    /// Of the input: whatever is wrong with the files, an inverted window, or fewer than [`Field::FEWEST`] points left.
    pub fn read(&self, base_dir: &Path, window_mm: Option<[[f64; 2]; 2]>) -> Result<Field> {
        check_window(window_mm)?;
        self.files(base_dir)?;
        let source = &self.source;
        let path = base_dir.join(&source.path);
        let columns = source.columns.as_ref();
        let mut field = source.reader.read(&path, columns, self.frame)?;
        field.fringe_frequency_per_mm = self.fringe_frequency_per_mm;
        field.subset_mm = self.image_correlation.map(|c| c.subset_mm);
        if let Some(window) = window_mm {
            field.restrict_to(window);
        }
        let place = field
            .files
            .first()
            .map_or_else(String::new, |file| file.display().to_string());
        field.check_enough(&place)?;
        if self.outliers == OutlierRule::Reject {
            outliers::reject(&mut field);
            field.forget_remote_outliers();
            field.check_enough(&place)?;
        }
        Ok(field)
    }
}

/// A window has its lower corner first.
///
/// # Errors
/// Of the input, at `window_mm`, with the corners.
pub fn check_window(window_mm: Option<[[f64; 2]; 2]>) -> Result<()> {
    match window_mm {
        // written so that a NaN fails too
        Some([a, b]) if !(a[0] < b[0] && a[1] < b[1]) => Err(Error::input(
            "window_mm",
            "[[x0, y0], [x1, y1]] with x0 < x1 and y0 < y1",
        )
        .found(format!("[{a:?}, {b:?}]"))
        .hint("the corner with the smaller x and y comes first, in the data's coordinates")),
        _ => Ok(()),
    }
}
