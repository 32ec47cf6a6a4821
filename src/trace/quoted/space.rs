//! Everything that enters linearly beside the constants, in the directions that the data see.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::expanded::TestExpansion;
use crate::linearise::{Column, Measured, Sensitivities};

/// Whose a column is that enters linearly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whose {
    /// Thickness, load, motion, declared effects, what the data would not show: it acts with its own prior.
    Always,
    /// A candidate's.
    Candidate(usize),
    /// The near-edge rival's.
    Rival,
}

/// Columns that enter linearly, each at its largest prior sd, and an orthonormal basis of what the data see of them: amplitudes in
/// those units are V gamma and something in the null space of V', of which the data know nothing.
pub struct Space {
    pub whose: Vec<Whose>,
    /// Largest prior sds of the columns, in units of their own.
    pub largest: DVector<f64>,
    /// V, columns x directions.
    pub seen: DMatrix<f64>,
}

/// Directions are seen in which the data leave less than all but a hundredth of the prior variance.
const SEEN: f64 = 1e-2;

impl Space {
    /// Of columns with the sum of their normal equations under some choices of the noise.
    pub fn new(whose: Vec<Whose>, largest: DVector<f64>, gram: &DMatrix<f64>) -> Self {
        let scaled = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| {
            gram[(i, j)] * largest[i] * largest[j]
        });
        let eigen = SymmetricEigen::new(scaled);
        let mut kept: Vec<usize> = (0..eigen.eigenvalues.len())
            .filter(|&k| eigen.eigenvalues[k] > SEEN)
            .collect();
        kept.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        Self {
            whose,
            largest,
            seen: eigen.eigenvectors.select_columns(&kept),
        }
    }

    /// Number of directions.
    pub fn directions(&self) -> usize {
        self.seen.ncols()
    }

    /// Prior sds over the largest ones, of an account in which the candidates `own` act with their prior sds, all others with `size` of
    /// theirs, and the rival with stresses of `rival` times the nominal one.
    pub fn sds(&self, own: &[usize], size: f64, rival: f64) -> DVector<f64> {
        DVector::from_fn(self.whose.len(), |k, _| {
            let sd = match self.whose[k] {
                Whose::Always => 1.0,
                Whose::Candidate(c) if own.contains(&c) => 1.0,
                Whose::Candidate(_) => size,
                Whose::Rival => rival,
            };
            sd / self.largest[k]
        })
    }

    /// Prior covariance of gamma for prior sds of [`Space::sds`].
    pub fn covariance(&self, sds: &DVector<f64>) -> DMatrix<f64> {
        let mut scaled = self.seen.clone();
        for (mut row, sd) in scaled.row_iter_mut().zip(sds.iter()) {
            row *= *sd;
        }
        scaled.tr_mul(&scaled)
    }
}

/// Products of up to two of the constants' distances from where the test was linearised, 1 first: which distances each is of.
pub fn monomials(constants: usize) -> Vec<[usize; 2]> {
    let pairs = (0..=constants).flat_map(|a| (a..=constants).map(move |b| [a, b]));
    pairs.collect()
}

/// Values of [`monomials`] at distances d, of which the first is 1.
pub fn values(of: &[[usize; 2]], d: &[f64]) -> Vec<f64> {
    of.iter().map(|[a, b]| d[*a] * d[*b]).collect()
}

/// Columns that enter linearly: the base columns beyond the constants, the candidates' and the rival's.
pub fn linear(of: &Sensitivities) -> Vec<&Column> {
    let sought = of.candidates.iter().flat_map(|c| &c.columns);
    of.base[of.constants..].iter().chain(sought).collect()
}

/// Some linear columns of one component, the near-edge rival's behind all others.
pub fn shown(of: &Sensitivities, kept: &[usize], c: usize) -> DMatrix<f64> {
    let own = linear(of);
    let column = |&k: &usize| match own.get(k) {
        Some(column) => column.values[c].clone(),
        None => of.near_edge[k - own.len()][c].clone(),
    };
    DMatrix::from_columns(&kept.iter().map(column).collect::<Vec<DVector<f64>>>())
}

/// One component's columns for an account, from the test as it is linearised `here` on one of the meshes: those of `space` in its
/// directions, at the point and then their changes for a prior sd of each constant; and what the data leave where all amplitudes in the
/// directions are zero, a column for each of [`monomials`].
pub fn stacked(
    here: &Sensitivities,
    expanded: &TestExpansion,
    measured: &Measured,
    space: &Space,
    kept: &[usize],
    c: usize,
) -> DMatrix<f64> {
    let all = linear(here);
    let about = linear(&expanded.about);
    let rows = here.predicted[c].len();
    let matrix = |of: &Sensitivities| shown(of, kept, c);
    let mut scaled = space.seen.clone();
    for (mut row, sd) in scaled.row_iter_mut().zip(space.largest.iter()) {
        row *= *sd;
    }
    let first = matrix(here);
    let before = matrix(&expanded.about);
    let mut parts = vec![&first * &scaled];
    // an amplitude that is not zero where the test was linearised: its column bends with the constants from there
    let at: DVector<f64> =
        DVector::from_iterator(all.len(), all.iter().map(|k| (k.at - k.mean) / k.sd));
    let mut bent = vec![DVector::zeros(rows); expanded.raised.len()];
    for ((raised, by), bent) in expanded.raised.iter().zip(&expanded.by).zip(&mut bent) {
        parts.push((matrix(raised) - &before) * &scaled / *by);
        for (k, (a, b)) in linear(raised).into_iter().zip(&about).enumerate() {
            if at[k] != 0.0 {
                bent.axpy(at[k] / by, &(&a.values[c] - &b.values[c]), 1.0);
            }
        }
    }
    parts.push(left((here, expanded), measured, &bent, c));
    let width = parts.iter().map(DMatrix::ncols).sum();
    let mut together = DMatrix::zeros(rows, width);
    let mut next = 0;
    for part in parts {
        together.columns_mut(next, part.ncols()).copy_from(&part);
        next += part.ncols();
    }
    together
}

/// What the data leave, by [`monomials`]: the difference to the prediction at the point, with amplitudes taken back to their prior
/// means, the constants' columns and half their changes.
fn left(
    (here, expanded): (&Sensitivities, &TestExpansion),
    measured: &Measured,
    bent: &[DVector<f64>],
    c: usize,
) -> DMatrix<f64> {
    let constants = here.constants;
    let mut there = measured.averages[c].clone() - &here.predicted[c];
    // the prediction is that at the prior means: carry it to where the constants were
    for column in &here.base[..constants] {
        there.axpy(
            -(column.at - column.mean) / column.sd,
            &column.values[c],
            1.0,
        );
    }
    let slope = |k: usize| -&here.base[k].values[c] + &bent[k];
    let curve = |i: usize, j: usize| -> DVector<f64> {
        let of = |i: usize, j: usize| {
            let change = &expanded.raised[i].base[j].values[c] - &expanded.about.base[j].values[c];
            change / expanded.by[i]
        };
        if i == j {
            -0.5 * of(i, i)
        } else {
            -0.5 * (of(i, j) + of(j, i))
        }
    };
    let columns: Vec<DVector<f64>> = monomials(constants)
        .into_iter()
        .map(|[a, b]| match (a, b) {
            (0, 0) => there.clone(),
            (0, b) => slope(b - 1),
            (a, b) => curve(a - 1, b - 1),
        })
        .collect();
    DMatrix::from_columns(&columns)
}
