//! Finite elements: closed forms, convergence rates, independent reference fields.

use std::sync::Arc;

use plychain::fem::{EndLoad, Locator, Plate, Setup, end_forces};
use plychain::geometry::{Density, Geometry, Outline, StripWithHole};
use plychain::laminate::{Membrane, Ply};

use crate::verify::{self, Check};

use crate::common::article;
use crate::common::shared;

mod checks;
mod lekhnitskii;

use lekhnitskii::{HoleSolution, stress_concentration};

const NOMINAL: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

fn setup() -> Setup {
    article::setup(4.0, [0.0; 2], -1.0)
}

fn strip(diameter: f64, center: [f64; 2]) -> Arc<dyn Geometry> {
    let s = [-100.0 - center[0], 100.0 - center[0]];
    let t = [-12.5 - center[1], 12.5 - center[1]];
    holed(s, t, 0.5 * diameter)
}

fn holed(s: [f64; 2], t: [f64; 2], radius: f64) -> Arc<dyn Geometry> {
    let clamp = None;
    Arc::new(StripWithHole {
        outline: Outline { s, t, clamp },
        radius,
    })
}

fn assert_passed(rows: &[Check]) {
    for Check {
        what,
        value,
        bound,
        passed,
    } in rows
    {
        assert!(passed, "{what}: {value:e}, at most {bound:e}");
    }
}

#[test]
fn every_verification_check_passes_for_the_nominal_laminate() {
    assert_passed(&checks::checks(&setup(), &NOMINAL, 12.15).unwrap());
}

#[test]
fn window_converges_for_extreme_plies_off_centre_holes_and_loads() {
    let stiff = Ply {
        e1: 234e3,
        e2: 7e3,
        nu12: 0.189,
        g12: 3.5e3,
    };
    let with = |geometry: Arc<dyn Geometry>, load: EndLoad| Setup {
        geometry,
        load,
        ..setup()
    };
    let axial = setup().load;
    let cases = [
        (setup(), stiff),
        (with(strip(4.0, [0.0, 6.0]), axial), NOMINAL),
        (with(strip(4.0, [60.0, -3.0]), axial), NOMINAL),
        (with(strip(1.25, [0.0; 2]), axial), NOMINAL),
        (with(strip(15.0, [0.0; 2]), axial), NOMINAL),
        (
            with(
                strip(4.0, [0.0; 2]),
                EndLoad {
                    shear: 12.0,
                    moment: 140.0,
                    ..axial
                },
            ),
            NOMINAL,
        ),
    ];
    for (setup, ply) in cases {
        assert_passed(&[
            verify::window_convergence(&setup, &ply, Density::DEFAULT, 12.15).unwrap(),
        ]);
    }
}

#[test]
fn steel_strip_converges() {
    let steel = Setup {
        geometry: holed([-60.0, 40.0], [-10.0, 10.0], 4.0),
        angles: vec![0.0],
        ..setup()
    };
    let ply = Ply::isotropic(210e3, 0.29);
    assert_passed(&[verify::window_convergence(&steel, &ply, Density::DEFAULT, 12.15).unwrap()]);
}

#[test]
fn stress_concentration_of_the_nominal_laminate() {
    let k = stress_concentration(&setup().membrane(&NOMINAL)).unwrap();
    assert!((k - 2.98345).abs() < 5e-6, "{k}");
    let exact = HoleSolution::new(&setup().membrane(&NOMINAL), 2.0, [1.0, 0.0, 0.0]).unwrap();
    assert!((exact.resultants([0.0, 2.0])[0] - k).abs() < 1e-10);
}

#[test]
fn closed_form_leaves_the_hole_free_of_traction_and_is_the_potential_of_its_stress() {
    let turned = Setup {
        angles: vec![0.3, -0.9, 1.2],
        ..setup()
    };
    let a = turned.membrane(&NOMINAL);
    let exact = HoleSolution::new(&a, 2.0, [100.0, -30.0, 20.0]).unwrap();
    for k in 0..36 {
        let (sin, cos) = (0.1 + f64::from(k) * 0.1745).sin_cos();
        let [n11, n22, n12] = exact.resultants([2.0 * cos, 2.0 * sin]);
        assert!((n11 * cos + n12 * sin).abs() < 1e-9 && (n12 * cos + n22 * sin).abs() < 1e-9);
        // A eps(u) by central differences is the resultant.
        let p = [3.0 * cos, 3.0 * sin];
        let d = |axis: usize| {
            let (mut q, mut r) = (p, p);
            q[axis] += 1e-5;
            r[axis] -= 1e-5;
            let (q, r) = (exact.displacement(q), exact.displacement(r));
            [(q[0] - r[0]) / 2e-5, (q[1] - r[1]) / 2e-5]
        };
        let (d1, d2) = (d(0), d(1));
        let n = a.matrix() * nalgebra::Vector3::new(d1[0], d2[1], d2[0] + d1[1]);
        for (n, exact) in n.iter().zip(exact.resultants(p)) {
            assert!((n - exact).abs() < 1e-5, "{n} {exact}");
        }
    }
}

