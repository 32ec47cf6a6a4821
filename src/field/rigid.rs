//! Least-squares rigid motion of a plane field.

use serde::{Deserialize, Serialize};

/// Translation of the centre and small rotation about it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RigidMotion {
    /// Translation (u1, u2), mm.
    pub shift: [f64; 2],
    /// Rotation in the right-handed pair (direction 1, direction 2), rad.
    pub angle: f64,
    /// The part of it that the load itself causes in a specimen that is held. It belongs to the solution, which is of first order: only the
    /// rest turns the strained specimen.
    pub own: f64,
    /// The centre of the points, mm.
    pub center: [f64; 2],
}

impl RigidMotion {
    /// No motion.
    pub const NONE: Self = Self {
        shift: [0.0; 2],
        angle: 0.0,
        own: 0.0,
        center: [0.0; 2],
    };

    /// The same, of which the load causes a rotation, rad. It is no larger than the whole angle, and zero if it has the other sign.
    #[must_use]
    pub fn with_own(self, rotation: f64) -> Self {
        let [least, most] = [self.angle.min(0.0), self.angle.max(0.0)];
        Self {
            own: rotation.clamp(least, most),
            ..self
        }
    }

    /// Displacement at a point by the part of the rotation that the load causes.
    pub fn own_at(&self, [s, t]: [f64; 2]) -> [f64; 2] {
        [
            -self.own * (t - self.center[1]),
            self.own * (s - self.center[0]),
        ]
    }

    /// Displacement by the finite motion of a point of the specimen as the load left it.
    pub fn turned(&self, p: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = (self.angle - self.own).sin_cos();
        let (s, t) = (p[0] - self.center[0], p[1] - self.center[1]);
        [
            self.shift[0] + (cos - 1.0) * s - sin * t,
            self.shift[1] + sin * s + (cos - 1.0) * t,
        ]
    }

    /// What a displacement `u` in a moved specimen, reported at `p`, is in the specimen's own axes without the motion: a strain of 0.2 %
    /// turned by 2 mrad is a shear of micrometres a metre otherwise.
    pub fn released(&self, p: [f64; 2], u: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = (self.angle - self.own).sin_cos();
        let (rigid, own) = (self.turned(p), self.own_at(p));
        let [a, b] = [u[0] - rigid[0], u[1] - rigid[1]];
        [cos * a + sin * b - own[0], cos * b - sin * a - own[1]]
    }

    /// Displacement at a point, of first order in the rotation.
    pub fn at(&self, [s, t]: [f64; 2]) -> [f64; 2] {
        [
            self.shift[0] - self.angle * (t - self.center[1]),
            self.shift[1] + self.angle * (s - self.center[0]),
        ]
    }
}

impl RigidMotion {
    /// Displacements at points without the motion, of first order in the rotation.
    pub fn removed(&self, points: &[[f64; 2]], displacements: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let rest = |(&p, u): (&[f64; 2], &[f64; 2])| {
            let m = self.at(p);
            [u[0] - m[0], u[1] - m[1]]
        };
        points.iter().zip(displacements).map(rest).collect()
    }
}

/// Fit a rigid motion to displacements `values` at `points`.
pub fn fit(points: &[[f64; 2]], values: &[[f64; 2]]) -> RigidMotion {
    fitted(points, values, |_| 1.0)
}

/// The same of points that each count with a weight.
pub fn fit_weighted(points: &[[f64; 2]], weights: &[usize], values: &[[f64; 2]]) -> RigidMotion {
    fitted(points, values, |k| weights[k] as f64)
}

fn fitted(points: &[[f64; 2]], values: &[[f64; 2]], weight: impl Fn(usize) -> f64) -> RigidMotion {
    let n: f64 = (0..points.len()).map(&weight).sum::<f64>().max(1.0);
    let mean = |v: &[[f64; 2]]| {
        v.iter().enumerate().fold([0.0; 2], |m, (k, v)| {
            let share = weight(k) / n;
            [m[0] + share * v[0], m[1] + share * v[1]]
        })
    };
    let (center, shift) = (mean(points), mean(values));
    let (mut moment, mut inertia) = (0.0, 0.0);
    for (k, (p, u)) in points.iter().zip(values).enumerate() {
        let (s, t) = (p[0] - center[0], p[1] - center[1]);
        moment += weight(k) * (s * (u[1] - shift[1]) - t * (u[0] - shift[0]));
        inertia += weight(k) * (s * s + t * t);
    }
    let angle = if inertia > 0.0 { moment / inertia } else { 0.0 };
    RigidMotion {
        shift,
        angle,
        own: 0.0,
        center,
    }
}
