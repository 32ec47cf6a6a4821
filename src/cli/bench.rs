//! `plychain bench`: what one log posterior costs, and what the samplers make of it; of the default model, or of a
//! tabulated posterior with known answers.

use std::cell::Cell;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::console::Console;
use super::{DEFAULT_MODEL, Global, cache, print};
use crate::chain::Draws;
use crate::diagnose::{Row, Rule, diagnose};
use crate::error::{Error, Result};
use crate::identify::{inverse_problem, prepare, start};
use crate::infer::{Model, Posterior, Tabulated, TabulatedMoments, TestPoint};
use crate::sample::{
    Ensemble, MOVES, Mixture, Monitor, Outcome, Phase, PhaseReport, Sampler, Schedule, Start, Stop,
};
use crate::sample::{Laplace, LogDensity, laplace};

/// Arguments of `bench`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain bench
  plychain bench --draws 500000 --repeat 1")]
pub struct BenchArguments {
    /// Tabulated posterior (default: the posterior of models/openhole.json)
    file: Option<PathBuf>,
    /// Draws of each sampler (of fewer, the first touch of memory is a larger part of the time)
    #[arg(long, default_value_t = 2_000_000)]
    draws: usize,
    /// Seeds, for each of which four runs with one thread and with two are timed; the fastest counts
    #[arg(long, default_value_t = 5)]
    repeat: usize,
}

pub fn run(arguments: &BenchArguments, global: &Global, console: &Console) -> Result<()> {
    let (posterior, normal, known) = match &arguments.file {
        Some(path) => tabulated(&Tabulated::load(path)?)?,
        None => {
            let model = Model::load_with(DEFAULT_MODEL.as_ref(), None)?;
            let prepared = prepare(&model, &cache(), console)?;
            let posterior = inverse_problem(&model, prepared, console)?.posterior;
            let normal = start(&posterior)?;
            (posterior, normal, None)
        }
    };
    cost(&posterior, &cloud(&normal, 64))?;
    print(&format!(
        "min ESS/s: of the bulk over all parameters, a second of sampling without warm-up that holds {} draws at most\n",
        Schedule::default().memory
    ))?;
    for (name, sampler) in samplers() {
        let known = known.as_ref().filter(|_| name == DEFAULT);
        let runs = (0..arguments.repeat.max(1) as u64)
            .map(|k| {
                let seed = global.seed + k;
                measure(&posterior, &*sampler, &normal, arguments.draws, seed)
            })
            .collect::<Result<Vec<_>>>()?;
        show(name, &runs, known)?;
    }
    Ok(())
}

/// The posterior of a table, its normal approximation, and its moments where they are known, after a comparison with the
/// table's own points.
fn tabulated(table: &Tabulated) -> Result<(Posterior, Laplace, Option<TabulatedMoments>)> {
    let posterior = table.posterior();
    let (centre, sd) = posterior.start();
    let normal = laplace(&posterior, &centre, &sd)?;
    let known = &table.test_points;
    let deviation = |t: &TestPoint| (posterior.log_density(&t.p) - t.logp).abs();
    let largest = known.iter().map(deviation).fold(0.0, f64::max);
    if !known.is_empty() {
        print(&format!(
            "log posterior at {} test points: largest deviation {largest:.1e}\n",
            known.len()
        ))?;
    }
    Ok((posterior, normal, table.reference.clone()))
}

const DEFAULT: &str = "default mixture";

/// The default mixture, and every move alone.
fn samplers() -> Vec<(&'static str, Box<dyn Sampler>)> {
    let mut all: Vec<(&str, Box<dyn Sampler>)> = vec![(DEFAULT, Box::new(Ensemble::default()))];
    for build in MOVES {
        let (name, alone) = (build().name(), Ensemble::with(Mixture::only(build())));
        all.push((name, Box::new(alone)));
    }
    all
}

/// Points about the mode, parameter by parameter.
fn cloud(normal: &Laplace, count: usize) -> Vec<f64> {
    let dim = normal.mode.len();
    let at = |k: usize, i: usize| {
        let phase = ((i * 7 + k * 3) % 29) as f64 / 29.0 - 0.5;
        normal.mode[k] + 3.0 * normal.covariance[k * dim + k].sqrt() * phase
    };
    (0..dim)
        .flat_map(|k| (0..count).map(move |i| at(k, i)))
        .collect()
}

fn cost(posterior: &Posterior, whole: &[f64]) -> Result<()> {
    let dim = posterior.dim();
    let count = whole.len() / dim;
    let points: Vec<f64> = (0..count)
        .flat_map(|i| whole.iter().skip(i).step_by(count).copied())
        .collect();
    let (mut together, mut alone) = (vec![0.0; count], vec![0.0; count]);
    let time = |work: &mut dyn FnMut()| {
        let times = (0..25).map(|_| {
            let start = Instant::now();
            (0..400).for_each(|_| work());
            start.elapsed().as_secs_f64() * 1e9 / (400 * count) as f64
        });
        // Others may be at work on the machine: the fastest run is the least disturbed.
        times.fold(f64::INFINITY, f64::min)
    };
    let batched =
        time(&mut || posterior.log_density_batch(black_box(whole), black_box(&mut together)));
    let single = time(&mut || {
        for (x, out) in points.chunks_exact(dim).zip(&mut alone) {
            *out = posterior.log_density(black_box(x));
        }
        black_box(&alone);
    });
    let same = together
        .iter()
        .zip(&alone)
        .all(|(a, b)| a.to_bits() == b.to_bits());
    print(&format!(
        "one log posterior of {dim} parameters: {batched:.1} ns in batches of {count}, {single:.1} ns alone ({}), {}\n",
        vectors(),
        if same { "the same bits" } else { "OTHER BITS" }
    ))
}

