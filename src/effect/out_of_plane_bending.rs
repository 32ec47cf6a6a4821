//! The specimen bends out of its plane: its surface strains, and the camera sees it nearer or farther.

use super::out_of_plane_translation::OutOfPlaneTranslation;
use super::{Companions, Effect, EffectParameter, Entry, Kind, Scene, Scope};
use crate::fem::plain_rotation;
use crate::laminate::{PlateStiffness, abd};

/// Millimetres in one metre.
const MM_PER_M: f64 = 1e3;

/// Prior sds before a camera: strain of the face by bending over that far from the hole, and its relative change a mm along the load.
const BENT: f64 = 0.05;
const BENT_GRADIENT_PER_MM: f64 = 0.1;

/// Strain along the load far from the hole under the nominal force, by lamination theory.
fn far_strain(scene: &Scene) -> f64 {
    let setup = &scene.setup;
    let [_, [low, high]] = setup.geometry.extents();
    let compliance = abd(&scene.ply, &setup.angles, setup.thickness)
        .a
        .try_inverse();
    compliance.map_or(0.0, |c| c[(0, 0)] * setup.load.axial.abs() / (high - low))
}

pub struct OutOfPlaneBending;

impl Effect for OutOfPlaneBending {
    fn entry(&self) -> Entry {
        Entry {
            name: "out_of_plane_bending",
            kind: Kind::Additive,
            parameters: const {
                &[
                    EffectParameter::new("uniform_per_m", 0.025, 100.0),
                    EffectParameter::new("gradient_per_m_per_mm", 0.0025, 10.0),
                ]
            },
            about: "The load acts off the middle surface, so that the specimen bends out of its plane. The amplitudes are the gross section's curvature along the load: at the hole, and its change a mm along the load. They are positive where the face that is seen is stretched (z = +h/2). Finite elements of bent plates give what the hole changes. Before a camera the deflection also shifts what is seen.",
            confirm: "Put strain gauges back to back, or measure both faces: this strain changes its sign from one face to the other. A second camera (3-D DIC) shows the deflection itself.",
        }
    }

    fn companions(&self) -> Companions {
        Companions::AxisAndLift {
            lift: &OutOfPlaneTranslation,
        }
    }

    fn prior_sd_before_camera(&self, k: usize, scene: &Scene) -> Option<f64> {
        let to_face_mm = 0.5 * scene.setup.thickness;
        let uniform_per_m = MM_PER_M * BENT * far_strain(scene) / to_face_mm;
        Some([1.0, BENT_GRADIENT_PER_MM][k] * uniform_per_m)
    }

    fn scope(&self) -> Scope {
        Scope::Mechanical
    }

    fn curvature(&self, amplitude: &[f64]) -> Option<[f64; 2]> {
        Some([amplitude[0] / MM_PER_M, amplitude[1] / MM_PER_M])
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        if !scene.setup.regions.is_empty() {
            return Some(
                "regions of the mesh have a stack of their own (mesh.regions): bending is solved for one bending stiffness",
            );
        }
        (!scene.setup.geometry.has_ends()).then_some(
            "the specimen has no straight edges low and high across the load to be bent at",
        )
    }

    /// That of the face z = +h/2 of a thin plate without a hole, about the hole's centre, under moments at its ends; for a stack that is
    /// not symmetric the coupling B is left out.
    fn displacement(&self, amplitude: &[f64], scene: &Scene, [s, t]: [f64; 2]) -> [f64; 2] {
        let setup = &scene.setup;
        let plate = PlateStiffness::of(&scene.ply, &setup.angles, setup.thickness);
        let [_, [low, high]] = setup.geometry.extents();
        let middle = 0.5 * (low + high);
        let curvature = [amplitude[0] / MM_PER_M, amplitude[1] / MM_PER_M];
        let [at, origin] =
            [[s, t - middle], [0.0, -middle]].map(|p| plain_rotation(&plate, curvature, p));
        [0, 1].map(|c| 0.5 * setup.thickness * (at[c] - origin[c]))
    }
}
