//! Steps of a series held out of the fit, and the test of linearity in the load: against dense algebra, on frames of known noise, and on
//! series that are simulated a second time (`tests/physics/dic`).

use nalgebra::{DMatrix, DVector};
use plychain::effect::{Scope, find};
use plychain::field::Blocks;
use plychain::field::places::BlockPoints;
use plychain::identify::{inverse_problem, prepare};
use plychain::infer::Model;
use plychain::noise::series::{Frames, Role, SeriesNoise, settings};
use plychain::progress::Silent;
use plychain::trace::{Tracing, attribute};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::common::{fresh, set_coarse};
use crate::dic::cases::{Kind, case};
use crate::dic::causes::Cause;
use crate::dic::folder::SERIES;
use crate::dic::series::{Observed, Series};

/// Five loads, and the frame after unloading.
const LOADS: [f64; 6] = [0.2, 0.4, 0.6, 0.8, 1.0, 0.0];

/// White noise of a block of one point, mm.
const SD: f64 = 2e-4;

/// A lattice of single points, blocks of their own.
fn lattice(side: usize) -> Blocks {
    let at = |i: usize| i as f64 - 0.5 * (side as f64 - 1.0);
    let places: Vec<[f64; 2]> = (0..side * side)
        .map(|k| [at(k % side), at(k / side)])
        .collect();
    Blocks {
        size_mm: 1.0,
        count: vec![1; places.len()],
        worth: vec![1.0; places.len()],
        weight: None,
        spread: vec![[0.0; 2]; places.len()],
        of_point: Vec::new(),
        noise_length_mm: 2.0,
        places: BlockPoints::of_few(places.iter().map(|p| vec![*p]).collect()),
        centroid: places,
    }
}

/// Noise of frames of some scales (sds) and a reference, and columns that grow with the load, are constant, and are a frame's own.
struct Simulated {
    blocks: Blocks,
    columns: [DMatrix<f64>; 2],
    scales: Vec<f64>,
}

/// The field by which a specimen departs from linearity.
fn bump(p: [f64; 2], c: usize) -> f64 {
    p[c] / (4.0 + p[0] * p[0] + p[1] * p[1])
}

impl Simulated {
    /// With a departure of some size (sds of a point) that goes as `departs` over the frames.
    fn new(side: usize, seed: u64, size: f64, departs: [f64; 6]) -> Self {
        let blocks = lattice(side);
        let n = blocks.len();
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let scales: Vec<f64> = (0..6).map(|k| 1.0 + 0.1 * k as f64).collect();
        let field = |f: &dyn Fn([f64; 2]) -> f64| {
            DVector::from_iterator(n, blocks.centroid.iter().map(|p| f(*p)))
        };
        let over =
            |law: &[f64], field: &DVector<f64>| DVector::from_column_slice(law).kronecker(field);
        let columns = [0, 1].map(|c: usize| {
            let mut normal = || -> f64 { rng.sample(StandardNormal) };
            let reference: Vec<f64> = (0..n).map(|_| normal()).collect();
            let mut all = Vec::new();
            for s in 0..6 {
                let only: Vec<f64> = (0..6).map(|t| f64::from(u8::from(s == t))).collect();
                for k in 0..2 {
                    all.push(over(&only, &field(&|_| 10.0 * f64::from(u8::from(k == c)))));
                }
                all.push(over(&only, &field(&|p| [-p[1], p[0]][c])));
            }
            all.push(over(&LOADS, &field(&|p| 0.01 * p[c])));
            all.push(over(&LOADS, &field(&|p| 0.01 * bump(p, c))));
            all.push(over(&[1.0; 6], &field(&|p| 1e-4 * p[0] * p[c])));
            // what any change at the hole does: a pattern
            all.push(over(&LOADS, &field(&|p| 0.01 * bump(p, c) * p[0])));
            let mut data = 0.3 * &all[18] - 1.2 * &all[19] + 0.7 * &all[20];
            data += over(&departs, &field(&|p| size * SD * bump(p, c) * p[0]));
            for s in 0..6 {
                for b in 0..n {
                    data[s * n + b] += SD * (scales[s] * normal() + reference[b]);
                }
            }
            all.push(data);
            DMatrix::from_columns(&all)
        });
        Self {
            blocks,
            columns,
            scales,
        }
    }

