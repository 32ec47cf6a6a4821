//! The reduced model: design, POD, response surfaces, and inputs that cannot work.

mod cross;
mod inputs;
mod published;

use std::sync::Arc;

use self::cross::{CrossValidation, leave_one_out};
use self::published::{GOGU_2013, TRUNCATIONS, of_the_article};
use faer::Mat;
use plychain::effect::Scene;
use plychain::experiment::{FieldExperiment, FieldTest, Gauge};
use plychain::fem::Setup;
use plychain::field::{Axis, Frame};
use plychain::geometry::Density;
use plychain::laminate::{LoadSpec, Material, SpecimenSpec};
use plychain::reduce::pod::decompose_as_seen;
use plychain::reduce::{
    Choice, Dimension, Modes, Pod, Problem, ReducedModel, ReducedSpec, Snapshots, Surface,
    THICKNESS, Variables, decompose, exponents, latin_hypercube, monomial, rows_to_solve,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// The open-hole laminate on a coarse mesh.
pub fn small_test() -> FieldTest {
    let specimen: SpecimenSpec = serde_json::from_str(
        r#"{ "length_mm": 60.0, "width_mm": 25.0, "hole": { "diameter_mm": 4.0, "center_mm": [0.0, 0.0] },
             "layup_deg": [45, -45, 0, 0, -45, 45], "thickness_mm": { "mean": 0.78, "sd": 0.005 } }"#,
    )
    .unwrap();
    FieldTest {
        specimen,
        load: LoadSpec { force_n: 700.0 },
        frame: Frame {
            loading_axis: Axis::X,
            hole_center_mm: [0.0; 2],
        },
        gauge: Gauge::Window,
        fringe_frequency_per_mm: Some(2400.0),
        images: None,
        window: [[-8.0, -8.0], [8.0, 8.0]],
        density: Density(0.18),
        full_order: false,
    }
}

/// What effects need to know of a test.
pub fn scene(test: &FieldTest) -> Scene {
    Scene {
        frame: test.frame,
        setup: Setup::nominal(&test.specimen, &test.load, test.frame.handedness()),
        ply: Material::Ply.ply(&[160.0, 7.5, 0.34, 4.5]),
        fringe_frequency_per_mm: test.fringe_frequency_per_mm,
        expansion_per_k: None,
        material: Material::Ply,
        camera_distance_mm: None,
        pixel_mm: None,
        subset_mm: None,
        solved_elsewhere: false,
        middle: [0.0; 2],
        declared_loads: Vec::new(),
    }
}

/// The reduced model's problem of a test.
pub fn problem_of(test: FieldTest) -> Problem {
    let side = |name: &str, low: f64, high: f64| Dimension {
        name: name.into(),
        low,
        high,
    };
    let scene = scene(&test);
    Problem {
        experiment: Arc::new(FieldExperiment::new(test, scene).unwrap()),
        dimensions: vec![
            side("E1_GPa", 120.0, 200.0),
            side("E2_GPa", 6.0, 9.0),
            side("nu12", 0.26, 0.42),
            side("G12_GPa", 3.2, 5.8),
            side(THICKNESS, 0.76, 0.80),
        ],
        spec: ReducedSpec::of(120, Modes::Count(4), 3),
    }
}

/// The open-hole laminate on a coarse mesh.
pub fn small_problem() -> Problem {
    problem_of(small_test())
}

/// A random matrix whose singular values fall by about a decade from one to the next.
fn decaying(n: usize, count: usize) -> Mat<f64> {
    let mut rng = Pcg64::seed_from_u64(5);
    let mut random = |rows, cols| {
        let values: Vec<f64> = (0..rows * cols)
            .map(|_| rng.random::<f64>() - 0.5)
            .collect();
        Mat::from_fn(rows, cols, |i, j| values[i * cols + j])
    };
    let (left, right) = (random(n, count), random(count, count));
    let scaled = Mat::from_fn(n, count, |i, j| left[(i, j)] * 10_f64.powi(-(j as i32)));
    &scaled * &right
}

/// The points of a problem's own design.
pub fn design(problem: &Problem) -> Vec<Vec<f64>> {
    rows_to_solve(&problem.dimensions, problem.spec.count())
}

/// Points of a Latin hypercube in the problem's box.
pub fn points(problem: &Problem, n: usize, seed: u64) -> Vec<Vec<f64>> {
    let unit = latin_hypercube(n, problem.dimensions.len(), seed);
    let scale = |u: &Vec<f64>| {
        u.iter()
            .zip(&problem.dimensions)
            .map(|(&u, d)| d.at(u))
            .collect()
    };
    unit.iter().map(scale).collect()
}

