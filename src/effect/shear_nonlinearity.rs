//! The plies soften in shear as the load grows.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::Setup;
use crate::laminate::Material;

pub struct ShearNonlinearity;

impl Effect for ShearNonlinearity {
    fn entry(&self) -> Entry {
        Entry {
            name: "shear_nonlinearity",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::positive("beta_per_MPa3", 1e-7, 1e-6)] },
            about: "Hahn and Tsai's shear law of every ply, gamma12 = tau12 / G12 + beta tau12^3.",
            confirm: "Repeat at half the load: the linear part of the field halves, this part falls to an eighth; or test a [45, -45]s coupon in tension (ASTM D3518).",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.shear_cubic += amplitude[0];
    }

    /// The stress at which a ply softens does not scale with its moduli.
    fn scales(&self) -> bool {
        false
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        (scene.material == Material::Isotropic)
            .then_some("an isotropic plate has no plies that shear along fibres")
    }
}
