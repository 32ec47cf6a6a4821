//! The article's format (its Appendix 4): four whitespace-separated matrices of one shape, `X.txt` and `Y.txt` in
//! mm, `U.txt` and `V.txt` in micrometres, NaN where nothing was measured. U is the displacement along the
//! *loading* axis and V along the other one, whichever axes these are. `SU.txt` and `SV.txt`, sds in micrometres, may stand beside them.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::frame::Frame;
use super::grid::Grid;
use super::measured::{FARTHEST_MM, Field};
use super::reader::{ColumnMap, Reader, number, unwritable};
use super::table::drop_unmoved;
use super::text;
use crate::error::{Error, Result};
use crate::quantity::UM_PER_MM;

/// Files of a measurement, in the order of reading.
const NAMES: [&str; 4] = ["X.txt", "Y.txt", "U.txt", "V.txt"];

/// Files of the sds of U and V, micrometres, which a measurement may have.
const SD_NAMES: [&str; 2] = ["SU.txt", "SV.txt"];

/// The reader of this format.
pub struct Matrices;

impl Reader for Matrices {
    fn format(&self) -> &'static str {
        "matrices"
    }

    fn is_directory(&self) -> bool {
        true
    }

    fn file_name(&self) -> &'static str {
        "."
    }

    fn has_columns(&self) -> bool {
        false
    }

    fn files(&self, path: &Path) -> Vec<PathBuf> {
        let sds = SD_NAMES.iter().map(|name| path.join(name));
        let needed = NAMES.iter().map(|name| path.join(name));
        needed.chain(sds.filter(|path| path.exists())).collect()
    }

    fn read(&self, path: &Path, _: Option<&ColumnMap>, frame: Frame) -> Result<Field> {
        read(path, frame)
    }

    fn write(&self, path: &Path, grid: &Grid, _: Frame) -> Result<Option<ColumnMap>> {
        write_matrices(path, grid, None).map(|()| None)
    }
}

/// One file: its numbers row by row and the line of each row.
struct Matrix {
    path: PathBuf,
    cols: usize,
    lines: Vec<usize>,
    values: Vec<f64>,
}

impl Matrix {
    /// An error at entry `i`.
    fn error_at(&self, i: usize, expected: &str) -> Error {
        let place = format!(
            "{}:{}, column {}",
            self.path.display(),
            self.lines[i / self.cols],
            i % self.cols + 1
        );
        Error::input(place, expected).found(self.values[i])
    }
}

/// Read `X.txt`, `Y.txt`, `U.txt`, `V.txt` of the directory `dir` as a field in `frame`.
///
/// # Errors
/// Of the input, naming file, line, column and value: a missing, empty or non-text file, a cell that is not a number,
/// ragged rows, different shapes, no measured point, a measured point without coordinates, impossible magnitudes.
pub fn read(dir: &Path, frame: Frame) -> Result<Field> {
    let files = Matrices.files(dir);
    let read: Vec<Result<Matrix>> = files[..NAMES.len()]
        .par_iter()
        .map(|path| read_matrix(path))
        .collect();
    let matrices = read.into_iter().collect::<Result<Vec<_>>>()?;
    let [x, y, u, v] = &matrices[..] else {
        return Err(Error::program("field::matrices", "four matrices"));
    };
    for other in [y, u, v] {
        if (other.lines.len(), other.cols) != (x.lines.len(), x.cols) {
            let expected = format!("{} rows x {} columns as in X.txt", x.lines.len(), x.cols);
            return Err(Error::input(other.path.display(), expected).found(format!(
                "{} rows x {} columns",
                other.lines.len(),
                other.cols
            )));
        }
    }
    for matrix in [u, v] {
        if matrix.values.iter().all(|value| value.is_nan()) {
            return Err(
                Error::input(matrix.path.display(), "at least one measured point")
                    .found("NaN everywhere"),
            );
        }
    }
    let grid = assemble(x, y, u, v)?;
    let sd = read_sds(dir, [u, v])?;
    let mut field = grid.field(frame);
    drop_unmoved(&mut field);
    if field.is_empty() {
        return Err(Error::input(
            u.path.display(),
            "at least one point where both U and V are measured",
        )
        .found("NaN everywhere"));
    }
    field.files = files;
    if let (Some(sd), Some(shape)) = (sd, &field.grid) {
        field.sigma = Some(shape.index.iter().map(|&i| sd[i]).collect());
    }
    Ok(field)
}

