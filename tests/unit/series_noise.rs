//! The noise of a load series, from simulated frames of known noise: white pixels averaged through a subset, smooth patterns, a
//! reference picture common to all frames, frames of different scales.

mod rivals;

use nalgebra::{DMatrix, DVector};
use plychain::error::Blame;
use plychain::field::Blocks;
use plychain::field::places::BlockPoints;
use plychain::noise::series::{
    At, Frames, Growth, SeriesNoise, Setting, settings, steps, subset_covariance,
};
use plychain::noise::{Matern, matern_pair};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Four loads and the frame after unloading.
const LOADS: [f64; 5] = [0.25, 0.5, 0.75, 1.0, 0.0];
/// Sd of a point's noise in u1 and u2, mm.
const SD: [f64; 2] = [20e-6, 35e-6];
const SUBSET: f64 = 2.0;
const STEP: f64 = 0.5;
/// Pixels a step.
const FINE: usize = 5;

fn normal(rng: &mut Pcg64) -> f64 {
    rng.sample(StandardNormal)
}

/// A window with a hole, measured on a lattice, in blocks of some points.
struct Window {
    blocks: Blocks,
    /// Row and column of the points of each block.
    sites: Vec<Vec<[usize; 2]>>,
    /// Points along a side.
    side: usize,
}

impl Window {
    /// Of `side` x `side` points, about a hole of 3 mm radius where `hole`, in blocks of `per` x `per` points.
    fn new(side: usize, per: usize, hole: bool) -> Self {
        let at = |i: usize| (i as f64 - 0.5 * (side as f64 - 1.0)) * STEP;
        let mut sites = Vec::new();
        for row in (0..side).step_by(per) {
            for column in (0..side).step_by(per) {
                let inside = |[i, j]: &[usize; 2]| {
                    *i < side && *j < side && !(hole && at(*i).hypot(at(*j)) < 3.0)
                };
                let all =
                    (row..row + per).flat_map(|i| (column..column + per).map(move |j| [i, j]));
                let own: Vec<[usize; 2]> = all.filter(inside).collect();
                if 2 * own.len() >= per * per {
                    sites.push(own);
                }
            }
        }
        let points: Vec<Vec<[f64; 2]>> = sites
            .iter()
            .map(|own| own.iter().map(|s| s.map(at)).collect())
            .collect();
        let mean = |own: &[[f64; 2]], f: &dyn Fn(&[f64; 2]) -> f64| {
            own.iter().map(f).sum::<f64>() / own.len() as f64
        };
        let centroid: Vec<[f64; 2]> = points
            .iter()
            .map(|own| [0, 1].map(|k: usize| mean(own, &|p| p[k])))
            .collect();
        let spread = points.iter().zip(&centroid);
        let spread =
            spread.map(|(own, c)| [0, 1].map(|k: usize| mean(own, &|p| (p[k] - c[k]).powi(2))));
        let blocks = Blocks {
            size_mm: per as f64 * STEP,
            count: points.iter().map(Vec::len).collect(),
            worth: points.iter().map(|own| own.len() as f64).collect(),
            weight: None,
            spread: spread.collect(),
            centroid,
            of_point: Vec::new(),
            noise_length_mm: 2.0 * SUBSET,
            places: BlockPoints::of_few(points),
        };
        Self {
            blocks,
            sites,
            side,
        }
    }

    fn average(&self, value: impl Fn(usize, usize) -> f64) -> DVector<f64> {
        let of = self
            .sites
            .iter()
            .map(|own| own.iter().map(|[i, j]| value(*i, *j)).sum::<f64>() / own.len() as f64);
        DVector::from_iterator(self.sites.len(), of)
    }

    /// White noise of pixels averaged over the subset about each point, unit variance of a point.
    fn pixels(&self, rng: &mut Pcg64) -> DVector<f64> {
        let subset = (SUBSET / STEP) as usize * FINE;
        let width = (self.side - 1) * FINE + subset;
        let mut sums = vec![0.0; (width + 1) * (width + 1)];
        for i in 0..width {
            let mut row = 0.0;
            for j in 0..width {
                row += normal(rng);
                sums[(i + 1) * (width + 1) + j + 1] = sums[i * (width + 1) + j + 1] + row;
            }
        }
        let sum = |i: usize, j: usize| sums[i * (width + 1) + j];
        self.average(|i, j| {
            let (a, b) = (i * FINE, j * FINE);
            let inside =
                sum(a + subset, b + subset) - sum(a, b + subset) - sum(a + subset, b) + sum(a, b);
            inside / subset as f64
        })
    }

