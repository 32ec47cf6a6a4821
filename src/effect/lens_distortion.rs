//! Radial distortion by the lens.

use super::{Companions, Effect, EffectParameter, Entry, Kind, Scene};

pub struct LensDistortion;

/// The radius at which the distortion is stated, mm.
const RADIUS_MM: f64 = 12.0;

/// Prior sd before a camera, percent at that radius (prototype study).
const BEFORE_CAMERA_PERCENT: f64 = 0.072;

impl Effect for LensDistortion {
    fn entry(&self) -> Entry {
        Entry {
            name: "lens_distortion",
            kind: Kind::Optical,
            parameters: const {
                &[
                    EffectParameter::new("percent_at_12mm", 0.3, 2.0),
                    EffectParameter::new("center_1_mm", 6.0, 100.0),
                    EffectParameter::new("center_2_mm", 6.0, 100.0),
                ]
            },
            about: "Radial distortion about a centre: from there true X = X (1 - k r^2), stated as k r^2 at a radius of 12 mm. The centre is given from the middle of the measured points, along direction 1 and 2; the origin of the coordinates stays at the imaged hole's centre. Displacements read from fringes stay right; those from image coordinates are distorted too, rigid motion included.",
            confirm: "Picture a calibrated grid of dots over the whole field of view; or move the specimen across the field of view and repeat: the distortion stays with the picture.",
        }
    }

    fn companions(&self) -> Companions {
        Companions::Centre
    }

    fn prior_sd_before_camera(&self, k: usize, _scene: &Scene) -> Option<f64> {
        (k == 0).then_some(BEFORE_CAMERA_PERCENT)
    }

    fn needed(&self) -> usize {
        1
    }

    /// With C the centre, d = X - C and D(d) = d (1 - k |d|^2): true X = D(d) - D(-C), so that the origin stays.
    fn true_point(&self, amplitude: &[f64], scene: &Scene, reported: [f64; 2]) -> [f64; 2] {
        let k = 0.01 * amplitude[0] / (RADIUS_MM * RADIUS_MM);
        let center = [0, 1].map(|i| scene.middle[i] + amplitude[1 + i]);
        let straightened = |p: [f64; 2]| {
            let d = [p[0] - center[0], p[1] - center[1]];
            d.map(|x| x * (1.0 - k * (d[0] * d[0] + d[1] * d[1])))
        };
        let (point, origin) = (straightened(reported), straightened([0.0; 2]));
        [point[0] - origin[0], point[1] - origin[1]]
    }
}
