//! Points that several fields have in common, by their coordinates.

use std::collections::HashMap;

/// Points within this share of the spacing of neighbours are the same, written with other decimals.
const SAME: f64 = 0.02;

/// The points of one field, to look others up among them.
pub(super) struct PointIndex<'a> {
    points: &'a [[f64; 2]],
    tolerance: f64,
    side: f64,
    /// First point of each cell of the plane, and after each point the next of its cell.
    first: HashMap<[i64; 2], usize>,
    next: Vec<usize>,
}

/// No further point in a cell.
const NONE: usize = usize::MAX;

impl<'a> PointIndex<'a> {
    /// `spacing_mm` is the distance of neighbouring points.
    pub fn new(points: &'a [[f64; 2]], spacing_mm: f64) -> Self {
        // coincident points have no spacing; coordinates are written to a nanometre at best
        let side = spacing_mm.max(1e-6);
        let mut places = Self {
            points,
            tolerance: SAME * side,
            side,
            first: HashMap::with_capacity(points.len()),
            next: vec![NONE; points.len()],
        };
        // backwards, so that a cell begins with its first point
        for (i, p) in points.iter().enumerate().rev() {
            let cell = places.cell(*p, [0.0; 2]);
            if let Some(earlier) = places.first.insert(cell, i) {
                places.next[i] = earlier;
            }
        }
        places
    }

    /// The cell of a point moved by `shift`.
    fn cell(&self, p: [f64; 2], shift: [f64; 2]) -> [i64; 2] {
        [0, 1].map(|k| ((p[k] + shift[k]) / self.side).floor() as i64)
    }

    /// The point at the place of `p`, not yet `taken`.
    fn at(&self, p: [f64; 2], taken: &[usize]) -> Option<usize> {
        let low = self.cell(p, [-self.tolerance; 2]);
        let high = self.cell(p, [self.tolerance; 2]);
        for a in low[0]..=high[0] {
            for b in low[1]..=high[1] {
                let mut i = self.first.get(&[a, b]).copied().unwrap_or(NONE);
                while i != NONE {
                    let near = (0..2).all(|k| (self.points[i][k] - p[k]).abs() <= self.tolerance);
                    if near && taken[i] == NONE {
                        return Some(i);
                    }
                    i = self.next[i];
                }
            }
        }
        None
    }

    /// For each point the first one at its place.
    pub fn first_at_each(&self) -> Vec<usize> {
        let none = vec![NONE; self.points.len()];
        let first = |(i, p): (usize, &[f64; 2])| self.at(*p, &none).unwrap_or(i);
        self.points.iter().enumerate().map(first).collect()
    }

    /// For each point its number among `others`, [`None`] where it is not there; each of `others` stands for one point.
    pub fn among(&self, others: &[[f64; 2]]) -> Vec<Option<usize>> {
        let mut found = vec![NONE; self.points.len()];
        for (j, p) in others.iter().enumerate() {
            // exports of one grid have its points in one order
            let same = self.points.get(j).is_some_and(|q| {
                found[j] == NONE && (0..2).all(|k| (q[k] - p[k]).abs() <= self.tolerance)
            });
            let place = if same { Some(j) } else { self.at(*p, &found) };
            if let Some(i) = place {
                found[i] = j;
            }
        }
        let index = found.into_iter();
        index.map(|j| (j != NONE).then_some(j)).collect()
    }
}
