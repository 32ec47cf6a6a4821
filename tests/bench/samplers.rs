//! Our samplers beside `hammer-and-sample` on one posterior, in one run and on one thread.
//!
//! `cargo bench --bench samplers`: the tabulated posterior beside this file. The other program gets the faster of two
//! evaluations of one point: the plain formula below, with vectors over the eight coordinates, and ours.
//!
//! On one core of a shared Zen 4 machine (AVX-512), with the kernel that served this table alone before there was one for all
//! posteriors: the default mixture gave 5.6 times the effective draws a second of `hammer-and-sample`'s differential evolution,
//! ours alone 2.1 times, stretch 2.3 to 2.5 times; one log posterior took 15 ns in a batch (16.5 with AVX2) and 59 to 67 ns
//! alone, where a formula written out for it took 44 to 58.
//!
//! Then the posterior to quote of a loop over the default test on a coarse mesh, whose density costs a tenth of a millisecond: the
//! constants of 35 dimensions, what enters linearly being integrated out. Beside other work on two such cores: 5.2 and 1.8 times on the table
//! (mixture, stretch), 48 and 8 to 15 times on the posterior to quote, of which batches make a factor of ten.

#[path = "../common/tabulated.rs"]
#[allow(dead_code)]
mod tabulated;

use std::cell::Cell;
use std::hint::black_box;
use std::time::Instant;

use hammer_and_sample as other;
use plychain::chain::Draws;
use plychain::diagnose::{Rule, diagnose};
use plychain::identify::Options;
use plychain::identify::doubts::Doubting;
use plychain::infer::Model;
use plychain::progress::Silent;
use plychain::sample::{
    De, Ensemble, Key, Mixture, Monitor, Phase, PhaseReport, Sampler, Schedule, Start, Stop,
    Stream, Stretch, run,
};
use plychain::sample::{LogDensity, laplace};
use plychain::trace::explain;
use pulp::{Simd, WithSimd};
use tabulated::{Tabulated, TabulatedPosterior};

const DRAWS: usize = 1_000_000;
const WARMUP: usize = 1000;
const QUOTED_DRAWS: usize = 20_000;
const REPEAT: u64 = 5;

fn main() {
    let posterior = Tabulated::load().posterior();
    let plain = Plain::new(&posterior.table);
    let start = starts(&posterior, 64);
    for x in &start {
        let (a, b) = (
            posterior.value(x).unwrap(),
            other::Model::log_prob(&plain, x),
        );
        assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{a} {b}");
    }
    let plain = Either {
        ours: costs(&posterior, &plain, &start).then_some(&posterior),
        plain: &plain,
    };
    println!(
        "min bulk ESS a second of processor time, one thread, without warm-up; best of {REPEAT}"
    );
    compare(&plain, &posterior, &start, DRAWS);
    quoted();
}

/// The same of the last round of a loop.
fn quoted() {
    let text = std::fs::read_to_string("models/openhole.json").unwrap();
    let mut file: serde_json::Value = serde_json::from_str(&text).unwrap();
    file["experiments"][0]["mesh_density"] = 0.3.into();
    let model = Model::parse(&file.to_string(), "models/openhole.json".as_ref()).unwrap();
    let sampler = Ensemble::default();
    let options = |_| Options {
        sampler: &sampler,
        schedule: Schedule::default(),
        rule: Rule::default(),
        keeping: None,
        deadline: None,
        doubting: Doubting::Unasked,
    };
    let closed = explain(&model, 3, &options, &Silent).unwrap();
    println!("the last round of a loop");
    let last = &closed.rounds[closed.rounds.len() - 1];
    let density = last.identification.inverse.posed.density.clone();
    let (centre, sd) = density.start();
    let key = Key {
        seed: 1,
        ensemble: 0,
    };
    let point = |walker| {
        let mut rng = Stream::at(key, walker, 0);
        [0, 1, 2, 3].map(|k: usize| centre[k] + 0.5 * sd[k] * rng.normal())
    };
    let start: Vec<[f64; 4]> = (0..64).map(point).collect();
    compare(&Any(&density), &density, &start, QUOTED_DRAWS);
}

/// Their samplers on `plain` beside ours on the same density.
fn compare<M: other::Model<Params = [f64; 4]>>(
    plain: &M,
    posterior: &dyn LogDensity,
    start: &[[f64; 4]],
    draws: usize,
) {
    let theirs = [
        ("stretch, 32 walkers", 32, true),
        ("stretch, 64 walkers", 64, true),
        ("DE, 64 walkers", 64, false),
    ]
    .map(|(name, walkers, stretch)| {
        let best = best(|seed| hammer(plain, &start[..walkers], stretch, seed, draws));
        println!("  hammer-and-sample {name:22} {best}");
        best.rate
    });
    for (name, sampler, rival) in ours() {
        let best = best(|seed| plychain(posterior, start, &*sampler, seed, draws));
        println!(
            "  plychain          {name:22} {best}, {:.2} x theirs",
            best.rate / theirs[rival]
        );
    }
}

