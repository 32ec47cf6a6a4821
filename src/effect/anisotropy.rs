//! A rolled sheet is not isotropic.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::Setup;
use crate::laminate::Material;

pub struct Anisotropy;

impl Effect for Anisotropy {
    fn entry(&self) -> Entry {
        Entry {
            name: "anisotropy",
            kind: Kind::Mechanical,
            // an estimate, without a source: rolled sheets differ by a few percent between directions
            parameters: const {
                &[
                    EffectParameter::new("across_percent", 4.0, 30.0),
                    EffectParameter::new("shear_percent", 4.0, 30.0),
                ]
            },
            about: "The sheet is not isotropic, as rolling leaves it. Young's modulus across the load is the first percentage above that along it. The shear modulus is the second percentage above E / (2 (1 + nu)). E and nu are those along the load.",
            confirm: "Test a second strip that is cut across the first, and one at 45 degrees.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        for (own, percent) in setup.anisotropy.iter_mut().zip(amplitude) {
            *own += 0.01 * percent;
        }
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        (scene.material != Material::Isotropic)
            .then_some("a laminate has moduli of its own across and in shear")
    }
}
