//! What one log posterior of the default model costs, and what the default mixture and every move alone make of it, with one thread and
//! with two: `cargo bench --bench default_model`.

use std::cell::Cell;
use std::hint::black_box;
use std::time::Instant;

use plychain::chain::Draws;
use plychain::diagnose::{Rule, diagnose};
use plychain::identify::{inverse_problem, prepare, start};
use plychain::infer::Model;
use plychain::posterior::PosteriorDensity;
use plychain::progress::Silent;
use plychain::sample::{
    Ensemble, Laplace, LogDensity, MOVES, Mixture, Monitor, Outcome, Phase, PhaseReport, Sampler,
    Schedule, Start, Stop, run,
};

const MODEL: &str = "models/openhole.json";

/// Draws of each sampler: of fewer, the first touch of memory is a larger part of the time.
const DRAWS: usize = 2_000_000;

/// Seeds, for each of which four runs with one thread and with two are timed; the fastest counts.
const REPEAT: u64 = 5;

fn main() {
    let model = Model::load_with(MODEL.as_ref(), None).unwrap();
    let prepared = prepare(&model, &Silent).unwrap();
    let posterior = inverse_problem(&model, prepared, &Silent)
        .unwrap()
        .posed
        .density;
    let normal = start(&posterior).unwrap();
    cost(&posterior, &cloud(&normal, 64));
    println!(
        "min ESS/s: of the bulk over all parameters, a second of sampling without warm-up that holds {} draws at most",
        Schedule::default().memory
    );
    for (name, sampler) in samplers() {
        let timing = Timing {
            posterior: &posterior,
            sampler: &*sampler,
            normal: &normal,
        };
        let runs: Vec<Measured> = (0..REPEAT).map(|seed| timing.measure(seed)).collect();
        show(name, &runs);
    }
}

const DEFAULT: &str = "default mixture";

/// The default mixture, and every move alone.
fn samplers() -> Vec<(&'static str, Box<dyn Sampler>)> {
    let mut all: Vec<(&str, Box<dyn Sampler>)> = vec![(DEFAULT, Box::new(Ensemble::default()))];
    for build in MOVES {
        let name = build().name();
        let alone = Ensemble {
            mixture: Mixture::new(vec![(build(), 1.0)]).unwrap(),
            ..Ensemble::default()
        };
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

fn cost(posterior: &PosteriorDensity, whole: &[f64]) {
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
    let batched = time(&mut || {
        posterior
            .values(black_box(whole), black_box(&mut together))
            .unwrap()
    });
    let single = time(&mut || {
        for (x, out) in points.chunks_exact(dim).zip(&mut alone) {
            *out = posterior.value(black_box(x)).unwrap();
        }
        black_box(&alone);
    });
    let same = together
        .iter()
        .zip(&alone)
        .all(|(a, b)| a.to_bits() == b.to_bits());
    println!(
        "one log posterior of {dim} parameters: {batched:.1} ns in batches of {count}, {single:.1} ns alone ({}), {}",
        vectors(),
        if same { "the same bits" } else { "OTHER BITS" }
    );
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
}

/// Others may be at work on the machine: the fastest run is the least disturbed.
fn show(name: &str, runs: &[Measured]) {
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
    println!(
        "  {name:22} {:.3e} one thread, {:5.1} ns a step; {:.2} x with two threads, {same}",
        mean(&|m| m.ess) / one,
        1e9 * one / mean(&|m| m.draws),
        one / two,
    );
}

/// Runs with one thread and with two, of each seed.
const PAIRS: usize = 4;

/// Steps before the clock starts.
const WARMUP: usize = 1000;

/// What is timed.
struct Timing<'a> {
    posterior: &'a PosteriorDensity,
    sampler: &'a dyn Sampler,
    normal: &'a Laplace,
}

impl Timing<'_> {
    fn measure(&self, seed: u64) -> Measured {
        // As every run holds them; one after the other, so that what else the machine does meets both. They take a
        // twentieth of the time of the diagnosis: several find a quiet moment.
        let usual = Schedule::default().memory;
        let (mut seconds, mut same) = ([f64::INFINITY; 2], true);
        for _ in 0..PAIRS {
            let (one, alone) = self.timed(seed, 1, usual);
            let (two, together) = self.timed(seed, 2, usual);
            same &= one == two;
            seconds = [seconds[0].min(alone), seconds[1].min(together)];
        }
        let (all, _) = self.timed(seed, 2, usize::MAX);
        Measured {
            seconds,
            same,
            ess: diagnose(&all.draws, &Rule::default()).ess_bulk_min(),
            draws: all.draws.len() as f64,
        }
    }

    /// A run by that many threads that holds at most `memory` draws, and the seconds after warm-up that it took.
    fn timed(&self, seed: u64, threads: usize, memory: usize) -> (Outcome, f64) {
        let schedule = Schedule {
            seed,
            warmup: Some(WARMUP),
            thin: Some(1),
            max_draws: DRAWS,
            growth: 1e9,
            memory,
            ..Schedule::default()
        };
        let start = Start::Ball {
            centre: &self.normal.mode,
            covariance: &self.normal.covariance,
            spread: 1.0,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let clock = Clock(Cell::new(Instant::now()));
            let outcome = run(
                self.posterior,
                self.sampler,
                &start,
                &schedule,
                &Never,
                &clock,
            );
            (outcome.unwrap(), clock.0.get().elapsed().as_secs_f64())
        })
    }
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
