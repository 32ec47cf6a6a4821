//! What stationary noise does not do, sought without a model: places where the residual breaks out of it.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use serde_json::Value;

use plychain::effect::EFFECTS;
use plychain::field::matrices::write_matrices;
use plychain::identify::{Patterns, Prepared, Residual, forward, inverse_problem, prepare, start};
use plychain::infer::Model;
use plychain::progress::Silent;

use crate::common::{changed, fresh, set_coarse, succeed};
use crate::tracing::{Noise, measured};

/// Patterns in what the bare model leaves of a measurement.
fn patterns(model: &Model) -> Patterns {
    let prepared = prepare(model, &Silent).unwrap();
    let inverse = inverse_problem(model, prepared, &Silent).unwrap();
    let mode = start(&inverse.posed.density).unwrap().mode;
    let (amplitudes, _) = inverse.posed.amplitudes_at(&mode);
    let forward = forward(model, &inverse.prepared, &inverse.measured, &|| ());
    let residual = Residual::at(&inverse, &forward, &mode, &amplitudes).unwrap();
    let field = &inverse.prepared.observation.field;
    Patterns::of(field, &residual.field, &inverse.noise, &|p| {
        p[0].hypot(p[1]) >= 2.4
    })
}

/// A measurement to which something was added: (x, y) in mm to (U, V) in nm.
pub fn with(noise: Noise, seed: u64, mut added: impl FnMut([f64; 2]) -> [f64; 2]) -> Model {
    let mut model = measured(&[], noise, seed);
    let field = model.read_field().unwrap();
    let mut grid = plychain::field::Grid::regular([[-12.15; 2], [12.15; 2]], 121, 121);
    for (p, u) in field.points.iter().zip(&field.displacement) {
        let [x, y] = field.frame.data_point(*p);
        let near = |v: f64| ((v + 12.15) / 24.3 * 120.0).round() as usize;
        let more = added([x, y]);
        grid.displacement[near(y) * 121 + near(x)] = [u[0] + 1e-6 * more[0], u[1] + 1e-6 * more[1]];
    }
    let folder = fresh("added");
    std::fs::create_dir_all(&folder).unwrap();
    write_matrices(&folder, &grid, None).unwrap();
    model.experiment_mut().measurement = model.experiment().measurement.clone().with_path(folder);
    model
}

/// Fields of noise; each has a pattern with a probability of 1e-4.
#[test]
#[ignore = "slow: run by .ci/run"]
fn noise_alone_has_no_patterns() {
    without_patterns(0..3);
}

#[test]
#[ignore = "45 fields, 1 minute"]
fn noise_of_many_fields_has_no_patterns() {
    without_patterns(3..48);
}

fn without_patterns(fields: std::ops::Range<usize>) {
    let kinds = [Noise::White, Noise::Correlated(0.3), Noise::Correlated(1.0)];
    for seed in fields {
        let found = patterns(&measured(&[], kinds[seed % 3], 700 + seed as u64));
        assert_eq!(found, Patterns::default(), "seed {seed}");
    }
}

/// White noise averaged over squares of 3 x 3 or 7 x 7 points, as subsets of image correlation do, prefers some directions; it breaks out nowhere.
#[test]
#[ignore = "slow: run by .ci/run"]
fn noise_of_square_subsets_has_no_patterns() {
    without_patterns_of_squares(&[(750, 1)]);
}

#[test]
#[ignore = "larger squares, 1 minute"]
fn noise_of_larger_square_subsets_has_no_patterns() {
    without_patterns_of_squares(&[(751, 3), (752, 2), (753, 3)]);
}

/// Seeds, and half the squares' sides in points.
fn without_patterns_of_squares(cases: &[(u64, usize)]) {
    for &(seed, half) in cases {
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let side = 121 + 2 * half;
        let white: Vec<[f64; 2]> = (0..side * side)
            .map(|_| [0, 1].map(|_| StandardNormal.sample(&mut rng)))
            .collect();
        let near = |v: f64| ((v + 12.15) / 24.3 * 120.0).round() as usize;
        let width = 2 * half + 1;
        let averaged = |[x, y]: [f64; 2]| {
            let mut sum = [0.0; 2];
            for k in 0..width * width {
                let at = (near(y) + k / width) * side + near(x) + k % width;
                sum = [sum[0] + white[at][0], sum[1] + white[at][1]];
            }
            sum.map(|s| 10.0 * s / width as f64)
        };
        let found = patterns(&with(Noise::Of(0.01), seed, averaged));
        assert_eq!(found, Patterns::default(), "{width} x {width}");
    }
}

