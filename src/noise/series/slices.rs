//! Columns over all frames, in a basis of what they do in one frame.
//!
//! A column of (frames x blocks) values is often one field times a law; all columns in all frames span a space of far fewer
//! fields than there are slices. Whatever has the covariance S (x) N then needs N^-1 of the basis only:
//! X' (S (x) N^-1) X = sum over s, t of S_st T_s' (A' N^-1 A) T_t.

use nalgebra::{DMatrix, DVector};

use crate::dense::{product, tr_product};

/// Parts of a slice below this share of its column's longest slice are left out: of a field of millimetres under noise of
/// 10 nm, 1e-4 sd.
const NEGLIGIBLE: f64 = 1e-9;

/// All columns of one component and, last, the data.
#[derive(Debug)]
pub(super) struct Slices {
    /// A: an orthonormal basis of the columns' slices, and the data's slices: blocks x k.
    pub basis: DMatrix<f64>,
    /// T_s: the columns and the data of each frame in that basis, k x (p + 1).
    pub frames: Vec<DMatrix<f64>>,
}

impl Slices {
    /// Of `columns` ((frames n) x (p + 1), frame by frame, the data last) over `n` blocks.
    pub fn new(columns: &DMatrix<f64>, n: usize) -> Self {
        let (count, last) = (columns.nrows() / n, columns.ncols() - 1);
        let explaining = columns.columns(0, last).into_owned();
        // frame-major columns side by side are all slices side by side
        let slices = explaining.reshape_generic(nalgebra::Dyn(n), nalgebra::Dyn(count * last));
        let mut spanned = SliceBasis::new(n);
        for column in 0..last {
            spanned.include(
                slices.columns(column * count, count).into_owned(),
                NEGLIGIBLE,
            );
        }
        let basis = spanned.into_matrix();
        let q = basis.ncols();
        let inside = tr_product(&basis, &slices);
        let frames = (0..count).map(|s| {
            let mut t = DMatrix::zeros(q + count, last + 1);
            for column in 0..last {
                let from = inside.column(column * count + s);
                t.view_mut((0, column), (q, 1)).copy_from(&from);
            }
            t[(q + s, last)] = 1.0;
            t
        });
        let frames = frames.collect();
        let data = DMatrix::from_column_slice(n, count, columns.column(last).as_slice());
        let mut all = basis.resize_horizontally(q + count, 0.0);
        all.columns_mut(q, count).copy_from(&data);
        Self { basis: all, frames }
    }

    /// What every frame has more than the one before.
    pub fn steps(mut self) -> Self {
        for s in (1..self.frames.len()).rev() {
            let (before, own) = self.frames.split_at_mut(s);
            own[0] -= &before[s - 1];
        }
        self
    }

    /// sum of weights times T_s.
    pub fn combined(&self, weights: &DVector<f64>) -> DMatrix<f64> {
        let (rows, columns) = self.frames.first().map_or((0, 0), DMatrix::shape);
        let mut sum = DMatrix::zeros(rows, columns);
        for (t, weight) in self.frames.iter().zip(weights.iter()) {
            if *weight != 0.0 {
                sum.iter_mut().zip(t).for_each(|(a, b)| *a += weight * b);
            }
        }
        sum
    }
}

/// A growing orthonormal basis of vectors of length n.
pub(super) struct SliceBasis {
    vectors: DMatrix<f64>,
}

impl SliceBasis {
    pub fn new(n: usize) -> Self {
        Self {
            vectors: DMatrix::zeros(n, 0),
        }
    }

    /// Take in what is new in some vectors, down to a part of the longest.
    pub fn include(&mut self, mut left: DMatrix<f64>, negligible: f64) {
        let longest = |m: &DMatrix<f64>| {
            let norms = m.column_iter().map(|c| c.norm());
            let mut places: Vec<(usize, f64)> = norms.enumerate().collect();
            places.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            places.first().copied().unwrap_or((0, 0.0))
        };
        let floor = negligible * longest(&left).1;
        // twice, for orthogonality
        for _ in 0..2 {
            let inside = tr_product(&self.vectors, &left);
            left -= product(&self.vectors, &inside);
        }
        while self.vectors.ncols() < self.vectors.nrows() {
            let (pivot, norm) = longest(&left);
            if norm <= floor {
                break;
            }
            let mut next: DVector<f64> = left.column(pivot) / norm;
            let inside = self.vectors.tr_mul(&next);
            next.gemv(-1.0, &self.vectors, &inside, 1.0);
            next.normalize_mut();
            let along = left.tr_mul(&next);
            left.ger(-1.0, &next, &along, 1.0);
            left.column_mut(pivot).fill(0.0);
            let at = self.vectors.ncols();
            let grown = std::mem::replace(&mut self.vectors, DMatrix::zeros(0, 0));
            self.vectors = grown.insert_column(at, 0.0);
            self.vectors.set_column(at, &next);
        }
    }

    pub fn into_matrix(self) -> DMatrix<f64> {
        self.vectors
    }
}