    /// A smooth pattern of unit variance.
    fn smooth(&self, length_mm: f64, rng: &mut Pcg64) -> DVector<f64> {
        let [field, _] = matern_pair([self.side; 2], [STEP; 2], length_mm, rng);
        self.average(|i, j| field[i * self.side + j])
    }

    /// A function of the blocks' places.
    fn field(&self, f: impl Fn([f64; 2]) -> f64) -> DVector<f64> {
        DVector::from_iterator(
            self.blocks.len(),
            self.blocks.centroid.iter().map(|p| f(*p)),
        )
    }
}

/// What a simulated series is made of.
#[derive(Clone)]
struct Truth {
    loads: Vec<f64>,
    scales: Vec<f64>,
    reference: f64,
    /// Sd of smooth patterns over that of a point, and their length, mm.
    smooth: Option<(f64, f64)>,
    /// Sd of a discrepancy over that of a point, its length, mm, and its law.
    discrepancy: Option<(f64, f64, Growth)>,
}

impl Truth {
    fn plain() -> Self {
        Self {
            loads: LOADS.to_vec(),
            scales: vec![1.0; 5],
            reference: 1.0,
            smooth: None,
            discrepancy: None,
        }
    }
}

/// Columns of a frame's law times a field.
fn spread_over(law: &[f64], field: &DVector<f64>) -> DVector<f64> {
    DVector::from_column_slice(law).kronecker(field)
}

/// All columns of a component: rigid motion of every frame, fields that grow with the load, that are constant, that sit, and that are
/// free in every frame.
fn explaining(window: &Window, loads: &[f64], c: usize) -> Vec<DVector<f64>> {
    let count = loads.len();
    let mut columns = Vec::new();
    let ones = vec![1.0; count];
    let seated: Vec<f64> = loads.iter().map(|f| f / (f + 0.05)).collect();
    let only = |s: usize| {
        (0..count)
            .map(|t| f64::from(u8::from(s == t)))
            .collect::<Vec<_>>()
    };
    for s in 0..count {
        for k in 0..2 {
            columns.push(spread_over(
                &only(s),
                &window.field(|_| f64::from(u8::from(k == c))),
            ));
        }
        columns.push(spread_over(
            &only(s),
            &window.field(|p| 1e-2 * [-p[1], p[0]][c]),
        ));
    }
    let hole = window.field(|p| 0.02 * p[c] / (4.0 + p[0] * p[0] + p[1] * p[1]));
    columns.push(spread_over(
        loads,
        &window.field(|p| 1e-3 * p[c] * [1.0, -0.3][c]),
    ));
    columns.push(spread_over(loads, &hole));
    for law in [ones.as_slice(), loads, &seated] {
        columns.push(spread_over(law, &window.field(|p| 1e-5 * p[0] * p[c])));
        columns.push(spread_over(law, &window.field(|p| 1e-5 * p[1] * p[1 - c])));
    }
    for s in 0..count {
        columns.push(spread_over(&only(s), &window.field(|p| 1e-4 * p[c])));
    }
    columns
}

/// The columns and the data of both components.
fn simulated(window: &Window, truth: &Truth, seed: u64) -> [DMatrix<f64>; 2] {
    let rng = &mut Pcg64::seed_from_u64(seed);
    // the same of everything else with and without a discrepancy
    let apart = &mut Pcg64::seed_from_u64(seed + 1_000_000);
    let amplitudes: Vec<f64> = (0..100).map(|_| normal(rng)).collect();
    [0, 1].map(|c: usize| {
        let mut noise = || {
            let pixels = window.pixels(rng);
            let own = truth.smooth.map(|(sd, l)| sd * window.smooth(l, rng));
            SD[c] * own.map_or_else(|| pixels.clone(), |s| &pixels + s)
        };
        let common = truth.reference.sqrt() * noise();
        let frames: Vec<_> = truth
            .scales
            .iter()
            .map(|d| d.sqrt() * noise() + &common)
            .collect();
        let columns = explaining(window, &truth.loads, c);
        let n = window.blocks.len();
        let mut y = DVector::zeros(frames.len() * n);
        for (s, u) in frames.iter().enumerate() {
            y.rows_mut(s * n, n).copy_from(u);
        }
        for (column, a) in columns.iter().zip(&amplitudes) {
            y.axpy(*a, column, 1.0);
        }
        if let Some((sd, l, law)) = truth.discrepancy {
            let field = sd * SD[c] * window.smooth(l, apart);
            let over = match law {
                Growth::Constant => vec![1.0; frames.len()],
                Growth::WithLoad => truth.loads.clone(),
            };
            y += spread_over(&over, &field);
        }
        DMatrix::from_columns(&columns.into_iter().chain([y]).collect::<Vec<_>>())
    })
}

