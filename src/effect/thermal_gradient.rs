//! The specimen's temperature varied over it when it was loaded.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_same_expansion};
use crate::laminate::free_expansion;

pub struct ThermalGradient;

impl Effect for ThermalGradient {
    fn entry(&self) -> Entry {
        Entry {
            name: "thermal_gradient",
            kind: Kind::Additive,
            parameters: const {
                &[
                    EffectParameter::new("along_K_per_mm", 0.1, 10.0),
                    EffectParameter::new("across_K_per_mm", 0.1, 10.0),
                ]
            },
            about: "When it was loaded, the specimen was warmer than at the reference exposure. The difference grows linearly along the load and across it, and is zero at the origin. The specimen expands freely, by its plies' coefficients.",
            confirm: "Use thermocouples at both ends and sides of the window, or a thermal camera. Or take two exposures at one and the same load, an hour apart.",
        }
    }

    /// Strains linear in the place are compatible, so that the plate stays free of stress: with eps the strains of one kelvin and
    /// T = a s + b t, u1,1 = eps1 T, u2,2 = eps2 T, u1,2 + u2,1 = gamma T.
    fn displacement(&self, amplitude: &[f64], scene: &Scene, [s, t]: [f64; 2]) -> [f64; 2] {
        let Some(expansion) = scene.expansion_per_k else {
            return [0.0; 2];
        };
        let strain = free_expansion(&scene.ply, &scene.setup.angles, expansion);
        let [e1, e2, gamma] = [strain[0], strain[1], strain[2]];
        let (a, b) = (amplitude[0], amplitude[1]);
        [
            0.5 * e1 * a * s * s + e1 * b * s * t + 0.5 * (gamma * b - e2 * a) * t * t,
            0.5 * e2 * b * t * t + e2 * a * s * t + 0.5 * (gamma * a - e1 * b) * s * s,
        ]
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_same_expansion(scene)
    }
}
