//! Everything that one finite-element solution depends on, apart from the mesh density.

use std::sync::Arc;

use super::load::EndLoad;
use super::profile::Profile;
use crate::error::Result;
use crate::geometry::{self, Geometry, Morph};
use crate::laminate::{LoadSpec, Membrane, Ply, SpecimenSpec, abd, rotate_stiffness};
use crate::mesh_files::RegionSpec;

/// How a metal yields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Yield {
    /// Share of the plastic part that is added to the elastic displacements: 1 is physics, less is for derivatives.
    pub share: f64,
    /// Yield stress, MPa.
    pub stress: f64,
    /// Growth of the yield stress with the plastic strain, over Young's modulus.
    pub hardening: f64,
}

/// What a region of the mesh has in place of the specimen's stack.
#[derive(Debug, Clone)]
pub struct Region {
    /// Ply angles in place of the specimen's, rad, as [`Setup::angles`].
    pub layup: Option<Vec<f64>>,
    /// By which these angles, or the specimen's, are turned, rad, in the same sense.
    pub rotation: f64,
    /// Its thickness over the specimen's.
    pub thickness: f64,
}

impl Region {
    /// Whether its plies have other directions than the specimen's.
    pub fn has_own_plies(&self) -> bool {
        self.layup.is_some() || self.rotation != 0.0
    }
}

/// A test about to be solved: the specimen as it is, and the load as it acts. Effects change it.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The declared shape.
    pub geometry: Arc<dyn Geometry>,
    /// How the shape differs from the declared one.
    pub morph: Morph,
    /// The named edge that is held still, if there is one.
    pub held: Option<&'static str>,
    /// Ply angles, rad, counter-clockwise in the right-handed pair (direction 1, direction 2).
    pub angles: Vec<f64>,
    /// Total thickness, mm.
    pub thickness: f64,
    /// By how much each ply is thicker than its part of the stack, over that; empty where all are equal. Sums to zero.
    pub thicker: Vec<f64>,
    /// Stacks of regions of the mesh ([`geometry::Mesh::region`]), from the first on.
    pub regions: Vec<Region>,
    /// Factor on the stiffness over the plate.
    pub profile: Profile,
    /// Cubic coefficient beta of the plies' shear law, MPa^-3: gamma12 = tau12 / G12 + beta tau12^3.
    pub shear_cubic: f64,
    /// Relative growth k of the plies' E1 with the strain along their fibres.
    pub fibre_quadratic: f64,
    /// Relative excess of E2 and of G12 over those that the constants give.
    pub anisotropy: [f64; 2],
    /// Declared yield stress of a metal, MPa.
    pub yield_stress: Option<f64>,
    /// How it yields; none where it stays elastic.
    pub yielding: Option<Yield>,
    /// Largest axial force that acted before, N.
    pub peak_before: f64,
    /// Tractions on the edges `low` and `high`.
    pub load: EndLoad,
    /// +1 where (direction 1, direction 2) is right-handed in the data's x-y plane, -1 where it is not: the
    /// factor from an angle counted counter-clockwise in the data to one in this set-up.
    pub handedness: f64,
}

impl Setup {
    /// The ply of the test, from that which the constants give, MPa.
    pub fn of_ply(&self, ply: Ply) -> Ply {
        let [across, shear] = self.anisotropy;
        Ply {
            e2: ply.e2 * (1.0 + across),
            g12: ply.g12 * (1.0 + shear),
            ..ply
        }
    }

    /// The nominal test of a model file.
    pub fn nominal(specimen: &SpecimenSpec, load: &LoadSpec, handedness: f64) -> Self {
        Self {
            geometry: geometry::declared(specimen),
            morph: Morph::NONE,
            held: specimen.clamp.map(|clamp| geometry::end(clamp.end)),
            angles: specimen
                .angles_deg()
                .iter()
                .map(|angle| handedness * angle.to_radians())
                .collect(),
            thickness: specimen.thickness_mm.mean,
            thicker: Vec::new(),
            regions: Vec::new(),
            profile: Profile::default(),
            shear_cubic: 0.0,
            fibre_quadratic: 0.0,
            anisotropy: [0.0; 2],
            yield_stress: None,
            yielding: None,
            peak_before: 0.0,
            load: EndLoad {
                axial: load.force_n,
                ..EndLoad::default()
            },
            handedness,
        }
    }

