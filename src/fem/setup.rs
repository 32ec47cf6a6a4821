//! Everything that one finite-element solution depends on, apart from the mesh density.

use super::clamp::Clamp;
use super::load::EndLoad;
use super::mesh::Outline;
use super::profile::Profile;
use crate::error::Result;
use crate::laminate::{End, LoadSpec, Membrane, Ply, SpecimenSpec, abd};

/// A test about to be solved: the specimen as it is, and the load as it acts. Effects change it.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// Plate outline, centred on the hole.
    pub outline: Outline,
    /// Ply angles, rad, counter-clockwise in the right-handed pair (direction 1, direction 2).
    pub angles: Vec<f64>,
    /// Total thickness, mm.
    pub thickness: f64,
    /// Factor on the stiffness over the plate.
    pub profile: Profile,
    /// Cubic coefficient beta of the plies' shear law, MPa^-3: gamma12 = tau12 / G12 + beta tau12^3.
    pub shear_cubic: f64,
    /// End tractions.
    pub load: EndLoad,
    /// +1 where (direction 1, direction 2) is right-handed in the data's x-y plane, -1 where it is not: the
    /// factor from an angle counted counter-clockwise in the data to one in this set-up.
    pub handedness: f64,
}

impl Setup {
    /// The nominal test of a model file.
    pub fn nominal(specimen: &SpecimenSpec, load: &LoadSpec, handedness: f64) -> Self {
        let [c1, c2] = specimen.hole.center_mm;
        let (l, w) = (0.5 * specimen.length_mm, 0.5 * specimen.width_mm);
        Self {
            outline: Outline {
                s: [-l - c1, l - c1],
                t: [-w - c2, w - c2],
                radius: 0.5 * specimen.hole.diameter_mm,
                clamp: specimen.clamp.map(|clamp| Clamp {
                    end: usize::from(clamp.end == End::Low),
                    widening: clamp.width_mm.unwrap_or(specimen.width_mm) / specimen.width_mm,
                    fillet_radius: clamp.fillet_radius_mm.unwrap_or(0.0),
                }),
            },
            angles: specimen
                .angles_deg()
                .iter()
                .map(|angle| handedness * angle.to_radians())
                .collect(),
            thickness: specimen.thickness_mm.mean,
            profile: Profile::default(),
            shear_cubic: 0.0,
            load: EndLoad {
                axial: load.force_n,
                ..EndLoad::default()
            },
            handedness,
        }
    }

    /// Width of the plate, mm.
    pub fn width(&self) -> f64 {
        self.outline.t[1] - self.outline.t[0]
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
    /// Those of [`Outline::validate`] and [`Profile::validate`].
    pub fn validate(&self) -> Result<()> {
        self.outline.validate()?;
        self.profile.validate(&self.outline)
    }

    /// Membrane stiffness for a ply, where the profile's factor is 1.
    pub fn membrane(&self, ply: &Ply) -> Membrane {
        Membrane::from(&abd(ply, &self.angles, self.thickness).a)
    }
}
