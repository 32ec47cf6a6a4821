//! The article's likelihood in the POD coefficients, with the thickness marginalised analytically.
//!
//! Residual r = alpha_measured - alpha(theta, h_mean), covariance C = s^2 P^-1 + F + sd_h^2 J J^T: noise of scale s
//! with precision P at s = 1, fixed errors F = diag(surrogate PRESS^2 + (model_error_fraction x mean |alpha|)^2), and the
//! thickness to first order, J = d alpha / d h. A fixed change of coordinates diagonalises P and F together, so that
//! every evaluation costs a diagonal and a rank-one term (Sherman-Morrison).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::kernel::{Kernel, Parts, with_room};
use super::statistics::Statistics;
use crate::error::{Error, Result};
use crate::lanes::{Lanes, Repeated, first};
use crate::reduce::{Choice, ReducedModel, Surface, monomial};

/// The likelihood of elastic constants (and mechanical amplitudes) and of the noise scale.
#[derive(Debug, Clone)]
pub struct Likelihood {
    surface: Surface,
    /// Polynomial coefficients in the diagonalising coordinates, coordinates x monomials.
    polynomial: DMatrix<f64>,
    /// The same, differentiated by the thickness; only for a surface in the plain parameters.
    slope: Option<DMatrix<f64>>,
    measured: DVector<f64>,
    /// Information of the data on each coordinate relative to the fixed errors, at noise scale 1.
    lambda: DVector<f64>,
    /// From the diagonalising coordinates to coefficients, mm.
    backward: DMatrix<f64>,
    thickness_mean: f64,
    thickness_sd: f64,
    freedom: f64,
    kernel: Kernel,
}

/// What remains fixed of the errors however good the surrogate, as a fraction of a coefficient's mean size.
const ERROR_FLOOR: f64 = 1e-9;

impl Likelihood {
    /// Combine the data's statistics with a reduced model. `thickness` is (mean, sd) in mm.
    pub fn new(
        statistics: &Statistics,
        reduced: &ReducedModel,
        model_error_fraction: f64,
        thickness: (f64, f64),
    ) -> Result<Self> {
        let surface = reduced.surface.clone();
        let error: Vec<f64> = surface
            .quality
            .iter()
            .map(|q| {
                let model = model_error_fraction.max(ERROR_FLOOR) * q.mean_abs;
                q.press.hypot(model).max(f64::MIN_POSITIVE)
            })
            .collect();
        let p = error.len();
        let scaled = DMatrix::from_fn(p, p, |i, j| {
            statistics.precision[(i, j)] * error[i] * error[j]
        });
        let eigen = SymmetricEigen::try_new(scaled, 1e-15, 10_000)
            .ok_or_else(|| Error::program("likelihood", "an eigendecomposition that converges"))?;
        let v = eigen.eigenvectors;
        let forward = DMatrix::from_fn(p, p, |i, k| v[(k, i)] / error[k]);
        let backward = DMatrix::from_fn(p, p, |k, i| v[(k, i)] * error[k]);
        let largest = eigen.eigenvalues.amax();
        // A coordinate without information has lambda 0; rounding must not make it negative.
        let lambda = eigen.eigenvalues.map(|l| l.max(1e-14 * largest));
        let weighted = DVector::from_fn(p, |k, _| statistics.weighted[k] * error[k]);
        let measured = v.tr_mul(&weighted).component_div(&lambda);
        let raw = DMatrix::from_fn(p, surface.exponents.len(), |k, m| {
            surface.coefficients[k][m]
        });
        let slope = thickness_slope(&surface, &raw, thickness.0).map(|s| &forward * s);
        let mut likelihood = Self {
            polynomial: &forward * raw,
            slope,
            surface,
            measured,
            lambda,
            backward,
            thickness_mean: thickness.0,
            thickness_sd: thickness.1,
            freedom: statistics.freedom,
            kernel: Kernel::default(),
        };
        likelihood.compile(None);
        Ok(likelihood)
    }

