//! Stiffness of a Reissner-Mindlin plate element on the eight-node quadrilateral, free of shear locking.
//!
//! It is the MITC9 element of Bathe, Brezzi and Fortin (Int. J. Numer. Methods Eng. 28 (1989) 1787): deflection in the space of Q8,
//! rotations in that of Q9, and their covariant components along local axis a tied into the space 1, a, b, ab, b^2 (in the same way
//! along b), to which the local gradients of all Q8 deflections belong. The tying keeps the mean and the first moment along the edges and
//! the mean over the element. So integrated, not sampled, it commutes with the gradient on curved elements as well: whatever
//! deflection the rotations are the gradient of, its interpolant has no shear, and constant curvature is exact on any mesh.
//! The rotations' bubble (1 - a^2) (1 - b^2) is the element's own and condensed out, so that there are three unknowns a node: the
//! deflection w and the rotations theta_1, theta_2, with the displacement u_i = z theta_i and the transverse shear strain
//! gamma_i = dw/dx_i + theta_i.

use nalgebra::{Matrix2, Matrix5, SMatrix, SVector};

use super::element::{self, GAUSS};
use crate::laminate::PlateStiffness;

/// Unknowns a node.
pub const PER_NODE: usize = 3;

/// Unknowns of an element's eight nodes.
pub const UNKNOWNS: usize = 8 * PER_NODE;

/// The same with the two of the bubble.
const ALL: usize = UNKNOWNS + 2;

/// What a quantity is for every unknown of one.
type BendingRow = SVector<f64, ALL>;

/// Index of component `c` of the rotation of node `i`, of the bubble for i = 8.
fn rotation(i: usize, c: usize) -> usize {
    if i < 8 {
        PER_NODE * i + 1 + c
    } else {
        UNKNOWNS + c
    }
}

/// Stiffness matrix of an element with node coordinates `x`; unknowns w, theta_1, theta_2 node by node.
pub fn stiffness(x: &[[f64; 2]; 8], plate: &PlateStiffness) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
    let mut law = Matrix5::zeros();
    law.fixed_view_mut::<3, 3>(0, 0).copy_from(&plate.bending);
    law.fixed_view_mut::<2, 2>(3, 3).copy_from(&plate.shear);
    let tied = [tied(x, 0), tied(x, 1)];
    let mut sum = SMatrix::<f64, ALL, ALL>::zeros();
    for (a, wa) in GAUSS {
        for (b, wb) in GAUSS {
            let (strains, det) = strains(x, &tied, a, b);
            sum += strains.transpose() * (law * strains) * (wa * wb * det);
        }
    }
    condensed(&sum)
}

/// Curvatures kappa_1, kappa_2, kappa_12 and shear strains gamma_1, gamma_2 at a point, and the Jacobian determinant.
fn strains(
    x: &[[f64; 2]; 8],
    tied: &[[BendingRow; 5]; 2],
    a: f64,
    b: f64,
) -> (SMatrix<f64, 5, ALL>, f64) {
    let local = element::shape_gradient(a, b);
    let j = element::jacobian(x, &local);
    let det = element::determinant(&j);
    let physical = |d0: f64, d1: f64| {
        [
            (j[1][1] * d0 - j[1][0] * d1) / det,
            (j[0][0] * d1 - j[0][1] * d0) / det,
        ]
    };
    let bubble = [-2.0 * a * (1.0 - b * b), -2.0 * b * (1.0 - a * a)];
    let mut strains = SMatrix::<f64, 5, ALL>::zeros();
    for (i, d) in local.iter().chain([&bubble]).enumerate() {
        let [g1, g2] = physical(d[0], d[1]);
        strains[(0, rotation(i, 0))] = g1;
        strains[(1, rotation(i, 1))] = g2;
        strains[(2, rotation(i, 0))] = g2;
        strains[(2, rotation(i, 1))] = g1;
    }
    let mut covariant = [(a, b), (b, a)].map(|_| BendingRow::zeros());
    for (k, (p, q)) in [(a, b), (b, a)].into_iter().enumerate() {
        let [one, along, across, both, square] = &tied[k];
        covariant[k] = one + along * p + across * q + both * (p * q) + square * (q * q);
        for (i, d) in local.iter().enumerate() {
            covariant[k][PER_NODE * i] += d[k];
        }
    }
    for column in 0..ALL {
        let [g1, g2] = physical(covariant[0][column], covariant[1][column]);
        strains[(3, column)] = g1;
        strains[(4, column)] = g2;
    }
    (strains, det)
}

/// Coefficients of 1, p, q, p q, q^2 of the tied component of the rotations along local axis `k`; p is the local coordinate k, q the other.
fn tied(x: &[[f64; 2]; 8], k: usize) -> [BendingRow; 5] {
    let component = |p: f64, q: f64| {
        let (a, b) = if k == 0 { (p, q) } else { (q, p) };
        let j = element::jacobian(x, &element::shape_gradient(a, b));
        let shapes = element::shape(a, b);
        let bubble = (1.0 - a * a) * (1.0 - b * b);
        let mut row = BendingRow::zeros();
        for (i, n) in shapes.iter().chain([&bubble]).enumerate() {
            for (c, j) in j.iter().enumerate() {
                row[rotation(i, c)] = n * j[k];
            }
        }
        row
    };
    // mean and slope along the edge on which q is constant
    let edge = |q: f64| {
        GAUSS.iter().fold(
            [BendingRow::zeros(), BendingRow::zeros()],
            |sum, &(p, w)| {
                let row = component(p, q);
                [sum[0] + row * (0.5 * w), sum[1] + row * (1.5 * w * p)]
            },
        )
    };
    let mean = GAUSS.iter().fold(BendingRow::zeros(), |sum, &(q, w)| {
        let line = GAUSS.iter();
        sum + line.fold(BendingRow::zeros(), |s, &(p, v)| {
            s + component(p, q) * (0.25 * v * w)
        })
    });
    let ([low, low_slope], [high, high_slope]) = (edge(-1.0), edge(1.0));
    let even = (high + low) * 0.5;
    let square = (even - mean) * 1.5;
    [
        even - square,
        (high_slope + low_slope) * 0.5,
        (high - low) * 0.5,
        (high_slope - low_slope) * 0.5,
        square,
    ]
}

/// The stiffness of the nodes' unknowns alone, where the bubble's take what costs least.
fn condensed(all: &SMatrix<f64, ALL, ALL>) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
    let own: Matrix2<f64> = all.fixed_view::<2, 2>(UNKNOWNS, UNKNOWNS).into_owned();
    let coupling = all.fixed_view::<2, UNKNOWNS>(UNKNOWNS, 0);
    let nodes = all.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0).into_owned();
    // without an inverse the plate has no stiffness, which the factorisation reports
    own.try_inverse()
        .map_or(nodes, |own| nodes - coupling.transpose() * own * coupling)
}
