//! The data under one choice of the noise, as the constants move: normal equations that are polynomials of their coordinates.

use nalgebra::{DMatrix, DVector};

use super::space::{monomials, values};

/// G(x) = sum of monomials of the coordinates times matrices, z(x) and r(x): G = X' C^-1 X of the directions' columns, X' C^-1 y of what the data
/// leave, and y' C^-1 y. What they leave is a sum of fields with factors that depend on the constants.
#[derive(Clone)]
pub struct Equations {
    pub monomials: Vec<[usize; 2]>,
    /// One a monomial.
    pub gram: Vec<DMatrix<f64>>,
    /// For 1 and every coordinate, directions x factors.
    pub right: Vec<DMatrix<f64>>,
    /// Factors x factors.
    pub rest: DMatrix<f64>,
}

impl Equations {
    /// From X' C^-1 X of the columns of [`super::space::stacked`].
    pub fn new(all: &DMatrix<f64>, directions: usize, constants: usize) -> Self {
        let monomials = monomials(constants);
        let n = directions;
        let gram = monomials.iter().map(|&[a, b]| {
            let of = all.view((a * n, b * n), (n, n)).into_owned();
            if a == b { of } else { &of + of.transpose() }
        });
        let tail = (constants + 1) * n;
        let factors = all.nrows() - tail;
        Self {
            gram: gram.collect(),
            right: (0..=constants)
                .map(|a| all.view((a * n, tail), (n, factors)).into_owned())
                .collect(),
            rest: all.view((tail, tail), (factors, factors)).into_owned(),
            monomials,
        }
    }

    /// In other directions: gamma = `by` delta.
    pub fn turned(&self, by: &DMatrix<f64>) -> Self {
        Self {
            gram: self.gram.iter().map(|g| by.tr_mul(g) * by).collect(),
            right: self.right.iter().map(|z| by.tr_mul(z)).collect(),
            ..self.clone()
        }
    }

    /// G and z at coordinates of the constants, 1 first, and factors of what is left.
    pub fn at(&self, coordinates: &[f64], factors: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
        let m = values(&self.monomials, coordinates);
        let left = DVector::from_column_slice(factors);
        let n = self.right[0].nrows();
        let mut gram = DMatrix::zeros(n, n);
        for (g, w) in self.gram.iter().zip(m) {
            gram += g * w;
        }
        let mut right = DVector::zeros(n);
        for (z, x) in self.right.iter().zip(coordinates) {
            right += z * &left * *x;
        }
        (gram, right)
    }
}
