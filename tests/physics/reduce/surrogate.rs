//! What the reduced model's error does to the posterior.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use plychain::effect::{EFFECTS, Kind};
use plychain::experiment::State;
use plychain::experiment::simulate::Truth;
use plychain::field::matrices::write_matrices;
use plychain::identify::{CHECKED_DRAWS, Options, TOLERANCE, identify};
use plychain::infer::{
    Likelihood, Marginal, Model, Posterior, Statistics, problem_within, simulated_field,
};
use plychain::laminate::Material;
use plychain::progress::Silent;
use plychain::reduce::{Problem, ReducedModel, Snapshots, SnapshotsSpec, spread_over};
use plychain::sample::laplace;
use plychain::sample::{SAMPLERS, Schedule};

use serde_json::json;

use super::{design, small_problem};
use crate::common::changed;
use crate::loops::options;

/// A reduced model on the coarse mesh.
fn reduced_model() -> (Problem, ReducedModel) {
    let mut problem = small_problem();
    problem.spec.snapshots = SnapshotsSpec::Count(60);
    let snapshots = Snapshots::at(&problem, design(&problem), &|| ()).unwrap();
    let reduced = ReducedModel::build(&problem, &snapshots).unwrap();
    (problem, reduced)
}

/// Data that say the coefficients `alpha`, about as sharply as a measurement does.
fn statistics(alpha: Vec<f64>) -> Statistics {
    let p = alpha.len();
    let precision = DMatrix::from_fn(p, p, |i, j| 1e10 * if i == j { 1.0 } else { 0.1 });
    Statistics {
        weighted: &precision * DVector::from_vec(alpha),
        precision,
        effect_offset: DVector::zeros(0),
        effect_slope: DMatrix::zeros(0, p),
        effect_covariance: DMatrix::zeros(0, 0),
        residual: 0.0,
        count: 500,
        freedom: 400.0,
    }
}

const TRUTH: [f64; 4] = [150.0, 7.7, 0.32, 4.8];

fn likelihood(statistics: &Statistics, reduced: &ReducedModel) -> Likelihood {
    Likelihood::new(statistics, reduced, 0.004, (0.78, 0.005)).unwrap()
}

#[test]
fn an_error_of_the_prediction_acts_like_its_negative_in_the_data() {
    let (problem, reduced) = reduced_model();
    let statistics = statistics(reduced.surface.evaluate(&problem.point(&TRUTH, 0.78)));
    let error = DVector::from_fn(8, |k, _| 1e-5 * (k as f64 - 3.0));
    let weighted = &statistics.precision * &error;
    let mut shifted = statistics.clone();
    shifted.weighted -= &weighted;
    let (before, after) = (
        likelihood(&statistics, &reduced),
        likelihood(&shifted, &reduced),
    );
    for theta in [TRUTH, [160.0, 7.0, 0.36, 4.2]] {
        for s in [0.8, 1.3] {
            let direct = after.log_likelihood(&theta, s) - before.log_likelihood(&theta, s);
            let change = before.log_likelihood_change(&theta, s, &weighted);
            assert!(
                (direct - change).abs() < 1e-7 * (1.0 + direct.abs()),
                "{direct} and {change}"
            );
        }
    }
}

