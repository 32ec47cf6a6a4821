//! The fibres stiffen as they are stretched.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::Setup;
use crate::laminate::Material;

pub struct FibreNonlinearity;

impl Effect for FibreNonlinearity {
    fn entry(&self) -> Entry {
        Entry {
            name: "fibre_nonlinearity",
            kind: Kind::Mechanical,
            // carbon fibres gain 10 to 25 % of E1 a percent of strain
            parameters: const { &[EffectParameter::new("percent_per_percent", 15.0, 200.0)] },
            about: "E1 of every ply grows by this percentage for each percent of strain along its fibres, as carbon fibres do; below 0 it falls.",
            confirm: "Repeat at half the load: the linear part of the field halves, this part falls to a quarter; or test a [0] coupon in tension with an extensometer.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        // percent a percent is a ratio
        setup.fibre_quadratic += amplitude[0];
    }

    /// The strain at which a fibre stiffens does not scale with the moduli.
    fn scales(&self) -> bool {
        false
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        (scene.material == Material::Isotropic).then_some("an isotropic plate has no fibres")
    }
}
