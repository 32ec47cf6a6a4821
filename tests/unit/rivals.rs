//! Our default sampler beside `hammer-and-sample` and emcee on the same densities, in one run: effective draws an evaluation and a second
//! of processor time, all counted by one diagnosis.

use std::time::Instant;

use hammer_and_sample as other;
use plychain::chain::{Draws, read_npz};
use plychain::diagnose::{Rule, diagnose};
use plychain::sample::{Ensemble, Key, Quiet, Schedule, Start, Stop, Stream, density, run};

use crate::common::{fresh, python};

const WALKERS: usize = 64;
const DRAWS: usize = 200_000;
const WARMUP: usize = 500;
const DIM: usize = 5;

/// A density in five dimensions, and the same for arrays of points in NumPy.
struct Rival {
    name: &'static str,
    density: fn(&[f64; DIM]) -> f64,
    numpy: &'static str,
}

/// Neighbours correlated by 0.9: an autoregression along the coordinates.
fn correlated(x: &[f64; DIM]) -> f64 {
    let steps: f64 = x.windows(2).map(|w| (w[1] - 0.9 * w[0]).powi(2)).sum();
    -0.5 * (x[0] * x[0] + steps / 0.19)
}

/// Two bent pairs and one coordinate alone.
fn bent(x: &[f64; DIM]) -> f64 {
    let pair = |k: usize| x[k].powi(2) + (x[k + 1] - x[k] * x[k]).powi(2);
    -0.5 * (pair(0) + pair(2) + x[4] * x[4])
}

const RIVALS: [Rival; 2] = [
    Rival {
        name: "normal, neighbours correlated by 0.9",
        density: correlated,
        numpy: "-0.5 * (x[:, 0]**2 + ((x[:, 1:] - 0.9 * x[:, :-1])**2).sum(1) / 0.19)",
    },
    Rival {
        name: "bent (two bananas)",
        density: bent,
        numpy: "-0.5 * (x[:, 0]**2 + (x[:, 1] - x[:, 0]**2)**2 + x[:, 2]**2 + (x[:, 3] - x[:, 2]**2)**2 + x[:, 4]**2)",
    },
];

struct Plain(fn(&[f64; DIM]) -> f64);

impl other::Model for Plain {
    type Params = [f64; DIM];

    fn log_prob(&self, x: &[f64; DIM]) -> f64 {
        self.0(x)
    }
}

/// Never content: all samplers make the same number of draws.
struct Never;

impl Stop for Never {
    fn settled(&self, _: &Draws) -> Option<usize> {
        Some(1)
    }

    fn fallback(&self, _: &Draws) -> usize {
        1
    }

    fn enough(&self, _: &Draws) -> bool {
        false
    }
}

fn names() -> Vec<String> {
    (0..DIM).map(|k| format!("x{k}")).collect()
}

fn starts() -> Vec<[f64; DIM]> {
    let key = Key {
        seed: 7,
        ensemble: 0,
    };
    let point = |w| {
        let mut rng = Stream::at(key, w, 0);
        [0.0; DIM].map(|_: f64| rng.normal())
    };
    (0..WALKERS as u64).map(point).collect()
}

fn ours(rival: &Rival) -> (Draws, f64) {
    let of = rival.density;
    let target = density(names(), move |x: &[f64]| of(&std::array::from_fn(|k| x[k])));
    let unit: Vec<f64> = (0..DIM * DIM)
        .map(|k| f64::from(u8::from(k % (DIM + 1) == 0)))
        .collect();
    let start = Start::Ball {
        centre: &[0.0; DIM],
        covariance: &unit,
        spread: 1.0,
    };
    let sampler = Ensemble {
        walkers: Some(WALKERS),
        ..Ensemble::default()
    };
    let schedule = |draws| Schedule {
        seed: 3,
        ensembles: 1,
        warmup: Some(WARMUP),
        thin: Some(1),
        max_draws: draws,
        growth: 1e9,
        ..Schedule::default()
    };
    let go = |draws| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        pool.unwrap().install(|| {
            let begin = Instant::now();
            let end = run(&target, &sampler, &start, &schedule(draws), &Never, &Quiet).unwrap();
            (end.draws, begin.elapsed().as_secs_f64())
        })
    };
    // the time of the warm-up alone is taken off
    let (_, warm) = go(4 * WALKERS);
    let (draws, all) = go(DRAWS);
    (draws, all - warm)
}

