//! `plychain bench`: what one log posterior costs, and what the samplers make of it.

use std::cell::Cell;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::{Global, print};
use crate::chain::Draws;
use crate::diagnose::{Row, Rule, diagnose};
use crate::error::{Error, Result};
use crate::infer::{LogDensity, Moments, Posterior, Tabulated, laplace};
use crate::sample::{
    De, Ensemble, Mixture, Monitor, Outcome, Phase, Report, Sampler, Schedule, Start, Stop, Stretch,
};

/// Arguments of `bench`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain bench --draws 500000 --repeat 1")]
pub struct Arguments {
    /// Tabulated posterior (default: a small synthetic one)
    file: Option<PathBuf>,
    /// Draws of each sampler (of fewer, the first touch of memory is a larger part of the time)
    #[arg(long, default_value_t = 2_000_000)]
    draws: usize,
    /// Seeds, for each of which four runs with one thread and with two are timed; the fastest counts
    #[arg(long, default_value_t = 5)]
    repeat: usize,
}

/// Run the verb.
pub fn run(arguments: &Arguments, global: &Global) -> Result<()> {
    let table = match &arguments.file {
        Some(path) => Tabulated::load(path)?,
        None => Tabulated::synthetic()?,
    };
    let posterior = table.posterior();
    let start = Point::of(&posterior)?;
    agreement(&table, &posterior, &start)?;
    cost(&posterior, &start)?;
    print(&format!(
        "min ESS/s: of the bulk over all parameters, a second of sampling without warm-up that holds {} draws at most\n",
        Schedule::default().memory
    ))?;
    for (name, sampler) in samplers() {
        let known = table.reference.as_ref().filter(|_| name == DEFAULT);
        let runs = (0..arguments.repeat.max(1) as u64)
            .map(|k| {
                let seed = global.seed + k;
                measure(&posterior, &*sampler, &start, arguments.draws, seed)
            })
            .collect::<Result<Vec<_>>>()?;
        show(name, &runs, known)?;
    }
    Ok(())
}

const DEFAULT: &str = "default mixture";

fn samplers() -> Vec<(&'static str, Box<dyn Sampler>)> {
    let stretch = |walkers| Ensemble {
        mixture: Mixture::only(Box::new(Stretch::default())),
        walkers: Some(walkers),
    };
    vec![
        (DEFAULT, Box::new(Ensemble::default())),
        ("stretch, 32 walkers", Box::new(stretch(32))),
        ("stretch, 64 walkers", Box::new(stretch(64))),
        (
            "DE",
            Box::new(Ensemble::with(Mixture::only(Box::new(De::default())))),
        ),
    ]
}

/// Where chains start.
struct Point {
    mode: Vec<f64>,
    covariance: Vec<f64>,
    sd: Vec<f64>,
}

impl Point {
    fn of(posterior: &Posterior) -> Result<Self> {
        let (centre, sd) = posterior.start();
        let normal = laplace(posterior, &centre, &sd)?;
        let dim = centre.len();
        Ok(Self {
            sd: (0..dim)
                .map(|k| normal.covariance[k * dim + k].sqrt())
                .collect(),
            mode: normal.mode,
            covariance: normal.covariance,
        })
    }

    /// Points about the mode, row by row.
    fn cloud(&self, count: usize) -> Vec<f64> {
        let mut points = Vec::with_capacity(count * self.mode.len());
        for i in 0..count {
            for (k, (m, s)) in self.mode.iter().zip(&self.sd).enumerate() {
                let phase = ((i * 7 + k * 3) % 29) as f64 / 29.0 - 0.5;
                points.push(m + 3.0 * s * phase);
            }
        }
        points
    }
}

/// Points row by row, parameter by parameter.
fn columns(points: &[f64], dim: usize) -> Vec<f64> {
    let column = |k: usize| points.iter().skip(k).step_by(dim).copied();
    (0..dim).flat_map(column).collect()
}

fn agreement(table: &Tabulated, posterior: &Posterior, start: &Point) -> Result<()> {
    let worst = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        points.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    if !table.test_points.is_empty() {
        let known = &table.test_points;
        let largest = worst(&mut known.iter().map(|t| (posterior.log_density(&t.p), t.logp)));
        print(&format!(
            "log posterior at {} test points: largest deviation {largest:.1e}\n",
            known.len()
        ))?;
    }
    let cloud = start.cloud(64);
    let points = cloud.chunks_exact(posterior.dim());
    let dense = worst(
        &mut points
            .clone()
            .map(|x| (posterior.log_density(x), table.dense(x))),
    );
    let mut batch = vec![0.0; 64];
    posterior.log_density_batch(&columns(&cloud, posterior.dim()), &mut batch);
    let same = points
        .zip(&batch)
        .all(|(x, v)| posterior.log_density(x).to_bits() == v.to_bits());
    print(&format!(
        "against the formula with a dense covariance: {dense:.1e}; batch and single to the same bits: {}\n",
        if same { "yes" } else { "NO" }
    ))
}

fn cost(posterior: &Posterior, start: &Point) -> Result<()> {
    let (count, dim) = (64, posterior.dim());
    let cloud = start.cloud(count);
    let whole = columns(&cloud, dim);
    let halves: Vec<Vec<f64>> = cloud.chunks(32 * dim).map(|c| columns(c, dim)).collect();
    let mut out = vec![0.0; count];
    let time = |work: &mut dyn FnMut()| {
        let times = (0..25).map(|_| {
            let start = Instant::now();
            (0..400).for_each(|_| work());
            start.elapsed().as_secs_f64() * 1e9 / (400 * count) as f64
        });
        // Others may be at work on the machine: the fastest run is the least disturbed.
        times.fold(f64::INFINITY, f64::min)
    };
    let batched = time(&mut || {
        posterior.log_density_batch(std::hint::black_box(&whole), std::hint::black_box(&mut out));
    });
    let half = time(&mut || {
        for (xs, out) in halves.iter().zip(out.chunks_mut(32)) {
            posterior.log_density_batch(std::hint::black_box(xs), std::hint::black_box(out));
        }
    });
    let single = time(&mut || {
        for (x, out) in cloud.chunks_exact(dim).zip(&mut out) {
            *out = posterior.log_density(std::hint::black_box(x));
        }
        std::hint::black_box(&out);
    });
    print(&format!(
        "one log posterior: {batched:.1} ns in batches of 64, {half:.1} ns of 32, {single:.1} ns alone ({})\n",
        vectors()
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
    fn deviation(&self, known: &Moments) -> f64 {
        let rows = self.rows.iter().zip(known.mean.iter().zip(&known.sd));
        rows.map(|(row, (mean, sd))| {
            let mean = (row.mean - mean).abs() / row.mcse_mean;
            mean.max((row.sd - sd).abs() / row.mcse_sd)
        })
        .fold(0.0, f64::max)
    }
}

/// Others may be at work on the machine: the fastest run is the least disturbed.
fn show(name: &str, runs: &[Measured], known: Option<&Moments>) -> Result<()> {
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
    start: &Point,
    draws: usize,
    seed: u64,
) -> Result<Measured> {
    let run = |threads, memory| timed(posterior, sampler, start, draws, seed, threads, memory);
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
    start: &Point,
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
        centre: &start.mode,
        covariance: &start.covariance,
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
    fn report(&self, report: &Report) -> bool {
        if report.phase == Phase::Warmup {
            // The last report of warm-up counts.
            self.0.set(Instant::now());
        }
        true
    }
}
