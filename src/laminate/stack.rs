//! Classical lamination theory: plies stacked to A, B, D.

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::ply::{Ply, rotate_stiffness};

/// Laminate stiffnesses: N = A eps + B kappa, M = B eps + D kappa (N/mm, N, N mm).
#[derive(Debug, Clone, Copy)]
pub struct Abd {
    /// Membrane stiffness, N/mm.
    pub a: Matrix3<f64>,
    /// Coupling stiffness, N.
    pub b: Matrix3<f64>,
    /// Bending stiffness, N mm.
    pub d: Matrix3<f64>,
}

/// Stiffnesses of a stack of equal plies: fibre angles `angles` (rad, from the face z = -h/2 up) and total
/// thickness `thickness` (mm).
pub fn abd(ply: &Ply, angles: &[f64], thickness: f64) -> Abd {
    stacked(&ply.stiffness(), angles, thickness)
}

/// [`abd`] of a plane stiffness `q` (MPa) in the ply's axes, in which it is linear: of dQ/dp it is the derivative.
pub fn stacked(q: &Matrix3<f64>, angles: &[f64], thickness: f64) -> Abd {
    let t = thickness / angles.len() as f64;
    let mut sum = Abd {
        a: Matrix3::zeros(),
        b: Matrix3::zeros(),
        d: Matrix3::zeros(),
    };
    for (k, &angle) in angles.iter().enumerate() {
        let q = rotate_stiffness(q, angle);
        let low = -0.5 * thickness + k as f64 * t;
        let high = low + t;
        sum.a += q * t;
        sum.b += q * ((high * high - low * low) / 2.0);
        sum.d += q * ((high.powi(3) - low.powi(3)) / 3.0);
    }
    sum
}

/// The six in-plane stiffness components on which the plane-stress plate depends, N/mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Membrane {
    pub a11: f64,
    pub a12: f64,
    pub a22: f64,
    pub a16: f64,
    pub a26: f64,
    pub a66: f64,
}

impl From<&Matrix3<f64>> for Membrane {
    fn from(a: &Matrix3<f64>) -> Self {
        Self {
            a11: a[(0, 0)],
            a12: a[(0, 1)],
            a22: a[(1, 1)],
            a16: a[(0, 2)],
            a26: a[(1, 2)],
            a66: a[(2, 2)],
        }
    }
}

impl Membrane {
    /// The symmetric 3 x 3 matrix A, N/mm.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(
            self.a11, self.a12, self.a16, //
            self.a12, self.a22, self.a26, //
            self.a16, self.a26, self.a66,
        )
    }
}

/// What the bending of a Reissner-Mindlin plate depends on: M = D kappa, Q = S gamma. The coupling B of a stack that is not symmetric is
/// left out.
#[derive(Debug, Clone, Copy)]
pub struct PlateStiffness {
    /// Bending stiffness D, N mm.
    pub bending: Matrix3<f64>,
    /// Transverse shear stiffness S in (direction 1, direction 2), N/mm.
    pub shear: Matrix2<f64>,
}

/// Share of the stack's transverse shear stiffness that resists, for the parabola of shear stress over the thickness (Reissner 1945).
pub const SHEAR_CORRECTION: f64 = 5.0 / 6.0;

/// Transverse shear stiffness S (N/mm) of a stack of equal plies of transverse moduli `g13` and `g23` (MPa), with a shear correction of 5/6.
/// It is linear in both moduli.
pub fn transverse(g13: f64, g23: f64, angles: &[f64], thickness: f64) -> Matrix2<f64> {
    let t = thickness / angles.len() as f64;
    let shear = angles.iter().fold(Matrix2::zeros(), |sum, angle| {
        let (s, c) = angle.sin_cos();
        let along = Matrix2::new(c * c, s * c, s * c, s * s);
        let across = Matrix2::identity() - along;
        sum + (along * g13 + across * g23) * t
    });
    shear * SHEAR_CORRECTION
}

impl PlateStiffness {
    /// Of a stack of equal plies, as [`abd`]. No field test measures a ply's transverse moduli: G13 = G12 as in any transversely isotropic
    /// ply, and G23 = E2 / (2 (1 + nu12)), which is G for an isotropic one.
    pub fn of(ply: &Ply, angles: &[f64], thickness: f64) -> Self {
        let (g13, g23) = (ply.g12, ply.e2 / (2.0 * (1.0 + ply.nu12)));
        Self {
            bending: abd(ply, angles, thickness).d,
            shear: transverse(g13, g23, angles, thickness),
        }
    }

    /// Curvatures (1/mm) under moments M1, M2, M12 (N mm a mm of section); zeros for a stiffness that is not positive definite.
    pub fn curvature(&self, moment: &Vector3<f64>) -> Vector3<f64> {
        let factor = self.bending.cholesky();
        factor.map_or_else(Vector3::zeros, |d| d.solve(moment))
    }
}