/// Our samplers, and which of theirs each is held against.
fn ours() -> Vec<(&'static str, Box<dyn Sampler>, usize)> {
    let stretch = |walkers| Ensemble {
        mixture: Mixture::new(vec![(Box::new(Stretch::default()), 1.0)]).unwrap(),
        walkers: Some(walkers),
    };
    let de = Ensemble {
        mixture: Mixture::new(vec![(Box::new(De::default()), 1.0)]).unwrap(),
        ..Ensemble::default()
    };
    vec![
        ("default mixture", Box::new(Ensemble::default()), 2),
        ("DE, 64 walkers", Box::new(de), 2),
        ("stretch, 32 walkers", Box::new(stretch(32)), 0),
        ("stretch, 64 walkers", Box::new(stretch(64)), 1),
    ]
}

/// Nanoseconds that this process has run on a processor, so that others on the machine do not count; wall time where
/// the system does not tell.
fn clock() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten();
    let spent = tasks.filter_map(|task| {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    });
    let spent: f64 = spent.sum();
    thread_local!(static ORIGIN: Instant = Instant::now());
    if spent > 0.0 {
        spent
    } else {
        ORIGIN.with(|o| o.elapsed().as_secs_f64() * 1e9)
    }
}

struct Speed {
    rate: f64,
    step: f64,
}

impl std::fmt::Display for Speed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3e} ESS/s, {:6.1} ns a step", self.rate, self.step)
    }
}

fn best(measure: impl Fn(u64) -> (Draws, f64)) -> Speed {
    let runs = (1..=REPEAT).map(|seed| {
        let (draws, spent) = measure(seed);
        let ess = diagnose(&draws, &Rule::default()).ess_bulk_min();
        Speed {
            rate: ess / spent * 1e9,
            step: spent / draws.len() as f64,
        }
    });
    runs.max_by(|a, b| a.rate.total_cmp(&b.rate)).unwrap()
}

/// Whether our evaluation of one point is the faster one.
fn costs(posterior: &TabulatedPosterior, plain: &Plain, points: &[[f64; 4]]) -> bool {
    let columns: Vec<f64> = (0..4)
        .flat_map(|k| points.iter().map(move |x| x[k]))
        .collect();
    let mut out = vec![0.0; points.len()];
    let time = |work: &mut dyn FnMut()| {
        let times = (0..200).map(|_| {
            let begin = Instant::now();
            (0..100).for_each(|_| work());
            begin.elapsed().as_secs_f64() * 1e7 / points.len() as f64
        });
        times.fold(f64::INFINITY, f64::min)
    };
    let batched = time(&mut || posterior.values(black_box(&columns), &mut out).unwrap());
    let alone = time(&mut || {
        for x in points {
            black_box(other::Model::log_prob(plain, black_box(x)));
        }
    });
    let ours = time(&mut || {
        for x in points {
            black_box(posterior.value(black_box(x)).unwrap());
        }
    });
    println!(
        "one log posterior: {batched:.1} ns batched, {ours:.1} ns alone; {alone:.1} ns alone by the plain formula"
    );
    ours < alone
}

/// Points of the normal approximation at the mode.
fn starts(posterior: &TabulatedPosterior, count: u64) -> Vec<[f64; 4]> {
    let (centre, sd) = posterior.start();
    let normal = laplace(posterior, &centre, &sd).unwrap();
    let key = Key {
        seed: 1,
        ensemble: 0,
    };
    let sd = [0, 1, 2, 3].map(|k: usize| normal.covariance[5 * k].sqrt());
    let point = |walker| {
        let mut rng = Stream::at(key, walker, 0);
        [0, 1, 2, 3].map(|k: usize| normal.mode[k] + sd[k] * rng.normal())
    };
    (0..count).map(point).collect()
}