/// The sds of `SU.txt` and `SV.txt` where there are both: of each entry the geometric mean, mm.
fn read_sds(dir: &Path, [u, v]: [&Matrix; 2]) -> Result<Option<Vec<f64>>> {
    let paths = SD_NAMES.map(|name| dir.join(name));
    if !paths.iter().all(|path| path.exists()) {
        return Ok(None);
    }
    let [su, sv] = [read_matrix(&paths[0])?, read_matrix(&paths[1])?];
    let is_measured = |i: usize| !(u.values[i].is_nan() || v.values[i].is_nan());
    for sd in [&su, &sv] {
        if (sd.lines.len(), sd.cols) != (u.lines.len(), u.cols) {
            let expected = format!("{} rows x {} columns as in U.txt", u.lines.len(), u.cols);
            let found = format!("{} rows x {} columns", sd.lines.len(), sd.cols);
            return Err(Error::input(sd.path.display(), expected).found(found));
        }
        let is_sd = |sd: f64| !sd.is_nan() && sd > 0.0;
        let wrong = |i: &usize| is_measured(*i) && !is_sd(sd.values[*i]);
        if let Some(i) = (0..sd.values.len()).find(wrong) {
            return Err(sd.error_at(
                i,
                "an sd above 0 in micrometres, since U and V are measured here",
            ));
        }
    }
    let both = su.values.iter().zip(&sv.values);
    Ok(Some(
        both.map(|(a, b)| (a * b).sqrt() / UM_PER_MM).collect(),
    ))
}

/// Join the four matrices, checking every entry.
fn assemble(x: &Matrix, y: &Matrix, u: &Matrix, v: &Matrix) -> Result<Grid> {
    let n = x.values.len();
    let mut points = Vec::with_capacity(n);
    let mut displacement = Vec::with_capacity(n);
    for i in 0..n {
        let measured = !(u.values[i].is_nan() || v.values[i].is_nan());
        for matrix in [x, y] {
            if measured && matrix.values[i].is_nan() {
                return Err(matrix.error_at(i, "a coordinate, since U and V are measured here"));
            }
            if matrix.values[i].abs() > FARTHEST_MM {
                return Err(matrix
                    .error_at(i, "a coordinate in mm below 1e5")
                    .hint("X.txt and Y.txt are in mm"));
            }
        }
        for matrix in [u, v] {
            if matrix.values[i].abs() > FARTHEST_MM * UM_PER_MM {
                return Err(matrix.error_at(i, "a displacement in micrometres below 1e8"));
            }
        }
        points.push([x.values[i], y.values[i]]);
        displacement.push([u.values[i] / UM_PER_MM, v.values[i] / UM_PER_MM]);
    }
    Ok(Grid {
        rows: x.lines.len(),
        cols: x.cols,
        points,
        displacement,
    })
}

