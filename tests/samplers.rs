//! Samplers against targets with known answers, judged in Monte Carlo standard errors.

use plychain::chain::Draws;
use plychain::diagnose::{Rule, Verdict, diagnose};
use plychain::infer::LogDensity;
use plychain::sample::{
    Ensemble, Key, MOVES, Mixture, Outcome, Quiet, SAMPLERS, Sampler, Schedule, Span, Start,
    Stream, run,
};

use crate::targets::{self, Known};

/// Every sampler of the registry, and the ensemble with each move alone.
fn kernels() -> Vec<(String, Box<dyn Sampler>)> {
    let mut kernels: Vec<(String, Box<dyn Sampler>)> = Vec::new();
    for entry in SAMPLERS {
        kernels.push((entry.name.to_string(), (entry.build)()));
    }
    for entry in MOVES {
        let only = Ensemble::with(Mixture::only((entry.build)()));
        kernels.push((format!("only {}", entry.name), Box::new(only)));
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
        all.push((format!("mean {}", row.name), (row.mean - target.mean[k]) / row.mcse_mean));
        all.push((format!("sd {}", row.name), (row.sd - target.sd[k]) / row.mcse_sd));
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
/// standard normal if the sampler and its MCSE are right. About 400 sums against 4 sd: one false alarm in 40
/// choices of the seeds. A kernel that does not converge must say so, and only those known to be slow may.
#[test]
fn moments_within_four_standard_errors() {
    let seeds = [11, 12, 13];
    let mut squares = Vec::new();
    for (kernel, sampler) in kernels() {
        for target in targets::all() {
            let mut sums: Vec<(String, f64)> = Vec::new();
            for seed in seeds {
                let schedule = Schedule { seed, max_draws: 400_000, ..Schedule::default() };
                let outcome = sample(&*sampler, &target, &schedule);
                let verdict = diagnose(&outcome.draws, &Rule::default());
                println!("{kernel:18} {:18} {:8} {:?} {}", target.name, outcome.draws.info.evaluations, outcome.stopped, verdict.line());
                for (k, (name, z)) in deviations(&target, &verdict).into_iter().enumerate() {
                    squares.push(z * z);
                    if sums.len() <= k {
                        sums.push((name, 0.0));
                    }
                    sums[k].1 += z / (seeds.len() as f64).sqrt();
                }
            }
            for (name, z) in sums {
                if z.abs() >= 4.0 { println!("FAIL {kernel} on {}: {name} is {z:.1} standard errors off", target.name); }
            }
        }
    }
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    println!("rms {rms}");
}
