//! The specimen turns out of its plane.

use super::optics::no_camera;
use super::out_of_plane_translation::OutOfPlaneTranslation;
use super::uniform_strain::UniformStrain;
use super::{Companions, Effect, EffectParameter, Entry, Kind, Scene, Scope};

pub struct OutOfPlaneRotation;

/// Radians in one milliradian.
const MILLI: f64 = 1e-3;

impl Effect for OutOfPlaneRotation {
    fn entry(&self) -> Entry {
        Entry {
            name: "out_of_plane_rotation",
            kind: Kind::Optical,
            parameters: const {
                &[
                    EffectParameter::new("about_1_mrad", 2.0, 100.0),
                    EffectParameter::new("about_2_mrad", 2.0, 100.0),
                ]
            },
            about: "The specimen turns between the exposures about axes in its plane through the hole's centre. A point (s, t) rises towards the camera by a1 t - a2 s. By perspective this is a displacement that grows with the square of the distance from the camera's axis. Only angle divided by camera distance matters. Without camera_distance_mm, ten specimen widths are assumed.",
            confirm: "A mirror or two dial gauges on the face, or a second camera (3-D DIC), show the rotation. Or repeat from twice the distance: its field halves.",
        }
    }

    /// The rotation vector a = (a1, a2, 0) to second order, a x X + a x (a x X) / 2: at 5 mrad the second is 12 microstrain.
    fn motion(&self, amplitude: &[f64], _scene: &Scene, [s, t]: [f64; 2]) -> [f64; 3] {
        let (a1, a2) = (MILLI * amplitude[0], MILLI * amplitude[1]);
        [
            0.5 * a2 * (a1 * t - a2 * s),
            0.5 * a1 * (a2 * s - a1 * t),
            a1 * t - a2 * s,
        ]
    }

    fn companions(&self) -> Companions {
        Companions::AxisAndPivot {
            lift: &OutOfPlaneTranslation,
        }
    }

    /// A rotation about an axis off the hole, or before a camera whose axis is off the middle of the picture, leaves a strain.
    fn entails(&self) -> Option<&'static dyn Effect> {
        Some(&UniformStrain)
    }

    /// Microstrain of an angle a (mrad) about an axis c off, before a camera at the distance Z: a c / Z.
    fn entailed_sd(&self, amplitude: &[f64], off_mm: f64, distance_mm: f64) -> f64 {
        let mrad = amplitude.iter().fold(0.0, |m: f64, a| m.hypot(*a));
        1e3 * mrad * off_mm / distance_mm
    }

    fn scope(&self) -> Scope {
        Scope::Motion
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        no_camera(scene)
    }
}
