//! A meshed plate that can be solved for any laminate and any end load.

use std::borrow::Cow;

use super::assemble::Assembly;
use super::mesh::{Density, Mesh, Outline};
use super::setup::Setup;
use super::shear::ShearLaw;
use super::solve::{Factor, Pool, Symbolic};
use crate::error::Result;
use crate::laminate::Ply;

/// Nodal displacements and the mesh they live on.
pub struct Solution<'a> {
    /// The plate's own mesh, or one of the same connectivity where the test has another outline.
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

/// Mesh, assembly pattern and symbolic factorisation of one outline.
pub struct Plate {
    /// The mesh.
    pub mesh: Mesh,
    /// The stiffness integrals.
    pub assembly: Assembly,
    symbolic: Symbolic,
    pool: Pool,
}

impl Plate {
    /// Mesh an outline and analyse its stiffness pattern.
    ///
    /// # Errors
    /// A hole that does not stay clear of the plate's edges.
    pub fn new(outline: Outline, density: Density) -> Result<Self> {
        outline.validate()?;
        let mesh = Mesh::new(outline, density);
        let assembly = Assembly::new(&mesh, &pinned(&mesh));
        let symbolic = Symbolic::new(assembly.pattern())?;
        Ok(Self {
            mesh,
            assembly,
            symbolic,
            pool: Pool::default(),
        })
    }

    /// Solve a test; any number of threads may at once. A test with another outline, or with a ring about the hole, gets
    /// a mesh of its own with this one's connectivity; a stiffness that varies gets integrals of its own.
    ///
    /// # Errors
    /// A test that cannot be meshed, a stiffness that is not positive definite, an iteration for the shear law that
    /// does not converge.
    pub fn solve(&self, setup: &Setup, ply: &Ply) -> Result<Solution<'_>> {
        let mesh = self.mesh_of(setup)?;
        let scale = |p: [f64; 2]| setup.profile.factor(&setup.outline, p);
        let a = setup.membrane(ply);
        let mut factor = self.factor();
        if matches!(mesh, Cow::Borrowed(_)) && setup.profile.is_uniform() {
            factor.factorise(&a)?;
        } else {
            setup.validate()?;
            factor.factorise_with(&self.assembly.integrals(&mesh, &scale), &a)?;
        }
        let load = mesh.end_forces(&setup.load);
        let mut nodal = load.clone();
        factor.solve(&mut nodal);
        if let Some(law) = ShearLaw::new(setup, ply) {
            law.iterate(&mesh, &scale, &load, &mut factor, &mut nodal)?;
        }
        Ok(Solution { mesh, nodal })
    }

    /// The mesh of a test: this one's, or one of the same connectivity where the test has another outline or a ring about
    /// the hole.
    ///
    /// # Errors
    /// A test that cannot be meshed.
    pub fn mesh_of(&self, setup: &Setup) -> Result<Cow<'_, Mesh>> {
        let ring = setup.profile.ring(&setup.outline);
        if setup.outline == self.mesh.outline && ring.is_none() {
            return Ok(Cow::Borrowed(&self.mesh));
        }
        setup.validate()?;
        Ok(Cow::Owned(self.mesh.remade(setup.outline, ring)))
    }

    /// A numeric factorisation of the plate's stiffness, for loads that are no [`Setup`]'s.
    pub fn factor(&self) -> Factor<'_> {
        Factor::new(&self.symbolic, &self.assembly, &self.pool)
    }

    /// Stored entries of the Cholesky factor.
    pub fn factor_entries(&self) -> usize {
        self.symbolic.factor_entries()
    }
}

/// The unknowns held at zero: those of a clamped end, or else three that fix the rigid motion without stress: both
/// components at the middle of the low end and the transverse one at the middle of the high end.
fn pinned(mesh: &Mesh) -> Vec<usize> {
    if let Some(clamp) = mesh.outline.clamp {
        let mut nodes: Vec<u32> = mesh.ends[clamp.end].iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        return nodes
            .iter()
            .flat_map(|&n| [2 * n as usize, 2 * n as usize + 1])
            .collect();
    }
    let middle = |end: usize| {
        let edges = &mesh.ends[end];
        edges[edges.len() / 2][0] as usize
    };
    vec![2 * middle(1), 2 * middle(1) + 1, 2 * middle(0) + 1]
}
