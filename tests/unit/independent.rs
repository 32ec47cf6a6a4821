//! Independent proposals that were fitted to a target: right where the first guess is near, refused where it is poor, the same bits always.

use plychain::chain::Draws;
use plychain::diagnose::{Rule, diagnose};
use plychain::sample::{
    Adapted, Block, Ensemble, EnsembleState, Key, LogDensity, NormalPart, POOR, Quiet, Sampler,
    Schedule, Span, Start, Stream, adapted, run,
};

use crate::targets::{self, Known};

const KEY: Key = Key {
    seed: 11,
    ensemble: u64::MAX - 3,
};

/// A normal distribution that lies some sds beside a target and is so many times as wide.
fn beside(target: &Known, by: f64, width: f64) -> NormalPart {
    let pairs = target.mean.iter().zip(&target.sd);
    NormalPart {
        log_weight: 0.0,
        mean: pairs.map(|(mean, sd)| mean + by * sd).collect(),
        covariance: target
            .diagonal()
            .iter()
            .map(|c| width * width * c)
            .collect(),
    }
}

fn fitted(target: &Known, guess: &[NormalPart]) -> Adapted {
    let (share, fitted) = adapted(target, guess, KEY).unwrap();
    assert!(share >= POOR, "{}: {share}", target.name);
    fitted.unwrap()
}

fn sampled(target: &Known, sampler: &Adapted, seed: u64) -> Draws {
    let place = |_: usize, _: usize, rng: &mut Stream| sampler.place(rng);
    let start = Start::Walkers {
        place: &place,
        covariance: sampler.covariance(),
    };
    let schedule = Schedule {
        seed,
        warmup: Some(4),
        thin: Some(1),
        max_draws: 20_000,
        ..Schedule::default()
    };
    run(target, sampler, &start, &schedule, &few(), &Quiet)
        .unwrap()
        .draws
}

fn few() -> Rule {
    Rule {
        tau_change: 0.1,
        ..Rule::default()
    }
}

/// On a target of four dimensions, from two guesses of which neither is right: the exact moments, those of the ensemble within
/// the Monte Carlo errors of both, and nearly all proposals accepted.
#[test]
fn a_fitted_proposal_has_the_moments_of_the_ensemble_and_of_the_target() {
    let target = targets::student(4, 30.0);
    let guess = [beside(&target, 0.5, 1.2), beside(&target, -0.4, 0.9)];
    let sampler = fitted(&target, &guess);
    let (mut square, mut count) = (0.0, 0);
    for seed in 0..8 {
        let draws = sampled(&target, &sampler, seed);
        let verdict = diagnose(&draws, &few());
        assert!(verdict.converged, "{}", verdict.line());
        let moves = &draws.info.moves[0];
        assert!(moves.accepted > moves.proposed * 3 / 4, "{moves:?}");
        let covariance = target.diagonal();
        let start = Start::Ball {
            centre: &target.mean,
            covariance: &covariance,
            spread: 1.0,
        };
        let schedule = Schedule {
            seed,
            ..Schedule::default()
        };
        let ensemble = Ensemble::default();
        let other = run(&target, &ensemble, &start, &schedule, &few(), &Quiet).unwrap();
        let other = diagnose(&other.draws, &few());
        for (k, (a, b)) in verdict.rows.iter().zip(&other.rows).enumerate() {
            let mean = (a.mean - b.mean) / a.mcse_mean.hypot(b.mcse_mean);
            let sd = (a.sd - b.sd) / a.mcse_sd.hypot(b.mcse_sd);
            let exact = (a.mean - target.mean[k]) / a.mcse_mean;
            assert!(
                [mean, sd, exact].iter().all(|z| z.abs() < 4.5),
                "{seed} {k}: {mean} {sd} {exact}"
            );
            square += mean * mean + sd * sd;
            count += 2;
        }
    }
    let mean_square = square / f64::from(count);
    println!("{mean_square}");
    assert!((0.4..1.8).contains(&mean_square), "{mean_square}");
}

/// From a guess of which hardly a draw is of the target the proposals go there in several steps.
#[test]
fn a_guess_some_sds_away_leads_to_the_target() {
    let target = targets::student(4, 30.0);
    for (by, width) in [(4.0, 1.0), (-6.0, 1.5), (3.0, 0.5)] {
        let sampler = fitted(&target, &[beside(&target, by, width)]);
        let draws = sampled(&target, &sampler, 5);
        let verdict = diagnose(&draws, &few());
        assert!(verdict.converged, "{}", verdict.line());
        for (k, row) in verdict.rows.iter().enumerate() {
            let z = (row.mean - target.mean[k]) / row.mcse_mean;
            assert!(z.abs() < 4.5, "{by} {k}: {z}");
        }
    }
}

/// Nothing of a guess far away is of the target, and a funnel is no Student-t's.
#[test]
fn poor_proposals_are_refused() {
    let target = targets::student(4, 30.0);
    for guess in [
        vec![beside(&target, 60.0, 0.1)],
        Vec::new(),
        vec![NormalPart {
            log_weight: 0.0,
            mean: target.mean.clone(),
            covariance: vec![0.0; 16],
        }],
    ] {
        let (share, fitted) = adapted(&target, &guess, KEY).unwrap();
        assert!(share < POOR && fitted.is_none(), "{share}");
    }
    let funnel = targets::funnel();
    let (share, fitted) = adapted(&funnel, &[beside(&funnel, 0.0, 1.0)], KEY).unwrap();
    assert!(share < POOR && fitted.is_none(), "{share}");
}

/// One seed, one set of draws, for any number of threads and any cut of the spans; another seed, others.
#[test]
fn independent_draws_depend_on_the_seed_alone() {
    let target = targets::student(3, 30.0);
    let with = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let sampler = fitted(&target, &[beside(&target, 0.3, 1.1)]);
            sampled(&target, &sampler, seed)
        })
    };
    let bits = |d: &Draws| d.values().iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
    let one = with(1, 3);
    assert_eq!(bits(&one), bits(&with(3, 3)));
    assert_ne!(bits(&one), bits(&with(1, 4)));
    let sampler = fitted(&target, &[beside(&target, 0.3, 1.1)]);
    let after = |spans: &[usize]| -> EnsembleState {
        let mut rng = Stream::at(KEY, 0, 0);
        let walkers = sampler.walkers(3);
        let points: Vec<Vec<f64>> = (0..walkers).map(|_| sampler.place(&mut rng)).collect();
        let lp = points.iter().map(|x| (target.value(x)).unwrap());
        let lp = lp.collect();
        let mut state = sampler.begin(3, points.concat(), lp, &[]).unwrap();
        for &steps in spans {
            let span = Span {
                steps,
                thin: 1,
                warmup: false,
            };
            let mut block = Block::default();
            sampler
                .advance(&target, KEY, span, &mut state, &mut block)
                .unwrap();
        }
        state
    };
    assert_eq!(after(&[12]), after(&[5, 1, 6]));
}