/// A patch that is off by 60 nm is an exceedance, and it is where the patch is.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_patch_is_found_where_it_is() {
    let patch = |[x, y]: [f64; 2]| {
        let inside = (x - 5.0).hypot(y + 6.0) < 2.0;
        [0.0, if inside { 60.0 } else { 0.0 }]
    };
    let found = patterns(&with(Noise::White, 730, patch));
    let exceedance = found.exceedance.expect("an exceedance");
    assert_eq!(exceedance.component, "u2");
    let [x, y] = exceedance.place_in_data_mm;
    assert!((x.abs() - 5.0).hypot(y + 6.0) < 3.5, "{exceedance:?}");
}

/// Miscounted orders, out of the dictionary: the verdict is that something is unexplained.
#[test]
#[ignore = "slow: run by .ci/run"]
fn miscounted_orders_that_no_dictionary_has_do_not_go_unsaid() {
    let (case, words) = (
        "fringe_order_jump=1,0,5,6,3",
        "is larger than uniform noise in places",
    );
    let model = measured(&[case], Noise::White, 740);
    let (name, _) = case.split_once('=').unwrap();
    let others = EFFECTS.iter().map(|e| e.name()).filter(|n| *n != name);
    let others: Vec<&str> = others.collect();
    let path = changed("openhole.json", |m| {
        set_coarse(m);
        m["experiments"][0]["candidates"] = others.clone().into();
    });
    let out = fresh("out");
    let data = model.read_field().unwrap().files[0]
        .parent()
        .unwrap()
        .display()
        .to_string();
    let run = out.display().to_string();
    succeed(&["loop", &path, "--data", &data, "--quiet", "--out", &run]);
    let report = std::fs::read_to_string(out.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["verdict"]["status"], "unexplained", "{case}");
    let said = report["verdict"]["text"].as_str().unwrap();
    assert!(said.contains(words), "{case}: {said}");
}

/// A prediction carries no rigid motion over the points that were measured, whichever of them turn out to be bad: left out
/// at one corner alone, they would turn the field by 3 urad.
#[test]
fn outliers_do_not_turn_the_gauge() {
    let prepared = |model: &Model| prepare(model, &Silent).unwrap();
    let clean = measured(&[], Noise::Of(10.0), 5);
    let whole = prepared(&clean);
    let bad = with(Noise::Of(10.0), 5, |[x, y]| {
        // a corner, and all of one edge
        let bad = (x > 10.9 && y > 10.9) || y < -12.1;
        let size = if bad { 5e3 } else { 0.0 };
        [
            size * (97.3 * x + 51.7 * y).sin(),
            size * (31.1 * x * y).cos(),
        ]
    });
    let partial = prepared(&bad);
    let (all, left) = (&whole.observation.field, &partial.observation.field);
    assert!(left.outlying.len() > 140, "{}", left.outlying.len());
    assert!(left.bounds()[0] != all.bounds()[0]);
    assert_eq!(
        left.len() + left.outlying.len(),
        all.len() + all.outlying.len()
    );
    let at =
        |field: &plychain::field::Field, p: &[f64; 2]| field.points.iter().position(|q| q == p);
    let shown = |p: &Prepared| p.predict(&p.states[0]).unwrap().field;
    let [expected, found] = [&whole, &partial].map(shown);
    let size = expected
        .iter()
        .flatten()
        .fold(0.0f64, |m, u| m.max(u.abs()));
    for (p, u) in left.points.iter().zip(&found).step_by(7) {
        let e = expected[at(all, p).unwrap()];
        for (u, e) in u.iter().zip(e) {
            assert!((u - e).abs() < 1e-12 * size, "{p:?}: {u} {e}");
        }
    }
}
