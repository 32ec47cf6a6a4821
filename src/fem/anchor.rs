//! Solutions near one that is known, by its factorisation alone: what sensitivities need.

use super::plate::{Plate, Solution};
use super::ply_law::PlyLaw;
use super::setup::Setup;
use super::solve::Kept;
use crate::error::Result;
use crate::laminate::Ply;

/// A solved test with its factorised stiffness.
pub struct Anchor {
    pub(super) factor: Kept,
    nodal: Vec<f64>,
}

/// Corrections end when one is smaller than this share of the first: what is left is of the order of its square of what a central
/// difference sees.
const SETTLED: f64 = 1e-3;

/// Most corrections.
const MOST: usize = 12;

impl Plate {
    /// Solve a test and keep its factorisation.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn anchor(&self, setup: &Setup, ply: &Ply) -> Result<Anchor> {
        let mesh = self.mesh_of(setup)?;
        let geometry = self.geometry.morphed(&setup.whole_morph())?;
        let scale = |p: [f64; 2]| setup.profile.factor(&*geometry, p);
        let mut factor = self.factor();
        factor.factorise_with(
            &self.integrals_of(setup, &mesh, &scale),
            &setup.membrane(ply),
        )?;
        let load = mesh.end_forces(&setup.load);
        let mut nodal = load.clone();
        factor.solve(&mut nodal);
        if let Some(law) = PlyLaw::new(setup, ply) {
            law.iterate(&mesh, &scale, &load, &mut factor, &mut nodal)?;
        }
        Ok(Anchor {
            factor: factor.keep(),
            nodal,
        })
    }

    /// Solve a test near an anchor's, on a mesh of the same connectivity: corrections by the anchor's stiffness until they do not matter to
    /// a difference of two such solutions.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn solve_near(&self, anchor: &Anchor, setup: &Setup, ply: &Ply) -> Result<Solution<'_>> {
        if let Some(nodal) = self.spanned(setup, ply) {
            let mesh = self.mesh_of(setup)?;
            return Ok(Solution { mesh, nodal });
        }
        let mesh = self.mesh_of(setup)?;
        let geometry = self.geometry.morphed(&setup.whole_morph())?;
        setup.profile.validate(&*geometry)?;
        let scale = |p: [f64; 2]| setup.profile.factor(&*geometry, p);
        let integrals = self.integrals_of(setup, &mesh, &scale);
        let membrane = setup.membrane(ply);
        let law = PlyLaw::new(setup, ply);
        let load = mesh.end_forces(&setup.load);
        let mut nodal = anchor.nodal.clone();
        let mut first = 0.0;
        for k in 0..MOST {
            let mut correction = load.clone();
            if let Some(law) = &law {
                law.add_forces(&mesh, &scale, &nodal, &mut correction);
            }
            let inner = self.assembly.multiply(&integrals, &membrane, &nodal);
            for (c, f) in correction.iter_mut().zip(inner) {
                *c -= f;
            }
            self.solve_with(&anchor.factor, &mut correction);
            let size = correction.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
            for (u, c) in nodal.iter_mut().zip(&correction) {
                *u += c;
            }
            if k == 0 {
                first = size;
            }
            if size <= SETTLED * first {
                return Ok(Solution { mesh, nodal });
            }
            if size > first {
                break;
            }
        }
        // too far away
        self.solve_full_order(setup, ply)
    }
}
