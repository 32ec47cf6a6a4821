//! Quadratics through a small lattice of values, for densities of two variables.

/// A quadratic through the nine values of a 3 x 3 lattice, in units of its steps.
pub(super) struct Quadratic {
    gradient: [f64; 2],
    hessian: [[f64; 2]; 2],
}

/// Variance, in steps, of a direction in which the density hardly bends.
pub(super) const FLAT: f64 = 9.0;

impl Quadratic {
    /// Through `values` row by row.
    pub(super) fn new(values: &[f64; 9]) -> Self {
        let at = |i: usize, j: usize| values[3 * i + j];
        let middle = at(1, 1);
        let mixed = 0.25 * (at(2, 2) + at(0, 0) - at(2, 0) - at(0, 2));
        Self {
            gradient: [0.5 * (at(2, 1) - at(0, 1)), 0.5 * (at(1, 2) - at(1, 0))],
            hessian: [
                [at(2, 1) + at(0, 1) - 2.0 * middle, mixed],
                [mixed, at(1, 2) + at(1, 0) - 2.0 * middle],
            ],
        }
    }

    /// Inverse of the negative Hessian, with a variance of at most [`FLAT`] in each direction.
    pub(super) fn covariance(&self) -> [[f64; 2]; 2] {
        let h = &self.hessian;
        let (a, b) = ((-h[0][0]).max(1.0 / FLAT), (-h[1][1]).max(1.0 / FLAT));
        let limit = 0.95 * (a * b).sqrt();
        let c = (-h[0][1]).clamp(-limit, limit);
        let determinant = a * b - c * c;
        [
            [b / determinant, -c / determinant],
            [-c / determinant, a / determinant],
        ]
    }

    /// Newton's step to the maximum, and the sd of each direction.
    pub(super) fn newton(&self) -> ([f64; 2], [f64; 2]) {
        let c = self.covariance();
        let g = self.gradient;
        (
            [0, 1].map(|k| c[k][0] * g[0] + c[k][1] * g[1]),
            [0, 1].map(|k| c[k][k].sqrt()),
        )
    }
}
