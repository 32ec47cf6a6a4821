//! A field on a regular grid, with NaN where nothing was measured.

use super::frame::Frame;
use super::measured::{Field, GridShape, Rejected};

/// A field on a matrix, row by row; `points` and `displacement` have `rows * cols` entries.
#[derive(Debug, Clone)]
pub struct Grid {
    pub rows: usize,
    /// Columns.
    pub cols: usize,
    /// Points (x, y) in the data's coordinates, mm.
    pub points: Vec<[f64; 2]>,
    /// Displacements (u1, u2), u1 along the loading axis, mm; NaN where nothing was measured.
    pub displacement: Vec<[f64; 2]>,
}

impl Grid {
    /// A regular grid over the window `[[x0, y0], [x1, y1]]` mm, borders included; rows y increasing, columns x
    /// increasing, no displacement measured yet.
    pub fn regular([low, high]: [[f64; 2]; 2], rows: usize, cols: usize) -> Self {
        let at = |k: usize, i: usize, n: usize| {
            low[k] + (high[k] - low[k]) * i as f64 / (n.max(2) - 1) as f64
        };
        let points: Vec<_> = (0..rows * cols)
            .map(|i| [at(0, i % cols, cols), at(1, i / cols, rows)])
            .collect();
        Self {
            rows,
            cols,
            displacement: vec![[f64::NAN; 2]; points.len()],
            points,
        }
    }

    /// The field of the measured points, in the model's frame.
    pub fn field(&self, frame: Frame) -> Field {
        let index: Vec<usize> = (0..self.points.len())
            .filter(|&i| self.displacement[i].iter().all(|u| u.is_finite()))
            .collect();
        Field {
            points: index.iter().map(|&i| frame.point(self.points[i])).collect(),
            displacement: index.iter().map(|&i| self.displacement[i]).collect(),
            rejected: Rejected {
                missing: self.points.len() - index.len(),
                ..Rejected::default()
            },
            grid: Some(GridShape {
                rows: self.rows,
                cols: self.cols,
                index,
            }),
            ..Field::empty(frame)
        }
    }
}
