//! What a field shows of the conventions of its table: places before or after the deformation, axes that count the other way, pixels.

use nalgebra::{Matrix3, Vector3};
use rstar::RTree;

use super::common::PointIndex;
use super::measured::Field;

/// A field takes its places from a grid if it has so many points for each coordinate that occurs.
const OF_A_GRID: f64 = 3.0;

/// Of two readings of the places the one whose lines scatter so many times as much is not that of a grid.
const CLEARER: f64 = 4.0;

/// Coordinates closer than this share of the spacing are of one line of a grid.
const LINE: f64 = 0.3;

/// Scatter about a line, as a share of the spacing, that is nothing but rounding.
const ROUNDING: f64 = 1e-7;

/// Strains below so many standard errors are not judged.
const SURE: f64 = 10.0;

/// A shear so many times as large as both normal strains is none that a tension test makes.
const SHEARED: f64 = 4.0;

/// Of exchanged displacements the gradients across are those along and across a tension test: minus Poisson's ratio of one another.
const POISSON: std::ops::Range<f64> = 0.05..0.6;

/// A transverse strain of the sign of the axial one is odd beyond this share of it.
const SWELLS: f64 = 0.05;

/// Mean strains beyond these are a mistake in a unit rather than a measurement of an elastic specimen.
const STRAINS: [f64; 2] = [2e-6, 0.3];

/// Places that the points had before the deformation, if they are given after it.
fn carried_back(field: &Field) -> Vec<[f64; 2]> {
    let both = field.points.iter().zip(&field.displacement);
    both.map(|(p, u)| [p[0] - u[0], p[1] - u[1]]).collect()
}

/// Coordinates of one axis, line by line of the grid that they may be of.
fn lines(points: &[[f64; 2]], k: usize, spacing: f64) -> Vec<Vec<f64>> {
    let mut values: Vec<f64> = points.iter().map(|p| p[k]).collect();
    values.sort_by(f64::total_cmp);
    let apart = |a: &f64, b: &f64| b - a <= LINE * spacing;
    values.chunk_by(apart).map(<[f64]>::to_vec).collect()
}

/// Number of lines along both axes.
fn coordinates(points: &[[f64; 2]], spacing: f64) -> f64 {
    (0..2).map(|k| lines(points, k, spacing).len() as f64).sum()
}

/// RMS distance of the points from the lines of the grid that they are on, as a share of the spacing; `None` if they are on none.
fn scatter(points: &[[f64; 2]], spacing: f64) -> Option<f64> {
    let (mut count, mut sum) = (0, 0.0);
    for line in (0..2).flat_map(|k| lines(points, k, spacing)) {
        let mean = line.iter().sum::<f64>() / line.len() as f64;
        sum += line.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        count += 1;
    }
    let n = points.len() as f64;
    (f64::from(count) * OF_A_GRID < n).then(|| (sum / (2.0 * n)).sqrt() / spacing)
}

/// Whether places are those of the deformed state: by the grid from which one reading takes them, or by the steps, which have one
/// reference; `None` if the fields do not tell.
pub fn is_deformed(fields: &[Field]) -> Option<bool> {
    let is_moved = |f: &&Field| f.displacement.iter().flatten().any(|u| *u != 0.0);
    let moved: Vec<&Field> = fields.iter().filter(is_moved).collect();
    let (first, others) = moved.split_first()?;
    let spacing = first.spacing_mm();
    let in_common = |points: &dyn Fn(&Field) -> Vec<[f64; 2]>| {
        let base = points(first);
        let places = PointIndex::new(&base, spacing);
        let found = |f: &&Field| places.among(&points(f)).iter().flatten().count();
        others.iter().map(found).sum::<usize>()
    };
    match (in_common(&|f| f.points.clone()), in_common(&carried_back)) {
        (given, back) if given > 2 * back => return Some(false),
        (given, back) if back > 2 * given => return Some(true),
        _ => {}
    }
    // lines that are straight before the deformation are bent after it
    let read = |points: &[[f64; 2]]| scatter(points, spacing);
    match (read(&first.points), read(&carried_back(first))) {
        (Some(given), Some(back)) if given.max(back) < ROUNDING => None,
        (Some(given), Some(back)) if CLEARER * back < given => Some(true),
        (Some(given), Some(back)) if CLEARER * given < back => Some(false),
        (Some(_), Some(_)) | (None, None) => None,
        (given, _) => Some(given.is_none()),
    }
}

