//! A matrix that grows by columns.

use nalgebra::{DMatrixView, DVectorView};

/// A matrix that grows by columns.
pub struct Columns {
    pub rows: usize,
    values: Vec<f64>,
}

impl Columns {
    pub fn new(rows: usize) -> Self {
        Self {
            rows,
            values: Vec::new(),
        }
    }

    pub fn count(&self) -> usize {
        self.values.len() / self.rows
    }

    pub fn push(&mut self, column: &[f64]) {
        self.values.extend_from_slice(column);
    }

    pub fn column(&self, k: usize) -> DVectorView<'_, f64> {
        DVectorView::from_slice(&self.values[k * self.rows..(k + 1) * self.rows], self.rows)
    }

    pub fn view(&self) -> DMatrixView<'_, f64> {
        DMatrixView::from_slice(&self.values, self.rows, self.count())
    }
}
