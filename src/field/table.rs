//! A table with named columns, as programs for digital image correlation export it: found in its file by `super::sheet`, failed points
//! have empty cells or words for no value.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::frame::Frame;
use super::grid::Grid;
use super::level::{TiltedPlane, WORTH_A_WORD_DEG};
use super::measured::{Field, Reason, Rejected};
use super::programs::{MatchedColumns, matching};
use super::reader::{ColumnMap, Columns, LEAST_CORRELATION, Reader, Units, unwritable};
use super::row::{CsvRow, MeasuredRow, Point};
use super::rows::TableRows;
use super::sheet::Sheet;
pub use super::stated::{stated_force, stated_time};
use crate::error::{Error, Result};
use crate::numeric::median;
use crate::quantity::UM_PER_MM;

/// The reader of this format.
pub struct Csv;

impl Reader for Csv {
    fn format(&self) -> &'static str {
        "csv"
    }

    fn is_directory(&self) -> bool {
        false
    }

    fn file_name(&self) -> &'static str {
        "field.csv"
    }

    fn has_columns(&self) -> bool {
        true
    }

    fn files(&self, path: &Path) -> Vec<PathBuf> {
        vec![path.to_owned()]
    }

    fn read(&self, path: &Path, columns: Option<&ColumnMap>, frame: Frame) -> Result<Field> {
        let columns = columns.ok_or_else(|| Error::program("field::table", "declared columns"))?;
        read(path, columns, frame)
    }

    /// One row a point, failed ones with empty cells.
    fn write(&self, path: &Path, grid: &Grid, frame: Frame) -> Result<Option<ColumnMap>> {
        let mut text = String::from("x_mm,y_mm,ux_um,uy_um\n");
        for (p, u) in grid.points.iter().zip(&grid.displacement) {
            let [ux, uy] = frame.vector(*u).map(|u| u * UM_PER_MM);
            // writing to a String cannot fail
            let _ = if ux.is_finite() && uy.is_finite() {
                writeln!(text, "{:.5},{:.5},{ux:.6},{uy:.6}", p[0], p[1])
            } else {
                writeln!(text, "{:.5},{:.5},,", p[0], p[1])
            };
        }
        std::fs::write(path, text).map_err(|e| unwritable(path, &e))?;
        Ok(Some(ColumnMap {
            columns: Columns::new(["x_mm", "y_mm", "ux_um", "uy_um"].map(String::from)),
            units: Units::new("mm", "um"),
        }))
    }
}

/// Read the columns of the file `path` as a field in `frame`.
///
/// # Errors
/// Of the input: a missing, empty or non-text file, an unknown or repeated column (with the columns there are), a
/// row of another length or a cell that is not a number (with line and column), two displacements of one point, no measured point, a correlation that is
/// below [`LEAST_CORRELATION`] nearly everywhere.
pub fn read(path: &Path, map: &ColumnMap, frame: Frame) -> Result<Field> {
    Ok(read_said(path, map, frame)?.0)
}

/// The same with what was passed over or assumed on the way.
///
/// # Errors
/// The same.
pub fn read_said(path: &Path, map: &ColumnMap, frame: Frame) -> Result<(Field, Vec<String>)> {
    let named = map.columns.named();
    let has = |names: &[String], name: &str| {
        names
            .iter()
            .any(|n| n == name.trim() || name.trim().strip_prefix('-') == Some(n))
    };
    let sheet = Sheet::open(path, &|names| {
        named.iter().all(|(_, name)| has(names, name))
    })?;
    let row = CsvRow::new(path, map, &sheet)?;
    let mut field = Field {
        files: vec![path.to_owned()],
        ..Field::empty(frame)
    };
    let mut rows = TableRows::default();
    let (mut faint, mut of_zeros) = (0, 0);
    let said = sheet.rows(&mut |line, cells| {
        let place = || format!("{}:{line}", path.display());
        match row.point(cells, &place)? {
            Point::Missing => field.rejected.missing += 1,
            Point::Failed => field.rejected.uncorrelated += 1,
            Point::Faint => faint += 1,
            Point::Measured(row) => {
                of_zeros += usize::from(row.is_unfilled());
                if !row.is_unfilled() || of_zeros == 1 {
                    rows.add(row, line);
                }
            }
        }
        Ok(())
    })?;
    let mut remarks = sheet.remarks.clone();
    remarks.extend(said);
    if of_zeros > 1 {
        // a point is measured once: these are rows that a program did not fill
        rows.drop_unfilled();
        field.rejected.uncorrelated += of_zeros;
        remarks.push(format!(
            "{of_zeros} rows of zeros alone are not measured: dropped"
        ));
    }
    field.rejected.repeated = rows.again;
    remarks.extend(rows.settle(path, &mut field.rejected.repeated)?);
    let z = sheet.out_of_plane(&map.columns).map(|[z, _]| z);
    remarks.extend(take_points(&mut field, &rows, z.as_deref())?);
    remarks.extend(take_sigmas(&mut field, &rows.all, &row));
    remarks.extend(drop_unmoved(&mut field));
    field.rejected.uncorrelated += faint;
    check_measured(path, map, &field, faint)?;
    Ok((field, remarks))
}

