//! A meshed plate that can be solved for any laminate and any end load.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock, PoisonError, RwLock};

use super::assemble::Assembly;
use super::basis::{Answer, Query, SpanBasis};
use super::inverse::Inverse;
use super::load::end_forces;
use super::plastic_table::PlasticTable;
use super::ply_law::PlyLaw;
use super::profile::Profile;
use super::setup::Setup;
use super::solve::{Factor, Kept, Pool, Symbolic};
use super::supports::Supports;
use crate::error::{Error, Result};
use crate::geometry::{Density, Geometry, Mesh, Morph};
use crate::laminate::Ply;

/// Nodal displacements and the mesh they live on.
pub struct Solution<'a> {
    /// The plate's own mesh, or one of the same connectivity where the test has another shape.
    pub mesh: Cow<'a, Mesh>,
    /// Displacements, mm, two a node, rigid motion arbitrary.
    pub nodal: Vec<f64>,
}

impl Solution<'_> {
    /// Whether the mesh is the plate's own.
    pub fn is_nominal(&self) -> bool {
        matches!(self.mesh, Cow::Borrowed(_))
    }
}

/// Mesh, assembly pattern and symbolic factorisation of one geometry.
pub struct Plate {
    /// The geometry that was meshed.
    pub geometry: Arc<dyn Geometry>,
    /// The mesh.
    pub mesh: Mesh,
    counts: Vec<usize>,
    pub(super) held: Option<&'static str>,
    /// The stiffness integrals.
    pub assembly: Assembly,
    symbolic: Symbolic,
    pool: Pool,
    /// Reduced bases.
    pub(super) bases: RwLock<Vec<Arc<SpanBasis>>>,
    /// Load level at which the declared shape begins to yield.
    pub(super) onset: OnceLock<f64>,
    /// Its plastic parts beyond.
    pub(super) plastic: OnceLock<Result<Arc<PlasticTable>>>,
}

impl Plate {
    /// Mesh the declared shape of a test and analyse its stiffness pattern.
    ///
    /// # Errors
    /// A geometry that cannot be meshed, or has no edge of the name that is held.
    pub fn new(setup: &Setup, density: Density) -> Result<Self> {
        Self::meshed(setup.geometry.clone(), setup.held, density)
    }

    /// The same of a geometry with a named edge that is held still, or none.
    ///
    /// # Errors
    /// Those of [`Plate::new`].
    pub fn meshed(
        geometry: Arc<dyn Geometry>,
        held: Option<&'static str>,
        density: Density,
    ) -> Result<Self> {
        geometry.validate()?;
        let counts = geometry.counts(density);
        let mesh = geometry.mesh(&counts);
        let assembly = Assembly::new(&mesh, &Supports::of(&mesh, held)?);
        let symbolic = Symbolic::new(assembly.pattern())?;
        Ok(Self {
            geometry,
            mesh,
            counts,
            held,
            assembly,
            symbolic,
            pool: Pool::default(),
            bases: RwLock::default(),
            onset: OnceLock::new(),
            plastic: OnceLock::new(),
        })
    }

