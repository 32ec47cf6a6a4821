//! The `measurement` object of a model file: what was measured, in which units, axes and origin.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use super::coincident;
use super::correlation::ImageCorrelation;
use super::frame::{Axis, Frame};
use super::fringes::FringeFile;
use super::mask::{self, MaskShape};
use super::matrices::Matrices;
use super::measured::{Field, Reason};
use super::outliers;
use super::reader::{ColumnMap, Columns, PIXEL, Reader, Units};
use super::table::Csv;
use crate::error::{Error, Result};
use crate::files::absolute;

/// A declared measurement. In JSON its fields lie flat beside `format`; an unknown key is an error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SpecKeys", into = "SpecKeys")]
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
    /// Parts of the data that are not used.
    pub mask: Vec<MaskShape>,
}

/// The formats of measurements.
pub const READERS: &[&dyn Reader] = &[&Matrices, &Csv, &FringeFile];

/// The file or files of a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    pub reader: &'static dyn Reader,
    /// Directory of the matrices, or file of the table; of a series each step has its own.
    pub path: Option<PathBuf>,
    /// What is declared of the columns, where the format has some.
    pub columns: Option<ColumnMap>,
}

/// What happens to points that [`outliers::outliers`] finds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
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
#[skip_serializing_none]
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpecKeys {
    format: String,
    dir: Option<PathBuf>,
    file: Option<PathBuf>,
    columns: Option<Columns>,
    units: Option<Units>,
    loading_axis: Axis,
    hole_center_in_data_mm: Option<[f64; 2]>,
    fringe_frequency_per_mm: Option<f64>,
    image_correlation: Option<ImageCorrelation>,
    #[serde(default)]
    outliers: OutlierRule,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    mask: Vec<MaskShape>,
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

impl TryFrom<SpecKeys> for MeasurementSpec {
    type Error = Error;

    fn try_from(keys: SpecKeys) -> Result<Self> {
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
            keys.dir
        } else {
            foreign(&keys.dir, format, "dir")?;
            keys.file
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
            mask: keys.mask,
        };
        spec.check()?;
        Ok(spec)
    }
}