#[test]
fn isotropic_limit_is_kirsch() {
    let a = Setup {
        angles: vec![0.0],
        ..setup()
    }
    .membrane(&Ply::isotropic(200e3, 0.3));
    let exact = HoleSolution::new(&a, 2.0, [1.0, 0.0, 0.0]).unwrap();
    assert!((stress_concentration(&a).unwrap() - 3.0).abs() < 1e-12);
    for k in 0..12 {
        let (r, t) = (3.0_f64, 0.2 + 0.5 * f64::from(k));
        let [n11, n22, n12] = exact.resultants([r * t.cos(), r * t.sin()]);
        let radial = n11 * t.cos().powi(2) + n22 * t.sin().powi(2) + n12 * (2.0 * t).sin();
        let q = 4.0 / (r * r);
        let kirsch = 0.5 * (1.0 - q) + 0.5 * (1.0 - 4.0 * q + 3.0 * q * q) * (2.0 * t).cos();
        assert!((radial - kirsch).abs() < 1e-7, "{radial} {kirsch}");
    }
}

#[test]
fn observer_finds_nodes_and_reproduces_a_linear_field() {
    let plate = Plate::meshed(strip(4.0, [3.0, 2.0]), None, Density::DEFAULT.scaled(0.25)).unwrap();
    let u: Vec<f64> = plate
        .mesh
        .nodes
        .iter()
        .flat_map(|[x, y]| [2.0 * x - y, 0.5 * x + 3.0 * y])
        .collect();
    // Nodes lie on element edges, and many on the hole's curved edge.
    let (observer, inside) = Locator::new(&plate.mesh).observe(&plate.mesh.nodes);
    assert!(inside.iter().all(|x| *x));
    for (p, v) in plate.mesh.nodes.iter().zip(observer.displacement(&u)) {
        assert!(
            (v[0] - (2.0 * p[0] - p[1])).abs() + (v[1] - (0.5 * p[0] + 3.0 * p[1])).abs() < 1e-8
        );
    }
    for g in observer.gradient(&u) {
        for (g, exact) in g.iter().flatten().zip([2.0, -1.0, 0.5, 3.0]) {
            assert!((g - exact).abs() < 1e-9);
        }
    }
    let (_, inside) =
        Locator::new(&plate.mesh).observe(&[[0.0, 0.0], [1.9, 0.0], [2.1, 0.0], [0.0, 11.0]]);
    assert_eq!(inside, [false, false, true, false]);
}

#[test]
fn stiffness_times_solution_is_the_load() {
    let setup = setup();
    let plate = Plate::new(&setup, Density::DEFAULT.scaled(0.5)).unwrap();
    let a = setup.membrane(&NOMINAL);
    let mut factor = plate.factor();
    factor.factorise(&a).unwrap();
    let load = end_forces(&plate.mesh, &setup.load);
    let mut u = load.clone();
    factor.solve(&mut u);
    for (back, load) in plate
        .assembly
        .multiply(plate.assembly.nominal(), &[a], &u)
        .iter()
        .zip(&load)
    {
        assert!((back - load).abs() < 1e-6 * 700.0);
    }
}

/// A work space is used again whatever it holds, by any thread: no bit of a solution depends on it.
#[test]
fn solutions_do_not_depend_on_the_work_space() {
    use rayon::prelude::*;
    let plate = Plate::new(&setup(), Density::DEFAULT.scaled(0.25)).unwrap();
    let ply = |k: usize| Ply {
        e2: NOMINAL.e2 * (1.0 + 0.1 * k as f64),
        ..NOMINAL
    };
    let nodal = |plate: &Plate, k: usize| plate.solve(&setup(), &ply(k)).unwrap().nodal;
    let fresh: Vec<Vec<f64>> = (0..3)
        .map(|k| {
            let own = Plate::new(&setup(), Density::DEFAULT.scaled(0.25)).unwrap();
            nodal(&own, k)
        })
        .collect();
    let shared: Vec<Vec<f64>> = (0..12_usize)
        .into_par_iter()
        .map(|k| nodal(&plate, k % 3))
        .collect();
    for (k, u) in shared.iter().enumerate() {
        assert_eq!(*u, fresh[k % 3]);
    }
}

#[test]
fn what_cannot_work_is_an_error() {
    for bad in [
        strip(4.0, [0.0, 11.0]),
        strip(30.0, [0.0; 2]),
        strip(f64::NAN, [0.0; 2]),
    ] {
        assert!(Plate::meshed(bad, None, Density::DEFAULT.scaled(0.25)).is_err());
    }
    let plate = Plate::new(&setup(), Density::DEFAULT.scaled(0.25)).unwrap();
    let singular = Membrane {
        a11: 1.0,
        a12: 0.0,
        a22: 1.0,
        a16: 0.0,
        a26: 0.0,
        a66: -1.0,
    };
    for a in [
        singular,
        Membrane {
            a66: f64::NAN,
            ..singular
        },
        Membrane {
            a66: 0.0,
            a22: 0.0,
            ..singular
        },
    ] {
        assert!(plate.factor().factorise(&a).is_err(), "{a:?}");
        assert!(
            HoleSolution::new(&a, 2.0, [1.0, 0.0, 0.0]).is_err(),
            "{a:?}"
        );
    }
}

