//! A meshed plate that can be solved for any laminate and any end load.

use super::assemble::Assembly;
use super::mesh::{Density, Mesh, Outline};
use super::setup::Setup;
use super::solve::{Factor, Symbolic};
use crate::error::Result;
use crate::laminate::Ply;

/// A forward model: from a set-up and a ply to nodal displacements.
pub trait Forward: Sync {
    /// Nodal displacements (mm, two a node, rigid motion arbitrary) of the plate.
    fn displacement(&self, setup: &Setup, ply: &Ply) -> Result<Vec<f64>>;
}

/// Mesh, assembly pattern and symbolic factorisation of one outline.
pub struct Plate {
    /// The mesh.
    pub mesh: Mesh,
    /// The stiffness integrals.
    pub assembly: Assembly,
    symbolic: Symbolic,
}

impl Plate {
    /// Mesh an outline and analyse its stiffness pattern.
    ///
    /// # Errors
    /// A hole that does not stay clear of the plate's edges.
    pub fn new(outline: Outline, density: Density) -> Result<Self> {
        outline.validate()?;
        let mesh = Mesh::new(outline, density);
        let assembly = Assembly::new(&mesh, &pinned(&mesh), &|_| 1.0);
        let symbolic = Symbolic::new(assembly.pattern())?;
        Ok(Self {
            mesh,
            assembly,
            symbolic,
        })
    }

    /// Work space for numeric factorisations, one a thread.
    pub fn factor(&self) -> Factor<'_> {
        Factor::new(&self.symbolic, &self.assembly)
    }

    /// Stored entries of the Cholesky factor.
    pub fn factor_entries(&self) -> usize {
        self.symbolic.factor_entries()
    }
}

impl Forward for Plate {
    fn displacement(&self, setup: &Setup, ply: &Ply) -> Result<Vec<f64>> {
        let mut factor = self.factor();
        factor.factorise(&setup.membrane(ply))?;
        let mut u = self.mesh.end_forces(&setup.load);
        factor.solve(&mut u);
        Ok(u)
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
