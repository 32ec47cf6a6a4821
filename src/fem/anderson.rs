//! Anderson's acceleration of a fixed-point iteration (Walker and Ni, SIAM J. Numer. Anal. 49 (2011) 1715).

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

/// Differences that are remembered.
const DEPTH: usize = 10;

/// Singular values below this share of the largest count as 0.
const RANK: f64 = 1e-12;

/// A residual so many times the smallest one so far: what is remembered misleads.
const ASTRAY: f64 = 3.0;

/// The differences of an iteration x -> g(x) so far.
#[derive(Default)]
pub struct Anderson {
    /// g(x) - x and g(x) of the last step.
    last: Option<(DVector<f64>, DVector<f64>)>,
    /// Their changes from step to step.
    changes: VecDeque<(DVector<f64>, DVector<f64>)>,
    smallest: Option<f64>,
}

impl Anderson {
    /// The next x from the last one and its image: the combination of images whose residuals, taken as linear, nearly cancel. After a step
    /// that led astray, the image itself.
    pub fn next(&mut self, x: &[f64], image: Vec<f64>) -> Vec<f64> {
        let image = DVector::from_vec(image);
        let residual = &image - DVector::from_column_slice(x);
        let size = residual.norm();
        let smallest = self.smallest.map_or(size, |s| s.min(size));
        self.smallest = Some(smallest);
        if size > ASTRAY * smallest {
            *self = Self {
                smallest: Some(size),
                ..Self::default()
            };
        }
        if let Some((residual_before, image_before)) = self.last.take() {
            self.changes
                .push_back((&residual - residual_before, &image - image_before));
            if self.changes.len() > DEPTH {
                self.changes.pop_front();
            }
        }
        let next = self.combined(&residual, &image);
        self.last = Some((residual, image));
        next.data.into()
    }

    fn combined(&self, residual: &DVector<f64>, image: &DVector<f64>) -> DVector<f64> {
        let sizes: Vec<f64> = self.changes.iter().map(|(f, _)| f.norm()).collect();
        if sizes.is_empty() || sizes.contains(&0.0) {
            return image.clone();
        }
        let n = sizes.len();
        let f = |k: usize| &self.changes[k].0;
        let gram = DMatrix::from_fn(n, n, |i, j| f(i).dot(f(j)) / (sizes[i] * sizes[j]));
        let right = DVector::from_fn(n, |i, _| f(i).dot(residual) / sizes[i]);
        let Ok(weights) = gram.svd(true, true).solve(&right, RANK) else {
            return image.clone();
        };
        let mut next = image.clone();
        for (k, (_, g)) in self.changes.iter().enumerate() {
            next.axpy(-weights[k] / sizes[k], g, 1.0);
        }
        next
    }
}