/// The vector instructions in use.
fn vectors() -> String {
    let name = format!("{:?}", pulp::Arch::new());
    match name.split('(').next() {
        Some("V4") => "AVX-512".into(),
        Some("V3") => "AVX2".into(),
        other => other.unwrap_or_default().to_lowercase(),
    }
}

/// What the runs of one seed took with one thread and with two, and what they drew.
struct Measured {
    seconds: [f64; 2],
    /// Whether the threads made no difference to the draws and where they ended.
    same: bool,
    ess: f64,
    draws: f64,
    rows: Vec<Row>,
}

impl Measured {
    fn deviation(&self, known: &TabulatedMoments) -> f64 {
        let rows = self.rows.iter().zip(known.mean.iter().zip(&known.sd));
        rows.map(|(row, (mean, sd))| {
            let mean = (row.mean - mean).abs() / row.mcse_mean;
            mean.max((row.sd - sd).abs() / row.mcse_sd)
        })
        .fold(0.0, f64::max)
    }
}

/// Others may be at work on the machine: the fastest run is the least disturbed.
fn show(name: &str, runs: &[Measured], known: Option<&TabulatedMoments>) -> Result<()> {
    let least = |threads: usize| {
        let seconds = runs.iter().map(|m| m.seconds[threads]);
        seconds.fold(f64::INFINITY, f64::min)
    };
    let mean = |f: &dyn Fn(&Measured) -> f64| runs.iter().map(f).sum::<f64>() / runs.len() as f64;
    let [one, two] = [0, 1].map(least);
    let same = if runs.iter().all(|m| m.same) {
        "the same draws"
    } else {
        "OTHER DRAWS"
    };
    print(&format!(
        "  {name:22} {:.3e} one thread, {:5.1} ns a step; {:.2} x with two threads, {same}\n",
        mean(&|m| m.ess) / one,
        1e9 * one / mean(&|m| m.draws),
        one / two,
    ))?;
    if let (Some(known), Some(first)) = (known, runs.first()) {
        print(&format!(
            "  {:22} {:.2} largest deviation of mean or sd from the reference, MCSE\n",
            "",
            first.deviation(known)
        ))?;
    }
    Ok(())
}

/// Runs with one thread and with two, of each seed.
const PAIRS: usize = 4;

/// Steps before the clock starts.
const WARMUP: usize = 1000;

fn measure(
    posterior: &Posterior,
    sampler: &dyn Sampler,
    normal: &Laplace,
    draws: usize,
    seed: u64,
) -> Result<Measured> {
    let run = |threads, memory| timed(posterior, sampler, normal, draws, seed, threads, memory);
    // As every run holds them; one after the other, so that what else the machine does meets both. They take a
    // twentieth of the time of the diagnosis: several find a quiet moment.
    let usual = Schedule::default().memory;
    let (mut seconds, mut same) = ([f64::INFINITY; 2], true);
    for _ in 0..PAIRS {
        let (one, alone) = run(1, usual)?;
        let (two, together) = run(2, usual)?;
        same &= one == two;
        seconds = [seconds[0].min(alone), seconds[1].min(together)];
    }
    let (all, _) = run(2, usize::MAX)?;
    let verdict = diagnose(&all.draws, &Rule::default());
    Ok(Measured {
        seconds,
        same,
        ess: verdict.ess_bulk_min(),
        draws: all.draws.len() as f64,
        rows: verdict.rows,
    })
}

/// A run by that many threads that holds at most `memory` draws, and the seconds after warm-up that it took.
fn timed(
    posterior: &Posterior,
    sampler: &dyn Sampler,
    normal: &Laplace,
    draws: usize,
    seed: u64,
    threads: usize,
    memory: usize,
) -> Result<(Outcome, f64)> {
    let schedule = Schedule {
        seed,
        warmup: Some(WARMUP),
        thin: Some(1),
        max_draws: draws,
        growth: 1e9,
        memory,
        ..Schedule::default()
    };
    let start = Start::Ball {
        centre: &normal.mode,
        covariance: &normal.covariance,
        spread: 1.0,
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::program("bench", "a thread pool").found(e))?;
    pool.install(|| {
        let clock = Clock(Cell::new(Instant::now()));
        let outcome = crate::sample::run(posterior, sampler, &start, &schedule, &Never, &clock)?;
        Ok((outcome, clock.0.get().elapsed().as_secs_f64()))
    })
}

/// Runs to the most draws.
struct Never;

impl Stop for Never {
    fn settled(&self, _window: &Draws) -> Option<usize> {
        Some(1)
    }

    fn fallback(&self, _window: &Draws) -> usize {
        1
    }

    fn enough(&self, _draws: &Draws) -> bool {
        false
    }
}

/// Starts when warm-up ends.
struct Clock(Cell<Instant>);

impl Monitor for Clock {
    fn report(&self, report: &PhaseReport) -> bool {
        if report.phase == Phase::Warmup {
            // The last report of warm-up counts.
            self.0.set(Instant::now());
        }
        true
    }
}