/// The rows as points of the field, along the axes of their plane where the table has `z` and all points a place and a displacement
/// along it. What is said of that.
///
/// # Errors
/// Of the input: a plane that no camera sees.
fn take_points(field: &mut Field, rows: &TableRows, z: Option<&str>) -> Result<Option<String>> {
    let plane = z.and_then(|z| Some((rows.plane()?, z)));
    for row in &rows.all {
        let ([x, y], [u, v], [z, w]) = (row.at, row.u, row.out_of_plane);
        let level = |(plane, _): &(TiltedPlane, &str)| plane.level([x, y, z], [u, v, w]);
        let (at, u) = plane.as_ref().map_or((row.at, row.u), level);
        field.points.push(field.frame.point(at));
        field.displacement.push(field.frame.vector(u));
    }
    let Some((plane, z)) = plane else {
        return Ok(None);
    };
    plane.check(&field.place(), z)?;
    field.levelled_deg = Some(plane.angle_deg());
    let said = plane.said(z);
    let said = format!("{said}: places and displacements are taken along its axes");
    Ok((plane.angle_deg() > WORTH_A_WORD_DEG).then_some(said))
}

/// Standard deviations reach down to 0 where the least is below this share of the typical one.
const NEAR_0: f64 = 0.25;

/// Points whose standard deviation is 0 were not correlated, unless that of all points is: then it says nothing. Beside a coefficient that
/// is good it was rounded to 0, and is half of the least other, where no other is below its last decimal or others come near to 0.
fn take_sigmas(field: &mut Field, rows: &[MeasuredRow], row: &CsvRow) -> Option<String> {
    let above = rows.iter().map(|row| row.sigma).filter(|s| *s > 0.0);
    let least = above.clone().fold(f64::INFINITY, f64::min);
    if least.is_infinite() {
        return (!rows.is_empty())
            .then(|| "sigma is 0 everywhere: it says nothing and is not used".into());
    }
    let mut above: Vec<f64> = above.collect();
    let near_0 = least < NEAR_0 * median(&mut above);
    let rounded = |of: &MeasuredRow| {
        let is_good = row.has_correlation() && of.u != [0.0; 2];
        let below = of
            .zero_below
            .is_some_and(|unit| unit <= least * (1.0 + 1e-9));
        of.sigma == 0.0 && is_good && (below || near_0)
    };
    let sigma = |of: &MeasuredRow| if rounded(of) { 0.5 * least } else { of.sigma };
    let sigmas: Vec<f64> = rows.iter().map(sigma).collect();
    let count = rows.iter().filter(|of| rounded(of)).count();
    let is_kept: Vec<bool> = sigmas.iter().map(|s| *s > 0.0).collect();
    field.sigma = row.keeps_sigma().then_some(sigmas);
    let dropped = field.retain(Reason::Uncorrelated, |i| is_kept[i]);
    let said = [
        (
            count,
            "with sigma 0 and a good correlation are kept: sigma was rounded to 0",
        ),
        (
            dropped,
            "with sigma 0 are taken for not correlated: dropped",
        ),
    ];
    let said = said.iter().filter(|(n, _)| *n > 0);
    let said: Vec<String> = said.map(|(n, what)| format!("{n} points {what}")).collect();
    (!said.is_empty()).then(|| said.join("; "))
}