fn hammer<M: other::Model<Params = [f64; 4]>>(
    model: &M,
    start: &[[f64; 4]],
    stretch: bool,
    seed: u64,
    draws: usize,
) -> (Draws, f64) {
    let walkers = start.len();
    let go = |start: &[[f64; 4]], draws: usize, seed: u64| {
        let key = Key { seed, ensemble: 99 };
        let with_rng = start.iter().enumerate().map(|(k, x)| {
            let seed = Stream::at(key, k as u64, 0).bits();
            (*x, rand_pcg::Pcg64Mcg::new(u128::from(seed)))
        });
        let length = other::MinChainLen(draws);
        if stretch {
            other::sample(
                model,
                &other::Stretch::default(),
                with_rng,
                length,
                other::Serial,
            )
            .0
        } else {
            let gamma = 2.38 / 8.0_f64.sqrt();
            let de = other::DifferentialEvolution::new(gamma, 1e-5);
            other::sample(model, &de, with_rng, length, other::Serial).0
        }
    };
    let warm = go(start, WARMUP.min(draws / walkers / 4) * walkers, 2 * seed);
    let begin = clock();
    let chain = go(&warm[warm.len() - walkers..], draws, 2 * seed + 1);
    let spent = clock() - begin;
    let draws = chain.len() / walkers;
    let order = (0..walkers).flat_map(|w| (0..draws).map(move |d| d * walkers + w));
    let values = order.flat_map(|at| chain[at]).collect();
    let names = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"].map(String::from);
    let draws = Draws::new(
        names.to_vec(),
        vec![0; walkers],
        values,
        vec![0.0; draws * walkers],
    );
    (draws.unwrap(), spent)
}

fn plychain(
    posterior: &dyn LogDensity,
    start: &[[f64; 4]],
    sampler: &dyn Sampler,
    seed: u64,
    draws: usize,
) -> (Draws, f64) {
    let moment = |k: usize| {
        let n = start.len() as f64;
        let mean = start.iter().map(|x| x[k]).sum::<f64>() / n;
        let square = start.iter().map(|x| (x[k] - mean).powi(2)).sum::<f64>();
        (mean, square / n)
    };
    let moments = [0, 1, 2, 3].map(moment);
    let centre = moments.map(|m| m.0);
    let mut covariance = vec![0.0; 16];
    (0..4).for_each(|k| covariance[5 * k] = moments[k].1);
    let start = Start::Ball {
        centre: &centre,
        covariance: &covariance,
        spread: 1.0,
    };
    let schedule = Schedule {
        seed,
        warmup: Some(WARMUP.min(draws / 256)),
        thin: Some(1),
        max_draws: draws,
        growth: 1e9,
        memory: usize::MAX,
        ..Schedule::default()
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    pool.install(|| {
        let progress = Progress(Cell::new(clock()));
        let draws = run(posterior, sampler, &start, &schedule, &Never, &progress)
            .unwrap()
            .draws;
        (draws, clock() - progress.0.get())
    })
}

/// Never satisfied.
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
struct Progress(Cell<f64>);

impl Monitor for Progress {
    fn report(&self, report: &PhaseReport) -> bool {
        if report.phase == Phase::Warmup {
            self.0.set(clock());
        }
        true
    }
}

/// Any density, for them.
struct Any<'a>(&'a dyn LogDensity);

impl other::Model for Any<'_> {
    type Params = [f64; 4];

    fn log_prob(&self, x: &[f64; 4]) -> f64 {
        self.0.value(x).unwrap()
    }
}

/// The posterior for one point: eight coordinates side by side, four partial sums, nothing but arrays.
struct Plain {
    mid: [f64; 4],
    per_half: [f64; 4],
    mean: [[f64; 8]; 35],
    slope: [[f64; 8]; 15],
    measured: [f64; 8],
    prior: [[f64; 2]; 4],
    constant: f64,
}

impl Plain {
    fn new(table: &Tabulated) -> Self {
        let mut exponents = vec![[0_u8; 4]];
        let mut from = 0;
        for _degree in 0..3 {
            let to = exponents.len();
            for lower in from..to {
                let first = (0..4).rev().find(|&k| exponents[lower][k] > 0).unwrap_or(0);
                for variable in first..4 {
                    let mut e = exponents[lower];
                    e[variable] += 1;
                    exponents.push(e);
                }
            }
            from = to;
        }
        let z = (table.t0 - table.mid[4]) / table.half[4];
        let per_h = table.sigma_h * table.t0 / table.h0 / table.half[4];
        let (mut mean, mut slope) = ([[0.0; 8]; 35], [[0.0; 8]; 15]);
        for (e, c) in table.exponents.iter().zip(&table.coefficients) {
            let m = exponents.iter().position(|x| x[..] == e[..4]).unwrap();
            let t = i32::from(e[4]);
            for k in 0..8 {
                let weight = 1.0 / table.variance[k].sqrt();
                mean[m][k] += weight * c[k] * z.powi(t);
                if t > 0 {
                    slope[m][k] += weight * c[k] * f64::from(t) * z.powi(t - 1) * per_h;
                }
            }
        }
        let logs = |v: &[f64]| v.iter().map(|v| v.ln()).sum::<f64>();
        let tau = std::f64::consts::TAU.ln();
        Self {
            mid: [0, 1, 2, 3].map(|k| table.mid[k]),
            per_half: [0, 1, 2, 3].map(|k| 1.0 / table.half[k]),
            mean,
            slope,
            measured: std::array::from_fn(|k| table.alpha_measured[k] / table.variance[k].sqrt()),
            prior: std::array::from_fn(|k| [table.prior.mean[k], 1.0 / table.prior.sd[k]]),
            constant: -logs(&table.prior.sd) - 2.0 * tau,
        }
    }
}

