//! What to measure next: experiments that were not made yet, each with what it would say of the constants, alone and beside one that
//! was, and what the two would show of effects that neither shows by itself.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::experiment::frequencies::{EdgeSpec, FrequenciesSpec, PlateSpec, SupportSpec};
use crate::infer::Model;
use crate::laminate::{MeanSd, abd};
use crate::study::frequencies::PlateTest;
use crate::study::{Experiment, MeasuredField, Measuring, SharedConstants, Study};
use crate::trace::{Hidden, Information};

/// An experiment that could be made.
#[derive(Clone)]
pub struct ProposedExperiment {
    pub name: String,
    pub test: Arc<dyn Experiment>,
}

/// A candidate with what it would say.
pub struct Assessed {
    pub name: String,
    pub is_field: bool,
    pub information: Information,
}

/// Turns of the layup, degrees.
const TURNS: [f64; 7] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0];

/// Sides of plates over the side of the square of the same area; modes that are heard; reading, percent.
const ASPECTS: [f64; 3] = [1.0, 1.33, 2.0];
const MODES: usize = 12;
const READING_PERCENT: f64 = 0.2;

/// Side of the square, mm, and density of a plate of which nothing is said, kg/m^3.
const SIDE_MM: f64 = 173.0;
const DENSITY: MeanSd = MeanSd {
    mean: 1600.0,
    sd: 5.0,
};

/// The experiments of a study.
pub fn declared(study: &Study) -> Vec<ProposedExperiment> {
    let candidate = |test: &Arc<dyn Experiment>| ProposedExperiment {
        name: test.name().into(),
        test: Arc::clone(test),
    };
    study.experiments.iter().map(candidate).collect()
}

/// Other coupons of a model's laminate and of one ply direction, with the hole of the model, one of twice its size and none, under the force
/// that strains them as much.
pub fn coupons(model: &Model) -> Vec<ProposedExperiment> {
    let Some(layup) = model.experiment().specimen.layup_deg.clone() else {
        return Vec::new();
    };
    if !model.experiment().stacks().is_empty() {
        // the force that strains a coupon as much follows from one stack
        return Vec::new();
    }
    let single = vec![0.0; layup.len()];
    let mut all = Vec::new();
    for (what, angles) in [("layup", &layup), ("one direction", &single)] {
        for turn in TURNS {
            for (hole, times) in [("", 1.0), (", twice the hole", 2.0), (", no hole", 0.0)] {
                let is_own = what == "layup" && turn == 0.0 && times == 1.0;
                if is_own || (what != "layup" && times == 2.0) {
                    continue;
                }
                let turned: Vec<f64> = angles.iter().map(|a| a + turn).collect();
                let candidate = coupon(model, turned, times).map(|model| ProposedExperiment {
                    name: format!("coupon, {what} at {turn} deg{hole}"),
                    test: Arc::new(MeasuredField { model }),
                });
                all.extend(candidate);
            }
        }
    }
    all
}

/// The model with another layup and hole; none where that is no specimen.
fn coupon(model: &Model, layup: Vec<f64>, times: f64) -> Option<Model> {
    let mut other = model.clone();
    let before = longitudinal(model)?;
    let spec = other.experiment_mut();
    spec.specimen.layup_deg = Some(layup);
    match &mut spec.specimen.hole {
        Some(_) if times == 0.0 => spec.specimen.hole = None,
        Some(hole) => hole.diameter_mm *= times,
        None if times == 1.0 => {}
        None => return None,
    }
    let by = longitudinal(&other)? / before;
    let mut load = model.experiment().nominal_load();
    load.force_n *= by;
    let spec = other.experiment_mut();
    spec.load = Some(load);
    spec.steps = None;
    // the one field of a coupon to come, in place of the files of a series
    spec.measurement = spec.measurement.clone().with_path("planned.csv".into());
    let text = other.file.to_json().ok()?.to_string();
    Model::parse(&text, &model.path).ok()
}

/// Stiffness along the load of a laminate that may contract and shear, N/mm.
fn longitudinal(model: &Model) -> Option<f64> {
    let specimen = &model.experiment().specimen;
    let means: Vec<f64> = model.marginals().iter().map(|m| m.mean).collect();
    let layup = specimen.layup_deg.iter().flatten();
    let angles: Vec<f64> = layup.map(|a| a.to_radians()).collect();
    let ply = model.material().ply(&means);
    let stack = abd(&ply, &angles, specimen.thickness_mm.mean);
    Some(1.0 / stack.a.try_inverse()?[(0, 0)])
}

