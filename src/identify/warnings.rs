//! Results that should not be trusted as they stand.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::identification::Identification;
use super::inverse::InverseProblem;
use super::surrogate::TOLERANCE;
use crate::effect::EFFECTS;
use crate::field::rigid;
use crate::infer::{Model, REASON_SDS};
use crate::laminate::Material;
use crate::quantity::{NM_PER_MM, URAD_PER_RAD, plus_minus};

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
    if !of.determined {
        said.push(format!("These constants are not determined: what the model lacks drives them beyond {REASON_SDS} prior sd, and they were held within. Only the further rounds of a loop can say more."));
    }
    let (misfit, freedom, p) = modal_misfit(&of.inverse, &mean);
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
    let steps = of.inverse.prepared.observation.steps.iter();
    said.extend(steps.flat_map(|s| s.warnings.clone()));
    said.extend(without_force(model, of));
    said.extend(yields(model, of));
    said.extend(off_the_mesh(model, of));
    said.extend(of_mesh(model, of));
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

/// A series without a force measures ratios: they are stated.
fn without_force(model: &Model, of: &Identification) -> Option<String> {
    let experiment = model.experiment();
    if !experiment.lacks_force() {
        return None;
    }
    let constants = model.constants();
    let moduli: Vec<usize> = (0..constants.len())
        .filter(|k| constants[*k].ends_with("_GPa"))
        .collect();
    let symbol = |k: usize| constants[k].trim_end_matches("_GPa");
    let ratio = |k: usize, to: usize| {
        let values: Vec<f64> = of.draws.points().map(|x| x[k] / x[to]).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        format!(
            "{}/{} = {}",
            symbol(k),
            symbol(to),
            plus_minus(mean, variance.sqrt())
        )
    };
    let ratios: Vec<String> = match &moduli[..] {
        [first, rest @ ..] => rest.iter().map(|k| ratio(*k, *first)).collect(),
        [] => Vec::new(),
    };
    let measured = if ratios.is_empty() {
        String::new()
    } else {
        format!(" Measured by this model are ratios: {}.", ratios.join(", "))
    };
    Some(format!(
        "No force of the series is known: that of the largest step was taken for {:.0} N, at which displacements have the size that the priors expect. \
         All moduli are those of that force: their common factor is not measured.{measured}",
        experiment.nominal_load().force_n
    ))
}

/// A mesh's error that may be this share of the noise of a point, root mean square, and this many times of it anywhere: what is the same at
/// hundreds of points is seen below their noise.
const MESH_RMS: f64 = 0.1;
const MESH_LARGEST: f64 = 1.0;

/// An imported mesh, and elements that are too large for what was measured.
fn of_mesh(model: &Model, of: &Identification) -> Vec<String> {
    let spec = model.experiment();
    let Some(plate) = &spec.meshed else {
        return Vec::new();
    };
    let mut said = plate.part().warnings.clone();
    let state = model.state(&|name| of.moments(name).map(|(mean, _)| mean));
    let experiment = &of.inverse.prepared.problem.experiment;
    // constants without a solution are refused elsewhere
    let Ok(Some(error)) = experiment.mesh_error(&state) else {
        return said;
    };
    let noise = of.inverse.noise.reference_nm();
    let [rms, largest] = [error.rms_mm, error.largest_mm].map(|mm| mm * NM_PER_MM);
    if rms > MESH_RMS * noise || largest > MESH_LARGEST * noise {
        let [x, y] = experiment.scene().frame.data_point(error.place);
        said.push(format!(
            "The mesh is too coarse: halving its elements moves points by {rms:.2} nm (RMS), and by {largest:.2} nm at ({x:.2}, {y:.2}) mm of the data, where the noise of a point is {noise:.2} nm. Refine it there, or set mesh_density to {:.0}.",
            2.0 * spec.mesh_density.max(1.0)
        ));
    }
    said
}

/// Measured points off an imported mesh, as a share of all, that are more than a border: the frame may be wrong.
const OFF_THE_MESH: f64 = 0.03;

/// Points in the window that the imported mesh does not reach.
fn off_the_mesh(model: &Model, of: &Identification) -> Option<String> {
    model.experiment().meshed.as_ref()?;
    let field = &of.inverse.prepared.observation.field;
    let off = field.rejected.outside_plate;
    let all = field.len() + off;
    (off as f64 > OFF_THE_MESH * all as f64).then(|| {
        format!(
            "{off} of {all} points ({:.0} %) lie off the mesh and were dropped: look at the picture of the mesh; hole_center_in_data_mm, mesh.origin_mm or mesh.mm_per_unit may be wrong.",
            100.0 * off as f64 / all as f64
        )
    })
}

/// Metal that must yield at an edge, by the elastic stresses at the posterior mean.
fn yields(model: &Model, of: &Identification) -> Option<String> {
    let declared = model.file.material.yield_mpa?.mean;
    if model.material() != Material::Isotropic {
        return None;
    }
    let state = model.state(&|name| of.moments(name).map(|(mean, _)| mean));
    let experiment = &of.inverse.prepared.problem.experiment;
    // constants without a solution are refused elsewhere
    let at = experiment.edge_stress(&state).ok().flatten()?;
    let [x, y] = experiment.scene().frame.data_point(at.place);
    let name = EFFECTS.iter().find(|e| e.yields())?.name();
    let counted = model.effects.iter().any(|e| e.yields());
    (at.stress > declared).then(|| {
        format!(
            "The elastic stress at the edge `{}`, at ({x:.1}, {y:.1}) mm of the data, is {:.0} MPa (von Mises) under the declared force, {:.2} times the declared yield stress of {declared} MPa: the metal yields there{}",
            at.edge,
            at.stress,
            at.stress / declared,
            if counted {
                format!(", which the declared effect {name} counts.")
            } else {
                format!(
                    ", and the model without {name} is wrong near it. Declare the effect {name}, or let the loop weigh it."
                )
            }
        )
    })
}

/// Misfit of the measured modes at a point of the posterior, its degrees of freedom, and the probability of a larger one.
pub fn modal_misfit(of: &InverseProblem, mean: &[f64]) -> (f64, usize, f64) {
    let posterior = &of.posterior;
    let theta = &mean[..posterior.structural()];
    let (misfit, coordinates) = posterior.likelihood().misfit(theta, posterior.scale(mean));
    let freedom = coordinates.saturating_sub(theta.len()).max(1);
    let p = ChiSquared::new(freedom as f64).map_or(1.0, |d| d.sf(misfit));
    (misfit, freedom, p)
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