/// The faster evaluation of one point.
struct Either<'a> {
    ours: Option<&'a TabulatedPosterior>,
    plain: &'a Plain,
}

impl other::Model for Either<'_> {
    type Params = [f64; 4];

    fn log_prob(&self, x: &[f64; 4]) -> f64 {
        match self.ours {
            Some(posterior) => posterior.value(x).unwrap(),
            None => self.plain.log_prob(x),
        }
    }
}

impl other::Model for Plain {
    type Params = [f64; 4];

    fn log_prob(&self, x: &[f64; 4]) -> f64 {
        if !(x[0] > 0.0 && x[1] > 0.0 && x[3] > 0.0 && x[2] * x[2] < x[0] / x[1]) {
            return f64::NEG_INFINITY;
        }
        pulp::Arch::new().dispatch(Evaluation(self, x))
    }
}

struct Evaluation<'a>(&'a Plain, &'a [f64; 4]);

impl WithSimd for Evaluation<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self(p, x) = self;
        let z: [f64; 4] = std::array::from_fn(|k| (x[k] - p.mid[k]) * p.per_half[k]);
        let monomials = products(&z);
        let mean = combine(simd, &p.mean, &monomials);
        let w = combine(simd, &p.slope, &monomials[..15]);
        let (mut quad, mut ww, mut wr) = (0.0, 0.0, 0.0);
        for k in 0..8 {
            let r = p.measured[k] - mean[k];
            quad += r * r;
            ww += w[k] * w[k];
            wr += w[k] * r;
        }
        let prior: f64 = (0..4)
            .map(|k| ((x[k] - p.prior[k][0]) * p.prior[k][1]).powi(2))
            .sum();
        p.constant - 0.5 * (quad - wr * wr / (1.0 + ww) + (1.0 + ww).ln() + prior)
    }
}

/// All products of up to three of `z`, in the order of [`Plain::new`].
#[inline(always)]
fn products(z: &[f64; 4]) -> [f64; 35] {
    let mut out = [1.0; 35];
    out[1..5].copy_from_slice(z);
    let (mut two, mut three) = (5, 15);
    for i in 0..4 {
        for j in i..4 {
            let product = z[i] * z[j];
            out[two] = product;
            two += 1;
            for last in &z[j..] {
                out[three] = product * last;
                three += 1;
            }
        }
    }
    out
}

/// Sum of rows times monomials, in four partial sums.
#[inline(always)]
fn combine<S: Simd>(simd: S, rows: &[[f64; 8]], monomials: &[f64]) -> [f64; 8] {
    let used = 8 / S::F64_LANES;
    let mut sums = [[simd.splat_f64s(0.0); 8]; 4];
    let add = |sum: &mut [S::f64s; 8], row: &[f64; 8], m: f64| {
        let (row, _) = S::as_simd_f64s(row);
        let m = simd.splat_f64s(m);
        for v in 0..used {
            sum[v] = simd.mul_add_e_f64s(row[v], m, sum[v]);
        }
    };
    let (rows, last_rows) = rows.as_chunks::<4>();
    let (monomials, last_monomials) = monomials.as_chunks::<4>();
    for (rows, m) in rows.iter().zip(monomials) {
        add(&mut sums[0], &rows[0], m[0]);
        add(&mut sums[1], &rows[1], m[1]);
        add(&mut sums[2], &rows[2], m[2]);
        add(&mut sums[3], &rows[3], m[3]);
    }
    for (row, m) in last_rows.iter().zip(last_monomials) {
        add(&mut sums[0], row, *m);
    }
    let mut out = [0.0; 8];
    let (vectors, _) = S::as_mut_simd_f64s(&mut out);
    for (v, out) in vectors.iter_mut().enumerate() {
        let a = simd.add_f64s(sums[0][v], sums[1][v]);
        *out = simd.add_f64s(a, simd.add_f64s(sums[2][v], sums[3][v]));
    }
    out
}
