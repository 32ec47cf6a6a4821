//! The eight-node serendipity quadrilateral (Q8): shape functions, Jacobian, quadrature.

pub use crate::mesh_files::shape_gradient;

/// Gauss abscissae and weights of the 3-point rule on [-1, 1]; 3 x 3 points integrate Q8 stiffness fully.
pub const GAUSS: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Shape functions at local coordinates `(a, b)` in [-1, 1]^2.
pub fn shape(a: f64, b: f64) -> [f64; 8] {
    let mut n = [0.0; 8];
    for (k, [ca, cb]) in CORNERS.iter().enumerate() {
        n[k] = 0.25 * (1.0 + ca * a) * (1.0 + cb * b) * (ca * a + cb * b - 1.0);
    }
    n[4] = 0.5 * (1.0 - a * a) * (1.0 - b);
    n[5] = 0.5 * (1.0 + a) * (1.0 - b * b);
    n[6] = 0.5 * (1.0 - a * a) * (1.0 + b);
    n[7] = 0.5 * (1.0 - a) * (1.0 - b * b);
    n
}

/// The point of an element with node coordinates `x` at the local coordinates.
pub fn position(x: &[[f64; 2]; 8], n: &[f64; 8]) -> [f64; 2] {
    let mut p = [0.0; 2];
    for (x, n) in x.iter().zip(n) {
        p[0] += n * x[0];
        p[1] += n * x[1];
    }
    p
}

/// Gradients of the shape functions with respect to (direction 1, direction 2), and the Jacobian determinant.
pub fn physical_gradient(x: &[[f64; 2]; 8], a: f64, b: f64) -> ([[f64; 2]; 8], f64) {
    let local = shape_gradient(a, b);
    let j = jacobian(x, &local);
    let det = determinant(&j);
    let gradient = local.map(|d| {
        [
            (j[1][1] * d[0] - j[1][0] * d[1]) / det,
            (j[0][0] * d[1] - j[0][1] * d[0]) / det,
        ]
    });
    (gradient, det)
}

/// Determinant of a Jacobian.
pub fn determinant(j: &[[f64; 2]; 2]) -> f64 {
    j[0][0] * j[1][1] - j[0][1] * j[1][0]
}

/// `j[i][k]`: derivative of the physical coordinate i with respect to the local coordinate k.
pub fn jacobian(x: &[[f64; 2]; 8], local: &[[f64; 2]; 8]) -> [[f64; 2]; 2] {
    let mut j = [[0.0; 2]; 2];
    for (x, d) in x.iter().zip(local) {
        for i in 0..2 {
            for k in 0..2 {
                j[i][k] += x[i] * d[k];
            }
        }
    }
    j
}