impl From<MeasurementSpec> for SpecKeys {
    fn from(spec: MeasurementSpec) -> Self {
        let Source {
            reader,
            path,
            columns,
        } = spec.source;
        let (dir, file) = if reader.is_directory() {
            (path, None)
        } else {
            (None, path)
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
            mask: spec.mask,
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
        mask::check(&self.mask)?;
        if let Some(ColumnMap { columns, units }) = &self.source.columns {
            units.in_mm()?;
            units.sigma_in_mm()?;
            let declared = self.image_correlation.and_then(|c| c.pixel_mm);
            check_scale(units, declared)?;
            if let (None, Some(unit)) = (&columns.sigma, &units.sigma) {
                let expected = "no such key, because no column is named columns.sigma";
                return Err(Error::input("units.sigma", expected).found(unit));
            }
            let names = columns.named();
            for (i, (key, name)) in names.iter().enumerate() {
                if let Some((other, _)) = names[..i].iter().find(|(_, earlier)| earlier == name) {
                    let expected = format!("another column than that of columns.{other}");
                    return Err(Error::input(format!("columns.{key}"), expected).found(name));
                }
            }
        }
        Ok(())
    }

    /// Size of a pixel, mm, where the data's coordinates count pixels.
    pub fn mm_per_coordinate(&self) -> Option<f64> {
        let units = &self.source.columns.as_ref()?.units;
        units.mm_per_pixel.filter(|_| units.coordinates == PIXEL)
    }

    /// The same measurement at another place: the directory of the matrices or the file of the table.
    #[must_use]
    pub fn with_path(mut self, path: PathBuf) -> Self {
        self.source.path = Some(path);
        self
    }

    /// The same measurement with an absolute path, if it has one: `base_dir` is where relative ones start.
    ///
    /// # Errors
    /// Of the input: a current directory that is gone.
    pub fn below(self, base_dir: &Path) -> Result<Self> {
        match &self.source.path {
            Some(path) => {
                let absolute = absolute(&base_dir.join(path))?;
                Ok(self.with_path(absolute))
            }
            None => Ok(self),
        }
    }

    /// Where the numbers are. Relative paths start at `base_dir`.
    ///
    /// # Errors
    /// Of the input: no place is declared.
    fn path(&self, base_dir: &Path) -> Result<PathBuf> {
        let path = self.source.path.as_ref().map(|path| base_dir.join(path));
        path.ok_or_else(|| self.without_path().below("measurement."))
    }

    /// The key of the path is missing.
    pub fn without_path(&self) -> Error {
        let reader = self.source.reader;
        let key = if reader.is_directory() { "dir" } else { "file" };
        let format = reader.format();
        Error::input(
            key,
            format!("this key in a measurement of format \"{format}\""),
        )
        .found("no such key")
    }

    /// The files of the measurement, which are not read. Relative paths start at `base_dir`.
    ///
    /// # Errors
    /// Of the input: a directory where the format has a file, or a file where it has a directory.
    pub fn files(&self, base_dir: &Path) -> Result<Vec<PathBuf>> {
        let reader = self.source.reader;
        let path = self.path(base_dir)?;
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
        self.without_outliers(self.read_all(base_dir, window_mm)?)
    }

    /// A field of arrays: points (x, y) and displacements (ux, uy) along the data's axes, mm, treated as those of a file.
    ///
    /// # Errors
    /// Those of [`MeasurementSpec::read`] but for the files; arrays of different lengths, numbers that are not finite.
    pub fn of_arrays(
        &self,
        points: &[[f64; 2]],
        displacements: &[[f64; 2]],
        window_mm: Option<[[f64; 2]; 2]>,
    ) -> Result<Field> {
        check_window(window_mm)?;
        let (at, moved) = (points.len(), displacements.len());
        if at != moved {
            return Err(Error::input("displacements", format!("{at}, one a point")).found(moved));
        }
        let mut numbers = points.iter().zip(displacements);
        let odd = numbers.position(|(p, u)| [p, u].into_iter().flatten().any(|v| !v.is_finite()));
        if let Some(k) = odd {
            let found = format!("{:?} and {:?}", points[k], displacements[k]);
            return Err(Error::input(format!("point {k}"), "four finite numbers").found(found));
        }
        let field = Field {
            points: points.iter().map(|&p| self.frame.point(p)).collect(),
            displacement: displacements
                .iter()
                .map(|&u| self.frame.vector(u))
                .collect(),
            ..Field::empty(self.frame)
        };
        self.without_outliers(self.within(field, window_mm)?)
    }

    fn without_outliers(&self, mut field: Field) -> Result<Field> {
        if self.outliers == OutlierRule::Reject {
            outliers::reject(&mut field);
            field.forget_remote_outliers();
            field.check_enough(&field.place())?;
        }
        Ok(field)
    }

    /// The same with its outliers.
    pub(super) fn read_all(
        &self,
        base_dir: &Path,
        window_mm: Option<[[f64; 2]; 2]>,
    ) -> Result<Field> {
        check_window(window_mm)?;
        self.files(base_dir)?;
        let source = &self.source;
        let columns = source.columns.as_ref();
        let path = self.path(base_dir)?;
        let field = source.reader.read(&path, columns, self.frame)?;
        // a file of fringe images says it itself
        let both = self
            .fringe_frequency_per_mm
            .zip(field.fringe_frequency_per_mm);
        if let Some((declared, found)) = both.filter(|(a, b)| (a / b - 1.0).abs() > 1e-9) {
            let expected = format!("{found}, as {} says", path.display());
            return Err(Error::input("fringe_frequency_per_mm", expected).found(declared));
        }
        self.within(field, window_mm)
    }

    /// The points in the window, with what is declared of how they were measured.
    fn within(&self, mut field: Field, window_mm: Option<[[f64; 2]; 2]>) -> Result<Field> {
        let declared = self.fringe_frequency_per_mm;
        field.fringe_frequency_per_mm = declared.or(field.fringe_frequency_per_mm);
        coincident::merge(&mut field);
        field.subset_mm = self
            .image_correlation
            .map(|c| c.effective_subset_mm.unwrap_or(c.subset_mm));
        if let Some(window) = window_mm {
            field.restrict_to(window);
        }
        if !self.mask.is_empty() {
            let frame = field.frame;
            let points = field.points.iter().map(|p| frame.data_point(*p));
            let left: Vec<bool> = points
                .map(|p| !self.mask.iter().any(|shape| shape.covers(p)))
                .collect();
            field.retain(Reason::Masked, |i| left[i]);
        }
        field.check_enough(&field.place())?;
        Ok(field)
    }
}

/// A pixel's size stands where it is used, and is the same wherever it stands.
fn check_scale(units: &Units, declared_mm: Option<f64>) -> Result<()> {
    /// Sizes this close together are the same, rounded.
    const ROUNDED: f64 = 0.01;
    const PLACE: &str = "units.mm_per_pixel";
    let Some(size) = units.mm_per_pixel else {
        return Ok(());
    };
    let all = [Some(&units.coordinates), Some(&units.displacements)];
    let mut all = all.into_iter().chain([units.sigma.as_ref()]).flatten();
    if !all.any(|unit| unit == PIXEL) {
        let expected = format!("no such key, because no unit is \"{PIXEL}\"");
        return Err(Error::input(PLACE, expected).found(size));
    }
    match declared_mm {
        Some(other) if (size / other - 1.0).abs() > ROUNDED => {
            let expected = format!("the size of image_correlation.pixel_mm, {other} mm");
            Err(Error::input(PLACE, expected).found(size))
        }
        _ => Ok(()),
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
