//! Samplers against targets with known answers, judged in Monte Carlo standard errors.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

use plychain::chain::Draws;
use plychain::diagnose::{Rule, Verdict, diagnose};
use plychain::sample::LogDensity;
use plychain::sample::{
    Block, Ensemble, EnsembleState, Key, MOVES, Mixture, Outcome, Quiet, SAMPLERS, Sampler,
    Schedule, Span, Start, Stream, run,
};

use crate::targets::{self, Known};

/// Every sampler of the registry, and the ensemble with each move alone.
fn kernels() -> Vec<(String, Box<dyn Sampler>)> {
    let mut kernels: Vec<(String, Box<dyn Sampler>)> = Vec::new();
    for entry in SAMPLERS {
        kernels.push((entry.name.to_string(), (entry.build)()));
    }
    for build in MOVES {
        let only = Ensemble {
            mixture: Mixture::new(vec![(build(), 1.0)]).unwrap(),
            ..Ensemble::default()
        };
        kernels.push((format!("only {}", build().name()), Box::new(only)));
    }
    kernels
}

fn sample(sampler: &dyn Sampler, target: &Known, schedule: &Schedule) -> Outcome {
    let covariance = target.diagonal();
    let start = Start::Ball {
        centre: &target.mean,
        covariance: &covariance,
        spread: 1.0,
    };
    run(target, sampler, &start, schedule, &Rule::default(), &Quiet).unwrap()
}

/// Deviations from the truth in units of their standard errors: mean, sd, and three quantiles where known.
fn deviations(target: &Known, verdict: &Verdict) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    for (k, row) in verdict.rows.iter().enumerate() {
        all.push((
            format!("mean {}", row.name),
            (row.mean - target.mean[k]) / row.mcse_mean,
        ));
        all.push((
            format!("sd {}", row.name),
            (row.sd - target.sd[k]) / row.mcse_sd,
        ));
        let levels = [(0.025, row.low), (0.5, row.median), (0.975, row.high)];
        for ((p, found), mcse) in levels.into_iter().zip(row.mcse_quantiles) {
            if let Some(truth) = (target.quantile)(k, p) {
                all.push((format!("q{p} {}", row.name), (found - truth) / mcse));
            }
        }
    }
    all
}

/// Each deviation is summed over the seeds, so that a bias shows and luck does not: the sum over sqrt(seeds) is
/// standard normal if the sampler and its MCSE are right. 400 sums against 4 sd: one false alarm in 40 choices of the
/// seeds. The spread of single deviations tests the standard errors themselves: 1 within 20 % (they are correlated
/// within a run, so no closer).
#[test]
fn moments_within_four_standard_errors() {
    within_four_standard_errors(&[21, 22]);
}

#[test]
#[ignore = "more seeds, 1 minute"]
fn moments_within_four_standard_errors_for_more_seeds() {
    within_four_standard_errors(&[23, 24, 25, 26]);
}

fn within_four_standard_errors(seeds: &[u64]) {
    let cases: Vec<(String, Box<dyn Sampler>, Known)> = kernels()
        .into_iter()
        .map(|(name, _)| name)
        .flat_map(|name| {
            targets::all()
                .into_iter()
                .map(move |t| (name.clone(), kernel(&name), t))
        })
        .collect();
    let judged: Vec<(f64, usize, Vec<String>)> = cases
        .par_iter()
        .map(|(name, sampler, target)| judge(name, &**sampler, target, seeds))
        .collect();
    let failures: Vec<&String> = judged.iter().flat_map(|j| &j.2).collect();
    assert!(failures.is_empty(), "{failures:#?}");
    let (sum, count) = judged.iter().fold((0.0, 0), |(s, n), j| (s + j.0, n + j.1));
    let rms = (sum / count as f64).sqrt();
    assert!(
        (0.8..1.2).contains(&rms),
        "deviations spread by {rms} standard errors"
    );
}

