//! A matrix that grows by columns.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DMatrixView, DVectorView};

/// A matrix that grows by columns.
pub struct ColumnStore {
    pub rows: usize,
    values: Vec<f64>,
}

impl ColumnStore {
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
        // columns are long: room for one more at a time costs a remapping, twice the room as much memory again
        self.values.reserve_exact(column.len());
        self.values.extend_from_slice(column);
    }

    pub fn column(&self, k: usize) -> DVectorView<'_, f64> {
        DVectorView::from_slice(&self.values[k * self.rows..(k + 1) * self.rows], self.rows)
    }

    /// Their products with other columns of as many rows: C^T X. (By faer: nalgebra multiplies few columns one by one.)
    pub fn products(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut products = DMatrix::zeros(self.count(), x.ncols());
        let (m, n) = products.shape();
        matmul(
            MatMut::from_column_major_slice_mut(products.as_mut_slice(), m, n),
            Accum::Replace,
            self.all().transpose(),
            MatRef::from_column_major_slice(x.as_slice(), self.rows, n),
            1.0,
            Par::Seq,
        );
        products
    }

    fn all(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.values, self.rows, self.count())
    }

    pub fn view(&self) -> DMatrixView<'_, f64> {
        DMatrixView::from_slice(&self.values, self.rows, self.count())
    }
}