/// The field with its places as they were before the deformation.
#[must_use]
pub fn before_deformation(mut field: Field) -> Field {
    field.points = carried_back(&field);
    field
}

/// Whether all coordinates are whole numbers of a unit of `mm`, on a grid, as pixels are.
pub fn is_of_pixels(field: &Field, mm: f64) -> bool {
    let whole = |x: &f64| (x / mm - (x / mm).round()).abs() < 1e-9;
    let spacing = field.spacing_mm();
    field.points.iter().flatten().all(whole)
        && coordinates(&field.points, spacing) * OF_A_GRID < field.len() as f64
}

/// Points of `fields` at places where the first has none: what all together have measured.
pub fn all_points(fields: &[Field]) -> Vec<[f64; 2]> {
    let Some((first, others)) = fields.split_first() else {
        return Vec::new();
    };
    let near = (0.5 * first.spacing_mm()).powi(2);
    let mut tree = RTree::bulk_load(first.points.clone());
    for p in others.iter().flat_map(|f| &f.points) {
        if tree
            .nearest_neighbor(*p)
            .is_none_or(|q| (q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2) > near)
        {
            tree.insert(*p);
        }
    }
    tree.iter().copied().collect()
}

/// Mean gradient of the displacement in the field's axes and its standard error; `None` for points on a line.
fn gradient(field: &Field) -> Option<([[f64; 2]; 2], f64)> {
    let mut normal = Matrix3::zeros();
    for p in &field.points {
        let row = Vector3::new(1.0, p[0], p[1]);
        normal += row * row.transpose();
    }
    let inverse = normal.try_inverse()?;
    let fit = |k: usize| {
        let both = field.points.iter().zip(&field.displacement);
        let right: Vector3<f64> = both
            .map(|(p, u)| Vector3::new(1.0, p[0], p[1]) * u[k])
            .sum();
        inverse * right
    };
    let fits = [fit(0), fit(1)];
    let square: f64 = field
        .points
        .iter()
        .zip(&field.displacement)
        .map(|(p, u)| {
            (0..2)
                .map(|k| (u[k] - fits[k].dot(&Vector3::new(1.0, p[0], p[1]))).powi(2))
                .sum::<f64>()
        })
        .sum();
    let error = (square / (2.0 * field.len() as f64) * inverse[(1, 1)].max(inverse[(2, 2)])).sqrt();
    Some((fits.map(|f| [f[1], f[2]]), error))
}

/// The smaller of two numbers over the larger.
fn of_one_another(a: f64, b: f64) -> f64 {
    if a.abs() < b.abs() { a / b } else { b / a }
}

/// What is odd about a field in the data's own axes, each with what to change; `names` are the columns of y, ux, uy.
pub fn odd(field: &Field, names: [&str; 3]) -> Vec<String> {
    let Some((slope, error)) = gradient(field) else {
        return Vec::new();
    };
    let [y, ux, uy] = names;
    let normal = [slope[0][0], slope[1][1]];
    let shear = slope[0][1] + slope[1][0];
    let [less, more] = if normal[0].abs() < normal[1].abs() {
        normal
    } else {
        [normal[1], normal[0]]
    };
    let mut said = Vec::new();
    if shear.abs() > SURE * error
        && shear.abs() > SHEARED * more.abs()
        && POISSON.contains(&of_one_another(-slope[0][1], slope[1][0]))
    {
        said.push(format!(
            "the mean strains are x {:.1e}, y {:.1e} and shear {shear:.1e}. Of a shear test that is right. Of a tension test the displacements are exchanged: write \"ux\": \"{uy}\", \"uy\": \"{ux}\"",
            normal[0], normal[1]
        ));
    } else if less.abs() > SURE * error && less / more > SWELLS {
        said.push(format!(
            "both mean normal strains have one sign, x {:.1e} and y {:.1e}: does uy count against y? then write \"y\": \"-{y}\" or \"uy\": \"-{uy}\"; a camera that moved towards the specimen does this too",
            normal[0], normal[1]
        ));
    }
    if more.abs() > STRAINS[1] {
        said.push(format!("the larger mean strain is {more:.2}: are the displacements in a smaller unit than units.displacements (1000, 25.4)?"));
    } else if more.abs() < STRAINS[0] && more.abs() > SURE * error {
        said.push(format!("the larger mean strain is only {more:.1e}: are the displacements in a larger unit than units.displacements (1000, 25.4)?"));
    }
    said
}
