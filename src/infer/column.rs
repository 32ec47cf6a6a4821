//! What a change of one parameter does to the prediction.

use nalgebra::DVector;

use crate::effect::LOAD_SCALE;

/// What the names of forces that are not declared begin with.
pub const FORCE: &str = "force_";

/// A parameter of the linearised prediction.
#[derive(Clone)]
pub struct Column {
    /// `E1_GPa`, `thickness_mm`, `load_misalignment.angle_deg`.
    pub name: String,
    /// Prior mean, border units.
    pub mean: f64,
    /// Prior sd, border units.
    pub sd: f64,
    /// Value at which the test was linearised.
    pub at: f64,
    /// Whether the parameter cannot be negative.
    pub positive: bool,
    /// Whether it is a product of an amplitude with what is not known of the camera, which has no size of its own.
    pub product: bool,
    /// Change of the values of (u1, u2) for one prior sd, mm.
    pub values: [DVector<f64>; 2],
}

impl Column {
    /// Whether it moves the specimen as a whole.
    pub fn is_rigid(&self) -> bool {
        self.name.starts_with("rigid_")
    }

    /// Whether it is a force that is not declared.
    pub fn is_force(&self) -> bool {
        self.name.starts_with(FORCE)
    }

    /// Whether it is the scale of all forces.
    pub fn is_load(&self) -> bool {
        self.name.split('.').next() == Some(LOAD_SCALE.name())
    }
}
