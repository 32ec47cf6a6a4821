//! A measured field in rectangular cells, small enough to look at: each cell is the mean of its points.

use crate::numeric::range;

/// A regular grid of cells in the data's frame, and the cell of each point.
#[derive(Debug)]
pub struct FieldCells {
    /// Centres of the columns, mm, ascending.
    pub x: Vec<f64>,
    /// Centres of the rows, mm, ascending.
    pub y: Vec<f64>,
    /// `row * columns + column` of each point.
    pub of_point: Vec<usize>,
}

/// Cells along the longer side, at most.
const MOST_ALONG: usize = 240;

/// Cells in all, at most: what is 700 x 700 points is looked at as 180 x 180.
const MOST: usize = 33_000;

/// Points that lie scattered need larger cells than their spacing, or many cells stay empty.
const SCATTERED: f64 = 1.6;

impl FieldCells {
    /// Cells for points (x, y). Points on a lattice go to cells of whole lattice steps.
    pub fn new(points: &[[f64; 2]]) -> Self {
        let sides = [0, 1].map(|k| lattice(points, k));
        let nodes: usize = sides.iter().map(Vec::len).product();
        let is_lattice = nodes <= 2 * points.len() && nodes > 0;
        let [columns, rows] = if is_lattice {
            let most = most(sides[0].len() as f64, sides[1].len() as f64);
            [0, 1].map(|k| CellAxis::stepwise(&sides[k], most[k]))
        } else {
            let bounds = [0, 1].map(|k| range(points.iter().map(|p| p[k])));
            let span = bounds.map(|[low, high]| (high - low).max(f64::MIN_POSITIVE));
            let spacing = SCATTERED * (span[0] * span[1] / points.len().max(1) as f64).sqrt();
            let wanted = span.map(|s| (s / spacing).ceil().clamp(1.0, 1e6));
            let most = most(wanted[0], wanted[1]);
            [0, 1].map(|k| CellAxis::even(bounds[k], most[k].min(wanted[k] as usize)))
        };
        let of_point = points
            .iter()
            .map(|p| rows.cell(p[1]) * columns.centres.len() + columns.cell(p[0]))
            .collect();
        Self {
            x: columns.centres,
            y: rows.centres,
            of_point,
        }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.x.len() * self.y.len()
    }

    /// Mean of a quantity of the points in each cell; NaN where there is no point.
    pub fn mean(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sum = vec![0.0; self.count()];
        let mut count = vec![0.0; self.count()];
        for (i, &cell) in self.of_point.iter().enumerate() {
            sum[cell] += value(i);
            count[cell] += 1.0;
        }
        sum.iter().zip(&count).map(|(s, n)| s / n).collect()
    }
}

/// Cells along each side for so many points along them.
fn most(columns: f64, rows: f64) -> [usize; 2] {
    let shrink = (MOST as f64 / (columns * rows))
        .sqrt()
        .min(MOST_ALONG as f64 / columns.max(rows))
        .min(1.0);
    [columns, rows].map(|n| ((n * shrink).floor() as usize).max(1))
}

/// The different coordinates along one axis.
fn lattice(points: &[[f64; 2]], axis: usize) -> Vec<f64> {
    let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
    values.sort_by(f64::total_cmp);
    let span = values
        .last()
        .zip(values.first())
        .map_or(0.0, |(a, b)| a - b);
    values.dedup_by(|b, a| *b - *a <= 1e-6 * span);
    values
}

/// Cells along one axis.
struct CellAxis {
    centres: Vec<f64>,
    /// Lower edges of all cells but the first.
    edges: Vec<f64>,
}

impl CellAxis {
    /// At most `most` cells of whole lattice steps.
    fn stepwise(nodes: &[f64], most: usize) -> Self {
        let groups: Vec<&[f64]> = nodes.chunks(nodes.len().div_ceil(most.max(1))).collect();
        Self {
            centres: groups
                .iter()
                .map(|g| g.iter().sum::<f64>() / g.len() as f64)
                .collect(),
            edges: groups
                .windows(2)
                .map(|w| 0.5 * (w[0][w[0].len() - 1] + w[1][0]))
                .collect(),
        }
    }

    fn even([low, high]: [f64; 2], n: usize) -> Self {
        let step = (high - low) / n as f64;
        Self {
            centres: (0..n).map(|k| low + (k as f64 + 0.5) * step).collect(),
            edges: (1..n).map(|k| low + k as f64 * step).collect(),
        }
    }

    fn cell(&self, value: f64) -> usize {
        self.edges.partition_point(|edge| *edge <= value)
    }
}