    fn noise(&self) -> SeriesNoise {
        let frames = Frames {
            blocks: &self.blocks,
            loads: LOADS.to_vec(),
            subset_mm: None,
        };
        settings(&frames, [&self.columns[0], &self.columns[1]], &|| {}).unwrap()
    }
}

/// X' C^-1 X and log det C of all frames but one, by dense algebra.
#[test]
fn what_all_frames_but_one_know_is_that_of_their_covariance() {
    let simulated = Simulated::new(6, 1, 0.0, LOADS);
    let found = simulated.noise();
    let n = simulated.blocks.len();
    let reference = 0.7;
    let chosen = [0, 1, 2, 4, 18, 20];
    let (all, without) = found.in_frames.known();
    let known = std::iter::once((None, &all)).chain((0..6).map(Some).zip(&without));
    for (but, known) in known {
        let used: Vec<usize> = (0..6).filter(|s| Some(*s) != but).collect();
        let (mut expected, mut log_det) = (DMatrix::zeros(7, 7), 0.0);
        for (c, columns) in simulated.columns.iter().enumerate() {
            let spatial = &found.noise.spatial[c];
            let lower = spatial.covariance.colour(&DMatrix::identity(n, n));
            let frame = spatial.scale2 * &lower * lower.transpose();
            let of_frames = DMatrix::from_fn(used.len(), used.len(), |i, j| {
                let own = f64::from(u8::from(i == j)) * found.noise.scales[used[i]];
                own + reference
            });
            let factor = of_frames.kronecker(&frame).cholesky().unwrap();
            let last = columns.ncols() - 1;
            let rows = used.iter().flat_map(|s| s * n..(s + 1) * n);
            let rows: Vec<usize> = rows.collect();
            let own = columns.select_rows(&rows);
            let own = own.select_columns(&[0, 1, 2, 4, 18, 20, last]);
            expected += own.tr_mul(&factor.solve(&own));
            log_det += 2.0 * factor.l().diagonal().map(f64::ln).sum();
        }
        let (gram, det) = known.equations(&chosen, reference);
        assert!((det - log_det).abs() < 1e-8 * log_det.abs(), "{but:?}");
        for i in 0..7 {
            for j in 0..7 {
                let size = (expected[(i, i)] * expected[(j, j)]).sqrt().max(1e-300);
                let off = (gram[(i, j)] - expected[(i, j)]).abs() / size;
                assert!(off < 1e-8, "{but:?} {i} {j}: {off:.1e}");
            }
        }
        // columns 0 to 2 are the first frame's own, column 4 the second's
        assert_eq!(known.lacks(0), but == Some(0));
        assert_eq!(known.lacks(4), but == Some(1));
        assert!(!known.lacks(18));
        if let Some(s) = but {
            // the mean of a frame's noise given the others': r 1' Phi^-1
            let weights = found.in_frames.shared(s, reference);
            let of_frames = DMatrix::from_fn(5, 5, |i, j| {
                let own = f64::from(u8::from(i == j)) * found.noise.scales[used[i]];
                own + reference
            });
            let inverse = of_frames.try_inverse().unwrap();
            for (i, t) in used.iter().enumerate() {
                let expected = reference * inverse.column(i).sum();
                assert!((weights[*t] - expected).abs() < 1e-12);
            }
            assert_eq!(weights[s], 0.0);
        }
    }
    let found_scales: f64 = found.noise.scales.iter().map(|d| d.ln()).sum();
    assert!(found_scales.abs() < 1e-9 && simulated.scales.len() == 6);
}

/// Roles of the columns of [`Simulated`].
fn roles() -> Vec<Role> {
    let mut roles = vec![Role::Together; 18];
    roles.extend([
        Role::InEach(1.0),
        Role::Together,
        Role::Together,
        Role::Pattern,
    ]);
    roles
}

/// Smooth fields over the blocks.
fn waves(blocks: &Blocks) -> DMatrix<f64> {
    DMatrix::from_fn(blocks.len(), 4, |b, k| {
        let p = blocks.centroid[b].map(|x| 0.3 * x);
        (p[k % 2] * (1 + k / 2) as f64).cos()
    })
}

