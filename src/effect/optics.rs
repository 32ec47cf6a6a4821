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

/// The reported displacement of a small true one: `jacobian` is d true / d reported, so its inverse acts on `u`.
pub fn imaged(jacobian: [[f64; 2]; 2], u: [f64; 2]) -> [f64; 2] {
    let [[a, b], [c, d]] = jacobian;
    let det = a * d - b * c;
    [(d * u[0] - b * u[1]) / det, (a * u[1] - c * u[0]) / det]
}