    /// The same of a mesh with regions ([`crate::mesh_files::MeshSpec::stacks`]); the thickness is still the mean of the
    /// specimen's.
    #[must_use]
    pub fn with_regions(mut self, stacks: &[RegionSpec]) -> Self {
        let turned = |angle: f64| self.handedness * angle.to_radians();
        let region = |spec: &RegionSpec| Region {
            layup: spec
                .layup_deg
                .as_ref()
                .map(|all| all.iter().map(|a| turned(*a)).collect()),
            rotation: turned(spec.rotation_deg.unwrap_or(0.0)),
            thickness: spec.thickness_mm.map_or(1.0, |h| h / self.thickness),
        };
        self.regions = stacks.iter().map(region).collect();
        self
    }

    /// Turn all plies, those of regions too, by an angle, rad.
    pub fn turn_plies(&mut self, by: f64) {
        let own = self.regions.iter_mut().filter_map(|r| r.layup.as_mut());
        for angle in self.angles.iter_mut().chain(own.flatten()) {
            *angle += by;
        }
    }

    /// Whether some region's plies have other directions than the specimen's.
    pub fn has_own_plies(&self) -> bool {
        self.regions.iter().any(Region::has_own_plies)
    }

    /// Ply angles (rad) and thickness (mm) of every stack, the specimen's first.
    pub fn stacks(&self) -> Vec<(Vec<f64>, f64)> {
        let own = self.regions.iter().map(|region| {
            let angles = region.layup.as_ref().unwrap_or(&self.angles);
            let angles = angles.iter().map(|a| a + region.rotation).collect();
            (angles, region.thickness * self.thickness)
        });
        let specimen = (self.angles.clone(), self.thickness);
        std::iter::once(specimen).chain(own).collect()
    }

    /// Width of the plate, mm.
    pub fn width(&self) -> f64 {
        let [_, [low, high]] = self.geometry.extents();
        high - low
    }

    /// The largest axial force so far, N. Unloading is elastic: what has yielded is what yielded under that force.
    pub fn peak(&self) -> f64 {
        self.load.axial.max(self.peak_before)
    }

    /// Components along (direction 1, direction 2) of a vector given along the data's (x, y).
    pub fn vector(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if self.handedness < 0.0 {
            [y, x]
        } else {
            [x, y]
        }
    }

    /// Check that the plate can be meshed and is stiff everywhere.
    ///
    /// # Errors
    /// Those of [`Geometry::morphed`] and [`Profile::validate`].
    pub fn validate(&self) -> Result<()> {
        let morphed = self.geometry.morphed(&self.morph)?;
        self.profile.validate(&*morphed)
    }

    /// Membrane stiffness of every stack for a ply, the specimen's first, where the profile's factor is 1.
    pub fn membranes(&self, ply: &Ply) -> Vec<Membrane> {
        let stacks = self.stacks();
        let regions = stacks.iter().skip(1);
        let of = |(angles, thickness): &(Vec<f64>, f64)| abd(ply, angles, *thickness).a;
        let own = std::iter::once(self.membrane(ply));
        own.chain(regions.map(|stack| Membrane::from(&of(stack))))
            .collect()
    }

    /// That of the specimen's own stack.
    pub fn membrane(&self, ply: &Ply) -> Membrane {
        let each = self.thickness / self.angles.len() as f64;
        let q = ply.stiffness();
        let thicker = self.angles.iter().zip(&self.thicker);
        let more = thicker.map(|(angle, by)| rotate_stiffness(&q, *angle) * (by * each));
        let even = abd(ply, &self.angles, self.thickness).a;
        Membrane::from(&more.fold(even, |sum, part| sum + part))
    }
}
