//! Everything that enters linearly beside the constants, in the directions that the data see.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::expansion::TestExpansion;
use crate::linearise::{Column, Measured, Sensitivities};

/// What a column stands for that enters linearly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinearRole {
    /// Thickness, load, motion, declared effects, what the data would not show: it acts with its own prior.
    Always,
    /// A candidate's.
    Candidate(usize),
    /// The near-edge rival's.
    Rival,
}

/// Columns that enter linearly, each at its largest prior sd, and an orthonormal basis of what the data see of them: amplitudes in
/// those units are V gamma and something in the null space of V', of which the data know nothing.
#[derive(Clone)]
pub struct Space {
    pub whose: Vec<LinearRole>,
    /// Largest prior sds of the columns, in units of their own.
    pub largest: DVector<f64>,
    /// V, columns x directions.
    pub seen: DMatrix<f64>,
}

/// Directions are seen in which the data leave less than all but a hundredth of the prior variance.
const SEEN: f64 = 1e-2;

impl Space {
    /// Of columns with the sum of their normal equations under some choices of the noise.
    pub fn new(whose: Vec<LinearRole>, largest: DVector<f64>, gram: &DMatrix<f64>) -> Self {
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
                LinearRole::Always => 1.0,
                LinearRole::Candidate(c) if own.contains(&c) => 1.0,
                LinearRole::Candidate(_) => size,
                LinearRole::Rival => rival,
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

/// Products of up to two of the constants' coordinates, 1 first: which of them each is of.
pub fn monomials(constants: usize) -> Vec<[usize; 2]> {
    let pairs = (0..=constants).flat_map(|a| (a..=constants).map(move |b| [a, b]));
    pairs.collect()
}

/// Values of [`monomials`] at coordinates of which the first is 1.
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
/// directions, at the point and then their changes along each coordinate of the constants; and what the data leave where all amplitudes in the
/// directions are zero: at the point, by the surface's modes, and along each coordinate where the mesh, or amplitudes that are not zero at the
/// point, make that another than the surface has it.
pub fn stacked(
    here: &Sensitivities,
    expanded: &TestExpansion,
    measured: &Measured,
    space: &Space,
    kept: &[usize],
    c: usize,
) -> DMatrix<f64> {
    let surface = &expanded.surface;
    let mut scaled = space.seen.clone();
    for (mut row, sd) in scaled.row_iter_mut().zip(space.largest.iter()) {
        row *= *sd;
    }
    let before = shown(&expanded.about, kept, c);
    let mut parts = vec![shown(here, kept, c) * &scaled];
    let mut left = vec![DMatrix::from_column_slice(
        measured.averages[c].len(),
        1,
        (&measured.averages[c] - at_point(here, c)).as_slice(),
    )];
    left.push(-&surface.modes[c]);
    let own = linear(here);
    let about = linear(&expanded.about);
    for (j, (raised, by)) in expanded.raised.iter().zip(&expanded.by).enumerate() {
        parts.push((shown(raised, kept, c) - &before) * &scaled / *by);
        let mut bent = &surface.modes[c] * surface.slope(j) - &expanded.slope(here, j)[c];
        // an amplitude that is not zero at the point: its column bends with the constants from there
        for ((k, a), b) in own.iter().zip(linear(raised)).zip(&about) {
            let at = (k.at - k.mean) / k.sd;
            if at != 0.0 {
                bent.axpy(at / by, &(&a.values[c] - &b.values[c]), 1.0);
            }
        }
        left.push(DMatrix::from_columns(&[bent]));
    }
    parts.extend(left);
    let width = parts.iter().map(DMatrix::ncols).sum();
    let mut together = DMatrix::zeros(measured.averages[c].len(), width);
    let mut next = 0;
    for part in parts {
        together.columns_mut(next, part.ncols()).copy_from(&part);
        next += part.ncols();
    }
    together
}

/// One component of the prediction at the point, with amplitudes taken back to their prior means; the linearised one is that at the prior means
/// of the constants too.
fn at_point(here: &Sensitivities, c: usize) -> DVector<f64> {
    let mut predicted = here.predicted[c].clone();
    for column in &here.base[..here.constants] {
        let by = (column.at - column.mean) / column.sd;
        predicted.axpy(by, &column.values[c], 1.0);
    }
    predicted
}