/// Read one matrix; blank lines are skipped.
fn read_matrix(path: &Path) -> Result<Matrix> {
    let mut text = text::read_settings(path)?;
    // without a point in the file a comma is the decimal sign
    if text.contains(',') && !text.contains('.') {
        text = text.replace(',', ".");
    }
    let mut matrix = Matrix {
        path: path.to_owned(),
        cols: 0,
        lines: Vec::new(),
        values: Vec::new(),
    };
    for (line, row) in text.lines().enumerate() {
        let start = matrix.values.len();
        for (col, cell) in cells(row).enumerate() {
            let value = number(cell).ok_or_else(|| {
                let error = Error::input(
                    format!("{}:{}, column {}", path.display(), line + 1, col + 1),
                    "a number or NaN",
                );
                let error = error.found(cell);
                if cell.contains(',') {
                    error.hint("separate numbers by blanks and use a decimal point")
                } else {
                    error
                }
            })?;
            matrix.values.push(value);
        }
        let cols = matrix.values.len() - start;
        if cols == 0 {
            continue;
        }
        if matrix.lines.is_empty() {
            matrix.cols = cols;
        } else if cols != matrix.cols {
            let expected = format!("{} columns as in line {}", matrix.cols, matrix.lines[0]);
            return Err(
                Error::input(format!("{}:{}", path.display(), line + 1), expected)
                    .found(format!("{cols} columns")),
            );
        }
        matrix.lines.push(line + 1);
    }
    if matrix.values.is_empty() {
        return Err(Error::input(path.display(), "a matrix of numbers").found("an empty file"));
    }
    if let Some(cut) = cut_number(&text) {
        let place = format!("{}:{}", path.display(), text.lines().count());
        let expected = "a last number with as many decimals as the others";
        return Err(Error::input(place, expected)
            .found(cut)
            .hint("a file that was cut? copy it again"));
    }
    Ok(matrix)
}

/// The cells of a text, between blanks or semicolons.
fn cells(text: &str) -> impl DoubleEndedIterator<Item = &str> {
    let parts = text.split(|c: char| c.is_ascii_whitespace() || c == ';');
    parts.filter(|cell| !cell.is_empty())
}

/// The last number of a text whose last line does not end, if it has fewer decimals than all others.
fn cut_number(text: &str) -> Option<&str> {
    let decimals = |cell: &str| cell.rsplit_once('.').map_or(0, |(_, tail)| tail.len());
    let is_measured = |cell: &&str| !cell.eq_ignore_ascii_case("nan");
    let mut cells = cells(text).filter(is_measured);
    let last = cells.next_back().filter(|last| text.ends_with(last))?;
    let fewest = cells.map(decimals).min()?;
    (decimals(last) < fewest).then_some(last)
}

/// Write `grid` as the four files of this format into the directory `dir`, which is made if need be, and the sds of both displacements
/// (mm) beside them. X, Y have 5 decimals of a mm (at a strain of 1e-3 their rounding is worth 5 pm of displacement), U, V and the sds 6
/// decimals of a micrometre.
///
/// # Errors
/// Of the input: a place that cannot be written.
pub fn write_matrices(dir: &Path, grid: &Grid, sd_mm: Option<&[[f64; 2]]>) -> Result<()> {
    fs::create_dir_all(dir).map_err(|e| unwritable(dir, &e))?;
    let entry = |file: usize, i: usize| match file {
        0 | 1 => grid.points[i][file],
        2 | 3 => grid.displacement[i][file - 2] * UM_PER_MM,
        _ => sd_mm.map_or(f64::NAN, |sd| sd[i][file - 4] * UM_PER_MM),
    };
    let sds = SD_NAMES.iter().filter(|_| sd_mm.is_some());
    let names: Vec<(usize, &&str)> = NAMES.iter().chain(sds).enumerate().collect();
    names.par_iter().try_for_each(|&(file, name)| {
        let decimals = if file < 2 { 5 } else { 6 };
        let mut text = String::with_capacity(grid.points.len() * 12);
        for i in 0..grid.points.len() {
            let value = entry(file, i);
            // writing to a String cannot fail
            let _ = if value.is_finite() {
                write!(text, "{value:.decimals$}")
            } else {
                write!(text, "NaN")
            };
            text.push(if (i + 1) % grid.cols == 0 { '\n' } else { ' ' });
        }
        let path = dir.join(name);
        fs::write(&path, text).map_err(|e| unwritable(&path, &e))
    })
}
