//! The data under one choice of the noise, as the constants move: normal equations that are polynomials of their distances.
//!
//! Symmetric matrices are kept by their lower triangles, column after column: the density takes nearly all its time to add them up and
//! to factorise their sum.

use nalgebra::{DMatrix, DVector};

use super::space::{monomials, values};

/// H(d) = sum of monomials times matrices, z(d) and r(d): G = X' C^-1 X of the directions' columns, X' C^-1 y of what the data leave,
/// and y' C^-1 y.
#[derive(Clone)]
pub(super) struct Equations {
    directions: usize,
    monomials: Vec<[usize; 2]>,
    /// Lower triangles, one a monomial.
    gram: Vec<Vec<f64>>,
    /// For every constant's distance, directions x monomials.
    right: Vec<DMatrix<f64>>,
    rest: DMatrix<f64>,
}

/// The normal equations at a point: the lower triangle of G, z, r.
#[derive(Default)]
pub(super) struct At {
    pub gram: Vec<f64>,
    pub right: Vec<f64>,
    pub rest: f64,
}

impl Equations {
    /// From X' C^-1 X of the columns of [`super::space::stacked`].
    pub fn new(all: &DMatrix<f64>, directions: usize, constants: usize) -> Self {
        let monomials = monomials(constants);
        let n = directions;
        let gram = monomials.iter().map(|&[a, b]| {
            let of = all.view((a * n, b * n), (n, n)).into_owned();
            packed(&if a == b { of } else { &of + of.transpose() })
        });
        let tail = (constants + 1) * n;
        let count = monomials.len();
        Self {
            directions,
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
        let turn = |g: &Vec<f64>| packed(&(by.tr_mul(&unpacked(g, self.directions)) * by));
        Self {
            gram: self.gram.iter().map(turn).collect(),
            right: self.right.iter().map(|z| by.tr_mul(z)).collect(),
            ..self.clone()
        }
    }

    /// At distances of the constants from where the test was linearised, prior sds; `at` is used again.
    pub fn at(&self, distances: &[f64], at: &mut At) {
        let d: Vec<f64> = std::iter::once(1.0)
            .chain(distances.iter().copied())
            .collect();
        let m = DVector::from_vec(values(&self.monomials, &d));
        at.gram.clear();
        at.gram.extend_from_slice(&self.gram[0]);
        for (g, &w) in self.gram[1..].iter().zip(m.iter().skip(1)) {
            at.gram.iter_mut().zip(g).for_each(|(sum, g)| *sum += w * g);
        }
        at.right.clear();
        at.right.resize(self.directions, 0.0);
        for (z, d) in self.right.iter().zip(&d) {
            for (column, m) in z.as_slice().chunks_exact(self.directions).zip(m.iter()) {
                let by = d * m;
                at.right
                    .iter_mut()
                    .zip(column)
                    .for_each(|(sum, z)| *sum += by * z);
            }
        }
        at.rest = m.dot(&(&self.rest * &m));
    }
}

impl At {
    /// The whole matrix G.
    pub fn matrix(&self) -> DMatrix<f64> {
        unpacked(&self.gram, self.right.len())
    }

    /// Under a unit prior: ln |P| / 2 and z' P^-1 z of P = I + G, or none where P is not positive definite.
    pub fn eliminate(&mut self) -> Option<[f64; 2]> {
        let n = self.right.len();
        let mut next = 0;
        for j in 0..n {
            self.gram[next] += 1.0;
            next += n - j;
        }
        let (mut log_det, mut square) = (0.0, 0.0);
        let mut a = &mut self.gram[..];
        let mut z = &mut self.right[..];
        while !a.is_empty() {
            let (column, rest) = a.split_at_mut(z.len());
            let pivot = column[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            let by = 1.0 / pivot.sqrt();
            log_det -= by.ln();
            let (first, later) = z.split_at_mut(1);
            let y = first[0] * by;
            square += y * y;
            let column = &mut column[1..];
            column.iter_mut().for_each(|x| *x *= by);
            later
                .iter_mut()
                .zip(&*column)
                .for_each(|(z, l)| *z -= y * l);
            let mut next = 0;
            for k in 0..column.len() {
                let l = column[k];
                let below = &column[k..];
                rest[next..next + below.len()]
                    .iter_mut()
                    .zip(below)
                    .for_each(|(x, c)| *x -= l * c);
                next += below.len();
            }
            (a, z) = (rest, later);
        }
        Some([log_det, square])
    }
}

/// The lower triangle of a symmetric matrix, column after column.
fn packed(m: &DMatrix<f64>) -> Vec<f64> {
    let columns = m.column_iter().enumerate();
    columns
        .flat_map(|(j, column)| column.iter().skip(j).copied().collect::<Vec<f64>>())
        .collect()
}

fn unpacked(lower: &[f64], n: usize) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(n, n);
    let mut values = lower.iter();
    for j in 0..n {
        for (i, value) in (j..n).zip(&mut values) {
            m[(i, j)] = *value;
            m[(j, i)] = *value;
        }
    }
    m
}
