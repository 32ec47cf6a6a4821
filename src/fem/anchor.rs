//! Solutions near one that is known, by its factorisation alone: what sensitivities need.

use std::borrow::Cow;

use nalgebra::Vector3;

use super::anderson::Anderson;
use super::initial_stress::{add_forces, gauss_points};
use super::load::end_forces;
use super::plate::{Plate, Solution};
use super::ply_law::PlyLaw;
use super::setup::Setup;
use super::solve::Kept;
use crate::error::Result;
use crate::geometry::Mesh;
use crate::laminate::Ply;

/// A test solved without yielding, with its factorised stiffness.
pub struct Anchor {
    pub(super) factor: Kept,
    /// As if the plies were linear, under the axial force with it, N.
    linear: (f64, Vec<f64>),
    /// Under axial forces, N, where they are not.
    followed: Vec<(f64, Vec<f64>)>,
}

/// A Gaussian about a place, of height 1.
#[derive(Debug, Clone, Copy)]
pub struct Bump {
    pub center_mm: [f64; 2],
    pub sd_mm: f64,
}

impl Bump {
    pub fn at(&self, p: [f64; 2]) -> f64 {
        let r = (p[0] - self.center_mm[0]).hypot(p[1] - self.center_mm[1]) / self.sd_mm;
        (-0.5 * r * r).exp()
    }
}

/// Corrections end when one is smaller than this share of the first. Each is smaller by the relative change of the stiffness, so that what
/// is left is some ten thousandth of what a central difference sees, or less.
const SETTLED: f64 = 1e-3;

/// A first correction below this share of the displacements: the anchor's own solution.
const SAME: f64 = 1e-10;

/// Most corrections.
const MOST: usize = 12;

