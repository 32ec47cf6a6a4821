//! Sparse Cholesky of the plate: symbolic once a mesh, numeric for every membrane stiffness.

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltParams, LltRegularization};
use faer::prelude::default;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Side, Spec};

use super::assemble::Assembly;
use crate::error::{Error, Result};
use crate::laminate::Membrane;

/// Symbolic factorisation of a mesh's stiffness pattern.
#[derive(Debug)]
pub struct Symbolic(SymbolicCholesky<usize>);

impl Symbolic {
    /// Analyse a lower-triangular pattern (approximate minimum degree, supernodal).
    pub fn new(pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Self> {
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..default()
        };
        factorize_symbolic_cholesky(pattern, Side::Lower, SymmetricOrdering::Amd, params)
            .map(Self)
            .map_err(|e| {
                Error::program("symbolic factorisation", "a mesh that fits into memory")
                    .found(format!("{e:?}"))
            })
    }

    /// Stored entries of the factor.
    pub fn factor_entries(&self) -> usize {
        self.0.len_val()
    }
}

/// Work space of one thread: K's values, the factor, scratch.
pub struct Factor<'a> {
    symbolic: &'a Symbolic,
    assembly: &'a Assembly,
    values: Vec<f64>,
    factor: Vec<f64>,
    scratch: MemBuffer,
}

impl<'a> Factor<'a> {
    /// Allocate; nothing is factorised yet.
    pub fn new(symbolic: &'a Symbolic, assembly: &'a Assembly) -> Self {
        let params = Spec::<LltParams, f64>::default();
        let factorise = symbolic
            .0
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, params);
        let solve = symbolic
            .0
            .solve_in_place_scratch::<f64>(MAX_COLUMNS, Par::Seq);
        Self {
            symbolic,
            assembly,
            values: vec![0.0; assembly.stored()],
            factor: vec![0.0; symbolic.0.len_val()],
            scratch: MemBuffer::new(factorise.or(solve)),
        }
    }

    /// Refill K for a membrane stiffness on the mesh that was assembled, and factorise it.
    pub fn factorise(&mut self, a: &Membrane) -> Result<()> {
        self.factorise_with(self.assembly.nominal(), a)
    }

    /// The same with the integrals of another mesh of the same connectivity, from the plate's assembly.
    pub fn factorise_with(&mut self, integrals: &[[f64; 4]], a: &Membrane) -> Result<()> {
        self.assembly.refill(integrals, a, &mut self.values);
        let k = SparseColMatRef::new(self.assembly.pattern(), &self.values);
        self.symbolic
            .0
            .factorize_numeric_llt(
                &mut self.factor,
                k,
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.scratch),
                default(),
            )
            .map(|_| ())
            .map_err(|_| {
                Error::input("plate stiffness", "a positive definite stiffness matrix")
                    .found(format!("one with a pivot that is not positive, for the membrane stiffness {a:?} N/mm"))
                    .hint("check the elastic constants and the layup: some direction of the laminate has no stiffness")
            })
    }

    /// Solve for the load vectors in `loads` (column by column, each `unknowns` long), in place.
    pub fn solve(&mut self, loads: &mut [f64]) {
        let n = self.symbolic.0.nrows();
        for batch in loads.chunks_mut(n * MAX_COLUMNS) {
            for load in batch.chunks_mut(n) {
                self.assembly.pin_load(load);
            }
            let columns = batch.len() / n;
            LltRef::new(&self.symbolic.0, &self.factor).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(batch, n, columns),
                Par::Seq,
                MemStack::new(&mut self.scratch),
            );
        }
    }
}

/// Right-hand sides solved at once.
const MAX_COLUMNS: usize = 8;
