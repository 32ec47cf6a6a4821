//! Jacobian determinants of the four kinds of elements, and lengths of their sides.

use super::kind::ElementKind;
use crate::numeric;

/// Range of an element's Jacobian determinant, mm^2, at the points where it must not vanish.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    /// At points inside and on the sides, for linear elements also at the corners.
    pub inside: [f64; 2],
    /// At the corners; quarter-point elements have a zero there.
    pub corners: [f64; 2],
}

/// Gauss abscissa of the 3-point rule on [-1, 1].
const GAUSS: f64 = 0.774_596_669_241_483_4;

const TRIANGLE: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
const SQUARE: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// The range for nodes `x`, as many as the kind has.
pub(super) fn range(kind: ElementKind, x: &[[f64; 2]]) -> Range {
    let over = |points: &[[f64; 2]]| {
        let points = points.iter();
        numeric::range(points.map(|p| determinant(x, &gradients(kind, *p))))
    };
    let g = [-GAUSS, 0.0, GAUSS];
    let grid: Vec<[f64; 2]> = g.iter().flat_map(|&a| g.map(|b| [a, b])).collect();
    match kind {
        ElementKind::T3 => Range {
            inside: over(&TRIANGLE[..1]),
            corners: over(&TRIANGLE[..1]),
        },
        // The determinant is a quadratic polynomial, fixed by its values at corners and middles of sides.
        ElementKind::T6 => Range {
            inside: over(&[[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]),
            corners: over(&TRIANGLE),
        },
        ElementKind::Q4 => Range {
            inside: over(&SQUARE),
            corners: over(&SQUARE),
        },
        ElementKind::Q8 => Range {
            inside: over(&grid),
            corners: over(&SQUARE),
        },
    }
}

fn determinant(x: &[[f64; 2]], gradients: &[[f64; 2]; 8]) -> f64 {
    let mut j = [[0.0; 2]; 2];
    for (x, d) in x.iter().zip(gradients) {
        for i in 0..2 {
            for k in 0..2 {
                j[i][k] += x[i] * d[k];
            }
        }
    }
    j[0][0] * j[1][1] - j[0][1] * j[1][0]
}

/// Derivatives of the shape functions at a local point; zero where the kind has no node.
fn gradients(kind: ElementKind, [a, b]: [f64; 2]) -> [[f64; 2]; 8] {
    let mut d = [[0.0; 2]; 8];
    match kind {
        ElementKind::T3 => d[..3].copy_from_slice(&[[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]),
        ElementKind::T6 => {
            let c = 1.0 - a - b;
            d[..6].copy_from_slice(&[
                [1.0 - 4.0 * c, 1.0 - 4.0 * c],
                [4.0 * a - 1.0, 0.0],
                [0.0, 4.0 * b - 1.0],
                [4.0 * (c - a), -4.0 * a],
                [4.0 * b, 4.0 * a],
                [-4.0 * b, 4.0 * (c - b)],
            ]);
        }
        ElementKind::Q4 => {
            for (d, [ca, cb]) in d.iter_mut().zip(SQUARE) {
                *d = [0.25 * ca * (1.0 + cb * b), 0.25 * cb * (1.0 + ca * a)];
            }
        }
        ElementKind::Q8 => d = shape_gradient(a, b),
    }
    d
}

/// Derivatives of the Q8 shape functions with respect to local coordinates (a, b) in [-1, 1]^2: a row for each node, corners first.
pub fn shape_gradient(a: f64, b: f64) -> [[f64; 2]; 8] {
    let mut d = [[0.0; 2]; 8];
    for (d, [ca, cb]) in d.iter_mut().zip(SQUARE) {
        *d = [
            0.25 * ca * (1.0 + cb * b) * (2.0 * ca * a + cb * b),
            0.25 * cb * (1.0 + ca * a) * (ca * a + 2.0 * cb * b),
        ];
    }
    d[4] = [-a * (1.0 - b), -0.5 * (1.0 - a * a)];
    d[5] = [0.5 * (1.0 - b * b), -b * (1.0 + a)];
    d[6] = [-a * (1.0 + b), 0.5 * (1.0 - a * a)];
    d[7] = [-0.5 * (1.0 - b * b), -b * (1.0 - a)];
    d
}

/// The point of that parabola at a parameter from 0 at `a` to 1 at `b`.
pub(super) fn line_point(a: [f64; 2], m: [f64; 2], b: [f64; 2], t: f64) -> [f64; 2] {
    let xi = 2.0 * t - 1.0;
    [0, 1].map(|k| {
        0.5 * xi * (xi - 1.0) * a[k] + (1.0 - xi * xi) * m[k] + 0.5 * xi * (xi + 1.0) * b[k]
    })
}