/// Free plates of a layup and of one ply direction, turned and of several sides, all of one area.
pub fn plates(layup: &[f64], thickness_mm: MeanSd) -> Vec<ProposedExperiment> {
    let single = vec![0.0; layup.len()];
    let mut all = Vec::new();
    for (what, angles) in [("layup", layup), ("one direction", &single)] {
        for turn in TURNS {
            for aspect in ASPECTS {
                let turned = angles.iter().map(|a| a + turn).collect();
                let sides = [SIDE_MM * aspect.sqrt(), SIDE_MM / aspect.sqrt()];
                let [a, b] = sides;
                all.push(ProposedExperiment {
                    name: format!("plate, {what} at {turn} deg, {a:.0} x {b:.0} mm"),
                    test: Arc::new(PlateTest {
                        spec: plate(turned, sides, thickness_mm),
                    }),
                });
            }
        }
    }
    all
}

/// A free plate that was not made yet.
pub fn plate(layup_deg: Vec<f64>, sides: [f64; 2], thickness_mm: MeanSd) -> FrequenciesSpec {
    let [length_mm, width_mm] = sides.map(|mean| MeanSd { mean, sd: 0.1 });
    FrequenciesSpec {
        name: "plate".into(),
        kind: "frequencies".into(),
        specimen: PlateSpec {
            length_mm,
            width_mm,
            thickness_mm,
            layup_deg,
            mass_g: None,
            density_kg_m3: Some(DENSITY),
            g13_gpa: None,
            g23_gpa: None,
            hole: None,
            added_mass: None,
        },
        support: SupportSpec::All(EdgeSpec::Free),
        frequencies_hz: vec![1.0; MODES],
        sd_percent: READING_PERCENT,
        parity: None,
        band_hz: None,
        model_error_percent: None,
        missing: 0.1,
        additional: 1.0,
        air_kg_m3: MeanSd {
            mean: 1.2,
            sd: 0.03,
        },
    }
}

/// What each candidate would say, in their order. Those that cannot be made (a laminate that couples bending with stretching does not
/// vibrate in plates of this theory) are left out. `step` is called after each.
pub fn assess(
    candidates: &[ProposedExperiment],
    shared: &SharedConstants,
    measuring: Measuring,
    step: &(dyn Fn() + Sync),
) -> Vec<Assessed> {
    let assessed = |candidate: &ProposedExperiment| {
        let found = candidate.test.information(shared, measuring);
        step();
        Some(Assessed {
            name: candidate.name.clone(),
            is_field: candidate.test.field().is_some(),
            information: found.ok()?,
        })
    };
    candidates.par_iter().filter_map(assessed).collect()
}

/// Posterior sds of the constants over their prior sds, by some information.
pub fn posterior_sds(information: &[&DMatrix<f64>]) -> DVector<f64> {
    covariance(information).diagonal().map(f64::sqrt)
}

/// Logarithm of the determinant of the posterior covariance of some constants: the smaller, the more is known of them together.
pub fn log_volume(information: &[&DMatrix<f64>], of: &[usize]) -> f64 {
    let all = covariance(information);
    let own = DMatrix::from_fn(of.len(), of.len(), |i, j| all[(of[i], of[j])]);
    let factor = own.cholesky();
    factor.map_or(f64::INFINITY, |f| 2.0 * f.l().diagonal().map(f64::ln).sum())
}

fn covariance(information: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let n = information.first().map_or(0, |m| m.nrows());
    let mut precision = DMatrix::identity(n, n);
    information.iter().for_each(|m| precision += *m);
    precision
        .cholesky()
        .map_or_else(|| DMatrix::identity(n, n), |f| f.inverse())
}

/// By how many sds a field and a second experiment would disagree if an effect acted in the field at its plausible size and nobody
/// knew: what exposes it.
pub fn disagreement(hidden: &Hidden, field: &DMatrix<f64>, other: &DMatrix<f64>) -> f64 {
    let [a, b] = [covariance(&[field]), covariance(&[other])];
    let spread = &a + &b - &a * &b - &b * &a;
    // the other experiment's mean does not move
    let eigen = spread.symmetric_eigen();
    let along = eigen.eigenvectors.tr_mul(&hidden.shift);
    let each = along.iter().zip(eigen.eigenvalues.iter());
    let said = each.filter(|(_, v)| **v > 1e-3).map(|(d, v)| d * d / v);
    said.sum::<f64>().sqrt()
}