    /// Prepares the evaluation, with the noise scale fixed if `scale` gives it.
    pub(super) fn compile(&mut self, scale: Option<f64>) {
        let spread: Vec<f64> = self.lambda.iter().map(|l| 1.0 / l).collect();
        self.kernel = Kernel::new(&Parts {
            surface: &self.surface,
            polynomial: &self.polynomial,
            slope: self.slope.as_ref(),
            measured: self.measured.as_slice(),
            spread: &spread,
            scale,
            thickness: (self.thickness_mean, self.thickness_sd),
        });
    }

    /// Parameters of the surface: elastic constants and mechanical amplitudes with the mean thickness put in.
    fn point(&self, theta: &[f64]) -> Vec<f64> {
        let mut point = theta.to_vec();
        if let Some(k) = self.surface.variables.thickness() {
            point.insert(k, self.thickness_mean);
        }
        point
    }

    /// Middle and half-width of the surface's design along each of the parameters `theta`.
    pub(super) fn design(&self) -> Vec<[f64; 2]> {
        let mut design = self.surface.variables.design();
        if let Some(k) = self.surface.variables.thickness() {
            design.remove(k);
        }
        design
    }

    /// Whether the surface's design holds the parameters `theta`.
    pub(super) fn is_in_design(&self, theta: &[f64]) -> bool {
        let z = self.surface.variables.scaled(&self.point(theta));
        z.iter().all(|z| z.abs() <= 1.0)
    }

    /// Prediction and thickness response (times the thickness' sd) in the diagonalising coordinates.
    fn predict(&self, theta: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let point = self.point(theta);
        let z = self.surface.variables.scaled(&point);
        let factor = self.surface.variables.factor(&point);
        let m = DVector::from_iterator(
            self.surface.exponents.len(),
            self.surface.exponents.iter().map(|e| monomial(e, &z)),
        );
        let mean = factor * (&self.polynomial * &m);
        let response = match &self.slope {
            Some(slope) => self.thickness_sd * (slope * &m),
            None => -(self.thickness_sd / self.thickness_mean) * &mean,
        };
        (mean, response)
    }

    /// Log likelihood of the parameters `theta` (border units) at noise scale `s` (1: the estimated noise),
    /// without the noise's own contrasts.
    pub fn log_likelihood(&self, theta: &[f64], s: f64) -> f64 {
        with_room(|room| {
            pulp::Arch::new().dispatch(AtOnePoint {
                kernel: &self.kernel,
                lanes: &mut room.lanes,
                theta,
                scale: s,
            })
        })
    }

    /// Mean and sd of the thickness, mm.
    pub fn thickness(&self) -> (f64, f64) {
        (self.thickness_mean, self.thickness_sd)
    }