fn kernel(name: &str) -> Box<dyn Sampler> {
    kernels().into_iter().find(|(n, _)| n == name).unwrap().1
}

/// Sum and count of the squared deviations, and the failures in words.
fn judge(
    name: &str,
    sampler: &dyn Sampler,
    target: &Known,
    seeds: &[u64],
) -> (f64, usize, Vec<String>) {
    let (mut squares, mut count) = (0.0, 0);
    let mut sums: Vec<(String, f64)> = Vec::new();
    for &seed in seeds {
        let schedule = Schedule {
            seed,
            max_draws: 120_000,
            ..Schedule::default()
        };
        let outcome = sample(sampler, target, &schedule);
        let verdict = diagnose(&outcome.draws, &Rule::default());
        for (k, (label, z)) in deviations(target, &verdict).into_iter().enumerate() {
            squares += z * z;
            count += 1;
            if sums.len() <= k {
                sums.push((label, 0.0));
            }
            sums[k].1 += z / (seeds.len() as f64).sqrt();
        }
    }
    let failures = sums
        .into_iter()
        .filter(|(_, z)| z.is_nan() || z.abs() >= 4.0)
        .map(|(label, z)| {
            format!(
                "{name} on {}: {label} is {z:.1} standard errors off",
                target.name
            )
        })
        .collect();
    (squares, count, failures)
}

/// Walkers drawn exactly from the target are still exactly of the target after some steps, whatever the kernel: the
/// sharpest test of detailed balance. By the Kolmogorov-Smirnov distance of 20,000 walkers to the exact marginal,
/// independent of each other across ensembles and, at one time, within one; sqrt(n) D > 2.8 has probability 3e-7.
#[test]
fn an_exact_start_stays_exact() {
    for dim in [1, 2, 3, 5] {
        let target = targets::student(dim, 5.0);
        for (name, sampler) in kernels() {
            let adaptive = sampler.walkers(dim) == 1;
            let ensembles = if adaptive {
                20_000
            } else {
                20_000 / sampler.walkers(dim)
            };
            let finals: Vec<Vec<f64>> = (0..ensembles as u64)
                .into_par_iter()
                .map(|ensemble| after(&*sampler, &target, Key { seed: 5, ensemble }, dim))
                .collect();
            let mut first: Vec<f64> = finals.iter().flatten().copied().collect();
            first.sort_by(f64::total_cmp);
            let n = first.len() as f64;
            let t = StudentsT::new(0.0, 1.0, 5.0).unwrap();
            let distance = first
                .iter()
                .enumerate()
                .map(|(k, x)| (t.cdf(*x) - (k as f64 + 0.5) / n).abs())
                .fold(0.0, f64::max);
            assert!(
                n.sqrt() * distance < 2.8,
                "{name}, d = {dim}: {}",
                n.sqrt() * distance
            );
        }
    }
}

/// First coordinate of every walker of an exact start after eight steps.
fn after(sampler: &dyn Sampler, target: &Known, key: Key, dim: usize) -> Vec<f64> {
    let walkers = sampler.walkers(dim);
    let mut rng = Stream::at(key, 1 << 40, 0);
    let mut x = Vec::new();
    for _ in 0..walkers {
        let chi2: f64 = (0..5).map(|_| rng.normal().powi(2)).sum();
        x.extend(
            (0..dim)
                .map(|_| rng.normal() / (chi2 / 5.0).sqrt())
                .collect::<Vec<f64>>(),
        );
    }
    let lp = x.chunks(dim).map(|x| target.value(x).unwrap()).collect();
    let mut state = sampler.begin(dim, x, lp, &target.diagonal()).unwrap();
    let span = Span {
        steps: 8,
        thin: 8,
        warmup: false,
    };
    let mut block = Block::default();
    sampler
        .advance(target, key, span, &mut state, &mut block)
        .unwrap();
    // Of the one kept draw, the first parameter of every walker.
    block.x[..walkers].to_vec()
}

