//! Everything that one finite-element solution depends on, apart from the mesh density.

use std::sync::Arc;

use super::load::EndLoad;
use super::profile::Profile;
use crate::error::Result;
use crate::geometry::{self, Geometry, Morph};
use crate::laminate::{LoadSpec, Membrane, Ply, SpecimenSpec, abd};

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

/// A test about to be solved: the specimen as it is, and the load as it acts. Effects change it.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The declared shape.
    pub geometry: Arc<dyn Geometry>,
    /// How the shape differs from the declared one, apart from the ring of `profile`.
    pub morph: Morph,
    /// The named edge that is held still, if there is one.
    pub held: Option<&'static str>,
    /// Ply angles, rad, counter-clockwise in the right-handed pair (direction 1, direction 2).
    pub angles: Vec<f64>,
    /// Total thickness, mm.
    pub thickness: f64,
    /// Factor on the stiffness over the plate.
    pub profile: Profile,
    /// Cubic coefficient beta of the plies' shear law, MPa^-3: gamma12 = tau12 / G12 + beta tau12^3.
    pub shear_cubic: f64,
    /// Relative growth k of the plies' E1 with the strain along their fibres.
    pub fibre_quadratic: f64,
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
            profile: Profile::default(),
            shear_cubic: 0.0,
            fibre_quadratic: 0.0,
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

    /// What the shape differs by, the ring included.
    pub fn whole_morph(&self) -> Morph {
        Morph {
            ring: self.profile.annulus.map(|ring| ring.reach),
            ..self.morph
        }
    }

    /// Check that the plate can be meshed and is stiff everywhere.
    ///
    /// # Errors
    /// Those of [`Geometry::morphed`] and [`Profile::validate`].
    pub fn validate(&self) -> Result<()> {
        let morphed = self.geometry.morphed(&self.whole_morph())?;
        self.profile.validate(&*morphed)
    }

    /// Membrane stiffness for a ply, where the profile's factor is 1.
    pub fn membrane(&self, ply: &Ply) -> Membrane {
        Membrane::from(&abd(ply, &self.angles, self.thickness).a)
    }
}
