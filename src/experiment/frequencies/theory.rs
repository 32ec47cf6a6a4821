//! Plate theories as data: which unknown fields there are, and which of their derivatives make strains and velocities.
//!
//! Coordinates are (xi, eta) in [-1, 1]^2 with x = a xi / 2, y = b eta / 2. The rotations of the sheared plate are 2 t1 / a and 2 t2 / b, so
//! that every strain is one factor of the dimensions ([`strain_scale`]) times derivatives that do not know them.

use super::basis::{LegendreBasis, PlateEdge};

/// Which plate theory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Theory {
    /// Thin plate: normals stay normal (Kirchhoff).
    Thin,
    /// First-order shear deformation: deflection and two rotations (Reissner-Mindlin).
    Sheared,
}

/// How the four edges are held: at x = 0 and x = a, at y = 0 and y = b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateSupports {
    pub x: [PlateEdge; 2],
    pub y: [PlateEdge; 2],
}

impl PlateSupports {
    /// All four edges alike.
    pub fn all(edge: PlateEdge) -> Self {
        Self {
            x: [edge; 2],
            y: [edge; 2],
        }
    }
}

/// Layers at the free edges of a sheared plate, of the order of its thickness, in which the rotation along the edge adapts; torsion loses
/// 0.63 h / b of its stiffness there. Polynomials alone see them late: twisting modes come 4e-3 too high with 12 of them at a side of 100
/// thicknesses.
#[derive(Debug, Clone, Copy)]
pub struct EdgeLayers {
    /// Decay lengths over half the side: at the edges across x, and across y. Whatever is near gives the same frequencies.
    pub lengths: [f64; 2],
    /// Whether bending couples with twisting: the deflection and the other rotation then have the layers too.
    pub coupled: bool,
}

/// `factor` times a derivative, of order `order` in (xi, eta), of unknown field `field`.
#[derive(Debug, Clone, Copy)]
pub struct Derivative {
    pub field: usize,
    pub order: [usize; 2],
    pub factor: f64,
}

const fn d(field: usize, order: [usize; 2], factor: f64) -> Derivative {
    Derivative {
        field,
        order,
        factor,
    }
}

/// Pairs of strains (curvatures 1, 2, 12, transverse shears 1, 2) that a plate's stiffness couples: the six of D, the three of S.
pub const PAIRS: [[usize; 2]; 9] = [
    [0, 0],
    [1, 1],
    [2, 2],
    [0, 1],
    [0, 2],
    [1, 2],
    [3, 3],
    [4, 4],
    [3, 4],
];

/// The pairs that couple even with odd in both directions: D16, D26, S12.
pub const TWISTING: [usize; 3] = [4, 5, 8];

impl Theory {
    /// Number of unknown fields.
    pub fn fields(self) -> usize {
        match self {
            Theory::Thin => 1,
            Theory::Sheared => 3,
        }
    }

    /// The five strains, for u_i = z theta_i and gamma_i = dw/dx_i + theta_i; a thin plate has no shears.
    pub fn strains(self) -> [Vec<Derivative>; 5] {
        match self {
            Theory::Thin => [
                vec![d(0, [2, 0], -1.0)],
                vec![d(0, [0, 2], -1.0)],
                vec![d(0, [1, 1], -2.0)],
                vec![],
                vec![],
            ],
            Theory::Sheared => [
                vec![d(1, [1, 0], 1.0)],
                vec![d(2, [0, 1], 1.0)],
                vec![d(1, [0, 1], 1.0), d(2, [1, 0], 1.0)],
                vec![d(0, [1, 0], 1.0), d(1, [0, 0], 1.0)],
                vec![d(0, [0, 1], 1.0), d(2, [0, 0], 1.0)],
            ],
        }
    }

    /// The motions that carry inertia: deflection and the two rotations.
    pub fn motions(self) -> [Vec<Derivative>; 3] {
        let deflection = vec![d(0, [0, 0], 1.0)];
        match self {
            Theory::Thin => [
                deflection,
                vec![d(0, [1, 0], -1.0)],
                vec![d(0, [0, 1], -1.0)],
            ],
            Theory::Sheared => [deflection, vec![d(1, [0, 0], 1.0)], vec![d(2, [0, 0], 1.0)]],
        }
    }

    /// Functions of `field` along an axis (0: xi, 1: eta) with `count` polynomials, and those of the layers at its free edges.
    pub fn basis(
        self,
        supports: &PlateSupports,
        [field, axis]: [usize; 2],
        count: usize,
        layers: Option<EdgeLayers>,
    ) -> LegendreBasis {
        let edges = [supports.x, supports.y][axis];
        let zeros = edges.map(|edge| match (edge, self, field) {
            (PlateEdge::Free, ..) => 0,
            (PlateEdge::SimplySupported, _, 0) => 1,
            // the rotation about the edge is free, the one along it is not
            (PlateEdge::SimplySupported, ..) => usize::from(field != axis + 1),
            (PlateEdge::Clamped, Theory::Thin, _) => 2,
            (PlateEdge::Clamped, Theory::Sheared, _) => 1,
        });
        let layers = layers.filter(|layers| {
            let is_along_edge = field > 0 && field != axis + 1;
            self == Theory::Sheared && (layers.coupled || is_along_edge)
        });
        LegendreBasis::new(zeros, count, layers.map(|layers| layers.lengths[axis]))
    }

    /// Whether a function of degree parity `degree` of `field` along `axis` belongs to deflections that are odd there.
    pub fn is_odd(field: usize, axis: usize, degree: usize) -> bool {
        (degree + usize::from(field == axis + 1)) % 2 == 1
    }

    /// The motions of a rigid plate that the supports allow: amplitudes of (field, degree in xi, degree in eta), which are values of
    /// polynomials 1, xi, eta of the deflection with the rotations that go with them.
    ///
    /// Three without supports; one where a single edge is simply supported (about that edge); none otherwise.
    pub fn rigid_motions(self, supports: &PlateSupports) -> Vec<[f64; 3]> {
        let edges = [supports.x[0], supports.x[1], supports.y[0], supports.y[1]];
        let mut held = (0..4).filter(|&i| edges[i] != PlateEdge::Free);
        match (held.next(), held.next()) {
            (None, _) => vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            (Some(i), None) if edges[i] == PlateEdge::SimplySupported => {
                let away = if i % 2 == 0 { 1.0 } else { -1.0 };
                vec![if i < 2 {
                    [1.0, away, 0.0]
                } else {
                    [1.0, 0.0, away]
                }]
            }
            _ => Vec::new(),
        }
    }
}

/// What turns the strains of [`Theory::strains`] into those of a plate a x b (mm).
pub fn strain_scale(a: f64, b: f64) -> [f64; 5] {
    [
        4.0 / (a * a),
        4.0 / (b * b),
        4.0 / (a * b),
        2.0 / a,
        2.0 / b,
    ]
}