/// Probability of so large a distance of an empirical distribution from the uniform one (Kolmogorov, with Stephens' correction).
fn uniform(mut p: Vec<f64>) -> f64 {
    p.sort_by(f64::total_cmp);
    let n = p.len() as f64;
    let off = p.iter().enumerate().map(|(k, p)| {
        let (below, above) = (k as f64 / n, (k as f64 + 1.0) / n);
        (p - below).abs().max((above - p).abs())
    });
    let d = off.fold(0.0, f64::max) * (n.sqrt() + 0.12 + 0.11 / n.sqrt());
    let term = |k: i32| {
        let k = f64::from(k);
        (-1.0_f64).powf(k - 1.0) * (-2.0 * k * k * d * d).exp()
    };
    (2.0 * (1..100).map(term).sum::<f64>()).clamp(0.0, 1.0)
}

#[test]
fn linearity_is_refuted_at_the_rate_it_says() {
    let p: Vec<f64> = (0..120_u64)
        .into_par_iter()
        .map(|seed| {
            // proportional to the load, whatever it is
            let simulated = Simulated::new(9, 100 + seed, 3.0, LOADS);
            let found = simulated.noise();
            let smooth = waves(&simulated.blocks);
            found.in_frames.linearity(&roles(), &smooth).unwrap().p
        })
        .collect();
    let ks = uniform(p.clone());
    println!("linear: Kolmogorov-Smirnov p {ks:.3}");
    assert!(ks > 1e-3, "{ks} {p:?}");
}

#[test]
fn what_softens_or_yields_fails_linearity() {
    // as the load's square; yielding that stays
    let courses = [
        [0.04, 0.16, 0.36, 0.64, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.3, 1.0, 1.0],
    ];
    for (k, course) in courses.into_iter().enumerate() {
        let simulated = Simulated::new(9, 7 + k as u64, 30.0, course);
        let smooth = waves(&simulated.blocks);
        let found = simulated.noise().in_frames.linearity(&roles(), &smooth);
        let found = found.unwrap();
        println!("{course:?}: {found:?}");
        assert!(found.p < 1e-3, "{course:?}: {found:?}");
    }
}

#[test]
fn few_steps_or_two_loads_do_not_tell_linearity() {
    let simulated = Simulated::new(6, 3, 0.0, LOADS);
    for loads in [vec![0.5, 1.0, 0.0], vec![1.0, 0.0, 1.0, 0.0, 1.0, 0.0]] {
        let rows = loads.len() * simulated.blocks.len();
        let columns = simulated
            .columns
            .each_ref()
            .map(|c| c.rows(0, rows).into_owned());
        let frames = Frames {
            blocks: &simulated.blocks,
            loads: loads.clone(),
            subset_mm: None,
        };
        let found = settings(&frames, [&columns[0], &columns[1]], &|| {}).unwrap();
        let smooth = waves(&simulated.blocks);
        assert_eq!(
            found.in_frames.linearity(&roles(), &smooth),
            None,
            "{loads:?}"
        );
    }
}

/// What tracing says of a series by a model that declares what acts, with its law, or nothing.
fn traced(series: &Series, observed: &Observed, declared: bool) -> Tracing {
    let folder = fresh(&series.name);
    let truth = series.write(observed, &folder);
    let text = std::fs::read_to_string(folder.join(SERIES)).unwrap();
    let mut model: Value = serde_json::from_str(&text).unwrap();
    set_coarse(&mut model);
    let experiment = &mut model["experiments"][0];
    for effect in truth.effects.iter().filter(|_| declared) {
        let effects = experiment["effects"].as_array_mut().unwrap();
        effects.push(json!(effect.name));
        if find("test", &effect.name).unwrap().scope() == Scope::Motion {
            experiment["laws"][&effect.name] = json!(effect.law);
        }
    }
    let model = Model::parse(&model.to_string(), &folder.join(SERIES)).unwrap();
    let prepared = prepare(&model, &Silent).unwrap();
    let inverse = inverse_problem(&model, prepared, &Silent).unwrap();
    attribute(&model, &inverse, &|_| true, &Silent).unwrap().0
}