fn weighed(window: &Window, loads: &[f64], columns: &[DMatrix<f64>; 2]) -> SeriesNoise {
    let frames = Frames {
        blocks: &window.blocks,
        loads: loads.to_vec(),
        subset_mm: Some(SUBSET),
    };
    settings(&frames, [&columns[0], &columns[1]], &|| {}).unwrap()
}

/// Posterior probability of settings with all columns at unit prior.
fn probability(all: &SeriesNoise, of: impl Fn(&At) -> bool) -> f64 {
    let best = all
        .settings
        .iter()
        .map(|s| s.log_all)
        .fold(f64::NEG_INFINITY, f64::max);
    let weight = |s: &Setting| (s.log_all - best).exp();
    let total: f64 = all.settings.iter().map(weight).sum();
    let own = all.settings.iter().filter(|s| of(&s.at));
    own.map(weight).sum::<f64>() / total
}

fn mean_reference(all: &SeriesNoise) -> f64 {
    let grid = [0.0, 0.15, 0.4, 0.7, 1.0, 1.5, 2.5];
    let share = |r: f64| r * probability(all, |at| at.reference == r);
    grid.into_iter().map(share).sum()
}

fn mean_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (
        mean,
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt(),
    )
}

/// Mean over all points of two blocks, point by point.
fn by_pairs(window: &Window, shift: f64) -> DMatrix<f64> {
    let triangle = |d: f64| (1.0 - d.abs() / SUBSET).max(0.0);
    let n = window.sites.len();
    DMatrix::from_fn(n, n, |a, b| {
        let mut sum = 0.0;
        for p in &window.sites[a] {
            for q in &window.sites[b] {
                let d = [0, 1].map(|k| STEP * (p[k] as f64 - q[k] as f64));
                // points moved along direction 1 with their place in direction 2
                sum += triangle(d[0] + shift * d[1]) * triangle(d[1]);
            }
        }
        sum / (window.sites[a].len() * window.sites[b].len()) as f64
    })
}

#[test]
fn the_subsets_covariance_is_the_mean_over_all_points_of_both_blocks() {
    let window = Window::new(16, 3, true);
    assert!(matches!(window.blocks.places, BlockPoints::OnLattice(_)));
    let found = subset_covariance(&window.blocks, SUBSET);
    assert!((found - by_pairs(&window, 0.0)).amax() < 1e-12);

    // a sheared lattice is none
    let mut sheared = window.blocks.clone();
    let at = |[i, j]: &[usize; 2]| {
        [
            STEP * *i as f64 + 0.1234 * STEP * *j as f64,
            STEP * *j as f64,
        ]
    };
    let moved = window
        .sites
        .iter()
        .map(|own| own.iter().map(at).collect::<Vec<_>>());
    sheared.places = BlockPoints::of_few(moved.collect());
    assert!(matches!(sheared.places, BlockPoints::Anywhere(_)));
    let points = |own: &Vec<[usize; 2]>, k: usize| {
        own.iter().map(|p| at(p)[k]).sum::<f64>() / own.len() as f64
    };
    sheared.centroid = window
        .sites
        .iter()
        .map(|own| [points(own, 0), points(own, 1)])
        .collect();
    let found = subset_covariance(&sheared, SUBSET);
    assert!((found - by_pairs(&window, 0.1234)).amax() < 1e-12);

    // blocks so full that only the spread of their points is known
    let window = Window::new(20, 5, false);
    let mut full = window.blocks.clone();
    full.places = BlockPoints::Many;
    let found = subset_covariance(&full, SUBSET);
    let exact = by_pairs(&window, 0.0);
    let off = (found - &exact).amax() / exact.amax();
    assert!(off < 0.02, "{off}");
}