#[test]
fn a_latin_hypercube_has_one_point_in_every_stratum() {
    for (n, dims, seed) in [(1, 3, 1), (7, 2, 2), (200, 5, 2013)] {
        let design = latin_hypercube(n, dims, seed);
        assert_eq!(design, latin_hypercube(n, dims, seed));
        for d in 0..dims {
            let mut strata: Vec<usize> = design
                .iter()
                .map(|p| (p[d] * n as f64).floor() as usize)
                .collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..n).collect::<Vec<_>>());
        }
    }
}

#[test]
fn pod_is_orthonormal_reconstructs_and_leaves_its_input_alone() {
    let x = decaying(60, 9);
    let before = x.clone();
    let pod = decompose(&x).unwrap();
    assert_eq!(x, before);
    let gram = pod.modes.transpose() * &pod.modes;
    let identity = Mat::<f64>::identity(9, 9);
    assert!((&gram - &identity).norm_max() < 1e-13);
    assert!(pod.singular.windows(2).all(|s| s[0] >= s[1]));
    let total = x.norm_l2();
    for k in 1..=9 {
        let kept = Mat::from_fn(60, k, |i, j| pod.modes[(i, j)]);
        let rest = &x - &kept * pod.coefficients(k).transpose();
        let eps = (rest.norm_l2() / total).powi(2);
        let formula = pod.truncation_error(k);
        // The residual itself carries rounding of the whole.
        let slack = 1e-9 * eps + 1e-15 * eps.sqrt() + 1e-30;
        assert!(
            (formula - eps).abs() < slack,
            "K {k}: {formula:e} and {eps:e}"
        );
    }
}

/// CV_RMS by an SVD of the other snapshots for every one left out.
fn explicit_leave_one_out(x: &Mat<f64>, most: usize) -> CrossValidation {
    let (n, count) = (x.nrows(), x.ncols());
    let mut sums = vec![[0.0; 2]; most];
    for out in 0..count {
        let others = Mat::from_fn(n, count - 1, |i, j| x[(i, j + usize::from(j >= out))]);
        let pod: Pod = decompose(&others).unwrap();
        let mut rest: Vec<f64> = (0..n).map(|i| x[(i, out)]).collect();
        for (k, sum) in sums.iter_mut().enumerate() {
            let a: f64 = (0..n).map(|i| pod.modes[(i, k)] * rest[i]).sum();
            (0..n).for_each(|i| rest[i] -= a * pod.modes[(i, k)]);
            let at = (0..n)
                .max_by(|&i, &j| rest[i].abs().total_cmp(&rest[j].abs()))
                .unwrap();
            sum[0] += rest[at].powi(2);
            sum[1] += x[(at, out)].powi(2);
        }
    }
    CrossValidation {
        mm: sums.iter().map(|s| (s[0] / count as f64).sqrt()).collect(),
        percent: sums.iter().map(|s| 100.0 * (s[0] / s[1]).sqrt()).collect(),
    }
}

#[test]
fn the_short_cut_to_cv_rms_is_leave_one_out() {
    let x = decaying(60, 10);
    let short = leave_one_out(&decompose(&x).unwrap(), 5);
    let explicit = explicit_leave_one_out(&x, 5);
    for (a, b) in [
        (&short.mm, &explicit.mm),
        (&short.percent, &explicit.percent),
    ] {
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-7 * b, "{a:e} and {b:e}");
        }
    }
}

/// A smooth function that is no polynomial.
fn smooth(p: &[f64]) -> f64 {
    1e-3 * (p[2] + 2.0).ln() / (p[0] * p[4]) + 1e-5 * (p[1] / p[3]).sqrt()
}