fn hammer(rival: &Rival, stretch: bool) -> (Draws, f64) {
    let model = Plain(rival.density);
    let go = |start: &[[f64; DIM]], draws: usize, seed: u64| {
        let key = Key { seed, ensemble: 9 };
        let walkers = start.iter().enumerate().map(|(k, x)| {
            let seed = Stream::at(key, k as u64, 0).bits();
            (*x, rand_pcg::Pcg64Mcg::new(u128::from(seed)))
        });
        let length = other::MinChainLen(draws);
        if stretch {
            let moves = other::Stretch::default();
            return other::sample(&model, &moves, walkers, length, other::Serial).0;
        }
        let gamma = 2.38 / (2.0 * DIM as f64).sqrt();
        let moves = other::DifferentialEvolution::new(gamma, 1e-5);
        other::sample(&model, &moves, walkers, length, other::Serial).0
    };
    let warm = go(&starts(), WARMUP * WALKERS, 1);
    let begin = Instant::now();
    let chain = go(&warm[warm.len() - WALKERS..], DRAWS, 2);
    let spent = begin.elapsed().as_secs_f64();
    let draws = chain.len() / WALKERS;
    let order = (0..WALKERS).flat_map(|w| (0..draws).map(move |d| d * WALKERS + w));
    let values = order.flat_map(|at| chain[at]).collect();
    let lp = vec![f64::NAN; draws * WALKERS];
    let draws = Draws::new(names(), vec![0; WALKERS], values, lp);
    (draws.unwrap(), spent)
}

const EMCEE: &str = r#"
import sys, time
import numpy as np, emcee
place, moves, walkers, warmup, steps, dim = sys.argv[1], sys.argv[2], *map(int, sys.argv[4:])
density = eval("lambda x: " + sys.argv[3])
moves = emcee.moves.StretchMove() if moves == "stretch" else emcee.moves.DEMove()
np.random.seed(5)
sampler = emcee.EnsembleSampler(walkers, dim, density, vectorize=True, moves=moves)
state = sampler.run_mcmc(np.random.normal(size=(walkers, dim)), warmup)
sampler.reset()
begin = time.perf_counter()
sampler.run_mcmc(state, steps)
spent = time.perf_counter() - begin
np.savez(place, chain=sampler.get_chain(), log_prob=sampler.get_log_prob())
print(spent)
"#;

fn emcee(rival: &Rival, moves: &str) -> (Draws, f64) {
    let place = fresh("chain.npz");
    let numbers = [WALKERS, WARMUP, DRAWS / WALKERS, DIM].map(|n| n.to_string());
    let end = python()
        .args(["-c", EMCEE, place.to_str().unwrap(), moves, rival.numpy])
        .args(numbers)
        .env("OMP_NUM_THREADS", "1")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&end.stderr);
    assert!(end.status.success(), "{said}");
    let spent = String::from_utf8(end.stdout).unwrap();
    let draws = read_npz(&place).unwrap().with_walkers(WALKERS).unwrap();
    (draws, spent.trim().parse().unwrap())
}

/// The default sampler's moments are those of the density in their standard errors, and it has more effective draws for an evaluation than
/// any of the others.
#[test]
#[ignore = "needs Python"]
fn the_default_beside_hammer_and_sample_and_emcee() {
    for rival in &RIVALS {
        let programs = [
            ("plychain, default", ours(rival)),
            ("hammer-and-sample, stretch", hammer(rival, true)),
            ("hammer-and-sample, DE", hammer(rival, false)),
            ("emcee, stretch", emcee(rival, "stretch")),
            ("emcee, DE", emcee(rival, "de")),
        ];
        println!("{}", rival.name);
        let mut shares = Vec::new();
        for (program, (draws, spent)) in &programs {
            assert!(draws.len() >= DRAWS - WALKERS, "{program}: {}", draws.len());
            let verdict = diagnose(draws, &Rule::default());
            let ess = verdict.ess_bulk_min();
            let share = ess / draws.len() as f64;
            println!(
                "| {program} | {share:.3} | {:.2e} | {:.0} |",
                ess / spent,
                1e9 * spent / draws.len() as f64
            );
            shares.push(share);
            // symmetric but for the second of a bent pair, whose mean is the variance of the first
            for (k, row) in verdict.rows.iter().enumerate() {
                let mean = f64::from(u8::from(
                    rival.name.starts_with("bent") && k % 2 == 1 && k < 4,
                ));
                let z = (row.mean - mean) / row.mcse_mean;
                assert!(shares.len() > 1 || z.abs() < 5.0, "{program}, x{k}: {z}");
            }
        }
        let best = shares[1..].iter().copied().fold(0.0, f64::max);
        assert!(shares[0] > best, "{shares:?}");
    }
}
