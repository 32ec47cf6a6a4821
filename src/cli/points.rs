//! What the points of a field show: the hole, which is the largest gap in them, and the axis along which it is stretched.

use crate::field::Field;
use crate::mesh_files::Circle;
use crate::numeric::range;
use crate::report::FieldCells;

/// Share of the measured rectangle that a gap must at least cover to be a hole.
const SMALLEST_GAP: f64 = 0.003;

/// Centre and diameter of the largest gap in the points that is round and has points all about it: notches and lost patches are no
/// holes.
pub fn hole(points: &[[f64; 2]]) -> Option<([f64; 2], f64)> {
    let cells = FieldCells::new(points);
    let (columns, rows) = (cells.x.len(), cells.y.len());
    if columns < 5 || rows < 5 {
        return None;
    }
    let mut gaps = gaps(&cells);
    gaps.sort_by_key(|gap| std::cmp::Reverse(gap.len()));
    let large = |gap: &&Vec<usize>| gap.len() as f64 >= SMALLEST_GAP * cells.count() as f64;
    gaps.iter().take_while(large).find_map(|gap| {
        let n = gap.len() as f64;
        let middle = [
            gap.iter().map(|c| cells.x[c % columns]).sum::<f64>() / n,
            gap.iter().map(|c| cells.y[c / columns]).sum::<f64>() / n,
        ];
        let spacing = [&cells.x, &cells.y].map(|x| (x[x.len() - 1] - x[0]) / (x.len() - 1) as f64);
        let (centre, rim) = circle(points, middle, spacing[0].max(spacing[1]))?;
        // among few points the rim lies far outside the gap
        let of_cells = (4.0 / std::f64::consts::PI * n * spacing[0] * spacing[1]).sqrt();
        let diameter = missing(points, centre, rim).filter(|d| *d < rim);
        let diameter = diameter.unwrap_or(of_cells.min(rim));
        // a point that was lost leaves a gap, too
        (diameter > spacing[0].max(spacing[1])).then_some((centre, diameter))
    })
}

/// Connected cells without points that do not touch the border.
fn gaps(cells: &FieldCells) -> Vec<Vec<usize>> {
    let (columns, rows) = (cells.x.len(), cells.y.len());
    let mut empty = vec![true; cells.count()];
    cells.of_point.iter().for_each(|&c| empty[c] = false);
    let mut gaps = Vec::new();
    for start in 0..cells.count() {
        if !empty[start] {
            continue;
        }
        let (mut gap, mut inside) = (Vec::new(), true);
        let mut todo = vec![start];
        empty[start] = false;
        while let Some(cell) = todo.pop() {
            gap.push(cell);
            let (i, j) = (cell % columns, cell / columns);
            if i == 0 || j == 0 || i + 1 == columns || j + 1 == rows {
                inside = false;
                continue;
            }
            for next in [cell - 1, cell + 1, cell - columns, cell + columns] {
                if std::mem::take(&mut empty[next]) {
                    todo.push(next);
                }
            }
        }
        if inside {
            gaps.push(gap);
        }
    }
    gaps
}

/// Directions in which the hole's rim is sought.
const SECTORS: usize = 36;

/// Share of the directions in which the rim must lie near its circle: within a quarter of the radius and a spacing.
const CLOSED: f64 = 0.85;
const ROUND: f64 = 0.25;

/// The circle through the points next to a gap, by least squares: centre and diameter. The nearest point in each
/// direction stands for the rim; `None` where that is not round, or does not reach all around.
fn circle(points: &[[f64; 2]], start: [f64; 2], spacing: f64) -> Option<([f64; 2], f64)> {
    let (mut centre, mut radius) = (start, 0.0);
    for _ in 0..5 {
        let rim: Vec<[f64; 2]> = rim_about(points, centre).map(|(_, p)| p).collect();
        let fit = Circle::near(&rim)?;
        (centre, radius) = (fit.center, fit.radius);
    }
    let near =
        rim_about(points, centre).filter(|(r, _)| (r - radius).abs() < ROUND * radius + spacing);
    (near.count() as f64 >= CLOSED * SECTORS as f64).then_some((centre, 2.0 * radius))
}

/// The nearest point in each direction, with its distance.
fn rim_about(points: &[[f64; 2]], centre: [f64; 2]) -> impl Iterator<Item = (f64, [f64; 2])> {
    let mut rim: Vec<Option<(f64, [f64; 2])>> = vec![None; SECTORS];
    for p in points {
        let [x, y] = [p[0] - centre[0], p[1] - centre[1]];
        let turn = y.atan2(x) / std::f64::consts::TAU + 0.5;
        let sector = ((turn * SECTORS as f64) as usize).min(SECTORS - 1);
        let r = x.hypot(y);
        if rim[sector].is_none_or(|(nearest, _)| r < nearest) {
            rim[sector] = Some((r, *p));
        }
    }
    rim.into_iter().flatten()
}

/// Radii about a gap within which points are counted, over its own.
const COUNTED: [f64; 2] = [1.3, 1.8];
const COUNTS: usize = 40;

/// The diameter of a gap by the points that are missing in it: that of a circle through its rim is too large by some spacing. None where the
/// points about it do not reach all around.
fn missing(points: &[[f64; 2]], centre: [f64; 2], diameter: f64) -> Option<f64> {
    let radius = 0.5 * diameter;
    let [inner, outer] = COUNTED.map(|c| c * radius);
    let surrounds = [0, 1].iter().all(|&k| {
        let [low, high] = range(points.iter().map(|p| p[k] - centre[k]));
        high.min(-low) >= outer
    });
    if !surrounds {
        return None;
    }
    let mut distances: Vec<f64> = (points.iter())
        .map(|p| (p[0] - centre[0]).hypot(p[1] - centre[1]))
        .filter(|r| *r <= outer)
        .collect();
    distances.sort_by(f64::total_cmp);
    // points within r are density (pi r^2 - area): a line through their numbers
    let step = (outer - inner) / (COUNTS - 1) as f64;
    let counted = (0..COUNTS).map(|k| {
        let r = inner + step * k as f64;
        let within = distances.partition_point(|d| *d <= r);
        (std::f64::consts::PI * r * r, within as f64)
    });
    let counted: Vec<(f64, f64)> = counted.collect();
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| counted.iter().map(f).sum::<f64>() / COUNTS as f64;
    let (disc, within) = (mean(&|c| c.0), mean(&|c| c.1));
    let slope = mean(&|c| (c.0 - disc) * (c.1 - within)) / mean(&|c| (c.0 - disc).powi(2));
    let area = disc - within / slope;
    (area > 0.0).then(|| 2.0 * (area / std::f64::consts::PI).sqrt())
}

/// The axis of the larger mean strain (points and displacements in the data's own axes).
pub fn loading_axis(field: &Field) -> &'static str {
    let [x, y] = strain(field);
    if y > x { "y" } else { "x" }
}

/// Sizes of the mean strains along the data's axes.
pub fn strain(field: &Field) -> [f64; 2] {
    [0, 1].map(|k| {
        let n = field.len() as f64;
        let mean = |f: &dyn Fn(usize) -> f64| (0..field.len()).map(f).sum::<f64>() / n;
        let (x, u) = (
            mean(&|i| field.points[i][k]),
            mean(&|i| field.displacement[i][k]),
        );
        let xu = mean(&|i| (field.points[i][k] - x) * (field.displacement[i][k] - u));
        let xx = mean(&|i| (field.points[i][k] - x).powi(2));
        (xu / xx.max(f64::MIN_POSITIVE)).abs()
    })
}
