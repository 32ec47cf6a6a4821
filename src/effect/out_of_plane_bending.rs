//! The specimen bends out of its plane, and its surface strains.

use nalgebra::Vector3;

use super::{Effect, Entry, Kind, Parameter, Scene, Scope};
use crate::laminate::abd;

/// Millimetres in one metre.
const MM_PER_M: f64 = 1e3;

pub struct OutOfPlaneBending;

impl Effect for OutOfPlaneBending {
    fn entry(&self) -> Entry {
        Entry {
            name: "out_of_plane_bending",
            kind: Kind::Additive,
            parameters: const {
                &[
                    Parameter::new("uniform_per_m", 0.025, 100.0),
                    Parameter::new("gradient_per_m_per_mm", 0.0025, 10.0),
                ]
            },
            about: "The load acts off the middle surface, so that the specimen bends out of its plane. The curvature along the load, at the hole and its change a mm along the load, is positive where it stretches the face that is seen (z = +h/2).",
            confirm: "Put strain gauges back to back, or measure both faces: this strain changes its sign from one face to the other. A second camera (3-D DIC) shows the deflection itself.",
        }
    }

    fn scope(&self) -> Scope {
        Scope::Mechanical
    }

    /// Surface strains (h/2) kappa with kappa = D^-1 (M, 0, 0), scaled so that kappa_1 is the amplitude; for a stack
    /// that is not symmetric the coupling B is left out. Uniform: a homogeneous strain about the hole's centre.
    /// Linear along the load, kappa = k s: u1 = (h/2) (k1 s^2 / 2 - k2 t^2 / 2), u2 = (h/2) (k2 s t + k12 s^2 / 2).
    fn displacement(&self, amplitude: &[f64], scene: &Scene, [s, t]: [f64; 2]) -> [f64; 2] {
        let (k2, k12) = curvature_ratios(scene);
        let half = 0.5 * scene.setup.thickness;
        let uniform = half * amplitude[0] / MM_PER_M;
        let gradient = half * amplitude[1] / MM_PER_M;
        [
            uniform * (s + 0.5 * k12 * t) + gradient * 0.5 * (s * s - k2 * t * t),
            uniform * (0.5 * k12 * s + k2 * t) + gradient * (k2 * s * t + 0.5 * k12 * s * s),
        ]
    }
}

/// kappa_2 / kappa_1 and kappa_12 / kappa_1 under a moment M1 alone, in the pair (direction 1, direction 2).
fn curvature_ratios(scene: &Scene) -> (f64, f64) {
    let d = abd(&scene.ply, &scene.setup.angles, scene.setup.thickness).d;
    // D is positive definite for an admissible ply; without one there is no curvature to speak of.
    let kappa = d
        .cholesky()
        .map_or_else(Vector3::x, |d| d.solve(&Vector3::x()));
    (kappa[1] / kappa[0], kappa[2] / kappa[0])
}