#[test]
fn press_is_leave_one_out() {
    let problem = small_problem();
    let points = points(&problem, 75, 3);
    let values = vec![points.iter().map(|p| smooth(p)).collect::<Vec<f64>>()];
    for choice in [Choice::Plain, Choice::Ratios] {
        let variables = Variables::new(choice, &problem, &points);
        let full = Surface::fit(variables.clone(), 3, &points, &values).unwrap();
        let mut sum = 0.0;
        for out in 0..points.len() {
            let others = |k: &usize| *k != out;
            let kept: Vec<Vec<f64>> = (0..points.len())
                .filter(others)
                .map(|k| points[k].clone())
                .collect();
            let rest = (0..points.len())
                .filter(others)
                .map(|k| values[0][k])
                .collect();
            let surface = Surface::fit(variables.clone(), 3, &kept, &[rest]).unwrap();
            sum += (surface.evaluate(&points[out])[0] - values[0][out]).powi(2);
        }
        let explicit = (sum / points.len() as f64).sqrt();
        let press = full.quality[0].press;
        assert!(
            (press - explicit).abs() < 1e-6 * explicit,
            "{choice:?}: {press:e}, {explicit:e}"
        );
        let n = points.len() as f64;
        let least = full.quality[0].rms * ((n - full.exponents.len() as f64) / n).sqrt();
        assert!(press >= least, "PRESS is never below the residual");
    }
}

#[test]
fn a_cubic_surface_recovers_a_cubic() {
    let problem = small_problem();
    let cubic = |p: &[f64]| 3.0 + p[0] * p[1] * p[2] - 0.1 * p[3].powi(3) + p[4] * p[0];
    let fitted = points(&problem, 80, 4);
    let values = vec![fitted.iter().map(|p| cubic(p)).collect::<Vec<f64>>()];
    let variables = Variables::new(Choice::Plain, &problem, &fitted);
    let surface = Surface::fit(variables, 3, &fitted, &values).unwrap();
    assert_eq!(surface.exponents, exponents(5, 3));
    assert!((surface.quality[0].r2 - 1.0).abs() < 1e-14);
    for p in points(&problem, 50, 5) {
        let (a, b) = (surface.evaluate(&p)[0], cubic(&p));
        assert!((a - b).abs() < 1e-10 * b.abs(), "{a} and {b}");
    }
    assert_eq!(monomial(&[2, 0, 1], &[3.0, 7.0, 0.5]), 4.5);
}

#[test]
fn a_ratios_surface_is_exact_in_a_common_factor_and_in_the_thickness() {
    let problem = small_problem();
    let fitted = points(&problem, 80, 6);
    let values = vec![fitted.iter().map(|p| smooth(p)).collect::<Vec<f64>>()];
    let variables = Variables::new(Choice::Ratios, &problem, &fitted);
    let surface = Surface::fit(variables, 3, &fitted, &values).unwrap();
    for p in points(&problem, 20, 7) {
        let here = surface.evaluate(&p)[0];
        for (moduli, thickness) in [(1.7, 1.0), (1.0, 0.6), (0.4, 3.0)] {
            let there = [
                p[0] * moduli,
                p[1] * moduli,
                p[2],
                p[3] * moduli,
                p[4] * thickness,
            ];
            let scaled = surface.evaluate(&there)[0] * moduli * thickness;
            assert!(
                (scaled - here).abs() < 1e-12 * here.abs(),
                "{scaled:e} and {here:e}"
            );
        }
    }
}

#[test]
fn finite_elements_held_out_lie_within_the_stated_error() {
    let problem = small_problem();
    let snapshots = Snapshots::at(&problem, design(&problem), &|| ()).unwrap();
    let model = ReducedModel::build(&problem, &snapshots).unwrap();
    let held_out = Snapshots::at(&problem, points(&problem, 40, 99), &|| ()).unwrap();
    let count = held_out.points.len();
    // the modes as the lattice sees them, over which they are orthonormal
    let seen = [0, 1].map(|c| decompose(&snapshots.seen[c]).unwrap().modes);
    let seen = |c: usize, k: usize| seen[c].col(k).iter().copied().collect::<Vec<f64>>();
    for surface in [&model.surface, &model.plain] {
        for k in 0..8 {
            let mode = seen(k / 4, k % 4);
            let field = &held_out.seen[k / 4];
            let press = surface.quality[k].press;
            let error = |(j, p): (usize, &Vec<f64>)| {
                let truth: f64 = mode
                    .iter()
                    .enumerate()
                    .map(|(i, m)| m * field[(i, j)])
                    .sum();
                (surface.evaluate(p)[k] - truth).abs()
            };
            let errors: Vec<f64> = held_out.points.iter().enumerate().map(error).collect();
            // Errors grow towards the corners of the box, where a Latin hypercube has few points: most are within the
            // band, and the worst not far out.
            let within = errors.iter().filter(|e| **e < 2.0 * press).count();
            let worst = errors.iter().fold(0.0_f64, |a, e| a.max(*e));
            assert!(
                10 * within >= 8 * count,
                "coefficient {k}: {within} of {count}"
            );
            assert!(
                worst < 50.0 * press,
                "coefficient {k}: {worst:e}, PRESS {press:e} mm"
            );
        }
    }
    for c in 0..2 {
        let mut sum = 0.0;
        for j in 0..count {
            let mut rest: Vec<f64> = held_out.seen[c].col(j).iter().copied().collect();
            for mode in (0..4).map(|k| seen(c, k)) {
                let a: f64 = mode.iter().zip(&rest).map(|(m, r)| m * r).sum();
                rest.iter_mut().zip(&mode).for_each(|(r, m)| *r -= a * m);
            }
            sum += rest.iter().fold(0.0_f64, |a, r| a.max(r.abs())).powi(2);
        }
        let cv = of_component(&snapshots, c).mm[3];
        let rms = (sum / count as f64).sqrt();
        assert!(
            rms < 2.0 * cv && rms > 0.25 * cv,
            "component {c}: {rms:e} mm, CV_RMS {cv:e} mm"
        );
    }
}

