//! A meshed plate that can be solved for any laminate and any end load.

use std::borrow::Cow;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Instant;

use nalgebra::Vector3;

use super::anchor::Anchor;
use super::assemble::Assembly;
use super::basis::{Basis, Query, ROUNDING};
use super::initial_stress::{add_forces, gauss_points};
use super::ply_law::PlyLaw;
use super::profile::Profile;
use super::setup::Setup;
use super::solve::{Factor, Kept, Pool, Symbolic};
use crate::error::{Error, Result};
use crate::geometry::{Density, Geometry, HIGH, LOW, Mesh, Morph};
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

/// What a reduced basis answers to one test beside what the solver does.
#[derive(Debug, Clone, Copy)]
pub struct Certificate {
    /// Solutions in the basis.
    pub solutions: usize,
    /// Bound of the error in the energy norm, over that of the answer.
    pub bound: f64,
    /// The error itself.
    pub error: f64,
    /// Largest difference at a node, mm.
    pub largest_mm: f64,
    /// Time of the answer and of the solution, s.
    pub answer_s: f64,
    pub solve_s: f64,
}

impl Certificate {
    /// The bound over the error, where that is not all rounding.
    pub fn effectivity(&self) -> f64 {
        self.bound / self.error.max(ROUNDING)
    }
}