    /// The log likelihood by the article's way: mean and covariance of the coefficients from samples of the thickness
    /// (mm) in place of its analytic marginal; and its standard error, by a jackknife over a hundred groups of samples.
    pub fn sampled_log_likelihood(&self, theta: &[f64], s: f64, thicknesses: &[f64]) -> (f64, f64) {
        const GROUPS: usize = 100;
        let p = self.measured.len();
        let at_mean = self.point(theta);
        let variables = &self.surface.variables;
        let about = self.at_thickness(&at_mean, self.thickness_mean);
        let mut sums = vec![(0.0, DVector::zeros(p), DMatrix::zeros(p, p)); GROUPS];
        for (i, &h) in thicknesses.iter().enumerate() {
            let mut point = at_mean.clone();
            if let Some(k) = variables.thickness() {
                point[k] = h;
            }
            // about the mean, so that small variances are not lost in large means
            let d = self.at_thickness(&point, h) - &about;
            let (count, sum, square) = &mut sums[i % GROUPS];
            *count += 1.0;
            *sum += &d;
            square.ger(1.0, &d, &d, 1.0);
        }
        let total = sums.iter().fold(
            (0.0, DVector::zeros(p), DMatrix::zeros(p, p)),
            |(n, a, b), (m, c, d)| (n + m, a + c, b + d),
        );
        let r = &self.measured - about;
        let value = |n: f64, sum: &DVector<f64>, square: &DMatrix<f64>| {
            let mean = sum / n;
            let mut c = square / n - &mean * mean.transpose();
            for k in 0..p {
                c[(k, k)] += 1.0 + s * s / self.lambda[k];
            }
            let r = &r - mean;
            c.cholesky().map_or(f64::NEG_INFINITY, |c| {
                let log_det: f64 = c.l_dirty().diagonal().iter().map(|l| l.ln()).sum();
                -0.5 * r.dot(&c.solve(&r)) - log_det
            })
        };
        let (n, sum, square) = &total;
        let whole = value(*n, sum, square);
        let without: Vec<f64> = sums
            .iter()
            .map(|(m, a, b)| value(n - m, &(sum - a), &(square - b)))
            .collect();
        let mean = without.iter().sum::<f64>() / GROUPS as f64;
        let square: f64 = without.iter().map(|v| (v - mean).powi(2)).sum();
        let groups = GROUPS as f64;
        (whole, ((groups - 1.0) / groups * square).sqrt())
    }

    /// Prediction in the diagonalising coordinates at a point of the surface's variables and a thickness.
    fn at_thickness(&self, point: &[f64], thickness: f64) -> DVector<f64> {
        let variables = &self.surface.variables;
        let z = variables.scaled(point);
        let m = DVector::from_iterator(
            self.surface.exponents.len(),
            self.surface.exponents.iter().map(|e| monomial(e, &z)),
        );
        // without the thickness among the variables the field is proportional to 1/h all the same
        let factor = if variables.thickness().is_none() && self.slope.is_none() {
            variables.factor(point) * self.thickness_mean / thickness
        } else {
            variables.factor(point)
        };
        factor * (&self.polynomial * &m)
    }

    /// Misfit r' C^-1 r of the measured coefficients at `theta` and noise scale `s`, and how many there are. The prediction gains an error
    /// where one is given, and effects may act too, each by what one prior sd of it adds; all as weighted projections
    /// ([`Statistics::weighted_of`], [`Statistics::weighted_of_averages`]).
    pub fn misfit(
        &self,
        (theta, s): (&[f64], f64),
        gained: Option<&DVector<f64>>,
        effects: &[DVector<f64>],
    ) -> (f64, usize) {
        let (mean, response) = self.predict(theta);
        let mut r = &self.measured - mean;
        if let Some(weighted) = gained {
            r -= self.error(weighted);
        }
        let mut directions = vec![response];
        directions.extend(effects.iter().map(|weighted| self.error(weighted)));
        let directions = DMatrix::from_columns(&directions);
        let deviation = self.lambda.map(|l| ((s * s + l) / l).sqrt());
        let r = r.component_div(&deviation);
        let mut scaled = directions;
        for mut column in scaled.column_iter_mut() {
            column.component_div_assign(&deviation);
        }
        let along = scaled.tr_mul(&r);
        let gram = DMatrix::identity(along.len(), along.len()) + scaled.tr_mul(&scaled);
        let taken_up = gram.cholesky().map_or(0.0, |c| along.dot(&c.solve(&along)));
        (r.norm_squared() - taken_up, r.len())
    }

    /// What an error of the predicted field adds to the coefficients, by its weighted projection.
    fn error(&self, weighted: &DVector<f64>) -> DVector<f64> {
        self.backward.tr_mul(weighted).component_div(&self.lambda)
    }

