//! What the frequencies of a plate would say of the constants before they are heard.

use nalgebra::{DMatrix, DVector};

use super::peaks::{USUAL_ERROR, of_constant};
use crate::error::Result;
use crate::experiment::frequencies::FrequenciesSpec;
use crate::experiment::frequencies::PlateParameter;
use crate::infer::Marginal;
use crate::laminate::Material;

/// Precision that the lowest modes of a plate, as many as the experiment has peaks, add to the constants' prior, in prior sds; with
/// dimensions, mass and air as uncertain as is said, and a model error of a usual size where none is stated.
///
/// # Errors
/// The input's fault: a plate that cannot be.
pub fn plate_information(
    spec: &FrequenciesSpec,
    material: Material,
    constants: &[(String, Marginal)],
) -> Result<DMatrix<f64>> {
    let means: Vec<f64> = constants.iter().map(|c| c.1.mean).collect();
    let plate = spec.plate(material.ply(&means));
    let ritz = spec.ritz(&plate)?;
    let modes = ritz.modes(&plate.coefficients(), spec.frequencies_hz.len())?;
    let mut to: Vec<(PlateParameter, f64)> = constants
        .iter()
        .map(|(name, prior)| {
            let (parameter, unit) = of_constant(name);
            (parameter, prior.sd * unit)
        })
        .collect();
    let n = to.len();
    let known = spec.known().into_iter().filter(|k| k.known.sd > 0.0);
    to.extend(known.map(|k| (k.parameter, k.known.sd * k.unit)));
    let parameters: Vec<PlateParameter> = to.iter().map(|t| t.0).collect();
    let error = spec.model_error_percent.unwrap_or(USUAL_ERROR);
    let spread = 0.01 * spec.sd_percent.hypot(error);
    let mut gram = DMatrix::zeros(to.len(), to.len());
    for mode in &modes {
        let slope = ritz.sensitivities_hz(mode, &plate, &parameters);
        let scaled = slope
            .iter()
            .zip(&to)
            .map(|(s, (_, sd))| s * sd / mode.frequency_hz() / spread);
        let row = DVector::from_iterator(to.len(), scaled);
        gram.ger(1.0, &row, &row, 1.0);
    }
    let m = to.len() - n;
    let others = gram.view((n, n), (m, m)) + DMatrix::identity(m, m);
    let across = gram.view((n, 0), (m, n)).into_owned();
    let own = gram.view((0, 0), (n, n)).into_owned();
    Ok(match others.cholesky() {
        Some(factor) => own - across.tr_mul(&factor.solve(&across)),
        None => own,
    })
}
