//! Free thermal expansion of a laminate.

use nalgebra::{Matrix3, Vector3};

use super::ply::{Ply, rotate_stiffness, strain_rotation};

/// Strains (e1, e2, gamma12) a kelvin of a laminate of equal plies that expands freely and stays flat: A^-1 N_T.
/// Fibre angles in rad, ply expansion along and across the fibres in 1/K.
///
/// N_T = sum of T' Q (alpha_1, alpha_2, 0) over the plies, with T the strain rotation; the thickness cancels.
/// For a ply that is not admissible, no strain.
pub fn free_expansion(ply: &Ply, angles: &[f64], expansion_per_k: [f64; 2]) -> Vector3<f64> {
    let q = ply.stiffness();
    let stress = q * Vector3::new(expansion_per_k[0], expansion_per_k[1], 0.0);
    let mut stiffness = Matrix3::zeros();
    let mut resultant = Vector3::zeros();
    for &angle in angles {
        stiffness += rotate_stiffness(&q, angle);
        resultant += strain_rotation(angle).transpose() * stress;
    }
    stiffness
        .cholesky()
        .map_or_else(Vector3::zeros, |a| a.solve(&resultant))
}
