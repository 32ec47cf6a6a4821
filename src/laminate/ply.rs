//! One ply: its elastic constants and its plane-stress stiffness.

use nalgebra::Matrix3;

use crate::error::{Error, Result};

/// Elastic constants of a ply in its own axes; moduli in MPa.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ply {
    /// Young's modulus along the fibres, MPa.
    pub e1: f64,
    /// Young's modulus across the fibres, MPa.
    pub e2: f64,
    /// Major Poisson's ratio.
    pub nu12: f64,
    /// In-plane shear modulus, MPa.
    pub g12: f64,
}

impl Ply {
    /// The isotropic ply of Young's modulus `e` (MPa) and Poisson's ratio `nu`.
    pub fn isotropic(e: f64, nu: f64) -> Self {
        Self {
            e1: e,
            e2: e,
            nu12: nu,
            g12: e / (2.0 * (1.0 + nu)),
        }
    }

    /// Whether the strain energy is positive: moduli > 0 and nu12^2 < E1/E2.
    #[inline(always)]
    pub fn is_admissible(&self) -> bool {
        let coupled = self.nu12 * self.nu12 * self.e2;
        self.e1 > 0.0 && self.e2 > 0.0 && self.g12 > 0.0 && coupled < self.e1
    }

    /// The ply itself if it is admissible, otherwise an error at `place`.
    pub fn admissible(self, place: &str) -> Result<Self> {
        if self.is_admissible() {
            return Ok(self);
        }
        Err(
            Error::input(place, "E1, E2, G12 > 0 and nu12^2 < E1/E2").found(format!(
                "E1 {:.6} GPa, E2 {:.6} GPa, nu12 {:.6}, G12 {:.6} GPa",
                self.e1 / 1e3,
                self.e2 / 1e3,
                self.nu12,
                self.g12 / 1e3
            )),
        )
    }

    /// Reduced stiffness Q (3 x 3, MPa) in the ply's axes, engineering shear strain.
    pub fn stiffness(&self) -> Matrix3<f64> {
        let nu21 = self.nu12 * self.e2 / self.e1;
        let d = 1.0 - self.nu12 * nu21;
        let q12 = self.nu12 * self.e2 / d;
        Matrix3::new(
            self.e1 / d,
            q12,
            0.0,
            q12,
            self.e2 / d,
            0.0,
            0.0,
            0.0,
            self.g12,
        )
    }
}

/// A plane stiffness (3 x 3, engineering shear) of a ply whose fibres lie at `angle` (rad, counter-clockwise
/// from direction 1 in a right-handed pair), seen in directions 1 and 2.
pub fn rotate_stiffness(q: &Matrix3<f64>, angle: f64) -> Matrix3<f64> {
    let strain = strain_rotation(angle);
    strain.transpose() * q * strain
}

/// The matrix that takes engineering strains in directions 1, 2 to axes turned by `angle` (rad).
pub fn strain_rotation(angle: f64) -> Matrix3<f64> {
    let (s, c) = angle.sin_cos();
    Matrix3::new(
        c * c,
        s * s,
        s * c,
        s * s,
        c * c,
        -s * c,
        -2.0 * s * c,
        2.0 * s * c,
        c * c - s * s,
    )
}
