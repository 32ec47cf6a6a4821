//! The declared frame of a measurement: which data axis carries the load, and where the hole is.

use serde::{Deserialize, Serialize};

/// An axis of the data's x-y plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// The data's x axis.
    X,
    /// The data's y axis.
    Y,
}

/// From the data's axes to the model's: direction 1 is the positive loading axis, direction 2 the other axis, both
/// as the data count them, and the origin is the hole's centre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Frame {
    /// The axis of the data along which the load acts.
    pub loading_axis: Axis,
    /// The hole's centre (x, y) in the data's coordinates, mm.
    pub hole_center_mm: [f64; 2],
}

/// The axes of the data themselves.
pub const DATA_AXES: Frame = Frame {
    loading_axis: Axis::X,
    hole_center_mm: [0.0, 0.0],
};

impl Frame {
    /// The model's point (s, t) in mm of the data's point (x, y) in mm.
    pub fn point(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [cx, cy] = self.hole_center_mm;
        self.vector([x - cx, y - cy])
    }

    /// The data's point (x, y) in mm of the model's point (s, t) in mm.
    pub fn data_point(&self, point: [f64; 2]) -> [f64; 2] {
        let [dx, dy] = self.vector(point);
        [self.hole_center_mm[0] + dx, self.hole_center_mm[1] + dy]
    }

    /// Components along (direction 1, direction 2) of a vector with components (x, y), and back: it is its own inverse.
    pub fn vector(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.loading_axis {
            Axis::X => [x, y],
            Axis::Y => [y, x],
        }
    }

    /// +1 where (direction 1, direction 2) is right-handed in the data's plane (loading along x), -1 where it is
    /// left-handed (loading along y). A counter-clockwise angle in the data's plane has this sign in the model's.
    pub fn handedness(&self) -> f64 {
        match self.loading_axis {
            Axis::X => 1.0,
            Axis::Y => -1.0,
        }
    }
}
