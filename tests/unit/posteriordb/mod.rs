//! Posteriors of posteriordb (Magnusson et al., github.com/stan-dev/posteriordb at 28f8d3d6, April 2025) against its reference draws: 10,000 of
//! each, by Stan's dynamic HMC. `facts.json` has the data (of a linear regression its inner products), and from the reference draws the mean and
//! the mean square of each parameter, each with its Monte Carlo standard error.

mod cases;

use plychain::chain::{Draws, ScalarDraws};
use plychain::diagnose::{Rule, diagnose, mcse_mean, mean};
use plychain::sample::{Ensemble, Quiet, Schedule, Start, density, laplace, run};
use serde_json::Value;

use cases::{CASES, Case};

fn facts() -> Value {
    serde_json::from_str(include_str!("facts.json")).unwrap()
}

/// Draws of a posterior, of posteriordb's parameters.
fn draws(case: &Case, names: Vec<String>) -> Draws {
    let coordinates = (0..case.start.len()).map(|k| format!("x{k}"));
    let target = density(coordinates, &case.density);
    let (start, sd): (Vec<f64>, Vec<f64>) = case.start.iter().copied().unzip();
    let mode = laplace(&target, &start, &sd).unwrap();
    let start = Start::Ball {
        centre: &mode.mode,
        covariance: &mode.covariance,
        spread: 1.5,
    };
    let rule = Rule {
        ess: 1000.0,
        ..Rule::default()
    };
    let schedule = Schedule::default();
    let outcome = run(
        &target,
        &Ensemble::default(),
        &start,
        &schedule,
        &rule,
        &Quiet,
    )
    .unwrap();
    let own = &outcome.draws;
    let values = own.points().flat_map(|x| (case.parameters)(x)).collect();
    let shown = Draws::new(names, own.ensemble().to_vec(), values, own.lp().to_vec()).unwrap();
    let verdict = diagnose(&shown, &Rule::default());
    assert!(verdict.converged, "{}: {verdict}", case.name);
    shown
}

/// Differences of means and mean squares from the reference's, in their common standard error.
fn differences(case: &Case, reference: &Value) -> Vec<(String, f64)> {
    let reference = reference.as_object().unwrap();
    let names: Vec<String> = reference.keys().cloned().collect();
    let draws = draws(case, names.clone());
    let mut found = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let series = draws.series(k);
        let squares = series.values.iter().map(|v| v * v).collect();
        let squares = ScalarDraws {
            values: squares,
            ..series.clone()
        };
        for (power, series) in [series, squares].iter().enumerate() {
            let known = |k: usize| reference[name][2 * power + k].as_f64().unwrap();
            let error = mcse_mean(series).hypot(known(1));
            let z = (mean(&series.values) - known(0)) / error;
            found.push((format!("{} {name}^{}", case.name, power + 1), z));
        }
    }
    found
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn moments_are_those_of_reference_draws() {
    let facts = facts();
    let all: Vec<(String, f64)> = CASES
        .iter()
        .flat_map(|(name, build)| {
            let case = build(name, &facts[name]["data"]);
            let found = differences(&case, &facts[name]["reference"]);
            let rms = found.iter().map(|f| f.1 * f.1).sum::<f64>() / found.len() as f64;
            println!("{name}: rms {:.2}", rms.sqrt());
            found
        })
        .collect();
    let rms = (all.iter().map(|f| f.1 * f.1).sum::<f64>() / all.len() as f64).sqrt();
    println!("{} moments, rms {rms:.3}", all.len());
    let far: Vec<_> = all.iter().filter(|f| f.1.abs() > 4.5).collect();
    assert!(far.is_empty(), "{far:?}");
    assert!(all.len() > 150 && (0.8..1.2).contains(&rms), "rms {rms}");
}
