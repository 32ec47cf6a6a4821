//! Rigid translation of the observed field.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::quantity::UM_PER_MM;

pub struct RigidTranslation;

impl Effect for RigidTranslation {
    fn entry(&self) -> Entry {
        Entry {
            name: "rigid_translation",
            kind: Kind::Additive,
            parameters: const {
                &[
                    EffectParameter::unbounded("tx_um", 1e6),
                    EffectParameter::unbounded("ty_um", 1e6),
                ]
            },
            about: "The whole field is shifted along the data's x and y: a fringe order has no origin, and a specimen moves in its grips.",
            confirm: "Nothing to confirm: any displacement measurement carries it unless a point is held fixed.",
        }
    }

    fn is_rigid(&self) -> bool {
        true
    }

    fn displacement(&self, amplitude: &[f64], scene: &Scene, _point: [f64; 2]) -> [f64; 2] {
        scene
            .frame
            .vector([amplitude[0] / UM_PER_MM, amplitude[1] / UM_PER_MM])
    }
}