/// Simulation-based calibration (Talts et al. 2018): theta from the prior, data from theta, then the rank of theta
/// among posterior draws is uniform. 400 data sets, 16 bins; chi^2 of 15 degrees of freedom above 60 has probability
/// 2e-7, and there are 12 of them.
#[test]
#[ignore = "slow: run by .ci/run"]
fn ranks_on_prior_predictive_data_are_uniform() {
    uniform(0..200);
}

#[test]
#[ignore = "more replicas, 1 minute"]
fn ranks_on_more_prior_predictive_data_are_uniform() {
    uniform(200..600);
}

fn uniform(replicas: std::ops::Range<u64>) {
    let expected = (replicas.end - replicas.start) as f64 / 16.0;
    for (name, sampler) in kernels() {
        let ranks: Vec<[usize; 2]> = replicas
            .clone()
            .into_par_iter()
            .map(|k| rank(&*sampler, k))
            .collect();
        for parameter in 0..2 {
            let mut bins = [0.0; 16];
            ranks.iter().for_each(|r| bins[r[parameter]] += 1.0);
            let chi2: f64 = bins
                .iter()
                .map(|b: &f64| (b - expected).powi(2) / expected)
                .sum();
            assert!(
                chi2 < 60.0,
                "{name}, parameter {parameter}: chi^2 {chi2:.0}, {bins:?}"
            );
        }
    }
}

/// Bin of the rank of the truth in a model of curved posterior: a, b ~ N(0, 1), y ~ N(a exp(b), 0.5), N(b, 0.5).
fn rank(sampler: &dyn Sampler, replica: u64) -> [usize; 2] {
    let mut rng = Stream::at(
        Key {
            seed: 77,
            ensemble: replica,
        },
        0,
        0,
    );
    let truth = [rng.normal(), rng.normal()];
    let y = [
        truth[0] * truth[1].exp() + 0.5 * rng.normal(),
        truth[1] + 0.5 * rng.normal(),
    ];
    let target = targets::custom(2, move |x| {
        let r = [y[0] - x[0] * x[1].exp(), y[1] - x[1]];
        -0.5 * (x[0] * x[0] + x[1] * x[1]) - 2.0 * (r[0] * r[0] + r[1] * r[1])
    });
    let schedule = Schedule {
        seed: replica,
        ensembles: 1,
        warmup: Some(if sampler.walkers(2) == 1 { 2000 } else { 200 }),
        max_draws: if sampler.walkers(2) == 1 {
            319
        } else {
            319 * 10
        },
        thin: Some(20),
        ..Schedule::default()
    };
    let never = Rule {
        ess: f64::INFINITY,
        ..Rule::default()
    };
    let start = Start::Ball {
        centre: &[0.0; 2],
        covariance: &[1.0, 0.0, 0.0, 1.0],
        spread: 1.0,
    };
    let draws = run(&target, sampler, &start, &schedule, &never, &Quiet)
        .unwrap()
        .draws;
    [0, 1].map(|k| {
        let below = draws.points().filter(|x| x[k] < truth[k]).count();
        16 * below / (draws.len() + 1)
    })
}

/// Snooker on a standard normal in several dimensions, where emcee 3.1.6's gives sd 0.857.
#[test]
fn snooker_is_exact() {
    exact(&[31]);
}

#[test]
#[ignore = "more seeds, 1 minute"]
fn snooker_is_exact_for_more_seeds() {
    exact(&[32, 33, 34]);
}

