//! What the fitted model leaves unexplained.

use nalgebra::DVector;

use super::inverse::InverseProblem;
use crate::effect::width_error;
use crate::error::Result;
use crate::experiment::predict;
use crate::infer::Steps;
use crate::linearise::{AtPlaces, Forward, StepStack};
use crate::posterior::Full;
use crate::quantity::NM_PER_MM;

/// The residual field and its size.
#[derive(Debug, Clone)]
pub struct Residual {
    /// Measured minus predicted (u1, u2) at every point, mm; of a series of what grows with the load.
    pub field: Vec<[f64; 2]>,
    /// Root mean square of each component, nm.
    pub rms_nm: [f64; 2],
    /// Noise sd of each component, nm, independent of the model.
    pub noise_nm: [f64; 2],
    /// chi^2 of the block averages of all steps by their covariance, over their number.
    pub chi2_reduced: f64,
    /// Probability of a larger one, the uncertainty of the noise's size counted.
    pub p_chi2: f64,
    /// Share of the residual's variance that is not noise.
    pub structured_fraction: f64,
    pub points: usize,
    /// Effective number of independent values (both components), given the noise's correlation.
    pub effective_points: f64,
}

/// Relative variance of the noise's size, of so many degrees of freedom.
fn of_scale(freedom: f64) -> f64 {
    2.0 / freedom
}

/// chi^2 of what a density leaves at a point, over the number of values, at the noise as its contrasts have it, and the probability of more.
pub fn chi2(inverse: &InverseProblem, parameters: &[f64]) -> (f64, f64) {
    let density = &inverse.posed.density;
    let (mut at, reference) = (parameters.to_vec(), density.start().0);
    // at the scale of the contrasts: a fit that does not follow the data asks for more noise
    if let (Some(noise), Some(own)) = (at.get_mut(density.constants()), reference.last())
        && reference.len() > density.constants()
    {
        *noise = *own;
    }
    let (square, values) = inverse.posed.misfit(&at);
    let values = values as f64;
    let explained = inverse.sensitivities.columns().count() as f64;
    let error = (2.0 / values + of_scale((values - explained).max(1.0))).sqrt();
    let reduced = square / values;
    let z = (reduced - 1.0) / error;
    (
        reduced,
        0.5 * statrs::function::erf::erfc(z / std::f64::consts::SQRT_2),
    )
}

impl Residual {
    /// What is left at constants and amplitudes of the linear columns, prior sds from their means.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn at(
        inverse: &InverseProblem,
        forward: &Forward<'_>,
        parameters: &[f64],
        amplitudes: &DVector<f64>,
    ) -> Result<Self> {
        let field = left(inverse, forward, parameters, amplitudes)?;
        let noise = &inverse.noise;
        let n = field.len() as f64;
        let square = |c: usize| field.iter().map(|r| r[c] * r[c]).sum::<f64>() / n;
        let rms_nm = [0, 1].map(|c| square(c).sqrt() * NM_PER_MM);
        let noise_nm = [0, 1].map(|c| noise.point_sd_nm(c));
        let total: f64 = rms_nm.iter().map(|v| v * v).sum();
        let random: f64 = noise_nm.iter().map(|v| v * v).sum();
        let (chi2_reduced, p_chi2) = chi2(inverse, parameters);
        Ok(Self {
            rms_nm,
            noise_nm,
            chi2_reduced,
            p_chi2,
            structured_fraction: (1.0 - random / total).max(0.0),
            points: field.len(),
            effective_points: noise.effective_points,
            field,
        })
    }

    /// Root mean square of both components together, nm.
    pub fn rms_all_nm(&self) -> f64 {
        (0.5 * (self.rms_nm[0].powi(2) + self.rms_nm[1].powi(2))).sqrt()
    }
}

/// Measured minus predicted at every point, mm.
fn left(
    inverse: &InverseProblem,
    forward: &Forward<'_>,
    parameters: &[f64],
    amplitudes: &DVector<f64>,
) -> Result<Vec<[f64; 2]>> {
    let InverseProblem {
        prepared, posed, ..
    } = inverse;
    let full = Full {
        forward,
        point: &inverse.about,
        here: &posed.expanded.here,
    };
    let constants = &parameters[..posed.density.constants()];
    let mut drawn = full.drawn(constants, &posed.amplitudes(amplitudes));
    for (column, by) in drawn.left.iter().filter(|(c, _)| c.is_width()) {
        drawn.state.shared.shift(width_error(), 0, by * column.sd);
    }
    let observation = &prepared.observation;
    let experiment = &*prepared.problem.experiment;
    let Some(steps) = &observation.steps else {
        let predicted = predict(experiment, &drawn.state.shared, &observation.sight)?.field;
        let each = observation.field.displacement.iter().zip(predicted);
        return Ok(each.map(|(u, p)| [u[0] - p[0], u[1] - p[1]]).collect());
    };
    let points = &observation.field.points;
    let ones = vec![1; points.len()];
    let at_points = Forward {
        model: forward.model,
        observing: Box::new(AtPlaces {
            experiment,
            sight: &observation.sight,
            steps,
            places: points,
            counts: &ones,
            blocks: None,
        }),
        solves_width: false,
        step: &|| (),
    };
    let shown = at_points.shown(&drawn.state)?;
    let mut predicted = summed(steps, points.len(), &shown);
    if !drawn.left.is_empty() {
        let here = at_points.about(&drawn.state)?;
        for effect in &inverse.about.declared {
            for column in here.columns(effect)? {
                let own = drawn.left.iter().find(|(c, _)| c.name == column.name);
                let Some((_, by)) = own else { continue };
                let field = summed(steps, points.len(), &column.values);
                crate::numeric::add_scaled(&mut predicted, &field, *by);
            }
        }
    }
    let each = observation.field.displacement.iter().zip(predicted);
    Ok(each.map(|(u, p)| [u[0] - p[0], u[1] - p[1]]).collect())
}

/// What grows with the load of stacked values of both components.
fn summed(steps: &Steps, points: usize, values: &StepStack) -> Vec<[f64; 2]> {
    let weights = steps.weights();
    let at = |k: usize| {
        [0, 1].map(|c| {
            let own = weights.iter().enumerate();
            own.map(|(s, w)| w * values[c][s * points + k]).sum()
        })
    };
    (0..points).map(at).collect()
}
