//! The tabulated posterior: the values that were published with it, and its moments by our sampler.

use plychain::diagnose::{Rule, diagnose};
use plychain::sample::{Ensemble, LogDensity, Quiet, Schedule, Start, laplace, run};

use crate::common::tabulated::Tabulated;

#[test]
fn the_formula_to_1e_9() {
    let posterior = Tabulated::load().posterior();
    for t in &posterior.table.test_points {
        let found = posterior.value(&t.p).unwrap() + posterior.constant();
        let off = (found - t.logp).abs();
        assert!(off <= 1e-9, "{:?}: {found} {}", t.p, t.logp);
    }
    assert_eq!(
        posterior.value(&[-1.0, 7.0, 0.3, 4.0]).unwrap(),
        f64::NEG_INFINITY
    );
}

#[test]
fn moments_of_a_tabulated_posterior() {
    let posterior = Tabulated::load().posterior();
    let known = &posterior.table.reference;
    let (centre, sd) = posterior.start();
    let mode = laplace(&posterior, &centre, &sd).unwrap();
    let start = Start::Ball {
        centre: &mode.mode,
        covariance: &mode.covariance,
        spread: 2.0,
    };
    let rule = Rule {
        ess: 5000.0,
        ..Rule::default()
    };
    let sampler = Ensemble::default();
    let draws = run(
        &posterior,
        &sampler,
        &start,
        &Schedule::default(),
        &rule,
        &Quiet,
    )
    .unwrap()
    .draws;
    let verdict = diagnose(&draws, &rule);
    assert!(verdict.converged, "{}", verdict.line());
    for (k, row) in verdict.rows.iter().enumerate() {
        assert!(
            (row.mean - known.mean[k]).abs() < 4.0 * row.mcse_mean,
            "{row:?}"
        );
        assert!((row.sd - known.sd[k]).abs() < 4.0 * row.mcse_sd, "{row:?}");
    }
}
