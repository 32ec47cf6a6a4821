//! The target of every sampler: an unnormalised log density over a real vector.

/// An unnormalised log density. A point outside the support has density `f64::NEG_INFINITY`, which is not an
/// error; `NaN` is one (samplers refuse it at the start and treat it as outside the support later, counted).
pub trait LogDensity: Sync {
    /// Names of the parameters with their units, in order (`E1_GPa`).
    fn names(&self) -> &[String];

    /// Number of parameters.
    fn dim(&self) -> usize {
        self.names().len()
    }

    /// Log density at one point, `x.len() == dim()`.
    fn log_density(&self, x: &[f64]) -> f64;

    /// Log density at several points, parameter by parameter: parameter k of point i is `xs[k * out.len() + i]`. The
    /// result must not depend on how points are grouped into calls.
    fn log_density_batch(&self, xs: &[f64], out: &mut [f64]) {
        let mut point = vec![0.0; self.dim()];
        let count = out.len();
        for (i, value) in out.iter_mut().enumerate() {
            for (k, x) in point.iter_mut().enumerate() {
                *x = xs[k * count + i];
            }
            *value = self.log_density(&point);
        }
    }
}
