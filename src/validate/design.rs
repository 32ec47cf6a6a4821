//! What to measure next: experiments that were not made yet, each with what it would say of the constants, alone and beside one that
//! was, and what the two would show of effects that neither shows by itself.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::error::Result;
use crate::experiment::frequencies::{EdgeSpec, FrequenciesSpec, PlateSpec, SupportSpec};
use crate::experiment::simulate::HALF_WINDOW;
use crate::infer::{FrequenciesModel, Marginal, Model, plate_information};
use crate::laminate::{Material, MeanSd, abd};
use crate::quantity::NM_PER_MM;
use crate::trace::{Hidden, Information, field_information};

/// An experiment that could be made.
pub struct Candidate {
    pub name: String,
    pub test: Test,
}

/// What kind it is of.
pub enum Test {
    Field(Box<Model>),
    Plate(Box<FrequenciesSpec>),
}

/// A candidate with what it would say.
pub struct Assessed {
    pub name: String,
    pub is_field: bool,
    pub information: Information,
}

/// How a field would be measured.
#[derive(Debug, Clone, Copy)]
pub struct Measuring {
    /// Noise sd of a point, nm.
    pub noise_nm: f64,
    /// Points along each side of the window, a square about the hole.
    pub grid: usize,
}

/// Points along each side of the window at which a field is looked at: each stands for all of its tile.
const TILES: usize = 25;

/// Factor on the mesh of a candidate: a sensitivity need not be as good as a prediction.
const COARSER: f64 = 0.5;

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

/// What a model file declares, its field first.
pub fn declared(model: &Model) -> Vec<Candidate> {
    let field = Candidate {
        name: model.experiment().name.clone(),
        test: Test::Field(Box::new(model.clone())),
    };
    let plates = model.file.frequencies.iter().map(of_plate);
    std::iter::once(field).chain(plates).collect()
}

/// The experiments of a model of plates.
pub fn declared_plates(model: &FrequenciesModel) -> Vec<Candidate> {
    model.file.experiments.iter().map(of_plate).collect()
}

fn of_plate(spec: &FrequenciesSpec) -> Candidate {
    Candidate {
        name: spec.name.clone(),
        test: Test::Plate(Box::new(spec.clone())),
    }
}

/// Other coupons of a model's laminate and of one ply direction, with the hole of the model, one of twice its size and none, under the force
/// that strains them as much.
pub fn coupons(model: &Model) -> Vec<Candidate> {
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
                let candidate = coupon(model, turned, times).map(|model| Candidate {
                    name: format!("coupon, {what} at {turn} deg{hole}"),
                    test: Test::Field(Box::new(model)),
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
    other.file.frequencies.clear();
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
pub fn plates(layup: &[f64], thickness_mm: MeanSd) -> Vec<Candidate> {
    let single = vec![0.0; layup.len()];
    let mut all = Vec::new();
    for (what, angles) in [("layup", layup), ("one direction", &single)] {
        for turn in TURNS {
            for aspect in ASPECTS {
                let turned = angles.iter().map(|a| a + turn).collect();
                let sides = [SIDE_MM * aspect.sqrt(), SIDE_MM / aspect.sqrt()];
                let [a, b] = sides;
                all.push(Candidate {
                    name: format!("plate, {what} at {turn} deg, {a:.0} x {b:.0} mm"),
                    test: Test::Plate(Box::new(plate(turned, sides, thickness_mm))),
                });
            }
        }
    }
    all
}

fn plate(layup_deg: Vec<f64>, sides: [f64; 2], thickness_mm: MeanSd) -> FrequenciesSpec {
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
    candidates: &[Candidate],
    material: Material,
    constants: &[(String, Marginal)],
    measuring: Measuring,
    step: &(dyn Fn() + Sync),
) -> Vec<Assessed> {
    let of = |candidate: &Candidate| {
        let found = information(&candidate.test, material, constants, measuring);
        step();
        Some(Assessed {
            name: candidate.name.clone(),
            is_field: matches!(candidate.test, Test::Field(_)),
            information: found.ok()?,
        })
    };
    candidates.par_iter().filter_map(of).collect()
}

/// What one test would say.
///
/// # Errors
/// A specimen that cannot be computed.
pub fn information(
    test: &Test,
    material: Material,
    constants: &[(String, Marginal)],
    measuring: Measuring,
) -> Result<Information> {
    match test {
        Test::Plate(spec) => plate_information(spec, material, constants).map(Information::plain),
        Test::Field(model) => {
            let mut model = (**model).clone();
            model.experiment_mut().mesh_density *= COARSER;
            let half = HALF_WINDOW * model.experiment().specimen.width_mm;
            let at = |k: usize| half * ((2 * k + 1) as f64 / TILES as f64 - 1.0);
            let rows = (0..TILES).flat_map(|i| (0..TILES).map(move |j| [i, j]));
            let points: Vec<[f64; 2]> = rows.map(|[i, j]| [at(i), at(j)]).collect();
            // of the points of a tile those count that lie in subsets of their own
            let tile = 2.0 * half / TILES as f64;
            let side = model.subsets().map_or(0.0, |s| s.side_mm);
            let points_in_tile = (measuring.grid as f64 / TILES as f64).powi(2);
            let worth = points_in_tile.min((tile / side).powi(2));
            field_information(
                &model,
                &points,
                measuring.noise_nm / NM_PER_MM / worth.sqrt(),
            )
        }
    }
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
