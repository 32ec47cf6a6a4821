//! Sparse Cholesky of the plate: symbolic once a mesh, numeric for every membrane stiffness.

use std::sync::Mutex;

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
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
use crate::error::{Error, Result, locked};
use crate::laminate::Membrane;

/// Symbolic factorisation of a mesh's stiffness pattern.
#[derive(Debug)]
pub struct Symbolic(pub(super) SymbolicCholesky<usize>);

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

    /// Cholesky factor of a matrix of this pattern, by its lower triangle; none where it is not positive definite.
    pub(super) fn factorised(&self, lower: SparseColMatRef<'_, usize, f64>) -> Option<Vec<f64>> {
        let params = Spec::<LltParams, f64>::default();
        let scratch = self
            .0
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, params);
        let mut factor = vec![0.0; self.0.len_val()];
        self.factorise(lower, &mut factor, &mut MemBuffer::new(scratch))
            .then_some(factor)
    }

    /// The same into a factor that is there; whether the matrix is positive definite.
    fn factorise(
        &self,
        lower: SparseColMatRef<'_, usize, f64>,
        factor: &mut [f64],
        scratch: &mut MemBuffer,
    ) -> bool {
        self.0
            .factorize_numeric_llt(
                factor,
                lower,
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(scratch),
                default(),
            )
            .is_ok()
    }

    /// Solve with a factor for the load vectors in `loads` (column by column), in place.
    pub(super) fn solve(&self, factor: &[f64], loads: &mut [f64]) {
        let columns = MAX_COLUMNS.min(loads.len() / self.0.nrows());
        let scratch = self.0.solve_in_place_scratch::<f64>(columns, Par::Seq);
        self.solve_in(factor, &mut MemBuffer::new(scratch), loads);
    }

    fn solve_in(&self, factor: &[f64], scratch: &mut MemBuffer, loads: &mut [f64]) {
        let n = self.0.nrows();
        for batch in loads.chunks_mut(n * MAX_COLUMNS) {
            let columns = batch.len() / n;
            LltRef::new(&self.0, factor).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(batch, n, columns),
                Par::Seq,
                MemStack::new(scratch),
            );
        }
    }
}

/// Work spaces that wait for the next factorisation; there are as many as have been in use at once.
#[derive(Default)]
pub struct Pool(Mutex<Vec<Workspace>>);

/// What one numeric factorisation works in: K's values, the factor, scratch.
struct Workspace {
    values: Vec<f64>,
    factor: Vec<f64>,
    scratch: MemBuffer,
}

impl Workspace {
    fn new(symbolic: &Symbolic, assembly: &Assembly) -> Self {
        let params = Spec::<LltParams, f64>::default();
        let factorise = symbolic
            .0
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, params);
        let solve = symbolic
            .0
            .solve_in_place_scratch::<f64>(MAX_COLUMNS, Par::Seq);
        Self {
            values: vec![0.0; assembly.stored()],
            factor: vec![0.0; symbolic.0.len_val()],
            scratch: MemBuffer::new(factorise.or(solve)),
        }
    }

    fn empty() -> Self {
        Self {
            values: Vec::new(),
            factor: Vec::new(),
            scratch: MemBuffer::new(StackReq::EMPTY),
        }
    }
}

/// A numeric factorisation, in a work space that goes back to the plate's pool when it is dropped. Nothing that an earlier
/// one left there is read.
pub struct Factor<'a> {
    symbolic: &'a Symbolic,
    assembly: &'a Assembly,
    pool: &'a Pool,
    space: Workspace,
}

impl Drop for Factor<'_> {
    fn drop(&mut self) {
        let space = std::mem::replace(&mut self.space, Workspace::empty());
        if !space.values.is_empty() {
            locked(&self.pool.0).push(space);
        }
    }
}

impl Pool {
    /// Free what waits.
    pub fn clear(&self) {
        locked(&self.0).clear();
    }
}

impl<'a> Factor<'a> {
    /// Take a work space from the pool, or allocate one; nothing is factorised yet.
    pub fn new(symbolic: &'a Symbolic, assembly: &'a Assembly, pool: &'a Pool) -> Self {
        let waiting = locked(&pool.0).pop();
        Self {
            symbolic,
            assembly,
            pool,
            space: waiting.unwrap_or_else(|| Workspace::new(symbolic, assembly)),
        }
    }

    /// Refill K for a membrane stiffness on the mesh that was assembled, which has one stack, and factorise it.
    pub fn factorise(&mut self, a: &Membrane) -> Result<()> {
        self.factorise_with(self.assembly.nominal(), std::slice::from_ref(a))
    }

    /// The same for the membrane stiffness of every stack, with the integrals of a mesh of the same connectivity, from the plate's assembly.
    ///
    /// # Errors
    /// Of the program: another number of stacks than the mesh has. Of the input: a stiffness that is not positive definite.
    pub fn factorise_with(&mut self, integrals: &[[f64; 4]], a: &[Membrane]) -> Result<()> {
        if a.len() != self.assembly.stacks() {
            let expected = format!("{} membrane stiffnesses", self.assembly.stacks());
            return Err(Error::program("Factor::factorise_with", expected).found(a.len()));
        }
        let space = &mut self.space;
        self.assembly.refill(integrals, a, &mut space.values);
        let k = SparseColMatRef::new(self.assembly.pattern(), &space.values);
        if self
            .symbolic
            .factorise(k, &mut space.factor, &mut space.scratch)
        {
            return Ok(());
        }
        let all: Vec<String> = a.iter().map(|a| format!("{a:?} N/mm")).collect();
        Err(not_definite(format!(
            "the membrane stiffness {}",
            all.join(", ")
        )))
    }

    /// Solve for the load vectors in `loads` (column by column, each `unknowns` long), in place.
    pub fn solve(&mut self, loads: &mut [f64]) {
        let Workspace {
            factor, scratch, ..
        } = &mut self.space;
        self.assembly.pin_loads(loads);
        self.symbolic.solve_in(factor, scratch, loads);
        self.assembly.follow(loads);
    }
}

/// A numeric factorisation that is kept, and solved with by any number of threads at once.
pub struct Kept(pub(super) Vec<f64>);

impl Factor<'_> {
    /// Keep it.
    pub fn keep(mut self) -> Kept {
        let space = std::mem::replace(&mut self.space, Workspace::empty());
        Kept(space.factor)
    }
}

impl Kept {
    /// Solve for load vectors as [`Factor::solve`] does.
    pub fn solve(&self, symbolic: &Symbolic, assembly: &Assembly, loads: &mut [f64]) {
        assembly.pin_loads(loads);
        symbolic.solve(&self.0, loads);
        assembly.follow(loads);
    }
}

/// The fault of a stiffness that leaves a direction without resistance.
pub(super) fn not_definite(stiffness: impl std::fmt::Display) -> Error {
    Error::input("plate stiffness", "a positive definite stiffness matrix")
        .found(format!(
            "one with a pivot that is not positive, for {stiffness}"
        ))
        .hint("check the elastic constants and the layup: some direction of the laminate has no stiffness")
}

/// Right-hand sides solved at once.
const MAX_COLUMNS: usize = 8;
