//! The data under one choice of the noise, as the constants move: normal equations that are polynomials of their distances.

use nalgebra::{DMatrix, DVector};

use super::space::{monomials, values};

/// H(d) = sum of monomials times matrices, z(d) and r(d): G = X' C^-1 X of the directions' columns, X' C^-1 y of what the data leave,
/// and y' C^-1 y.
#[derive(Clone)]
pub struct Equations {
    pub monomials: Vec<[usize; 2]>,
    /// One a monomial.
    pub gram: Vec<DMatrix<f64>>,
    /// For every constant's distance, directions x monomials.
    pub right: Vec<DMatrix<f64>>,
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
        let count = monomials.len();
        Self {
            gram: gram.collect(),
            right: (0..=constants)
                .map(|a| all.view((a * n, tail), (n, count)).into_owned())
                .collect(),
            rest: all.view((tail, tail), (count, count)).into_owned(),
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

    /// G and z at distances of the constants from where the test was linearised, prior sds.
    pub fn at(&self, distances: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
        let d: Vec<f64> = std::iter::once(1.0)
            .chain(distances.iter().copied())
            .collect();
        let m = DVector::from_vec(values(&self.monomials, &d));
        let n = self.right[0].nrows();
        let mut gram = DMatrix::zeros(n, n);
        for (g, w) in self.gram.iter().zip(m.iter()) {
            gram += g * *w;
        }
        let mut right = DVector::zeros(n);
        for (z, d) in self.right.iter().zip(&d) {
            right += z * &m * *d;
        }
        (gram, right)
    }
}
