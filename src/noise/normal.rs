//! Small dense symmetric systems whose unknowns have very different sizes.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Scale a symmetric matrix to a unit diagonal, so that columns of very different size do not spoil its inverse.
fn unit_scaling(m: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(
        m.nrows(),
        (0..m.nrows()).map(|k| 1.0 / m[(k, k)].max(f64::MIN_POSITIVE).sqrt()),
    )
}

/// Solve a symmetric positive semi-definite system; directions without information get 0.
pub fn solve(m: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let d = unit_scaling(m);
    let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * d[i] * d[j]);
    let eigen = nalgebra::SymmetricEigen::new(scaled);
    let floor = 1e-13 * eigen.eigenvalues.amax();
    let mut x = eigen.eigenvectors.tr_mul(&b.component_mul(&d));
    for (x, &e) in x.iter_mut().zip(&eigen.eigenvalues) {
        *x = if e > floor { *x / e } else { 0.0 };
    }
    (eigen.eigenvectors * x).component_mul(&d)
}

/// Normal equations P x = z of a linear model with normal errors and a normal prior, factorised after scaling to a unit diagonal.
pub struct NormalEquations {
    factor: Cholesky<f64, Dyn>,
    /// The scaling, and z in it.
    scaling: DVector<f64>,
    right: DVector<f64>,
}

impl NormalEquations {
    /// For the posterior precision P and z; none unless P is positive definite.
    pub fn new(mut precision: DMatrix<f64>, right: DVector<f64>) -> Option<Self> {
        let scaling = unit_scaling(&precision);
        for (j, mut column) in precision.column_iter_mut().enumerate() {
            column
                .iter_mut()
                .zip(&scaling)
                .for_each(|(value, d)| *value *= d * scaling[j]);
        }
        Some(Self {
            factor: precision.cholesky()?,
            right: right.component_mul(&scaling),
            scaling,
        })
    }

    /// For G = X' C^-1 X, z = X' C^-1 y and unknowns of prior N(0, 1) each: P = I + G; none unless that is positive definite.
    pub fn with_unit_prior(mut gram: DMatrix<f64>, right: DVector<f64>) -> Option<Self> {
        for k in 0..gram.nrows() {
            gram[(k, k)] += 1.0;
        }
        Self::new(gram, right)
    }

    /// Those of some columns of a larger system G x = z, each scaled: unknowns of prior N(0, scale^2); none unless P is positive
    /// definite.
    pub fn of_columns(
        gram: &DMatrix<f64>,
        right: impl Fn(usize) -> f64,
        columns: &[(usize, f64)],
    ) -> Option<Self> {
        let n = columns.len();
        Self::with_unit_prior(
            DMatrix::from_fn(n, n, |i, j| {
                let ((a, by_a), (b, by_b)) = (columns[i], columns[j]);
                by_a * by_b * gram[(a, b)]
            }),
            DVector::from_fn(n, |i, _| columns[i].1 * right(columns[i].0)),
        )
    }

    /// Posterior mean, P^-1 z.
    pub fn mean(&self) -> DVector<f64> {
        self.factor.solve(&self.right).component_mul(&self.scaling)
    }

    /// P^-1 of some columns.
    pub fn solve(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = |mut x: DMatrix<f64>| {
            for mut column in x.column_iter_mut() {
                column.component_mul_assign(&self.scaling);
            }
            x
        };
        scaled(self.factor.solve(&scaled(columns.clone())))
    }

    /// Posterior covariance, P^-1.
    pub fn covariance(&self) -> DMatrix<f64> {
        let inverse = self.factor.inverse();
        let d = &self.scaling;
        DMatrix::from_fn(d.len(), d.len(), |i, j| inverse[(i, j)] * d[i] * d[j])
    }

    /// log |P|.
    pub fn log_det(&self) -> f64 {
        let diagonal = self.factor.l_dirty().diagonal();
        2.0 * diagonal
            .iter()
            .zip(&self.scaling)
            .map(|(l, d)| (l / d).ln())
            .sum::<f64>()
    }

    /// z' P^-1 z.
    pub fn quadratic(&self) -> f64 {
        self.right.dot(&self.factor.solve(&self.right))
    }

    /// Log evidence under the unit prior against no unknowns at all: (z' P^-1 z - log |P|) / 2.
    pub fn log_evidence(&self) -> f64 {
        0.5 * (self.quadratic() - self.log_det())
    }
}