/// What an effect may do beside the model takes of the misfit what its best amplitude would, where the prior is wide; two effects that are one
/// take as much as that one.
#[test]
fn an_effect_beside_the_model_takes_up_its_part_of_the_misfit() {
    let (problem, reduced) = reduced_model();
    let mut alpha = reduced.surface.evaluate(&problem.point(&TRUTH, 0.78));
    for (k, a) in alpha.iter_mut().enumerate() {
        *a += 3e-5 * (1.7 * k as f64).sin();
    }
    let statistics = statistics(alpha);
    let likelihood = likelihood(&statistics, &reduced);
    let effect = DVector::from_fn(8, |k, _| 1e-5 * (k as f64 - 3.0));
    let weighted = &statistics.precision * &effect;
    let at = (&TRUTH[..], 1.1);
    // a parabola in the amplitude
    let [minus, none, plus] =
        [-1.0, 0.0, 1.0].map(|t| likelihood.misfit(at, Some(&(t * &weighted)), &[]).0);
    let slope = 0.5 * (plus - minus);
    let curvature = minus + plus - 2.0 * none;
    let beside = |sds: &[f64]| {
        let columns: Vec<DVector<f64>> = sds.iter().map(|sd| *sd * &weighted).collect();
        likelihood.misfit(at, None, &columns).0
    };
    let prior = |sd: f64| none - 0.5 * slope * slope / (curvature + 2.0 / (sd * sd));
    for sd in [0.3, 1.0, 1e4] {
        let [one, two] = [beside(&[sd]), beside(&[0.6 * sd, 0.8 * sd])];
        assert!((one - prior(sd)).abs() < 1e-6 * none, "{one} {}", prior(sd));
        assert!((one - two).abs() < 1e-6 * none, "{one} {two}");
    }
    assert!(prior(1e4) < 0.9 * none, "{} {none}", prior(1e4));
}

#[test]
fn one_newton_step_finds_the_mode_that_another_surface_has() {
    let (problem, reduced) = reduced_model();
    let statistics = statistics(reduced.surface.evaluate(&problem.point(&TRUTH, 0.78)));
    let mut other = reduced.clone();
    for (k, c) in other.surface.coefficients.iter_mut().enumerate() {
        c[0] += 1e-8 * (k as f64 - 2.5);
    }
    let sds = [16.0, 0.75, 0.03, 0.5];
    let mode = |reduced: &ReducedModel| {
        let marginal = |(&mean, &sd): (&f64, &f64)| Marginal {
            mean,
            sd,
            truncate: None,
        };
        let posterior = Posterior::new(
            ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"]
                .map(String::from)
                .to_vec(),
            Material::Ply,
            [162.0, 7.58, 0.34, 4.41]
                .iter()
                .zip(&sds)
                .map(marginal)
                .collect(),
            likelihood(&statistics, reduced),
            10.0,
            Some(10.0),
        );
        laplace(&posterior, &TRUTH, &sds).unwrap()
    };
    let (here, there) = (mode(&reduced), mode(&other));
    let point = problem.point(&here.mode, 0.78);
    let predictions = [&other, &reduced].map(|r| DVector::from_vec(r.surface.evaluate(&point)));
    let weighted = &statistics.precision * (&predictions[0] - &predictions[1]);
    let covariance = DMatrix::from_row_slice(4, 4, &here.covariance);
    let sd = covariance.diagonal().map(f64::sqrt);
    let likelihood = likelihood(&statistics, &reduced);
    let gradient = DVector::from_fn(4, |k, _| {
        let at = |sign: f64| {
            let mut theta = here.mode.clone();
            theta[k] += sign * 0.1 * sd[k];
            likelihood.log_likelihood_change(&theta, 1.0, &weighted)
        };
        (at(1.0) - at(-1.0)) / (0.2 * sd[k])
    });
    let step = (&covariance * gradient).component_div(&sd);
    let shift = DVector::from_fn(4, |k, _| (there.mode[k] - here.mode[k]) / sd[k]);
    assert!(shift.amax() > 1e-4, "{shift}");
    assert!(
        (&step - &shift).amax() < 0.05 * shift.amax(),
        "{step} and {shift}"
    );
}