impl Anchor {
    /// Solve a test and keep its factorisation. What its plies do that is not linear is followed along the load, through some times the
    /// test's own.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn new(plate: &Plate, setup: &Setup, ply: &Ply, times: &[f64]) -> Result<Self> {
        let (mut factor, mut solution) = plate.linear(setup, ply)?;
        let axial = setup.load.axial;
        let linear = (axial, solution.nodal.clone());
        let mut followed = Vec::new();
        if PlyLaw::new(setup, ply).is_some() {
            let mut times = times.to_vec();
            times.sort_by(f64::total_cmp);
            let mut last = 1.0;
            for by in times {
                let own = Setup {
                    load: setup.load.times(by),
                    ..setup.clone()
                };
                solution.nodal.iter_mut().for_each(|u| *u *= by / last);
                plate.follow(&own, ply, &mut factor, &mut solution)?;
                followed.push((by * axial, solution.nodal.clone()));
                last = by;
            }
        }
        Ok(Self {
            factor: factor.keep(),
            linear,
            followed,
        })
    }

    /// Displacements near those of a test whose plies are linear or not, by the nearest axial force that is known.
    fn start(&self, setup: &Setup, is_linear: bool) -> Vec<f64> {
        let axial = setup.load.axial;
        let off = |(force, _): &&(f64, Vec<f64>)| (force - axial).abs();
        let followed = self.followed.iter().filter(|_| !is_linear);
        let nearest = followed.min_by(|a, b| off(a).total_cmp(&off(b)));
        let (force, nodal) = nearest.unwrap_or(&self.linear);
        let ratio = axial / force;
        match ratio.is_finite() {
            true => nodal.iter().map(|u| ratio * u).collect(),
            false => nodal.clone(),
        }
    }

    /// Solve a test near the anchor's, on a mesh of the same connectivity: corrections by the anchor's stiffness until they do not matter to
    /// a difference of two such solutions.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn solve_near<'a>(
        &self,
        plate: &'a Plate,
        setup: &Setup,
        ply: &Ply,
    ) -> Result<Solution<'a>> {
        let mut solution = self.elastic_near(plate, setup, ply)?;
        plate.add_plastic(setup, ply, &mut solution.nodal)?;
        Ok(solution)
    }

    /// The same without yielding.
    fn elastic_near<'a>(&self, plate: &'a Plate, setup: &Setup, ply: &Ply) -> Result<Solution<'a>> {
        if let Some(nodal) = plate.spanned(setup, ply) {
            let mesh = plate.mesh_of(setup)?;
            return Ok(Solution { mesh, nodal });
        }
        let mesh = plate.mesh_of(setup)?;
        let geometry = plate.geometry.morphed(&setup.morph)?;
        setup.profile.validate(&*geometry)?;
        let scale = |p: [f64; 2]| setup.profile.factor(&*geometry, p);
        let integrals = plate.integrals_of(setup, &mesh, &scale);
        let membranes = setup.membranes(ply);
        let law = PlyLaw::new(setup, ply).map(|law| (law, gauss_points(&mesh)));
        let load = end_forces(&mesh, &setup.load);
        let mut nodal = self.start(setup, law.is_none());
        let largest = nodal.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
        let mut first = 0.0;
        let mut accelerated = Anderson::default();
        for k in 0..MOST {
            let mut correction = load.clone();
            if let Some((law, gauss)) = &law {
                law.add_forces((&mesh, gauss), &scale, &nodal, &mut correction);
            }
            let inner = plate.assembly.multiply(&integrals, &membranes, &nodal);
            for (c, f) in correction.iter_mut().zip(inner) {
                *c -= f;
            }
            plate.solve_with(&self.factor, &mut correction);
            let size = correction.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
            let mut image = correction;
            for (u, c) in nodal.iter().zip(&mut image) {
                *c += u;
            }
            if k == 0 {
                first = size;
            }
            if size <= (SETTLED * first).max(SAME * largest) {
                return Ok(Solution { mesh, nodal: image });
            }
            if size > first {
                break;
            }
            nodal = accelerated.next(&nodal, image);
        }
        // too far away
        Ok(plate.factorised(setup, ply)?.1)
    }

    /// Nodal displacements (mm) of the anchor's mesh, that of the test `setup`, under unit initial stresses within `reach` radii of the hole
    /// instead of the load: the resultants N11, N22, N12 of one N/mm each, times cos(m theta) and sin(m theta), m up to `harmonics`.
    /// Whatever changes the stiffness there, its field outside is a sum of such fields. Empty without a hole.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn near_edge<'a>(
        &self,
        plate: &'a Plate,
        setup: &Setup,
        reach: f64,
        harmonics: usize,
    ) -> Result<(Cow<'a, Mesh>, Vec<Vec<f64>>)> {
        let mesh = plate.mesh_of(setup)?;
        let geometry = plate.geometry.morphed(&setup.morph)?;
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
        plate.solve_with(&self.factor, &mut loads);
        let fields = loads.chunks(mesh.unknowns()).map(<[f64]>::to_vec).collect();
        Ok((mesh, fields))
    }

    /// Nodal displacements (mm) of the anchor's mesh, that of the test `setup`, that a relative change of the membrane stiffness by each of
    /// some bumps adds to the anchor's, to first order and one unit each, its plies taken for linear: K u' = -K_bump u.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn softened<'a>(
        &self,
        plate: &'a Plate,
        (setup, ply): (&Setup, &Ply),
        bumps: &[Bump],
    ) -> Result<(Cow<'a, Mesh>, Vec<Vec<f64>>)> {
        let mesh = plate.mesh_of(setup)?;
        let geometry = plate.geometry.morphed(&setup.morph)?;
        let membranes = setup.membranes(ply);
        let mut loads = Vec::with_capacity(bumps.len() * mesh.unknowns());
        for bump in bumps {
            let scale = |p: [f64; 2]| bump.at(p) * setup.profile.factor(&*geometry, p);
            let integrals = plate.assembly.integrals(&mesh, &scale);
            let forces = plate
                .assembly
                .multiply(&integrals, &membranes, &self.linear.1);
            loads.extend(forces.into_iter().map(|f| -f));
        }
        plate.solve_with(&self.factor, &mut loads);
        let fields = loads.chunks(mesh.unknowns()).map(<[f64]>::to_vec).collect();
        Ok((mesh, fields))
    }
}