/// A matrix file of the reference.
fn matrix(case: &str, name: &str) -> Vec<f64> {
    let path = shared("open-hole-reference").join(case).join(name);
    let text = std::fs::read_to_string(path).unwrap();
    text.split_whitespace()
        .map(|x| x.parse().unwrap())
        .collect()
}

fn assert_reference(case: &str, setup: &Setup) {
    let [x, y, u, v] = ["X.txt", "Y.txt", "U.txt", "V.txt"].map(|name| matrix(case, name));
    let kept: Vec<usize> = (0..x.len()).filter(|&k| u[k].is_finite()).collect();
    let points: Vec<[f64; 2]> = kept.iter().map(|&k| [y[k], x[k]]).collect();
    let reference: Vec<[f64; 2]> = kept.iter().map(|&k| [1e-3 * u[k], 1e-3 * v[k]]).collect();
    let plate = Plate::new(setup, Density::DEFAULT).unwrap();
    let nodal = plate.solve(setup, &NOMINAL).unwrap().nodal;
    let (observer, inside) = Locator::new(&plate.mesh).observe(&points);
    assert!(inside.iter().all(|x| *x));
    let error = verify::difference(&points, &observer.displacement(&nodal), &reference);
    assert!(error < 1e-5, "{case}: {error:e}");
}

#[test]
#[ignore = "needs ../shared"]
fn independent_reference_fields() {
    assert_reference("nominal", &setup());
    let angle = 1.0_f64.to_radians();
    let mut misaligned = setup();
    misaligned.load = EndLoad {
        axial: 700.0 * angle.cos(),
        shear: 700.0 * angle.sin(),
        moment: 0.0,
        ..EndLoad::default()
    };
    assert_reference("load-misalignment", &misaligned);
    let mut bent = setup();
    bent.load.moment = 140.0;
    assert_reference("in-plane-bending", &bent);
    let mut turned = setup();
    turned.angles.iter_mut().for_each(|a| *a -= angle);
    assert_reference("ply-misorientation", &turned);
}

#[test]
fn a_box_that_reaches_the_ends_needs_no_strips() {
    let geometry = holed([-8.0, 8.0], [-8.0, 8.0], 2.0);
    let short = Setup {
        geometry,
        ..setup()
    };
    assert_passed(&[verify::window_convergence(&short, &NOMINAL, Density::DEFAULT, 8.0).unwrap()]);
}

#[test]
fn shape_functions_interpolate() {
    use plychain::fem::element::{shape, shape_gradient};
    let nodes = [
        [-1.0, -1.0],
        [1.0, -1.0],
        [1.0, 1.0],
        [-1.0, 1.0],
        [0.0, -1.0],
        [1.0, 0.0],
        [0.0, 1.0],
        [-1.0, 0.0],
    ];
    for (k, [a, b]) in nodes.into_iter().enumerate() {
        for (j, n) in shape(a, b).into_iter().enumerate() {
            assert!((n - f64::from(u8::from(j == k))).abs() < 1e-15);
        }
    }
    for (a, b) in [(0.3, -0.7), (-0.9, 0.2), (0.0, 0.0), (1.0, 0.4)] {
        assert!((shape(a, b).iter().sum::<f64>() - 1.0).abs() < 1e-14);
        let h = 1e-6;
        for (k, g) in shape_gradient(a, b).into_iter().enumerate() {
            let d = [
                (shape(a + h, b)[k] - shape(a - h, b)[k]) / (2.0 * h),
                (shape(a, b + h)[k] - shape(a, b - h)[k]) / (2.0 * h),
            ];
            assert!((g[0] - d[0]).abs().max((g[1] - d[1]).abs()) < 1e-9);
        }
    }
}

#[test]
fn closed_form_turns_with_its_axes() {
    let (sin, cos) = 0.4_f64.sin_cos();
    let straight = setup();
    let turned = Setup {
        angles: straight.angles.iter().map(|a| a + 0.4).collect(),
        ..straight.clone()
    };
    // A pull of 1 along direction 1 of the turned plate, in the laminate's own axes.
    let own = HoleSolution::new(
        &straight.membrane(&NOMINAL),
        2.0,
        [cos * cos, sin * sin, -sin * cos],
    )
    .unwrap();
    let seen = HoleSolution::new(&turned.membrane(&NOMINAL), 2.0, [1.0, 0.0, 0.0]).unwrap();
    for k in 0..24 {
        let (s, c) = (0.26 * f64::from(k)).sin_cos();
        let p = [2.5 * c, 2.5 * s];
        let u = own.displacement([cos * p[0] + sin * p[1], cos * p[1] - sin * p[0]]);
        let v = seen.displacement(p);
        let back = [cos * u[0] - sin * u[1], sin * u[0] + cos * u[1]];
        let size = v[0].hypot(v[1]);
        assert!(
            (back[0] - v[0]).hypot(back[1] - v[1]) < 1e-10 * size,
            "{back:?} {v:?}"
        );
    }
}