/// Programs write zeros, or another number, where they correlated nothing: points with both displacements exactly this number that lie
/// beside points that moved are dropped. In a field that is continuous they would be among points that hardly moved from it.
pub(super) fn drop_unmoved(field: &mut Field) -> Option<String> {
    const FEWEST: usize = 3;
    const MOVED: f64 = 0.25;
    const COARSE: f64 = 20.0;
    let filled = filled_with(&field.displacement);
    let size = |u: &[f64; 2]| (u[0] - filled[0]).hypot(u[1] - filled[1]);
    let (still, moved): (Vec<usize>, Vec<usize>) =
        (0..field.len()).partition(|&i| size(&field.displacement[i]) == 0.0);
    if still.len() < FEWEST || moved.is_empty() {
        return None;
    }
    let typical = median(
        &mut moved
            .iter()
            .map(|&i| size(&field.displacement[i]))
            .collect::<Vec<_>>(),
    );
    // 0 may be a small displacement in a file of few decimals
    let mut components: Vec<f64> = field.displacement.as_flattened().to_vec();
    components.sort_by(f64::total_cmp);
    let gaps = components.windows(2).map(|w| w[1] - w[0]);
    let step = gaps.filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
    if typical < COARSE * step {
        return None;
    }
    let tree = RTree::bulk_load(
        moved
            .iter()
            .map(|&i| GeomWithData::new(field.points[i], i))
            .collect(),
    );
    let beside = |i: &&usize| {
        let nearest = tree.nearest_neighbor(field.points[**i]);
        nearest.is_some_and(|n| size(&field.displacement[n.data]) > MOVED * typical)
    };
    if 2 * still.iter().filter(beside).count() <= still.len() {
        return None;
    }
    let is_kept: Vec<bool> = field.displacement.iter().map(|u| size(u) > 0.0).collect();
    let dropped = field.retain(Reason::Uncorrelated, |i| is_kept[i]);
    Some(format!(
        "{dropped} points with both displacements exactly {} beside points that moved are not measured: dropped",
        if filled == [0.0; 2] {
            "0"
        } else {
            "one number"
        }
    ))
}

/// The number that two displacements share most often, if none is larger, or 0.
fn filled_with(displacement: &[[f64; 2]]) -> [f64; 2] {
    let equal = displacement.iter().filter(|u| u[0] == u[1]);
    let mut equal: Vec<f64> = equal.map(|u| u[0]).collect();
    equal.sort_by(f64::total_cmp);
    let most = equal.chunk_by(|a, b| a == b).max_by_key(|same| same.len());
    let all = displacement.as_flattened();
    let is_largest = |fill: &f64| all.iter().all(|u| u.abs() <= fill.abs());
    [most.map_or(0.0, |same| same[0]); 2].map(|fill| if is_largest(&fill) { fill } else { 0.0 })
}

/// Something was measured, and little of it is `faint`.
fn check_measured(path: &Path, map: &ColumnMap, field: &Field, faint: usize) -> Result<()> {
    if faint > field.len() {
        return Err(faint_everywhere(path, map, [faint, field.len()]));
    }
    if !field.is_empty() {
        return Ok(());
    }
    let Rejected {
        missing,
        uncorrelated,
        ..
    } = field.rejected;
    let found = match uncorrelated {
        0 => format!("{missing} rows, none complete"),
        _ => format!("{missing} rows not complete, {uncorrelated} not correlated"),
    };
    Err(Error::input(path.display(), "at least one measured point").found(found))
}

/// Most of the points have a small correlation: it is rather another measure than a bad picture.
fn faint_everywhere(path: &Path, map: &ColumnMap, [faint, left]: [usize; 2]) -> Error {
    let name = map.columns.correlation.as_deref().unwrap_or_default();
    let expected = format!(
        "correlation coefficients, 1 for a perfect match, of at least {LEAST_CORRELATION} for half of the points"
    );
    let place = format!("{}, column \"{name}\"", path.display());
    Error::input(place, expected)
        .found(format!("smaller ones at {faint} of {} points", faint + left))
        .hint("a residual of the correlation (ZNSSD, gamma), 0 for a perfect match, is no coefficient: leave columns.correlation out")
}

/// The column names of a table.
///
/// # Errors
/// Those of [`described`].
pub fn header(path: &Path) -> Result<Vec<String>> {
    Ok(described(path, &[])?.names)
}

/// What is to be known of a table before its columns are.
#[derive(Debug)]
pub struct TableHeader {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Its line.
    pub line: usize,
    /// What the columns hold, if they are known.
    pub found: Option<MatchedColumns>,
    /// The lines before it.
    pub preamble: String,
    /// The units in a row of their own.
    pub units: Option<Vec<Option<&'static str>>>,
}

/// The header of a table: that of the first line with columns that are known, or with all of `named`.
///
/// # Errors
/// Of the input: a missing, empty or non-text file.
pub fn described(path: &Path, named: &[&str]) -> Result<TableHeader> {
    let wanted = |names: &[String]| {
        let has = |name: &&str| names.iter().any(|n| n == name);
        match named {
            [] => matching(names, None, "").is_some(),
            _ => named.iter().all(has),
        }
    };
    let sheet = Sheet::open(path, &wanted)?;
    let preamble = sheet.preamble().collect::<Vec<_>>().join("\n");
    Ok(TableHeader {
        found: matching(&sheet.names, sheet.units.as_deref(), &preamble),
        preamble,
        line: sheet.line,
        names: sheet.names,
        units: sheet.units,
    })
}
