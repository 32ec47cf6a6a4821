//! What the optical effects share: a map from reported to true points, and what it does to displacements.

use super::Scene;

/// Apply a function of vectors in the data's axes, (x, y) from the hole's centre, to one in the model's.
pub fn in_data_axes(scene: &Scene, v: [f64; 2], map: impl Fn([f64; 2]) -> [f64; 2]) -> [f64; 2] {
    scene.frame.vector(map(scene.frame.vector(v)))
}

/// Whether displacements are read from image coordinates, as in digital image correlation, so that whatever distorts
/// coordinates distorts them too. Fringes count grating lines on the specimen: only their places are distorted.
pub fn displacements_are_imaged(scene: &Scene) -> bool {
    scene.fringe_frequency_per_mm.is_none()
}

/// Why motion out of the plane is not seen, where it is not.
pub fn no_camera(scene: &Scene) -> Option<&'static str> {
    if !displacements_are_imaged(scene) {
        return Some("fringes do not show motion towards the camera");
    }
    scene
        .camera_distance_mm
        .is_none()
        .then_some("no image correlation is declared: give image_correlation.subset_mm")
}
