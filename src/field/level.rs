//! The plane of a stereo measurement's points: places and displacements along its axes instead of the table's.

use nalgebra::{Matrix3, Vector3};

use crate::error::{Error, Result};

/// Angle above which measurements in the table's axes would be wrong by more than their noise, degrees.
pub const WORTH_A_WORD_DEG: f64 = 1.0;

/// Steepest plane, degrees: a camera sees none beyond it.
const STEEPEST_DEG: f64 = 60.0;

/// The plane z = a + b x + c y through points.
#[derive(Debug, Clone, Copy)]
pub(super) struct TiltedPlane {
    height: f64,
    slope: [f64; 2],
}

impl TiltedPlane {
    /// By least squares; none through points on a line.
    pub fn through(points: &[[f64; 3]]) -> Option<Self> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let count = points.len().max(1) as f64;
        let middle = [0, 1, 2].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
        for p in points {
            let row = Vector3::new(1.0, p[0] - middle[0], p[1] - middle[1]);
            normal += row * row.transpose();
            right += row * (p[2] - middle[2]);
        }
        let fit = normal.try_inverse()? * right;
        let slope = [fit[1], fit[2]];
        let height = middle[2] + fit[0] - slope[0] * middle[0] - slope[1] * middle[1];
        height.is_finite().then_some(Self { height, slope })
    }

    /// Its angle with the table's x-y plane, degrees.
    pub fn angle_deg(&self) -> f64 {
        self.slope[0].hypot(self.slope[1]).atan().to_degrees()
    }

    /// The table's axis about which it is tilted; none where it is about both.
    fn about(&self) -> Option<&'static str> {
        const ALONE: f64 = 0.1;
        let [x, y] = self.slope.map(f64::abs);
        match () {
            () if y < ALONE * x => Some("y"),
            () if x < ALONE * y => Some("x"),
            () => None,
        }
    }

    /// What is said of it; `z` is the column of the coordinate out of the plane.
    pub fn said(&self, z: &str) -> String {
        let about = self.about().map_or("an axis between x and y", |axis| axis);
        format!(
            "the plane of the points is tilted by {:.2} degrees about {about} (column {z})",
            self.angle_deg()
        )
    }

    /// A place and a displacement along the axes of the plane. Its x axis is in the plane of the table's x and z, and the point above the
    /// table's origin keeps its coordinates.
    pub fn level(&self, at: [f64; 3], u: [f64; 3]) -> ([f64; 2], [f64; 2]) {
        let [b, c] = self.slope;
        let along = Vector3::new(1.0, 0.0, b).normalize();
        let across = Vector3::new(-b, -c, 1.0).normalize().cross(&along);
        let place = Vector3::new(at[0], at[1], at[2] - self.height);
        let u = Vector3::from(u);
        (
            [along.dot(&place), across.dot(&place)],
            [along.dot(&u), across.dot(&u)],
        )
    }

    /// Refuse a plane that no camera sees.
    ///
    /// # Errors
    /// Of the input, with the angle.
    pub fn check(&self, place: &str, z: &str) -> Result<()> {
        if self.angle_deg() < STEEPEST_DEG {
            return Ok(());
        }
        Err(Error::input(place, format!("points in a plane tilted by less than {STEEPEST_DEG} degrees"))
            .found(self.said(z))
            .hint("is this column a coordinate in the unit of the others? export the points in the plane of the specimen"))
    }
}
