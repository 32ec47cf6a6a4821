//! What an analyst should be told: input that cannot be meant, and results that should not be trusted as they stand.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::identification::Identification;
use super::inverse::Prepared;
use super::surrogate::TOLERANCE;
use crate::error::{Error, Result};
use crate::experiment::{Gauge, Sight, gauged};
use crate::field::rigid;
use crate::infer::{Columns, Model};
use crate::quantity::{NM_PER_MM, URAD_PER_RAD};

/// Largest ratio of the measured displacements to the model's that is not a mistake in the units.
const MOST_RATIO: f64 = 5.0;

/// A field many times too large, too small, or of the wrong sign for the model's own constants (`nominal`, a point of
/// the reduced model's parameters) is a mistake in the units, the axes or the load, and no posterior should come of it.
///
/// # Errors
/// Of the input, naming the component and its ratio to the model's.
pub fn check_size(prepared: &Prepared, columns: &Columns, nominal: &[f64]) -> Result<()> {
    let field = &prepared.observation.field;
    let points = Sight::anywhere(&field.points, &[]);
    let predicted = prepared.reduced.field(&columns.modes, nominal);
    let [predicted, measured] =
        [&predicted, &field.displacement].map(|u| gauged(Gauge::Window, &points, u));
    for (c, direction) in ["u1, along the load", "u2, across it"].iter().enumerate() {
        let dot = |a: &[[f64; 2]]| {
            a.iter()
                .zip(&predicted)
                .map(|(a, b)| a[c] * b[c])
                .sum::<f64>()
        };
        let ratio = dot(&measured) / dot(&predicted);
        if (1.0 / MOST_RATIO..MOST_RATIO).contains(&ratio) {
            continue;
        }
        let place = match &field.files[..] {
            [_, _, u, v] => [u, v][c].display().to_string(),
            files => files
                .first()
                .map_or_else(|| "measurement".into(), |f| f.display().to_string()),
        };
        let size = format!("{:.1} to {MOST_RATIO}", 1.0 / MOST_RATIO);
        let hint = if ratio < 0.0 {
            "check the signs and directions of the axes, and which file or column is which"
        } else {
            "check the units, the loading axis, which file or column is which, the layup, the load and the thickness"
        };
        return Err(Error::input(
            place,
            format!("displacements {size} times those the model predicts for its prior means"),
        )
        .found(format!(
            "displacements ({direction}) {ratio:.3} times as large"
        ))
        .hint(hint));
    }
    Ok(())
}

/// Structure is spoken of where the residual's chi^2 exceeds 1 by this many standard errors of chi^2.
const CHI2_ERRORS: f64 = 4.0;

/// A posterior mean this many prior sd away from the prior's mean contradicts it.
pub const PRIOR_SDS: f64 = 4.0;

/// Sentences about results that should not be trusted as they stand; none if nothing is wrong.
pub fn warnings(model: &Model, of: &Identification) -> Vec<String> {
    let mut said = Vec::new();
    structure(of, &mut said);
    let posterior = &of.inverse.posterior;
    let declared_noise_nm = model.file.likelihood.noise_nm;
    let mean: Vec<f64> = of.verdict.rows.iter().map(|row| row.mean).collect();
    let theta = &mean[..posterior.structural()];
    let scale = posterior.scale(&mean);
    let likelihood = posterior.likelihood();
    let (misfit, coordinates) = likelihood.misfit(theta, scale);
    let freedom = coordinates.saturating_sub(theta.len()).max(1);
    let p = ChiSquared::new(freedom as f64).map_or(1.0, |d| d.sf(misfit));
    if p < 1e-3 {
        said.push(format!(
            "No constants within the priors fit the measured modes: their misfit is {misfit:.1} with {freedom} degrees of freedom."
        ));
    }
    if scale > 1.3 && declared_noise_nm.is_none() {
        said.push(format!("The fit calls for {scale:.1} times the noise that the data show: the model cannot follow the data."));
    }
    if let Some(declared) = declared_noise_nm {
        let seen = of.inverse.noise.reference_nm();
        if !(0.7..1.4).contains(&(declared / seen)) {
            said.push(format!("The declared noise of {declared} nm a point is {:.2} times what the data show ({seen:.3} nm).", declared / seen));
        }
    }
    for (m, (x, name)) in posterior
        .marginals()
        .iter()
        .zip(theta.iter().zip(posterior.parameter_names()))
    {
        let z = (x - m.mean) / m.sd;
        if z.abs() > PRIOR_SDS {
            said.push(format!("{name} lies {z:+.1} prior sd from its prior's mean: data and prior contradict each other."));
        }
    }
    let error = of.surrogate.max_sd();
    if error > TOLERANCE {
        said.push(format!(
            "The reduced model's own error moves a constant by {:.1} % of its posterior sd, more than {} %. Use --refine, or raise modes and snapshots.",
            100.0 * error,
            100.0 * TOLERANCE
        ));
    }
    if of.outside_doe > 0.01 {
        said.push(format!(
            "{:.1} % of the draws lie outside the box in which the reduced model was built: it extrapolates there. Use --refine, or widen the priors if the data are right.",
            100.0 * of.outside_doe
        ));
    }
    said
}

fn structure(of: &Identification, said: &mut Vec<String>) {
    let r = &of.residual;
    let limit = 1.0 + CHI2_ERRORS * (2.0 / (2 * of.inverse.noise.blocks.len()) as f64).sqrt();
    if r.chi2_reduced <= limit {
        return;
    }
    said.push("The model leaves structure that is not noise: the intervals of the model alone do not include what it does to the constants.".into());
    let points = &of.inverse.prepared.observation.field.points;
    let motion = rigid::fit(points, &r.field);
    let square = |f: &dyn Fn(usize) -> [f64; 2]| {
        (0..points.len())
            .map(|i| f(i)[0].powi(2) + f(i)[1].powi(2))
            .sum::<f64>()
    };
    let share = square(&|i| motion.at(points[i])) / square(&|i| r.field[i]);
    if share > 0.5 {
        let handedness = of.inverse.prepared.observation.field.frame.handedness();
        said.push(format!(
            "{:.0} % of the residual is a rigid motion (rotation {:.3} urad, translation {:.1} and {:.1} nm): declare rigid_translation and rigid_rotation.",
            100.0 * share,
            handedness * motion.angle * URAD_PER_RAD,
            motion.shift[0] * NM_PER_MM,
            motion.shift[1] * NM_PER_MM
        ));
    }
}
