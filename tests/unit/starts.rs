//! Starts that are refused, densities that are not numbers.

use std::sync::atomic::{AtomicUsize, Ordering};

use plychain::diagnose::Rule;
use plychain::error::Result;
use plychain::sample::{
    Adaptive, Ensemble, Mixture, Monitor, Outcome, PhaseReport, Quiet, SAMPLERS, Sampler, Schedule,
    Start, Stopped, Stream, run,
};

use crate::targets::{self, Known};

const UNIT: [f64; 4] = [1.0, 0.0, 0.0, 1.0];

fn start(target: &Known, sampler: &dyn Sampler, start: &Start<'_>) -> Result<Outcome> {
    let schedule = Schedule {
        max_draws: 5000,
        ..Schedule::default()
    };
    run(target, sampler, start, &schedule, &Rule::default(), &Quiet)
}

fn ball(centre: &[f64]) -> Start<'_> {
    Start::Ball {
        centre,
        covariance: &UNIT,
        spread: 1.0,
    }
}

#[test]
fn a_degenerate_start_is_refused() {
    let target = targets::banana();
    let line = |_: usize, _: usize, rng: &mut Stream| {
        let t = rng.normal();
        vec![1.0 + t, 2.0 - 3.0 * t]
    };
    let point = |_: usize, _: usize, _: &mut Stream| vec![0.1, 0.7];
    for place in [
        &line as &(dyn Fn(usize, usize, &mut Stream) -> Vec<f64> + Sync),
        &point,
    ] {
        let place = Start::Walkers {
            place,
            covariance: &UNIT,
        };
        let error = start(&target, &Ensemble::default(), &place).unwrap_err();
        assert!(error.to_string().contains("condition number"), "{error}");
        assert_eq!(error.exit_code(), 1);
    }
}

#[test]
fn too_few_or_odd_walkers_are_refused() {
    let target = targets::correlated(5, 1.0);
    for walkers in [0, 2, 8, 13] {
        let sampler = Ensemble {
            mixture: Mixture::parse("stretch").unwrap(),
            walkers: Some(walkers),
        };
        let covariance = target.diagonal();
        let ball = Start::Ball {
            centre: &target.mean,
            covariance: &covariance,
            spread: 1.0,
        };
        assert!(start(&target, &sampler, &ball).is_err(), "{walkers}");
    }
}

#[test]
fn nan_at_the_start_is_fatal() {
    let target = targets::custom(2, |x| {
        if x[0] > 0.5 {
            f64::NAN
        } else {
            -x[1] * x[1] - x[0] * x[0]
        }
    });
    for entry in SAMPLERS {
        let error = start(&target, &*(entry.build)(), &ball(&[3.0, 0.0])).unwrap_err();
        assert!(error.to_string().contains("NaN"), "{error}");
    }
}

#[test]
fn a_start_outside_the_support_is_fatal() {
    let target = targets::custom(2, |_| f64::NEG_INFINITY);
    for entry in SAMPLERS {
        let error = start(&target, &*(entry.build)(), &ball(&[0.0, 0.0])).unwrap_err();
        assert!(error.to_string().contains("-inf"), "{error}");
    }
}

/// NaN later is outside the support: counted, and never stored.
#[test]
fn nan_later_is_counted() {
    let target = targets::custom(2, |x| {
        if x[0].abs() > 2.5 {
            f64::NAN
        } else {
            -0.5 * (x[0] * x[0] + x[1] * x[1])
        }
    });
    let near = |_: usize, _: usize, rng: &mut Stream| vec![0.1 * rng.normal(), 0.1 * rng.normal()];
    for entry in SAMPLERS {
        let place = Start::Walkers {
            place: &near,
            covariance: &UNIT,
        };
        let draws = start(&target, &*(entry.build)(), &place).unwrap().draws;
        assert!(draws.info.nan > 0);
        assert!(draws.lp().iter().all(|v| v.is_finite()));
        assert!(draws.points().all(|x| x[0].abs() <= 2.5));
    }
}

#[test]
fn mixtures_are_declared_and_counted() {
    assert!(Mixture::parse("de=0.5,walk=0.5").is_err());
    assert!(Mixture::parse("de=-1").is_err());
    assert!(Mixture::parse("de=a").is_err());
    let sampler = Ensemble {
        mixture: Mixture::parse("de=3,stretch").unwrap(),
        ..Ensemble::default()
    };
    let info = start(&targets::banana(), &sampler, &ball(&[0.0; 2]))
        .unwrap()
        .draws
        .info;
    assert_eq!(info.moves[0].name, "de");
    let proposed: u64 = info.moves.iter().map(|m| m.proposed).sum();
    assert_eq!(proposed, info.evaluations);
    assert!(
        info.moves
            .iter()
            .all(|m| m.accepted > 0 && m.accepted < m.proposed)
    );
    let rate = info.acceptance.iter().sum::<f64>() / info.acceptance.len() as f64;
    let accepted: u64 = info.moves.iter().map(|m| m.accepted).sum();
    assert!((rate - accepted as f64 / proposed as f64).abs() < 1e-12);
}

/// Ends a run after a number of reports.
struct Impatient(AtomicUsize);

impl Monitor for Impatient {
    fn report(&self, _report: &PhaseReport) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) > 1
    }
}

#[test]
fn progress_can_end_a_run() {
    let target = targets::banana();
    for reports in [1, 4] {
        let progress = Impatient(AtomicUsize::new(reports));
        let schedule = Schedule {
            warmup: Some(500),
            ..Schedule::default()
        };
        let never = Rule {
            rhat: 0.0,
            ..Rule::default()
        };
        let outcome = run(
            &target,
            &Adaptive::default(),
            &ball(&[0.0; 2]),
            &schedule,
            &never,
            &progress,
        )
        .unwrap();
        assert_eq!(outcome.stopped, Stopped::Interrupted);
        assert_eq!(outcome.draws.is_empty(), reports == 1);
    }
}