/// The largest z of a step, and p of linearity.
fn said(name: &str, found: &Tracing) -> (f64, f64) {
    let z: Vec<f64> = found
        .steps()
        .iter()
        .map(|s| s.predicted.unwrap().z)
        .collect();
    let worst = z.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let test = found.series.as_ref().unwrap().linearity.unwrap();
    let z: Vec<String> = z.iter().map(|z| format!("{z:+.1}")).collect();
    let groups = found.groups.iter();
    let named: Vec<_> = groups.map(|g| (g.leader, g.predicts)).collect();
    println!(
        "{name:52} z {} linear p {:.2e} ({:.2}, {:?}) {named:?}",
        z.join(" "),
        test.p,
        test.ratio,
        test.freedom
    );
    (worst, test.p)
}

/// Every step is predicted by the others, and the p of linearity are uniform.
fn judge(cases: &[(Kind, bool, u64)]) {
    let one = |(kind, laminate, seed): &(Kind, bool, u64)| {
        let series = case(kind, *laminate, *seed);
        said(&series.name, &traced(&series, &series.observed(), true))
    };
    let judged: Vec<(f64, f64)> = cases.par_iter().map(one).collect();
    let worst = judged.iter().map(|j| j.0).fold(f64::NEG_INFINITY, f64::max);
    let p: Vec<f64> = judged.iter().map(|j| j.1).collect();
    let ks = uniform(p);
    println!("largest z {worst:.2}; Kolmogorov-Smirnov p of linearity {ks:.3}");
    assert!(worst < 4.5, "{worst}");
    assert!(ks > 1e-3, "{ks}");
}

#[test]
#[ignore = "by hand: 12 series, 6 minutes"]
fn steps_without_an_effect_are_predicted_and_linear() {
    let white = (0..8).map(|seed| (Kind::Null, seed % 2 == 0, 7000 + seed));
    let smooth = (0..4).map(|seed| (Kind::Hard(None), seed % 2 == 0, 7100 + seed));
    judge(&white.chain(smooth).collect::<Vec<_>>());
}

#[test]
#[ignore = "by hand: 18 series, 10 minutes"]
fn steps_of_a_right_account_are_predicted_and_linear() {
    let on_both = [
        "hole_size",
        "load_misalignment",
        "lens_distortion",
        "camera_tilt",
        "magnification",
        "thickness_taper",
        "out_of_plane_rotation",
        "out_of_plane_translation",
        "thermal_strain",
    ];
    let of = |(k, name): (usize, &'static str)| {
        let seed = 7200 + k as u64;
        [(true, seed), (false, seed + 50)].map(|(l, seed)| (Kind::Single(name), l, seed))
    };
    let cases: Vec<_> = on_both.into_iter().enumerate().flat_map(of).collect();
    judge(&cases);
}

/// Damage of the hole's edge that comes with the load and goes with it: some step is not predicted by the others, which forbids `closed`. The
/// test of linearity alone saw it in three of the four (p = 3e-5, 1e-4, 7e-8, 0.17).
#[test]
#[ignore = "by hand: 4 series, 2 minutes"]
fn damage_that_grows_is_not_predicted() {
    let cases = [(true, 7300), (false, 7301), (true, 7302), (false, 7303)];
    cases.par_iter().for_each(|&(laminate, seed)| {
        let sound = case(&Kind::Null, laminate, seed);
        let damaged = Series {
            causes: vec![Cause::Mechanical("hole_edge_damage", vec![40.0, 0.0])],
            ..sound.clone()
        };
        let (whole, broken) = (sound.exact().1, damaged.exact().1);
        let mut observed = sound.observed();
        for (k, share) in [0.0, 0.1, 0.5, 1.0, 0.0].into_iter().enumerate() {
            let pairs = observed.frames[k].iter_mut();
            for (u, (a, b)) in pairs.zip(whole[k].iter().zip(&broken[k])) {
                *u = [0, 1].map(|c| u[c] + share * (b[c] - a[c]));
            }
        }
        let found = traced(&sound, &observed, false);
        let (worst, _) = said(&format!("damage {}", sound.name), &found);
        assert!(worst > 4.5, "{worst}");
    });
}