/// The default test with a small simulated field, few snapshots, `modes` modes and a DoE box of `e1`.
fn coarse_model(directory: &Path, modes: usize, e1: [f64; 2]) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/openhole.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
    json["reduced_model"] = serde_json::json!({
        "snapshots": 60, "modes": modes, "degree": 3, "doe": { "E1_GPa": e1 },
    });
    let model = Model::parse(&json.to_string(), &directory.join("coarse.json")).unwrap();
    let truth = Truth {
        constants: vec![140.0, 7.9, 0.33, 5.0],
        thickness_mm: 0.78,
        effects: Vec::new(),
        noise_nm: 10.0,
        correlation_mm: 0.0,
        grid: 61,
        seed: 4,
    };
    write_matrices(
        &directory.join("openhole"),
        &simulated_field(&model, &truth).unwrap(),
        None,
    )
    .unwrap();
    model
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn refinement_brings_the_finite_elements_and_the_box_to_the_posterior() {
    let directory = tempfile::tempdir().unwrap();
    // Three modes are too few, and the box misses the truth.
    let model = coarse_model(directory.path(), 3, [150.0, 210.0]);
    let sampler = (SAMPLERS[0].build)();
    let options = Options {
        schedule: Schedule {
            seed: 1,
            max_draws: 4000,
            ..Schedule::default()
        },
        cache: directory.path().join("cache"),
        refinements: 3,
        ..options(&*sampler)
    };
    let round = identify(&model, &options, &Silent).unwrap();
    let steps = &round.refinements;
    let (first, last) = (&steps[0], &steps[steps.len() - 1]);
    // a reduced basis answers for the finite elements
    assert!(round.surrogate.draws > CHECKED_DRAWS);
    assert!(
        first.max_error_in_posterior_sd > TOLERANCE && first.draws_outside_doe > 0.5,
        "{first:?}"
    );
    assert!(steps.len() > 1 && last.modes > 3, "{last:?}");
    assert!(
        last.max_error_in_posterior_sd <= TOLERANCE && last.draws_outside_doe == 0.0,
        "{steps:?}"
    );
    assert!(last.max_field_error_nm < 0.2 * first.max_field_error_nm);
    let e1 = &round.verdict.rows[0];
    assert!(
        (e1.mean - 140.0).abs() < 4.0 * e1.sd,
        "{} +- {}",
        e1.mean,
        e1.sd
    );
}

/// What an effect changes that the reduced basis does not know comes from two solutions on a coarse mesh: snapshots are those of the fine one
/// to far less than a measurement's noise.
#[test]
#[ignore = "slow: run by .ci/run"]
fn what_effects_change_is_taken_from_a_coarse_mesh() {
    let names: Vec<&str> = EFFECTS
        .iter()
        .filter(|e| e.kind() == Kind::Mechanical)
        .map(|e| e.name())
        .collect();
    let mut compared = 0;
    for name in names {
        let file = changed("openhole.json", |m| {
            m["experiments"][0]["effects"] = json!([name])
        });
        let Ok(model) = Model::load(file.as_ref()) else {
            continue;
        };
        let Ok(problem) = problem_within(&model, [[-12.0; 2], [12.0; 2]]) else {
            continue;
        };
        let points = spread_over(&problem, 8, 3);
        let many = spread_over(&problem, 60, 4);
        let bare = many.iter().map(|p| State::new(&p[..4], p[p.len() - 1]));
        problem.experiment.span(&bare.collect::<Vec<_>>()).unwrap();
        let fine = Problem {
            coarse: None,
            ..problem.clone()
        };
        let solved = |problem: &Problem| Snapshots::at(problem, points.clone(), &|| ()).unwrap();
        let [a, b] = [&problem, &fine].map(solved);
        let off_nm: Vec<f64> = (0..2)
            .flat_map(|c| {
                let (a, b) = (&a.seen[c], &b.seen[c]);
                let of = move |j| (0..a.nrows()).map(move |i| 1e6 * (a[(i, j)] - b[(i, j)]).abs());
                (0..a.ncols()).flat_map(of)
            })
            .collect();
        let far = off_nm.iter().filter(|off| **off > 0.2).count();
        let largest = off_nm.iter().fold(0.0_f64, |m, off| m.max(*off));
        println!("{name}: {far} of {}, {largest:.3} nm at most", off_nm.len());
        // in the crescent that a moved hole leaves, a hundredth of the window, each mesh continues its field in its own way
        let most = if name == "hole_offset" { 0.02 } else { 0.002 };
        assert!((far as f64) < most * off_nm.len() as f64, "{name}: {far}");
        compared += 1;
    }
    // all but those of metals, of measured edges and of a third ply
    assert!(compared > 12, "{compared}");
}