    /// Solve a test; any number of threads may at once. A test of another shape gets a mesh of its own with this one's
    /// connectivity; a stiffness that varies gets integrals of its own. What yields adds its plastic part from
    /// [`Plate::plastic_table`].
    ///
    /// # Errors
    /// A test of another geometry or support than the plate's, one that cannot be meshed, a stiffness that is not positive
    /// definite, an iteration for the shear law or for yielding that does not converge.
    pub fn solve(&self, setup: &Setup, ply: &Ply) -> Result<Solution<'_>> {
        let mut solution = match self.spanned(setup, ply) {
            Some(nodal) => Solution {
                mesh: self.mesh_of(setup)?,
                nodal,
            },
            None => self.factorised(setup, ply)?.1,
        };
        self.add_plastic(setup, ply, &mut solution.nodal)?;
        Ok(solution)
    }

    /// The same without a reduced basis and without the table.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn solve_full_order(&self, setup: &Setup, ply: &Ply) -> Result<Solution<'_>> {
        let (factor, mut solution) = self.factorised(setup, ply)?;
        // its work space serves again
        drop(factor);
        self.add_plastic_solved(setup, ply, &mut solution.nodal)?;
        Ok(solution)
    }

    /// The solution without yielding, and the factorised stiffness.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub(super) fn factorised(
        &self,
        setup: &Setup,
        ply: &Ply,
    ) -> Result<(Factor<'_>, Solution<'_>)> {
        let (mut factor, mut solution) = self.linear(setup, ply)?;
        self.follow(setup, ply, &mut factor, &mut solution)?;
        Ok((factor, solution))
    }

    /// The same as if the plies were linear.
    pub(super) fn linear(&self, setup: &Setup, ply: &Ply) -> Result<(Factor<'_>, Solution<'_>)> {
        let mesh = self.mesh_of(setup)?;
        let geometry = self.geometry.morphed(&setup.morph)?;
        let scale = |p: [f64; 2]| setup.profile.factor(&*geometry, p);
        setup.profile.validate(&*geometry)?;
        let mut factor = self.factor();
        factor.factorise_with(
            &self.integrals_of(setup, &mesh, &scale),
            &setup.membranes(ply),
        )?;
        let mut nodal = end_forces(&mesh, &setup.load);
        factor.solve(&mut nodal);
        Ok((factor, Solution { mesh, nodal }))
    }

    /// From displacements near it to the solution with what plies do that are not linear, if any, on a stiffness that is factorised.
    pub(super) fn follow(
        &self,
        setup: &Setup,
        ply: &Ply,
        factor: &mut Factor<'_>,
        solution: &mut Solution<'_>,
    ) -> Result<()> {
        let Some(law) = PlyLaw::new(setup, ply) else {
            return Ok(());
        };
        let geometry = self.geometry.morphed(&setup.morph)?;
        let scale = |p: [f64; 2]| setup.profile.factor(&*geometry, p);
        let Solution { mesh, nodal } = solution;
        let load = end_forces(mesh, &setup.load);
        law.iterate(mesh, &scale, &load, factor, nodal)
    }

    /// Geometry integrals of a test on its mesh, its stiffness times `scale`.
    pub(super) fn integrals_of(
        &self,
        setup: &Setup,
        mesh: &Mesh,
        scale: &dyn Fn([f64; 2]) -> f64,
    ) -> Cow<'_, [[f64; 4]]> {
        if std::ptr::eq(mesh, &self.mesh) && setup.profile.is_uniform() {
            Cow::Borrowed(self.assembly.nominal())
        } else {
            Cow::Owned(self.assembly.integrals(mesh, scale))
        }
    }

    /// Geometry integrals of a uniform plate on a mesh of this one's connectivity.
    pub(super) fn uniform_integrals(&self, mesh: &Mesh) -> Cow<'_, [[f64; 4]]> {
        if std::ptr::eq(mesh, &self.mesh) {
            Cow::Borrowed(self.assembly.nominal())
        } else {
            Cow::Owned(self.assembly.integrals(mesh, &|_| 1.0))
        }
    }

    /// The inverse of a factorisation that was kept, among some unknowns.
    pub(super) fn inverse_of(&self, factor: &Kept, unknowns: &[usize]) -> Result<Inverse<'_>> {
        Inverse::new(&self.symbolic, factor, unknowns)
    }

    /// Solve with a factorisation that was kept.
    pub(super) fn solve_with(&self, factor: &Kept, loads: &mut [f64]) {
        factor.solve(&self.symbolic, &self.assembly, loads);
    }

    /// The basis of a uniform plate of the declared shape, if there is one.
    pub fn nominal_basis(&self) -> Option<Arc<SpanBasis>> {
        self.basis_of(&Profile::default())
    }

    /// A test's answer from [`Plate::nominal_basis`]; none where that cannot answer well enough, or is not all of the answer.
    pub fn coordinates(&self, setup: &Setup, ply: &Ply) -> Option<Answer> {
        if setup.yielding.is_some() {
            return None;
        }
        let query = query(setup, ply)?;
        if !query.profile.is_uniform() {
            return None;
        }
        let answer = self.nominal_basis()?.answer(&query)?;
        answer.is_enough().then_some(answer)
    }

    /// The basis for tests like this one, if there is one.
    pub fn basis_for(&self, setup: &Setup, ply: &Ply) -> Option<Arc<SpanBasis>> {
        self.basis_of(&query(setup, ply)?.profile)
    }

    /// The basis of a kind, if there is one.
    pub(super) fn basis_of(&self, profile: &Profile) -> Option<Arc<SpanBasis>> {
        let bases = self.bases.read().unwrap_or_else(PoisonError::into_inner);
        bases.iter().find(|b| b.is_of(profile)).cloned()
    }

    /// A test's answer without yielding from a basis, where there is one that is good enough.
    pub(super) fn spanned(&self, setup: &Setup, ply: &Ply) -> Option<Vec<f64>> {
        let query = query(setup, ply)?;
        let basis = self.basis_of(&query.profile)?;
        let answer = basis.answer(&query)?;
        answer.is_enough().then(|| basis.nodal(&answer))
    }

    /// The mesh of a test: this one's, or one of the same connectivity where the test has another shape.
    ///
    /// # Errors
    /// Of the program, for a test of another geometry or support than the plate's; a shape that cannot be meshed.
    pub fn mesh_of(&self, setup: &Setup) -> Result<Cow<'_, Mesh>> {
        if *setup.geometry != *self.geometry || setup.held != self.held {
            return Err(Error::program(
                "Plate::mesh_of",
                "a test of the plate's own geometry and support",
            )
            .found(format!("{:?}, held at {:?}", setup.geometry, setup.held)));
        }
        if 1 + setup.regions.len() != self.assembly.stacks() {
            return Err(
                Error::program("Plate::mesh_of", "a stack for every region of the mesh")
                    .found(format!("{:?}", setup.regions)),
            );
        }
        if setup.morph == Morph::NONE {
            return Ok(Cow::Borrowed(&self.mesh));
        }
        let geometry = self.geometry.morphed(&setup.morph)?;
        Ok(Cow::Owned(geometry.mesh(&self.counts)))
    }

    /// A numeric factorisation of the plate's stiffness, for loads that are no [`Setup`]'s.
    pub fn factor(&self) -> Factor<'_> {
        Factor::new(&self.symbolic, &self.assembly, &self.pool)
    }

    /// Whether edges are held that were declared to be.
    pub fn is_held(&self) -> bool {
        let boundary = self.mesh.boundary.as_ref();
        self.held.is_some() || boundary.is_some_and(|b| !b.held.is_empty())
    }

    /// Free the work spaces of factorisations that are over.
    pub fn drop_caches(&self) {
        self.pool.clear();
    }
}

/// What a basis would be asked for a test, apart from its yielding; none where a basis cannot answer.
pub(super) fn query(setup: &Setup, ply: &Ply) -> Option<Query> {
    if setup.morph != Morph::NONE || PlyLaw::new(setup, ply).is_some() {
        return None;
    }
    Some(Query {
        membranes: setup.membranes(ply),
        profile: setup.profile,
        load: setup.load,
    })
}
