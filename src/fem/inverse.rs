//! Entries of the inverse of a factorised stiffness, where its Cholesky factor has entries: how far a node moves under a unit force on it
//! or on a neighbour, for all nodes at once.
//!
//! With K = L L^T and a supernode of columns J with the rows R below them, Y = L_RJ L_JJ^-1: the inverse Z has Z_RJ = -Z_RR Y and
//! Z_JJ = (L_JJ L_JJ^T)^-1 - Y^T Z_RJ, and all of Z_RR belongs to supernodes that were done before, from the last to the first. (Takahashi,
//! Fagan and Chin, 1973; Erisman and Tinney, Comm. ACM 18 (1975).) It costs about two factorisations, less where only some unknowns matter.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::sparse::linalg::cholesky::SymbolicCholeskyRaw;
use faer::sparse::linalg::cholesky::supernodal::{SupernodalLltRef, SymbolicSupernodalCholesky};
use faer::{Accum, Mat, Par};

use super::solve::{Kept, Symbolic};
use crate::error::{Error, Result};

/// Entries of an inverse.
pub struct Inverse<'a> {
    symbolic: &'a SymbolicSupernodalCholesky<usize>,
    /// Column of each unknown in the factor.
    place: &'a [usize],
    /// Supernode of each column.
    owner: Vec<usize>,
    /// Laid out as the factor, the blocks on the diagonal whole.
    values: Vec<f64>,
}

impl<'a> Inverse<'a> {
    /// Those entries of the inverse that belong to neighbours among some unknowns.
    ///
    /// # Errors
    /// Of the program, for a factor that is not supernodal.
    pub fn new(symbolic: &'a Symbolic, factor: &Kept, unknowns: &[usize]) -> Result<Self> {
        let parts = (symbolic.0.raw(), symbolic.0.perm());
        let (SymbolicCholeskyRaw::Supernodal(symbolic), Some(permutation)) = parts else {
            return Err(Error::program("inverse", "a supernodal factor, permuted"));
        };
        let mut owner = vec![0; symbolic.nrows()];
        let begins = symbolic.supernode_begin().iter();
        for (s, (&begin, &end)) in begins.zip(symbolic.supernode_end()).enumerate() {
            owner[begin..end].fill(s);
        }
        let mut inverse = Self {
            symbolic,
            place: permutation.arrays().1,
            owner,
            values: vec![0.0; factor.0.len()],
        };
        let needed = inverse.needed(unknowns);
        let mut rows = vec![0; symbolic.nrows()];
        for s in (0..symbolic.n_supernodes()).rev().filter(|&s| needed[s]) {
            inverse.fill(SupernodalLltRef::new(symbolic, &factor.0), s, &mut rows);
        }
        Ok(inverse)
    }

    /// The supernodes of some unknowns, and all that those depend on: the supernodes of the rows below them.
    fn needed(&self, unknowns: &[usize]) -> Vec<bool> {
        let mut needed = vec![false; self.symbolic.n_supernodes()];
        for &unknown in unknowns {
            needed[self.owner[self.place[unknown]]] = true;
        }
        for s in 0..needed.len() {
            if needed[s] {
                for &row in self.symbolic.supernode(s).pattern() {
                    needed[self.owner[row]] = true;
                }
            }
        }
        needed
    }

    /// The entries of a supernode, from those that it depends on. `rows` is scratch.
    fn fill(&mut self, factor: SupernodalLltRef<'_, usize, f64>, s: usize, rows: &mut [usize]) {
        let block = factor.supernode(s);
        let size = block.val().ncols();
        let (top, below) = block.val().split_at_row(size);
        let count = below.nrows();
        // Y^T
        let mut y = below.transpose().to_owned();
        solve_upper_triangular_in_place(top.transpose(), y.as_mut(), Par::Seq);
        let inner = self.gathered(block.pattern(), rows);
        let mut low = Mat::<f64>::zeros(count, size);
        let out = low.as_mut();
        matmul(out, Accum::Replace, &inner, y.transpose(), -1.0, Par::Seq);
        let mut root = Mat::<f64>::identity(size, size);
        solve_lower_triangular_in_place(top, root.as_mut(), Par::Seq);
        let mut own = Mat::<f64>::zeros(size, size);
        let out = own.as_mut();
        matmul(out, Accum::Replace, root.transpose(), &root, 1.0, Par::Seq);
        matmul(own.as_mut(), Accum::Add, &y, &low, -1.0, Par::Seq);
        let first = self.symbolic.col_ptr_for_val()[s];
        let columns = self.values[first..].chunks_exact_mut(size + count);
        for (j, column) in columns.take(size).enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                *value = if i < size {
                    own[(i, j)]
                } else {
                    low[(i - size, j)]
                };
            }
        }
    }

    /// All entries of the inverse between some columns, which stand below one supernode.
    fn gathered(&self, pattern: &[usize], rows: &mut [usize]) -> Mat<f64> {
        let mut inner = Mat::zeros(pattern.len(), pattern.len());
        let mut known = None;
        for (j, &column) in pattern.iter().enumerate() {
            let s = self.owner[column];
            let own = self.symbolic.supernode(s);
            let begin = own.start();
            let size = self.symbolic.supernode_end()[s] - begin;
            if known != Some(s) {
                known = Some(s);
                for k in 0..size {
                    rows[begin + k] = k;
                }
                for (k, &row) in own.pattern().iter().enumerate() {
                    rows[row] = size + k;
                }
            }
            let values = self.column(s, column - begin);
            for (i, &row) in pattern.iter().enumerate() {
                if row >= begin {
                    inner[(i, j)] = values[rows[row]];
                    inner[(j, i)] = values[rows[row]];
                }
            }
        }
        inner
    }

    /// Column `k` of a supernode.
    fn column(&self, s: usize, k: usize) -> &[f64] {
        let height = self.height(s);
        let first = self.symbolic.col_ptr_for_val()[s] + k * height;
        &self.values[first..first + height]
    }

    fn height(&self, s: usize) -> usize {
        let own = self.symbolic.supernode(s);
        self.symbolic.supernode_end()[s] - own.start() + own.pattern().len()
    }

    /// The entry of two unknowns that share an element, which were asked for.
    pub fn entry(&self, a: usize, b: usize) -> Option<f64> {
        let (row, column) = (
            self.place[a].max(self.place[b]),
            self.place[a].min(self.place[b]),
        );
        let s = self.owner[column];
        let own = self.symbolic.supernode(s);
        let size = self.symbolic.supernode_end()[s] - own.start();
        let at = if row < own.start() + size {
            row - own.start()
        } else {
            size + own.pattern().iter().position(|&r| r == row)?
        };
        Some(self.column(s, column - own.start())[at])
    }
}
