//! Noise that is not as it is taken to be: points that stand in a measurement several times, a field brought to a finer grid, tails that are
//! heavier than a normal distribution's. No more is known of the constants than from the same points once, and not much less.

use std::fs;
use std::path::Path;

use plychain::infer::Model;
use plychain::trace::Status;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal, StudentT};
use rand_pcg::Pcg64;

use crate::common::{model, simulated};
use crate::load_mistakes::{STEEL, steel};
use crate::loops::{Ended, looped};

/// Points of a square lattice about a hole, and something measured there.
fn lattice(side: usize, seed: u64) -> Vec<[f64; 4]> {
    let rng = &mut Pcg64::seed_from_u64(seed);
    let at = |i: usize| 0.5 * (i as f64 - 0.5 * (side as f64 - 1.0));
    let all = (0..side * side).map(|i| [at(i % side), at(i / side)]);
    let outside = all.filter(|p| p[0].hypot(p[1]) > 2.5);
    let measured = |[x, y]: [f64; 2]| {
        let mut noise = || 1e-5 * rng.sample::<f64, _>(StandardNormal);
        [x, y, -3e-4 * x + noise(), 1e-3 * y + noise()]
    };
    outside.map(measured).collect()
}

/// Each point nine times, in a square of this side, mm, about its place.
fn nine_times(points: &[[f64; 4]], side: f64) -> Vec<[f64; 4]> {
    let mut all = Vec::new();
    for [x, y, u, v] in points {
        for k in 0..9 {
            let [i, j] = [k / 3, k % 3].map(|i| 0.5 * side * (f64::from(i) - 1.0));
            all.push([x + i, y + j, *u, *v]);
        }
    }
    all
}

/// Copies in one place, in places written with other decimals, and on a grid three times as fine.
#[test]
fn copies_of_a_point_count_once() {
    let specimen = Model::load(Path::new(&model("openhole.json"))).unwrap();
    let measurement = &specimen.experiment().measurement;
    let once = lattice(25, 1);
    let read = |rows: &[[f64; 4]]| {
        let points: Vec<[f64; 2]> = rows.iter().map(|r| [r[0], r[1]]).collect();
        let moved: Vec<[f64; 2]> = rows.iter().map(|r| [r[2], r[3]]).collect();
        measurement.of_arrays(&points, &moved, None).unwrap()
    };
    let expected = read(&once);
    assert_eq!(expected.rejected.repeated, 0);
    for side in [0.0, 2e-6, 2.0 / 6.0] {
        let found = read(&nine_times(&once, side));
        assert_eq!(found.rejected.repeated, 8 * once.len(), "{side}");
        assert_eq!(found.len(), expected.len(), "{side}");
        let points = found.points.iter().zip(&expected.points);
        let moved = found.displacement.iter().zip(&expected.displacement);
        for (a, b) in points.chain(moved) {
            let off = (0..2).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-12, "{side}: {a:?} {b:?}");
        }
    }
}

/// Displacements that are rounded so far that neighbours are equal are no copies: nothing but pairs in one place goes.
#[test]
fn rounded_displacements_are_no_copies() {
    let specimen = Model::load(Path::new(&model("openhole.json"))).unwrap();
    let rows = lattice(41, 2);
    let points: Vec<[f64; 2]> = rows.iter().map(|r| [r[0], r[1]]).collect();
    let round = |u: f64| (u / 1e-3).round() * 1e-3;
    let moved: Vec<[f64; 2]> = rows.iter().map(|r| [round(r[2]), round(r[3])]).collect();
    let field = specimen
        .experiment()
        .measurement
        .of_arrays(&points, &moved, None);
    assert_eq!(field.unwrap().rejected.repeated, 0);
}

/// A strip of steel measured with other noise, or written in another way.
fn strip(
    name: &str,
    seed: u64,
    of: impl Fn(&mut Pcg64) -> f64,
    written: impl Fn(&[[f64; 4]]) -> Vec<[f64; 4]>,
) -> Ended {
    const NOISE_UM: f64 = 0.15;
    let truth = format!("--set E_GPa={} --set nu={}", STEEL[0], STEEL[1]);
    let arguments = format!("--grid 41 --noise-nm 0 --format csv {truth}");
    let folder = simulated(&steel(), &arguments);
    let file = folder.join("field.csv");
    let text = fs::read_to_string(&file).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    assert!(header.contains("ux_um"), "{header}");
    let rng = &mut Pcg64::seed_from_u64(seed);
    let mut points = Vec::new();
    for line in rows.lines() {
        let numbers: Vec<f64> = line.split(',').filter_map(|n| n.parse().ok()).collect();
        if let [x, y, u, v] = numbers[..] {
            let [a, b] = [(); 2].map(|()| NOISE_UM * of(rng));
            points.push([x, y, u + a, v + b]);
        }
    }
    let line = |[x, y, u, v]: &[f64; 4]| format!("{x:.9},{y:.9},{u:.9},{v:.9}\n");
    let body: String = written(&points).iter().map(line).collect();
    fs::write(&file, format!("{header}\n{body}")).unwrap();
    let model = Model::load(&folder.join("model.json")).unwrap();
    let ended = looped(&format!("{name} {seed}"), &model, &STEEL);
    println!("{}", ended.line());
    ended
}

fn normal(rng: &mut Pcg64) -> f64 {
    StandardNormal.sample(rng)
}

/// Student's t of three degrees, of variance 1.
fn heavy(rng: &mut Pcg64) -> f64 {
    StudentT::new(3.0).unwrap().sample(rng) / 3.0_f64.sqrt()
}

/// E is known as well as from the same points once, or with normal noise, within a factor of two; nothing is named.
#[test]
#[ignore = "slow: run by .ci/run"]
fn copies_and_tails_cost_little() {
    for seed in 1..4 {
        let plain = |points: &[[f64; 4]]| points.to_vec();
        let as_it_is = strip("as it is", seed, normal, plain);
        let own: Vec<f64> = as_it_is.widths().collect();
        // the lattice has steps of 0.486 mm
        let finer = |points: &[[f64; 4]]| nine_times(points, 0.486 * 2.0 / 3.0);
        for ended in [
            strip("nine times", seed, normal, |p| nine_times(p, 2e-6)),
            strip("on a finer grid", seed, normal, finer),
            strip("heavy tails", seed, heavy, plain),
        ] {
            let widths: Vec<f64> = ended.widths().collect();
            assert!(widths[0] < 2.0 * own[0], "{}", ended.line());
            assert!(ended.effects.is_empty(), "{}", ended.line());
            assert_eq!(ended.held(), 2, "{}", ended.line());
            assert_eq!(ended.status, Status::NothingMissing, "{}", ended.line());
        }
    }
}
