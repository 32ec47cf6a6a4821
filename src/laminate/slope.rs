//! How a ply's stiffness changes with its constants.

use nalgebra::Matrix3;

use super::ply::Ply;

/// An elastic constant of a ply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constant {
    E1,
    E2,
    Nu12,
    G12,
}

/// Derivative of [`Ply::stiffness`] (3 x 3) by a constant: MPa per MPa, for nu12 MPa.
///
/// With r = E2 / E1 and d = 1 - nu12^2 r: Q11 = E1 / d, Q12 = nu12 E2 / d, Q22 = E2 / d, Q66 = G12.
pub fn stiffness_slope(ply: &Ply, constant: Constant) -> Matrix3<f64> {
    let (e2, nu) = (ply.e2, ply.nu12);
    let r = e2 / ply.e1;
    let d = 1.0 - nu * nu * r;
    let (q11, q12, q22) = match constant {
        Constant::E1 => {
            let common = -nu * nu * r * r / (d * d);
            ((1.0 - 2.0 * nu * nu * r) / (d * d), nu * common, common)
        }
        Constant::E2 => (nu * nu / (d * d), nu / (d * d), 1.0 / (d * d)),
        Constant::Nu12 => {
            let common = 2.0 * nu * e2 / (d * d);
            (common, e2 * (1.0 + nu * nu * r) / (d * d), common * r)
        }
        Constant::G12 => return Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
    };
    Matrix3::new(q11, q12, 0.0, q12, q22, 0.0, 0.0, 0.0, 0.0)
}
