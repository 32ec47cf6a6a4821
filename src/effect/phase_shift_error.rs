//! Wrong steps of the phase shifter print a ripple at twice the fringe frequency.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_fringes};
use crate::quantity::NM_PER_MM;

pub struct PhaseShiftError;

impl Effect for PhaseShiftError {
    fn entry(&self) -> Entry {
        Entry {
            name: "phase_shift_error",
            kind: Kind::Recorded,
            parameters: const {
                &[
                    EffectParameter::new("u1_sin_nm", 20.0, 1e3),
                    EffectParameter::new("u1_cos_nm", 20.0, 1e3),
                    EffectParameter::new("u2_sin_nm", 20.0, 1e3),
                    EffectParameter::new("u2_cos_nm", 20.0, 1e3),
                ]
            },
            about: "Wrong steps of the phase shifter add a sin(2 pi 2 f F) + b cos(2 pi 2 f F) to each component F of the displacement. F is u1 along the load or u2 across it, with its translation; f is the fringe frequency. Each component has its own a and b.",
            confirm: "Calibrate the phase shifter (piezo). Or repeat with another number of phase steps: the ripple changes, the displacement does not.",
        }
    }

    fn recorded(
        &self,
        amplitude: &[f64],
        scene: &Scene,
        _point: [f64; 2],
        u: [f64; 2],
    ) -> [f64; 2] {
        let Some(frequency) = scene.fringe_frequency_per_mm else {
            return u;
        };
        [0, 1].map(|c| {
            let [a, b] = [amplitude[2 * c], amplitude[2 * c + 1]].map(|nm| nm / NM_PER_MM);
            let (sin, cos) = (2.0 * std::f64::consts::TAU * frequency * u[c]).sin_cos();
            u[c] + a * sin + b * cos
        })
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_fringes(scene)
    }
}