fn exact(seeds: &[u64]) {
    let sampler = Ensemble {
        mixture: Mixture::parse("snooker").unwrap(),
        ..Ensemble::default()
    };
    for dim in [1, 2, 3, 8] {
        let target = targets::correlated(dim, 1.0);
        let (_, _, failures) = judge("snooker", &sampler, &target, seeds);
        assert!(failures.is_empty(), "{failures:?}");
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn the_funnel_is_flagged() {
    flagged(&[1]);
}

#[test]
#[ignore = "more seeds, 1 minute"]
fn the_funnel_is_flagged_for_more_seeds() {
    flagged(&[2, 3]);
}

fn flagged(seeds: &[u64]) {
    for entry in SAMPLERS {
        for &seed in seeds {
            let schedule = Schedule {
                seed,
                max_draws: 30_000,
                ..Schedule::default()
            };
            let outcome = sample(&*(entry.build)(), &targets::funnel(), &schedule);
            let verdict = diagnose(&outcome.draws, &Rule::default());
            assert!(!verdict.converged, "{}: {verdict}", entry.name);
        }
    }
}

fn bits(draws: &Draws) -> Vec<u64> {
    draws
        .values()
        .iter()
        .chain(draws.lp())
        .map(|v| v.to_bits())
        .collect()
}

#[test]
fn same_bits_for_any_number_of_threads() {
    for entry in SAMPLERS {
        let schedule = Schedule {
            seed: 3,
            max_draws: 20_000,
            ..Schedule::default()
        };
        let outcomes: Vec<Outcome> = [1, 2, 3]
            .into_iter()
            .map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap();
                pool.install(|| sample(&*(entry.build)(), &targets::banana(), &schedule))
            })
            .collect();
        assert_eq!(bits(&outcomes[0].draws), bits(&outcomes[1].draws));
        assert_eq!(outcomes[0], outcomes[2]);
        let other = Schedule {
            seed: 4,
            ..schedule
        };
        let other = sample(&*(entry.build)(), &targets::banana(), &other);
        assert_ne!(bits(&outcomes[0].draws), bits(&other.draws));
    }
}

/// Neighbouring seeds, ensembles and walkers have nothing in common, and a stream continues from its count.
#[test]
fn streams_are_distinct_and_positioned() {
    let mut seen = std::collections::HashSet::new();
    for seed in 0..64 {
        for ensemble in 0..16 {
            for lane in (0..32).chain([u64::MAX]) {
                let first = Stream::at(Key { seed, ensemble }, lane, 0).bits();
                assert!(seen.insert(first), "{seed} {ensemble} {lane}");
            }
        }
    }
    let key = Key {
        seed: 1,
        ensemble: 2,
    };
    let mut stream = Stream::at(key, 3, 0);
    for _ in 0..1000 {
        stream.normal();
    }
    let mut later = Stream::at(key, 3, stream.used());
    assert_eq!(stream.bits(), later.bits());
}

/// What resuming rests on: a state continues to the same bits wherever a span is cut.
#[test]
fn a_cut_span_continues_to_the_same_bits() {
    let target = targets::banana();
    for (name, sampler) in kernels() {
        let key = Key {
            seed: 9,
            ensemble: 2,
        };
        let walkers = sampler.walkers(2);
        let mut rng = Stream::at(key, 1 << 40, 0);
        let x: Vec<f64> = (0..2 * walkers).map(|_| rng.normal()).collect();
        let lp: Vec<f64> = x.chunks(2).map(|x| target.value(x).unwrap()).collect();
        let mut whole = sampler.begin(2, x, lp, &target.diagonal()).unwrap();
        let mut cut = whole.clone();
        let span = |steps, warmup| Span {
            steps,
            thin: 1,
            warmup,
        };
        let mut block = Block::default();
        let mut advance = |span, state: &mut EnsembleState| {
            sampler
                .advance(&target, key, span, state, &mut block)
                .unwrap();
            block.clone()
        };
        advance(span(150, true), &mut whole);
        let all = advance(span(100, false), &mut whole);
        advance(span(77, true), &mut cut);
        advance(span(73, true), &mut cut);
        let first = advance(span(41, false), &mut cut);
        let second = advance(span(59, false), &mut cut);
        assert_eq!(whole, cut, "{name}");
        assert_eq!(all.x, [first.x, second.x].concat(), "{name}");
    }
}