/// Mesh, assembly pattern and symbolic factorisation of one geometry.
pub struct Plate {
    /// The geometry that was meshed.
    pub geometry: Arc<dyn Geometry>,
    /// The mesh.
    pub mesh: Mesh,
    counts: Vec<usize>,
    held: Option<&'static str>,
    /// The stiffness integrals.
    pub assembly: Assembly,
    symbolic: Symbolic,
    pool: Pool,
    /// Reduced bases and the radii of the ring about the hole in their meshes.
    bases: RwLock<Vec<(Option<f64>, Arc<Basis>)>>,
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
        let assembly = Assembly::new(&mesh, &pinned(&mesh, held)?);
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
        })
    }

    /// Solve a test; any number of threads may at once. A test of another shape, or with a ring about the hole, gets a mesh
    /// of its own with this one's connectivity; a stiffness that varies gets integrals of its own.
    ///
    /// # Errors
    /// A test of another geometry or support than the plate's, one that cannot be meshed, a stiffness that is not positive
    /// definite, an iteration for the shear law that does not converge.
    pub fn solve(&self, setup: &Setup, ply: &Ply) -> Result<Solution<'_>> {
        match self.spanned(setup, ply) {
            Some(nodal) => Ok(Solution {
                mesh: self.mesh_of(setup)?,
                nodal,
            }),
            None => self.solve_full_order(setup, ply),
        }
    }

    /// The same without a reduced basis.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn solve_full_order(&self, setup: &Setup, ply: &Ply) -> Result<Solution<'_>> {
        let mesh = self.mesh_of(setup)?;
        let geometry = self.geometry.morphed(&setup.whole_morph())?;
        let scale = |p: [f64; 2]| setup.profile.factor(&*geometry, p);
        setup.profile.validate(&*geometry)?;
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
        Ok(Solution { mesh, nodal })
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

    /// Solve with a factorisation that was kept.
    pub(super) fn solve_with(&self, factor: &Kept, loads: &mut [f64]) {
        factor.solve(&self.symbolic, &self.assembly, loads);
    }

    /// Answer tests like these from reduced bases from now on, where there are enough of them on one mesh, to within [`super::TOLERANCE`] of the
    /// field; what a basis cannot answer so well is solved.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn span(&self, tests: &[(Setup, Ply)]) -> Result<()> {
        let mut kinds: Vec<(Option<f64>, bool, Vec<(&Setup, Query)>)> = Vec::new();
        for (setup, ply) in tests {
            let Some((ring, query)) = query(setup, ply) else {
                continue;
            };
            let uniform = query.profile.is_uniform();
            match kinds.iter_mut().find(|k| (k.0, k.1) == (ring, uniform)) {
                Some((_, _, same)) => same.push((setup, query)),
                None => kinds.push((ring, uniform, vec![(setup, query)])),
            }
        }
        let worth = |(ring, uniform, same): &(Option<f64>, bool, Vec<_>)| {
            let fields = match (ring, uniform) {
                (None, true) => 1,
                (Some(_), _) => 2,
                (None, false) => 4,
            };
            same.len() >= WORTH_A_BASIS * fields * fields
        };
        for (ring, _, same) in kinds.into_iter().filter(worth) {
            let mesh = self.mesh_of(same[0].0)?;
            let queries: Vec<Query> = same.into_iter().map(|(_, query)| query).collect();
            let known = self.basis_of(ring, &queries[0].profile);
            let is_answered = |b: &Basis, q| b.answer(self, q).is_some_and(|a| a.is_enough());
            let answered = |b: &Arc<Basis>| queries.iter().all(|q| is_answered(b, q));
            if known.as_ref().is_some_and(answered) {
                continue;
            }
            let basis = Arc::new(Basis::greedy(self, &mesh, &queries)?);
            let mut bases = self.bases.write().unwrap_or_else(PoisonError::into_inner);
            bases.retain(|(_, b)| known.as_ref().is_none_or(|k| !Arc::ptr_eq(k, b)));
            bases.push((ring, basis));
        }
        Ok(())
    }

    /// Hold a basis's answer to a test against the solver's; nothing where no basis answers for it.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn certify(&self, setup: &Setup, ply: &Ply) -> Result<Option<Certificate>> {
        let Some((ring, query)) = query(setup, ply) else {
            return Ok(None);
        };
        let Some(basis) = self.basis_of(ring, &query.profile) else {
            return Ok(None);
        };
        let begin = Instant::now();
        let Some(answer) = basis.answer(self, &query) else {
            return Ok(None);
        };
        let nodal = basis.nodal(&answer);
        let answer_s = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let solved = self.solve_full_order(setup, ply)?;
        let solve_s = begin.elapsed().as_secs_f64();
        let error: Vec<f64> = solved
            .nodal
            .iter()
            .zip(&nodal)
            .map(|(a, b)| a - b)
            .collect();
        Ok(Some(Certificate {
            solutions: basis.size(),
            bound: answer.relative(),
            error: basis.energy(self, &solved.mesh, &error) / answer.energy,
            largest_mm: error.iter().fold(0.0, |m, e| m.max(e.abs())),
            answer_s,
            solve_s,
        }))
    }

    /// The basis of a uniform plate of the declared shape, if there is one.
    pub fn nominal_basis(&self) -> Option<Arc<Basis>> {
        self.basis_of(None, &Profile::default())
    }

    /// Coordinates of a test's answer in [`Plate::nominal_basis`]; none where that cannot answer well enough.
    pub fn coordinates(&self, setup: &Setup, ply: &Ply) -> Option<Vec<f64>> {
        let (ring, query) = query(setup, ply)?;
        if ring.is_some() || !query.profile.is_uniform() {
            return None;
        }
        let answer = self.nominal_basis()?.answer(self, &query)?;
        answer
            .is_enough()
            .then(|| answer.coordinates.as_slice().to_vec())
    }

    /// The basis of a kind, if there is one.
    fn basis_of(&self, ring: Option<f64>, profile: &Profile) -> Option<Arc<Basis>> {
        let bases = self.bases.read().unwrap_or_else(PoisonError::into_inner);
        let own = |(r, b): &&(Option<f64>, Arc<Basis>)| *r == ring && b.is_of(profile);
        bases.iter().find(own).map(|(_, b)| b.clone())
    }

    /// A test's answer from a basis, where there is one that is good enough.
    pub(super) fn spanned(&self, setup: &Setup, ply: &Ply) -> Option<Vec<f64>> {
        let (ring, query) = query(setup, ply)?;
        let basis = self.basis_of(ring, &query.profile)?;
        let answer = basis.answer(self, &query)?;
        answer.is_enough().then(|| basis.nodal(&answer))
    }

    /// Displacements of an anchor's mesh, that of the test `setup`, under unit initial stresses within `reach` radii of the hole instead of the load: the resultants
    /// N11, N22, N12 of one N/mm each, times cos(m theta) and sin(m theta), m up to `harmonics`. Whatever changes the stiffness there, its
    /// field outside is a sum of such fields. Empty without a hole.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn near_edge(
        &self,
        anchor: &Anchor,
        setup: &Setup,
        reach: f64,
        harmonics: usize,
    ) -> Result<(Cow<'_, Mesh>, Vec<Vec<f64>>)> {
        let mesh = self.mesh_of(setup)?;
        let geometry = self.geometry.morphed(&setup.whole_morph())?;
        if geometry.hole_radius().is_none() {
            return Ok((mesh, Vec::new()));
        }
        let gauss = gauss_points(&mesh);
        let still = vec![0.0; mesh.unknowns()];
        let mut loads = Vec::new();
        for wave in 0..=2 * harmonics {
            for component in 0..3 {
                let stress = |p: [f64; 2]| {
                    let near = geometry.hole_radii(p).is_some_and(|radii| radii < reach);
                    let angle = wave.div_ceil(2) as f64 * p[1].atan2(p[0]);
                    let value = if wave % 2 == 1 {
                        angle.sin()
                    } else {
                        angle.cos()
                    };
                    let mut n = Vector3::zeros();
                    n[component] = if near { value } else { 0.0 };
                    n
                };
                let mut load = vec![0.0; mesh.unknowns()];
                add_forces(&mesh, &gauss, &still, &|at, _| stress(at.place), &mut load);
                loads.extend(load);
            }
        }
        self.solve_with(&anchor.factor, &mut loads);
        let fields = loads.chunks(mesh.unknowns()).map(<[f64]>::to_vec).collect();
        Ok((mesh, fields))
    }

    /// The mesh of a test: this one's, or one of the same connectivity where the test has another shape or a ring about
    /// the hole.
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
        let morph = setup.whole_morph();
        if morph == Morph::NONE {
            return Ok(Cow::Borrowed(&self.mesh));
        }
        Ok(Cow::Owned(
            self.geometry.morphed(&morph)?.mesh(&self.counts),
        ))
    }

    /// A numeric factorisation of the plate's stiffness, for loads that are no [`Setup`]'s.
    pub fn factor(&self) -> Factor<'_> {
        Factor::new(&self.symbolic, &self.assembly, &self.pool)
    }

    /// Free the work spaces of factorisations that are over.
    pub fn rest(&self) {
        self.pool.clear();
    }

    /// Stored entries of the Cholesky factor.
    pub fn factor_entries(&self) -> usize {
        self.symbolic.factor_entries()
    }
}