#[test]
fn the_article_s_box_gives_its_tables_in_figures_without_a_length() {
    let mut test = small_test();
    test.specimen.length_mm = 200.0;
    test.window = [[-12.15; 2], [12.15; 2]];
    test.density = Density(0.28);
    let problem = of_the_article(&problem_of(test));
    let snapshots = Snapshots::at(&problem, design(&problem), &|| ()).unwrap();
    let model = ReducedModel::build(&problem, &snapshots).unwrap();
    for c in 0..2 {
        let cross = of_component(&snapshots, c);
        for (i, k) in TRUNCATIONS.into_iter().enumerate() {
            let (eps, cv) = (model.truncation[c][k - 1], cross.percent[k - 1]);
            let (published_eps, published_cv) =
                (GOGU_2013.truncation[c][i], GOGU_2013.cv_percent[c][i]);
            assert!(
                (0.2..5.0).contains(&(eps / published_eps)),
                "eps {c} {k}: {eps:e}"
            );
            // The article's 4.71e-2 % (V, K = 3) does not fit its own figure in mm.
            let misprint = (c, k) == (1, 3);
            assert!(
                misprint || (0.2..5.0).contains(&(cv / published_cv)),
                "CV {c} {k}: {cv:e} %"
            );
        }
        let qualities = &model.plain.quality[4 * c..4 * c + 4];
        let published = &GOGU_2013.surfaces[c];
        for (q, p) in qualities.iter().zip(published) {
            assert!(q.r2 >= 0.998, "{q:?}");
            let (press_to_rms, floor) = (q.press / q.rms, (144.0_f64 / 200.0).sqrt());
            assert!((floor..2.0).contains(&press_to_rms), "{q:?}");
            // Below the floor, the article's PRESS of V2 is no PRESS.
            assert_eq!(p[4] / p[3] < floor, p[4] == 3.05e-6);
        }
        let spread = (qualities[0].sd / qualities[0].mean).abs();
        let there = (published[0][1] / published[0][0]).abs();
        assert!((spread / there - 1.0).abs() < 0.06, "{spread} and {there}");
    }
}

#[test]
fn automatic_modes_are_the_fewest_within_the_limit() {
    let pod = |singular: &[f64]| Pod {
        modes: Mat::zeros(4, singular.len()),
        singular: singular.to_vec(),
        right: Mat::zeros(singular.len(), singular.len()),
    };
    let pair = |a: &[f64], b: &[f64]| [pod(a), pod(b)];
    // of 3 snapshots at 12 points 6 mm of singular value leave 1 mm
    let auto = |a: &[f64], b: &[f64]| Modes::Auto.resolve(&pair(a, b), 12);
    assert_eq!(auto(&[1.0, 1e-3, 2e-8], &[1.0, 1e-6, 1e-9]), 2);
    assert_eq!(auto(&[1.0, 1e-3, 1e-4], &[1.0, 1e-6, 1e-9]), 3);
    assert_eq!(Modes::Count(7).resolve(&pair(&[1.0], &[1.0]), 12), 1);
}

/// Leave-one-out of a component's snapshots, for up to 12 modes.
fn of_component(snapshots: &Snapshots, c: usize) -> CrossValidation {
    let pod = decompose_as_seen(&snapshots.fields[c], &snapshots.seen[c]).unwrap();
    leave_one_out(&pod, 12)
}
