//! Results that should not be trusted as they stand.

use super::identification::Identification;
use super::inverse::InverseProblem;
use super::residual::chi2;
use crate::effect::EFFECTS;
use crate::infer::Model;
use crate::laminate::Material;
use crate::parameter::Parameter;
use crate::parameter::is_modulus;
use crate::posterior::REASON_SDS;
use crate::posterior::importance::{FAR, TOLERANCE};
use crate::quantity::{NM_PER_MM, plus_minus};

/// A posterior mean this many prior sd away from the prior's mean contradicts it.
pub const PRIOR_SDS: f64 = 4.0;

/// Sentences about results that should not be trusted as they stand; none if nothing is wrong.
pub fn warnings(model: &Model, of: &Identification) -> Vec<String> {
    let mut said = Vec::new();
    let posterior = &of.inverse.posed.density;
    let declared_noise_nm = model.file.likelihood.noise_nm;
    let mean: Vec<f64> = of.verdict.rows.iter().map(|row| row.mean).collect();
    let theta = &mean[..posterior.constants()];
    if !of.determined {
        said.push(format!("These constants are not determined: what the model lacks drives them beyond {REASON_SDS} prior sd, and they were held within. Only the further rounds of a loop can say more."));
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
        .zip(theta.iter().zip(posterior.constant_names()))
    {
        let z = (x - m.mean) / m.sd;
        if z.abs() > PRIOR_SDS {
            said.push(format!("{name} lies {z:+.1} prior sd from its prior's mean: data and prior contradict each other."));
        }
    }
    let fraction = model.file.likelihood.model_error_fraction;
    if fraction > 0.0 {
        said.push(format!("likelihood.model_error_fraction = {fraction} has no effect: candidates and rivals of the loop stand for what a model lacks."));
    }
    let steps = of.inverse.prepared.observation.steps.iter();
    said.extend(steps.flat_map(|s| s.warnings.clone()));
    said.extend(without_force(model, of));
    said.extend(yields(model, of));
    said.extend(repeated(of));
    said.extend(off_the_mesh(model, of));
    said.extend(of_mesh(model, of));
    said.extend(of.importance.beyond(TOLERANCE).map(|(name, [sds, _])| {
        format!("The finite elements have {name} {sds:+.2} posterior sd from where the density has it. A loop moves the draws that it quotes by as much, up to {FAR} sd.")
    }));
    said
}

/// Reduced chi^2 and factor on the noise from which on the first fit is spoken of before it is sampled.
const FIRST_CHI2: f64 = 20.0;
const FIRST_SCALE: f64 = 2.0;

/// What the mode of a posterior already shows, before it is sampled; nothing where it is as one would expect.
pub fn first_fit(of: &InverseProblem, mode: &[f64]) -> Option<String> {
    let posterior = &of.posed.density;
    let scale = posterior.noise_scale(mode);
    let (chi2, _) = chi2(of, mode);
    let names = posterior.constant_names().iter();
    let off = posterior.marginals().iter().zip(names.zip(mode));
    let off = off.filter_map(|(m, (name, x))| {
        let z = (x - m.mean) / m.sd;
        (z.abs() > PRIOR_SDS)
            .then(|| format!("{name} is {x:.3}, {z:+.1} prior sd from its prior's mean"))
    });
    let noise = (scale > FIRST_SCALE).then(|| format!("it needs {scale:.1} times the noise"));
    let structure = (chi2 > FIRST_CHI2)
        .then(|| format!("it leaves structure, reduced chi^2 {chi2:.0} where noise alone makes 1"));
    let said: Vec<String> = off.chain(noise).chain(structure).collect();
    (!said.is_empty()).then(|| format!("The first fit, before sampling: {}.", said.join("; ")))
}

/// What is said where the first fit has no mode that is not absurd.
pub const NO_MODE: &str = "The first fit, before sampling: no credible constants fit the field. Something acts that the model lacks, or the input is wrong.";

/// A series without a force measures ratios: they are stated.
fn without_force(model: &Model, of: &Identification) -> Option<String> {
    let experiment = model.experiment();
    if !experiment.lacks_force() {
        return None;
    }
    let constants = model.constants();
    let moduli: Vec<usize> = (0..constants.len())
        .filter(|k| is_modulus(constants[*k]))
        .collect();
    let symbol = |k: usize| Parameter::read(constants[k]).symbol().to_string();
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

/// Points that stand in the measurement again.
fn repeated(of: &Identification) -> Option<String> {
    let again = of.inverse.prepared.observation.field.rejected.repeated;
    (again > 0).then(|| {
        format!("{again} rows stand at places of other rows. Each place counts once, with the mean displacement: copies of a measurement are no further measurements.")
    })
}

/// Measured points off an imported mesh, as a share of all, that are more than a border: the frame may be wrong.
const OFF_THE_MESH: f64 = 0.03;

/// The same of image correlation, where a border half a subset wide is dropped too.
const OVER_AN_EDGE: f64 = 0.1;

/// Points in the window that the imported mesh does not reach.
fn off_the_mesh(model: &Model, of: &Identification) -> Option<String> {
    model.experiment().meshed.as_ref()?;
    let (share, how) = match model.experiment().measurement.image_correlation {
        Some(_) => (OVER_AN_EDGE, ", or their subsets reach over an edge,"),
        None => (OFF_THE_MESH, ""),
    };
    let field = &of.inverse.prepared.observation.field;
    let off = field.rejected.outside_plate;
    let all = field.len() + off;
    (off as f64 > share * all as f64).then(|| {
        format!(
            "{off} of {all} points ({:.0} %) lie off the mesh{how} and were dropped: look at the picture of the mesh; hole_center_in_data_mm, mesh.origin_mm or mesh.mm_per_unit may be wrong.",
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