#[test]
fn white_pixels_through_a_subset_have_that_covariance() {
    const SAMPLES: usize = 4000;
    let window = Window::new(10, 2, false);
    let expected = subset_covariance(&window.blocks, SUBSET);
    let rng = &mut Pcg64::seed_from_u64(5);
    let mut sampled = DMatrix::<f64>::zeros(expected.nrows(), expected.nrows());
    for _ in 0..SAMPLES {
        let u = window.pixels(rng);
        sampled.ger(1.0 / SAMPLES as f64, &u, &u, 1.0);
    }
    // five standard errors, and the pixels' own width
    let error = 5.0 * expected.amax() * (2.0 / SAMPLES as f64).sqrt();
    assert!((sampled - expected).amax() < error);
}

/// The dense covariance of all values of a component, written down as the model says.
fn dense(window: &Window, all: &SeriesNoise, at: &At, loads: &[f64], c: usize) -> DMatrix<f64> {
    let noise = &all.noise.spatial[c];
    let mut own = subset_covariance(&window.blocks, SUBSET);
    let nugget = noise.shape.nugget * own.diagonal().mean();
    let mean = window.blocks.mean_count();
    for (b, count) in window.blocks.count.iter().enumerate() {
        own[(b, b)] += nugget * mean / *count as f64;
    }
    own += noise.shape.ratio * Matern::new(&window.blocks, noise.shape.length_mm).correlation;
    let scales = DMatrix::from_diagonal(&DVector::from_column_slice(&all.noise.scales));
    let ones = DMatrix::repeat(loads.len(), loads.len(), 1.0);
    let mut covariance = (scales + at.reference * ones).kronecker(&own);
    if let Some(rival) = at.rival {
        let w = match rival.law {
            Growth::Constant => DVector::repeat(loads.len(), 1.0),
            Growth::WithLoad => DVector::from_column_slice(loads),
        };
        let more = Matern::new(&window.blocks, rival.length_mm).correlation;
        covariance += rival.ratio * (&w * w.transpose()).kronecker(&more);
    }
    covariance * noise.scale2
}

#[test]
fn settings_agree_with_the_dense_covariance_of_all_values() {
    let window = Window::new(12, 2, true);
    let truth = Truth {
        scales: vec![1.0, 1.0, 2.0, 1.0, 0.5],
        smooth: Some((2.0, 3.0)),
        ..Truth::plain()
    };
    let columns = simulated(&window, &truth, 3);
    let all = weighed(&window, &LOADS, &columns);
    assert!(all.settings.len() > 200, "{}", all.settings.len());
    let mut seen = [0; 3];
    for setting in all.settings.iter().step_by(3) {
        seen[setting
            .at
            .rival
            .map_or(0, |r| 1 + usize::from(r.law == Growth::WithLoad))] += 1;
        let (mut gram, mut log_det, mut log_all) = (DMatrix::zeros(0, 0), 0.0, setting.log_prior);
        let mut joint = DMatrix::zeros(0, 0);
        for c in [0, 1] {
            let covariance = dense(&window, &all, &setting.at, &LOADS, c);
            let factor = covariance.clone().cholesky().unwrap();
            let part = columns[c].tr_mul(&factor.solve(&columns[c]));
            gram = if c == 0 { part } else { gram + part };
            log_det += factor.ln_determinant();
            joint = if c == 0 {
                covariance
            } else {
                let (a, b) = (joint.nrows(), covariance.nrows());
                let mut both = DMatrix::zeros(a + b, a + b);
                both.view_mut((0, 0), (a, a)).copy_from(&joint);
                both.view_mut((a, a), (b, b)).copy_from(&covariance);
                both
            };
        }
        assert!((log_det - setting.log_det).abs() < 1e-7 * log_det.abs());
        let size = gram.diagonal().map(f64::sqrt);
        let off = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| {
            (gram[(i, j)] - setting.gram[(i, j)]) / (size[i] * size[j])
        });
        assert!(off.amax() < 1e-7, "{:?}: {}", setting.at, off.amax());
        if seen.iter().sum::<i32>() > 3 {
            continue;
        }
        // and the evidence is the normal density of the data with every column's prior in it
        let p = columns[0].ncols() - 1;
        let both = DMatrix::from_fn(joint.nrows(), p + 1, |i, j| {
            let half = columns[0].nrows();
            columns[i / half][(i % half, j)]
        });
        let x = both.columns(0, p);
        let y = both.column(p);
        let factor = (joint + x * x.transpose()).cholesky().unwrap();
        log_all -= 0.5 * (factor.ln_determinant() + y.dot(&factor.solve(&y)));
        assert!(
            (log_all - setting.log_all).abs() < 1e-3,
            "{log_all} {}",
            setting.log_all
        );
    }
    assert!(seen.iter().all(|k| *k > 1), "{seen:?}");
}

