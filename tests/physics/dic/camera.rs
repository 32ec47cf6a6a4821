//! Motion of the specimen and the camera before it, as exact maps: rotation matrices, K [R | t], and a picture that is inverted by
//! iteration. Points are (x, y) in the data's axes or (x, y, z) with z towards the camera, mm, from the hole's centre.

use nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector3, Vector4};

/// A rigid motion: in the plane about the origin first, then out of it about a pivot.
#[derive(Debug, Clone, Copy, Default)]
pub struct Motion {
    /// Translation in the plane, mm.
    pub shift_mm: [f64; 2],
    /// Rotation in the plane about the origin, counter-clockwise, rad.
    pub angle_rad: f64,
    /// Translation towards the camera, mm.
    pub rise_mm: f64,
    /// Rotation about the axes x and y, rad: to first order a point rises by ax y - ay x.
    pub turn_rad: [f64; 2],
    /// Where the axes of that rotation meet, mm.
    pub pivot_mm: [f64; 2],
}

impl Motion {
    /// The motion as x -> A x + b.
    pub fn map(&self) -> (Matrix3<f64>, Vector3<f64>) {
        let inside = Rotation3::from_axis_angle(&Vector3::z_axis(), self.angle_rad);
        let outside = Rotation3::new(Vector3::new(self.turn_rad[0], self.turn_rad[1], 0.0));
        let shift = Vector3::new(self.shift_mm[0], self.shift_mm[1], 0.0);
        let pivot = Vector3::new(self.pivot_mm[0], self.pivot_mm[1], 0.0);
        let rise = Vector3::new(0.0, 0.0, self.rise_mm);
        let turn = (outside * inside).into_inner();
        (turn, outside * (shift - pivot) + pivot + rise)
    }
}

/// A pinhole that looks straight at the reference plane z = 0, whose picture is calibrated by its scale there.
#[derive(Debug, Clone, Copy)]
pub struct Pinhole {
    /// From the reference plane, mm.
    pub distance_mm: f64,
    /// The foot of the optical axis, mm.
    pub principal_mm: [f64; 2],
}

/// Focal length and principal point of the sensor, pixels: they drop out.
const FOCAL: f64 = 8000.0;
const MIDDLE: [f64; 2] = [1023.5, 767.5];

impl Pinhole {
    /// K [R | t]: pixels (column to the right, row downwards) of points in space.
    pub fn matrix(&self) -> Matrix3x4<f64> {
        let intrinsic = Matrix3::new(
            FOCAL, 0.0, MIDDLE[0], //
            0.0, FOCAL, MIDDLE[1], //
            0.0, 0.0, 1.0,
        );
        // the camera's axes: x to the right, y down, z into the scene
        let turn = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        let place = Vector3::new(self.principal_mm[0], self.principal_mm[1], self.distance_mm);
        let mut extrinsic = Matrix3x4::zeros();
        extrinsic.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
        extrinsic.set_column(3, &(-(turn * place)));
        intrinsic * extrinsic
    }

    /// The picture's (x, y), mm, of a pixel in homogeneous coordinates.
    pub fn scaled(&self, pixel: Vector3<f64>) -> [f64; 2] {
        let scale = self.distance_mm / FOCAL;
        let [column, row] = [pixel.x / pixel.z, pixel.y / pixel.z];
        [
            self.principal_mm[0] + scale * (column - MIDDLE[0]),
            self.principal_mm[1] - scale * (row - MIDDLE[1]),
        ]
    }
}

/// What the picture does to every exposure alike, in the order of the fields. All zeros: nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Picture {
    /// A plane seen at an angle: reported = true / (1 - (a x + b y)), 1/mm.
    pub tilt_per_mm: [f64; 2],
    /// Radial distortion, c + d (1 + k1 d^2) about the lens' centre, 1/mm^2.
    pub k1_per_mm2: f64,
    /// Decentring distortion of the same lens (Brown), 1/mm.
    pub decentring_per_mm: [f64; 2],
    /// The lens' centre, mm.
    pub lens_mm: [f64; 2],
    /// What is reported is turned counter-clockwise about the hole's centre, degrees.
    pub rotation_deg: f64,
    /// What is reported is too large by, percent.
    pub magnification_percent: f64,
    /// What is reported is shifted by, mm.
    pub offset_mm: [f64; 2],
}

impl Picture {
    /// Where a point of the pinhole's picture is reported.
    pub fn reported(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let depth = 1.0 - (self.tilt_per_mm[0] * x + self.tilt_per_mm[1] * y);
        let [cx, cy] = self.lens_mm;
        let (dx, dy) = (x / depth - cx, y / depth - cy);
        let square = dx * dx + dy * dy;
        let radial = 1.0 + self.k1_per_mm2 * square;
        let [p1, p2] = self.decentring_per_mm;
        let x = cx + dx * radial + 2.0 * p1 * dx * dy + p2 * (square + 2.0 * dx * dx);
        let y = cy + dy * radial + p1 * (square + 2.0 * dy * dy) + 2.0 * p2 * dx * dy;
        let (sin, cos) = self.rotation_deg.to_radians().sin_cos();
        let scale = 1.0 + 0.01 * self.magnification_percent;
        [
            scale * (cos * x - sin * y) + self.offset_mm[0],
            scale * (sin * x + cos * y) + self.offset_mm[1],
        ]
    }

    /// The point of the pinhole's picture that is reported at a place. The map is near the identity, so that its distance from the
    /// place, taken off again and again, converges.
    pub fn true_point(&self, place: [f64; 2]) -> [f64; 2] {
        let mut p = place;
        for _ in 0..200 {
            let q = self.reported(p);
            let off = [place[0] - q[0], place[1] - q[1]];
            p = [p[0] + off[0], p[1] + off[1]];
            if off[0].abs().max(off[1].abs()) < 1e-13 {
                break;
            }
        }
        p
    }
}

/// One exposure: reported places of material points that have moved.
pub struct Exposure {
    motion: (Matrix3<f64>, Vector3<f64>),
    pinhole: Pinhole,
    projection: Matrix3x4<f64>,
    picture: Picture,
}

impl Exposure {
    pub fn new(motion: &Motion, pinhole: Pinhole, picture: Picture) -> Self {
        Self {
            motion: motion.map(),
            pinhole,
            projection: pinhole.matrix(),
            picture,
        }
    }

    /// Where a point is reported that lies at (x, y, z) of the specimen as it is strained, before its rigid motion.
    pub fn place(&self, point: [f64; 3]) -> [f64; 2] {
        let (turn, shift) = self.motion;
        let p = turn * Vector3::from(point) + shift;
        let pixel = self.projection * Vector4::new(p.x, p.y, p.z, 1.0);
        self.picture.reported(self.pinhole.scaled(pixel))
    }
}