/// Tests on one mesh from which a basis is worth it: it takes a dozen solutions, and three times as long to bound. What its bound costs
/// grows with the square of the fields that the stiffness is a sum of.
const WORTH_A_BASIS: usize = 30;

/// What a basis would be asked for a test: the ring in its mesh, and the query; none where a basis cannot answer.
fn query(setup: &Setup, ply: &Ply) -> Option<(Option<f64>, Query)> {
    if setup.morph != Morph::NONE || PlyLaw::new(setup, ply).is_some() {
        return None;
    }
    let query = Query {
        membrane: setup.membrane(ply),
        profile: setup.profile,
        load: setup.load,
    };
    Some((setup.profile.annulus.map(|ring| ring.reach), query))
}

/// The unknowns held at zero: those of the held edge, or else three that fix the rigid motion without stress: both
/// components at the middle of the low end and the transverse one at the middle of the high end.
fn pinned(mesh: &Mesh, held: Option<&str>) -> Result<Vec<usize>> {
    let edge = |name: &str| match mesh.edge(name) {
        [] => Err(Error::program("supports", "an edge of the mesh").found(name)),
        edges => Ok(edges),
    };
    if let Some(name) = held {
        let mut nodes: Vec<u32> = edge(name)?.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let unknowns = nodes.iter().map(|&n| 2 * n as usize);
        return Ok(unknowns.flat_map(|k| [k, k + 1]).collect());
    }
    let middle = |name: &str| edge(name).map(|edges| edges[edges.len() / 2][0] as usize);
    let (low, high) = (middle(LOW)?, middle(HIGH)?);
    Ok(vec![2 * low, 2 * low + 1, 2 * high + 1])
}