#[test]
fn frames_scales_size_and_reference_are_found() {
    const SEEDS: u64 = 12;
    let window = Window::new(40, 2, true);
    // of the spread that the estimate supposes: a posterior mode is right on average over its prior, not for one set of scales
    let mut rng = Pcg64::seed_from_u64(77);
    let mut drawn = || {
        let logs: Vec<f64> = (0..5).map(|_| 0.3 * normal(&mut rng)).collect();
        let mean = logs.iter().sum::<f64>() / 5.0;
        logs.iter().map(|l| (l - mean).exp()).collect::<Vec<f64>>()
    };
    let mut sizes: [Vec<f64>; 2] = Default::default();
    let mut found: [Vec<f64>; 5] = Default::default();
    let (mut references, mut white, mut nugget) = (Vec::new(), 0, Vec::new());
    for seed in 0..SEEDS {
        let scales = drawn();
        let truth = Truth {
            scales: scales.clone(),
            ..Truth::plain()
        };
        let all = weighed(&window, &LOADS, &simulated(&window, &truth, seed));
        for (c, sizes) in sizes.iter_mut().enumerate() {
            sizes.push(all.noise.spatial[c].scale2 / SD[c].powi(2));
        }
        for (s, found) in found.iter_mut().enumerate() {
            found.push(all.noise.scales[s] / scales[s]);
        }
        white += usize::from(all.noise.spatial.iter().all(|n| n.shape.ratio == 0.0));
        references.push(mean_reference(&all));
        nugget.push(all.noise.spatial[0].shape.nugget);
        let product: f64 = all.noise.scales.iter().product();
        assert!((product - 1.0).abs() < 1e-9);
        assert!(all.noise.by_contrasts);
    }
    for sizes in &sizes {
        let (mean, sd) = mean_sd(sizes);
        println!("s2 over the true one: mean {mean:.3}, sd {sd:.3}");
        assert!((mean - 1.0).abs() < 0.05);
    }
    for found in &found {
        let (mean, sd) = mean_sd(found);
        println!("scale over the true one: mean {mean:.3}, sd {sd:.3}");
        assert!((mean - 1.0).abs() < 0.08 && sd < 0.25);
    }
    let (mean, sd) = mean_sd(&references);
    println!("nugget {nugget:?}");
    println!("r: mean {mean:.3}, sd {sd:.3}; white in {white} of {SEEDS}");
    assert!((mean - 1.0).abs() < 0.15);
    assert!(white + 1 >= SEEDS as usize);
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn smooth_patterns_of_every_frame_are_noise() {
    const SEEDS: u64 = 10;
    let window = Window::new(40, 2, true);
    for (length, reference) in [(5.0, 1.0), (8.0, 0.4)] {
        let truth = Truth {
            smooth: Some((3.0, length)),
            reference,
            ..Truth::plain()
        };
        let (mut lengths, mut ratios, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
        let (mut references, mut shared) = (Vec::new(), 0);
        for seed in 0..SEEDS {
            let all = weighed(&window, &LOADS, &simulated(&window, &truth, 100 + seed));
            shared += usize::from(all.noise.is_shared());
            lengths.push((all.noise.spatial[0].shape.length_mm / length).ln());
            ratios.push((all.noise.spatial[0].shape.ratio / 9.0).ln());
            sizes.extend([0, 1].map(|c: usize| all.noise.spatial[c].scale2 / SD[c].powi(2)));
            references.push(mean_reference(&all));
            assert!(probability(&all, |at| at.rival.is_some()) < 0.5);
        }
        for (name, values) in [
            ("ln l", &lengths),
            ("ln rho", &ratios),
            ("s2", &sizes),
            ("r", &references),
        ] {
            let (mean, sd) = mean_sd(values);
            println!("l = {length} mm: {name} against the truth: mean {mean:.3}, sd {sd:.3}");
        }
        println!("shared in {shared} of {SEEDS}");
        assert!(mean_sd(&sizes).0 - 1.0 < 0.05);
        assert!(mean_sd(&lengths).0.abs() < 0.3 && mean_sd(&ratios).0.abs() < 0.5);
        assert!((mean_sd(&references).0 - reference).abs() < 0.2);
        assert!(shared as u64 + 1 >= SEEDS);
    }
}