    /// Change of the log likelihood when the predicted field gains an error whose weighted projection on the modes
    /// is `weighted` (1/mm, [`Statistics::weighted_of`]).
    pub fn log_likelihood_change(&self, theta: &[f64], s: f64, weighted: &DVector<f64>) -> f64 {
        let error = self.error(weighted);
        let (mean, response) = self.predict(theta);
        let variance = self.lambda.map(|l| (s * s + l) / l);
        let scaled = response.component_div(&variance);
        let by_diagonal = error.component_div(&variance);
        let solved =
            &by_diagonal - &scaled * (response.dot(&by_diagonal) / (1.0 + response.dot(&scaled)));
        (&self.measured - mean - 0.5 * &error).dot(&solved)
    }

    /// The compiled form.
    pub(super) fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// Degrees of freedom with which the noise scale is known beside these coefficients.
    pub(super) fn freedom(&self) -> f64 {
        self.freedom
    }

    /// Expected POD coefficients (mm) given the data and `theta`, noise scale `s`: the surface's prediction plus what
    /// the thickness and the fixed errors take up.
    pub fn expected(&self, theta: &[f64], s: f64) -> DVector<f64> {
        self.expected_with_covariance(theta, s).0
    }

    /// [`Likelihood::expected`] and its covariance (mm^2) given the data and `theta`.
    pub fn expected_with_covariance(&self, theta: &[f64], s: f64) -> (DVector<f64>, DMatrix<f64>) {
        let (mean, response) = self.predict(theta);
        let r = &self.measured - &mean;
        let variance = self.lambda.map(|l| 1.0 + s * s / l);
        let scaled = response.component_div(&variance);
        let w = 1.0 + response.dot(&scaled);
        // With S = I + w w' (signal) and V = diag(v) + w w' (signal and noise): mean S V^-1 r, covariance S - S V^-1 S.
        let signal = DMatrix::identity(r.len(), r.len()) + &response * response.transpose();
        let inverse =
            DMatrix::from_diagonal(&variance.map(|v| 1.0 / v)) - &scaled * scaled.transpose() / w;
        let gain = &signal * inverse;
        let covariance = &signal - &gain * &signal;
        (
            &self.backward * (mean + &gain * r),
            &self.backward * covariance * self.backward.transpose(),
        )
    }

    /// Surface prediction of the POD coefficients (mm) at the mean thickness.
    pub fn surface_prediction(&self, theta: &[f64]) -> Vec<f64> {
        self.surface.evaluate(&self.point(theta))
    }

    /// Least-squares coefficients (mm) in the coordinates that the data determine.
    pub fn measured(&self) -> DVector<f64> {
        &self.backward * &self.measured
    }
}

struct AtOnePoint<'a> {
    kernel: &'a Kernel,
    lanes: &'a mut Vec<Lanes>,
    theta: &'a [f64],
    scale: f64,
}

impl pulp::WithSimd for AtOnePoint<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> f64 {
        let scale = simd.splat_f64s(self.scale);
        let [value] =
            self.kernel
                .log_likelihood(simd, &[Repeated(self.theta)], &[scale], self.lanes);
        first(simd, value)
    }
}

/// Coefficients of d alpha / d h over the same monomials, for a surface that has the thickness among its variables
/// and no factor; `None` where the factor carries the thickness as 1/h. Without the thickness (mean `mean`, mm) among the variables the
/// field goes with 1/h all the same.
fn thickness_slope(surface: &Surface, raw: &DMatrix<f64>, mean: f64) -> Option<DMatrix<f64>> {
    if surface.variables.choice == Choice::Ratios {
        return None;
    }
    let Some(k) = surface.variables.thickness() else {
        return Some(raw / -mean);
    };
    let half = surface.variables.half_width(k);
    let mut slope = DMatrix::zeros(raw.nrows(), raw.ncols());
    for (m, e) in surface
        .exponents
        .iter()
        .enumerate()
        .filter(|(_, e)| e[k] > 0)
    {
        let mut lower = e.clone();
        lower[k] -= 1;
        if let Some(at) = surface.exponents.iter().position(|x| *x == lower) {
            let d = raw.column(m) * (f64::from(e[k]) / half);
            let mut column = slope.column_mut(at);
            column += d;
        }
    }
    Some(slope)
}
