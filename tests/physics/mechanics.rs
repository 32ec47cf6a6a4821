//! Mechanical effects: reference fields, equivalent models, closed forms, symmetry, convergence, refusals.

use std::sync::Arc;

use crate::common::article;
use nalgebra::{Matrix3, Vector3};
use plychain::effect::limit::alter_checked;
use plychain::effect::{self, Acting, EFFECTS, Effect, EffectParameter, Entry, Kind, Scene};
use plychain::experiment::{Gauge, PointSet, State, gauged, predict};
use plychain::fem::{Locator, Plate, Setup, end_forces};
use plychain::field::matrices;
use plychain::field::{Axis, Frame};
use plychain::geometry::{Density, PlainStrip};
use plychain::laminate::{Material, Ply, strain_rotation};

use crate::verify::{difference, window_points, without_rigid_motion};

use crate::reduce::{scene, small_problem, small_test};

const PLY: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

type Field = Vec<[f64; 2]>;

/// The article's plate, loaded along y, with a hole of some diameter at some place (direction 1, direction 2).
fn nominal(diameter: f64, center: [f64; 2]) -> Setup {
    article::setup(diameter, center, -1.0)
}

fn with(name: &str, amplitude: &[f64]) -> Setup {
    let mut setup = nominal(4.0, [0.0; 2]);
    effect::find("test", name)
        .unwrap()
        .alter(amplitude, &mut setup);
    setup
}

/// Mechanical effects that can act on a laminate.
/// Those that can act on a laminate with a hole.
fn mechanical() -> impl Iterator<Item = &'static dyn Effect> {
    let scene = scene(&small_test());
    EFFECTS
        .iter()
        .copied()
        .filter(move |e| e.kind() == Kind::Mechanical && e.why_not(&scene).is_none())
}

fn solve(plate: &Plate, setup: &Setup, points: &[[f64; 2]]) -> Field {
    let solution = plate.solve(setup, &PLY).unwrap();
    let (observer, inside) = Locator::new(&solution.mesh).observe(points);
    assert!(inside.iter().all(|x| *x));
    observer.displacement(&solution.nodal)
}

/// Points of the window that stay on the plate whatever effect acts.
fn points() -> Vec<[f64; 2]> {
    window_points(&*nominal(5.2, [0.0; 2]).geometry, 11.5)
}

fn largest(u: &[[f64; 2]]) -> f64 {
    u.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()))
}

fn combine(a: f64, u: &[[f64; 2]], b: f64, v: &[[f64; 2]]) -> Field {
    let sum = |(u, v): (&[f64; 2], &[f64; 2])| [a * u[0] + b * v[0], a * u[1] + b * v[1]];
    u.iter().zip(v).map(sum).collect()
}

#[test]
#[ignore = "needs ../shared"]
fn independent_reference_fields_of_effects() {
    let frame = Frame {
        loading_axis: Axis::Y,
        hole_center_mm: [0.0; 2],
    };
    for (name, amplitude) in [
        ("ply_misorientation", 1.0),
        ("load_misalignment", 1.0),
        ("in_plane_bending", 0.2),
    ] {
        let folder = format!("open-hole-reference/{}", name.replace('_', "-"));
        let folder = crate::common::shared(&folder);
        let read = matrices::read(&folder, frame).unwrap();
        let setup = with(name, &[amplitude]);
        let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
        let error = difference(
            &read.points,
            &solve(&plate, &setup, &read.points),
            &read.displacement,
        );
        assert!(error < 1e-5, "{name}: {error:e}");
    }
}

#[test]
fn another_hole_is_the_plate_with_that_hole() {
    let plate = Plate::new(&nominal(4.0, [0.0; 2]), Density::DEFAULT).unwrap();
    let points = points();
    // Loading along y: dx runs along direction 2, dy along direction 1.
    for (name, amplitude, other) in [
        ("hole_size", vec![6.0], nominal(4.24, [0.0; 2])),
        ("hole_size", vec![-10.0], nominal(3.6, [0.0; 2])),
        ("hole_offset", vec![0.8, -0.5], nominal(4.0, [-0.5, 0.8])),
    ] {
        let direct = Plate::new(&other, Density::DEFAULT).unwrap();
        let altered = solve(&plate, &with(name, &amplitude), &points);
        let error = difference(&points, &altered, &solve(&direct, &other, &points));
        assert!(error < 1e-5, "{name}: {error:e}");
    }
}

#[test]
fn an_offset_along_x_is_direction_1_where_the_load_is_along_x() {
    let mut setup = nominal(4.0, [0.0; 2]);
    setup.handedness = 1.0;
    effect::find("test", "hole_offset")
        .unwrap()
        .alter(&[2.0, 0.5], &mut setup);
    assert_eq!(setup.morph.hole_offset, [2.0, 0.5]);
    let moved = setup.geometry.morphed(&setup.morph).unwrap();
    assert_eq!(moved.extents(), [[-102.0, 98.0], [-13.0, 12.0]]);
}

/// A plate without a hole.
fn unnotched() -> (Setup, Plate) {
    let mut setup = nominal(4.0, [0.0; 2]);
    setup.geometry = Arc::new(PlainStrip::of(&article::strip(200.0, 4.0, [0.0; 2])));
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    (setup, plate)
}

/// Strains 11, 22, 12 at points.
fn strains(plate: &Plate, setup: &Setup, points: &[[f64; 2]]) -> Vec<Vector3<f64>> {
    let solution = plate.solve(setup, &PLY).unwrap();
    let (observer, _) = Locator::new(&solution.mesh).observe(points);
    let strain = |g: &[[f64; 2]; 2]| Vector3::new(g[0][0], g[1][1], g[0][1] + g[1][0]);
    observer
        .gradient(&solution.nodal)
        .iter()
        .map(strain)
        .collect()
}

/// N22 = N12 = 0 and eps11 = e0 + k t' balance a uniform end force on h (1 + f t' / W): k = -f e0 / W and
/// e0 (1 - f^2 / 12) = F / (W E h).
#[test]
fn a_taper_across_bends_the_far_field_as_the_beam_does() {
    let (mut setup, plate) = unnotched();
    let f = 0.2;
    setup.profile.across = f;
    let width = setup.width();
    let compliance = setup.membrane(&PLY).matrix().try_inverse().unwrap();
    let e0 = setup.load.axial / width * compliance[(0, 0)] / (1.0 - f * f / 12.0);
    // as far from both ends as can be, whose own fields have decayed there
    let points: Vec<[f64; 2]> = [-11.0, -6.0, 0.0, 4.0, 12.0].map(|t| [0.0, t]).into();
    for (p, strain) in points.iter().zip(strains(&plate, &setup, &points)) {
        let wanted = e0 * (1.0 - f * p[1] / width);
        let ratio = compliance[(1, 0)] / compliance[(0, 0)];
        assert!(
            (strain[0] / wanted - 1.0).abs() < 1e-4,
            "{p:?} {strain} {wanted}"
        );
        assert!((strain[1] / (ratio * wanted) - 1.0).abs() < 1e-4, "{p:?}");
        assert!(strain[2].abs() < 1e-4 * e0, "{p:?}");
    }
}

/// A strip is stiffer by what it is wider, and a plate with a hole is that of the wider declaration.
#[test]
fn a_wider_plate_is_the_one_that_is_declared_so() {
    let factor = 1.02;
    let wider = with("width_error", &[2.0]);
    let mut specimen = article::strip(200.0, 4.0, [0.0; 2]);
    specimen.width_mm *= factor;
    let mut declared = nominal(4.0, [0.0; 2]);
    declared.geometry = plychain::geometry::declared(&specimen);
    let points = points();
    let solved = |setup: &Setup| {
        let plate = Plate::new(setup, Density::DEFAULT).unwrap();
        solve(&plate, setup, &points)
    };
    assert!(difference(&points, &solved(&wider), &solved(&declared)) < 1e-5);
    let strip = |percent: f64| {
        let mut setup = with("width_error", &[percent]);
        setup.geometry = Arc::new(PlainStrip::of(&article::strip(200.0, 4.0, [0.0; 2])));
        let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
        strains(&plate, &setup, &[[3.0, 1.0]])[0][0]
    };
    let ratio = strip(0.0) / strip(2.0);
    assert!((ratio / factor - 1.0).abs() < 1e-9, "{ratio}");
}

/// Through every section goes the end force, whatever the profile.
#[test]
fn sections_of_a_tapered_and_damaged_plate_carry_the_load() {
    let mut setup = with("thickness_taper", &[10.0, -15.0]);
    effect::find("test", "hole_edge_damage")
        .unwrap()
        .alter(&[30.0, 0.0], &mut setup);
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    let a = setup.membrane(&PLY).matrix();
    for s in [-60.0_f64, -20.0, -3.5, -1.0, 0.0, 2.3, 9.0, 45.0] {
        let (n, mut sum) = (4000, 0.0);
        let step = 25.0 / f64::from(n);
        let points: Vec<[f64; 2]> = (0..n)
            .map(|k| [s, -12.5 + (f64::from(k) + 0.5) * step])
            .filter(|p| p[0].hypot(p[1]) > 2.0)
            .collect();
        for (p, strain) in points.iter().zip(strains(&plate, &setup, &points)) {
            sum += step * setup.profile.factor(&*setup.geometry, *p) * (a * strain)[0];
        }
        assert!((sum / 700.0 - 1.0).abs() < 3e-3, "s = {s}: {sum}");
    }
}

#[test]
fn damage_of_nothing_is_the_nominal_plate_and_loss_makes_it_compliant() {
    let plate = Plate::new(&nominal(4.0, [0.0; 2]), Density::DEFAULT).unwrap();
    let points = points();
    let healthy = solve(&plate, &nominal(4.0, [0.0; 2]), &points);
    let none = solve(&plate, &with("hole_edge_damage", &[0.0, 0.0]), &points);
    assert!(difference(&points, &none, &healthy) < 1e-5);
    let work = |loss: f64| {
        let setup = with("hole_edge_damage", &[loss, 0.0]);
        let solution = plate.solve(&setup, &PLY).unwrap();
        let force = end_forces(&solution.mesh, &setup.load);
        force
            .iter()
            .zip(&solution.nodal)
            .map(|(f, u)| f * u)
            .sum::<f64>()
    };
    let works = [-60.0, -20.0, 0.0, 20.0, 60.0].map(work);
    assert!(works.windows(2).all(|w| w[1] > w[0]), "{works:?}");
}

/// The loss at the hole's edge is the stated one; of the deeper mixture more is left far from it.
#[test]
fn damage_fades_into_the_plate() {
    let factor = |deeper: f64, radii: f64| {
        let setup = with("hole_edge_damage", &[30.0, deeper]);
        let p = [2.0 * radii * 0.6, -2.0 * radii * 0.8];
        setup.profile.factor(&*setup.geometry, p)
    };
    let all = |depth: f64, radii: f64| 1.0 - 0.3 * ((1.0 - radii) / depth).exp();
    for radii in [1.0, 1.1, 1.5, 3.0] {
        let [near, far] = [all(0.12, radii), all(0.4, radii)];
        assert!((factor(-30.0, radii) - near).abs() < 1e-12);
        assert!((factor(30.0, radii) - far).abs() < 1e-12);
        assert!((factor(0.0, radii) - 0.5 * (near + far)).abs() < 1e-12);
    }
}

/// Shear stress of a ply at a shear strain under gamma = tau / G + beta tau^3, by bisection.
fn ply_shear(gamma: f64, beta: f64) -> f64 {
    let (mut low, mut high) = (-PLY.g12 * gamma.abs(), PLY.g12 * gamma.abs());
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle / PLY.g12 + beta * middle.powi(3) < gamma {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The laminate's strain under uniform N11 by Newton's method on the plies' equations.
fn uniform_strain(setup: &Setup, n11: f64, beta: f64) -> Vector3<f64> {
    let q = PLY.stiffness();
    let h = setup.thickness / setup.angles.len() as f64;
    let resultants = |strain: &Vector3<f64>| -> Vector3<f64> {
        let ply = |&angle: &f64| {
            let turn = strain_rotation(angle);
            let own = turn * strain;
            let mut stress = q * own;
            stress[2] = ply_shear(own[2], beta);
            turn.transpose() * stress * h
        };
        setup.angles.iter().map(ply).sum()
    };
    let mut strain = Vector3::zeros();
    for _ in 0..50 {
        let rest = Vector3::new(n11, 0.0, 0.0) - resultants(&strain);
        let jacobian = Matrix3::from_fn(|i, j| {
            let mut moved = strain;
            moved[j] += 1e-8;
            (resultants(&moved)[i] - resultants(&strain)[i]) / 1e-8
        });
        strain += jacobian.try_inverse().unwrap() * rest;
    }
    strain
}

#[test]
fn nonlinear_plies_strain_as_their_equations_say() {
    let (mut setup, plate) = unnotched();
    setup.load.axial = 2000.0;
    setup.shear_cubic = 2e-7;
    // A layup without fibres along the load, with coupling of extension and shear.
    setup.angles = [45.0_f64, -45.0, 30.0, 45.0].map(f64::to_radians).into();
    let n11 = setup.load.axial / setup.width();
    let wanted = uniform_strain(&setup, n11, setup.shear_cubic);
    let linear = uniform_strain(&setup, n11, 0.0);
    let found = strains(&plate, &setup, &[[-70.0, 3.0]])[0];
    assert!((wanted - linear).norm() > 0.03 * linear.norm());
    assert!((wanted - found).norm() < 1e-4 * wanted.norm());
}

#[test]
fn the_shear_law_is_odd_in_beta_to_first_order_and_has_its_linear_limit() {
    let plate = Plate::new(&nominal(4.0, [0.0; 2]), Density::DEFAULT.scaled(0.5)).unwrap();
    let points = points();
    let zero = solve(&plate, &nominal(4.0, [0.0; 2]), &points);
    let rate = |beta: f64| {
        let u = solve(&plate, &with("shear_nonlinearity", &[beta]), &points);
        combine(1.0 / beta, &u, -1.0 / beta, &zero)
    };
    let slope = rate(1e-10);
    for beta in [1e-9, -1e-9, -1e-10] {
        let other = rate(beta);
        let error = largest(&combine(1.0, &other, -1.0, &slope)) / largest(&slope);
        assert!(error < 0.01, "{beta}: {error}");
    }
    // A large amplitude of either sign is solved, and softening stretches the plate.
    for beta in [1e-6, -1e-6] {
        let u = combine(1.0, &rate(beta), 0.0, &slope);
        assert!(largest(&u).is_finite() && largest(&u) > 0.1 * largest(&slope));
    }
}

/// Half the difference of the fields at amplitudes +a and -a, without rigid motion.
fn signature(plate: &Plate, effect: &dyn Effect, k: usize, a: f64, points: &[[f64; 2]]) -> Field {
    let at = |a: f64| {
        let mut setup = nominal(4.0, [0.0; 2]);
        let mut amplitude = vec![0.0; effect.parameters().len()];
        amplitude[k] = a;
        effect.alter(&amplitude, &mut setup);
        solve(plate, &setup, points)
    };
    without_rigid_motion(points, &combine(0.5, &at(a), -0.5, &at(-a)))
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn changes_of_the_field_converge_and_are_linear_where_small() {
    let setup = nominal(4.0, [0.0; 2]);
    let coarse = Plate::new(&setup, Density::DEFAULT).unwrap();
    let fine = Plate::new(&setup, Density::DEFAULT.scaled(1.5)).unwrap();
    let points = points();
    for effect in mechanical() {
        for (k, parameter) in effect.parameters().iter().enumerate() {
            let tau = parameter.prior_sd.unwrap();
            let u = signature(&coarse, effect, k, tau, &points);
            let v = signature(&fine, effect, k, tau, &points);
            let w = signature(&coarse, effect, k, 0.1 * tau, &points);
            let refined = largest(&combine(1.0, &u, -1.0, &v)) / largest(&v);
            let curved = largest(&combine(1.0, &u, -10.0, &w)) / largest(&u);
            if largest(&v) < 1e-8 {
                // A hole beside its place along the load leaves nothing but the ends' tractions far away.
                assert_eq!(parameter.name, "dy_mm");
                continue;
            }
            assert!(refined < 0.01, "{}: {refined}", effect.name());
            assert!(curved < 0.1, "{}: {curved}", effect.name());
        }
    }
}

#[test]
fn a_quadratic_field_goes_on_beyond_the_mesh() {
    let geometry = plychain::geometry::declared(&article::strip(120.0, 4.0, [0.0; 2]));
    let plate = Plate::meshed(geometry, None, Density::DEFAULT).unwrap();
    let exact = |[x, y]: [f64; 2]| {
        [
            1.0 + 2.0 * x - y + 0.3 * x * x - 0.1 * x * y + 0.05 * y * y,
            0.5 * x * y - y * y + 0.02 * x * x,
        ]
    };
    let u: Vec<f64> = plate.mesh.nodes.iter().flat_map(|&p| exact(p)).collect();
    let mut points: Vec<[f64; 2]> = (0..90)
        .map(|k| {
            let (sin, cos) = f64::from(k).sin_cos();
            let r = 2.0 - 0.3 * f64::from(k % 7) / 6.0 - 1e-6;
            [r * cos, r * sin]
        })
        .collect();
    points.extend([[3.0, 12.8], [-7.0, -12.6], [60.3, 2.0], [11.0, 12.500_01]]);
    let (_, inside) = Locator::new(&plate.mesh).observe(&points);
    assert!(inside.iter().all(|x| !x));
    let observer = Locator::new(&plate.mesh).observe_extended(&points);
    assert_eq!(observer.count(), points.len());
    let values = observer.displacement(&u);
    for ((&p, v), g) in points.iter().zip(values).zip(observer.gradient(&u)) {
        let e = exact(p);
        let size = 1.0 + e[0].abs() + e[1].abs();
        assert!(
            (v[0] - e[0]).abs().max((v[1] - e[1]).abs()) < 1e-8 * size,
            "{p:?} {v:?} {e:?}"
        );
        let slope = 2.0 + 0.6 * p[0] - 0.1 * p[1];
        assert!(
            (g[0][0] - slope).abs() < 1e-6 * (1.0 + slope.abs()),
            "{p:?}"
        );
    }
    // Points inside see their element, as ever.
    let all = Locator::new(&plate.mesh).observe_extended(&[[3.0, 1.0]]);
    let (some, _) = Locator::new(&plate.mesh).observe(&[[3.0, 1.0]]);
    assert_eq!(all.displacement(&u), some.displacement(&u));
}

#[test]
fn an_amplitude_that_cannot_be_is_refused_with_its_bound() {
    let acting = |name: &str, amplitude: &[f64]| Acting {
        effect: effect::find("test", name).unwrap(),
        amplitude: amplitude.to_vec(),
    };
    for (acting, bound) in [
        (
            acting("hole_offset", &[11.0, 0.0]),
            "hole_offset.dx_mm = 10.4",
        ),
        (
            acting("thickness_taper", &[0.0, -199.0]),
            "along_percent = -198.0",
        ),
        (acting("hole_size", &[-100.0]), "diameter_percent = -"),
    ] {
        let mut setup = nominal(4.0, [0.0; 2]);
        let error = alter_checked("--effect", &[acting], &mut setup).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().contains(bound), "{error}");
        assert_eq!(
            format!("{setup:?}"),
            format!("{:?}", nominal(4.0, [0.0; 2]))
        );
    }
}

#[test]
fn an_isotropic_plate_has_no_effects_of_its_plies() {
    let mut scene = small_problem().experiment.scene().clone();
    for name in ["ply_misorientation", "shear_nonlinearity"] {
        let effect = effect::find("test", name).unwrap();
        assert!(effect.why_not(&scene).is_none());
        scene.material = Material::Isotropic;
        assert!(effect.why_not(&scene).is_some());
        scene.material = Material::Ply;
    }
}

/// Points are reported beside their places, and displacements turned by a right angle.
struct Shifted;

const SHIFT: [EffectParameter; 1] = [EffectParameter::new("shift_mm", 0.1, 1.0)];

impl Effect for Shifted {
    fn entry(&self) -> Entry {
        Entry {
            name: "shifted",
            kind: Kind::Optical,
            parameters: &SHIFT,
            about: "",
            confirm: "",
        }
    }
    fn true_point(&self, amplitude: &[f64], _: &Scene, [s, t]: [f64; 2]) -> [f64; 2] {
        [s - amplitude[0], t]
    }
    fn components(&self, _: &[f64], _: &Scene, _: [f64; 2], u: [f64; 2]) -> [f64; 2] {
        [-u[1], u[0]]
    }
}

static SHIFTED: Shifted = Shifted;

/// A prediction is the field of the altered plate, seen through the optics, at the nodes of the nominal mesh.
#[test]
fn predictions_see_the_altered_plate_through_the_optics() {
    let experiment = small_problem().experiment;
    let hole_size = effect::find("test", "hole_size").unwrap();
    let test = small_test();
    let nominal = Plate::new(&scene(&test).setup, test.density).unwrap();
    // an effect without amplitude does not act: a shift that is as good as none turns the displacements
    const NONE: f64 = 1e-12;
    for (size, shift) in [
        (0.0, NONE),
        (-5.0, NONE),
        (6.0, NONE),
        (0.0, 0.2),
        (4.0, -0.3),
    ] {
        let acting = |effect, amplitude| Acting {
            effect,
            amplitude: vec![amplitude],
        };
        let state = State::new(&[160.0, 7.5, 0.34, 4.5], 0.78);
        let state = state.with([acting(hole_size, size), acting(&SHIFTED, shift)]);
        let predicted = predict(&*experiment, &state, experiment.support())
            .unwrap()
            .field;
        let Scene { mut setup, ply, .. } = scene(&test);
        hole_size.alter(&[size], &mut setup);
        let solution = nominal.solve(&setup, &ply).unwrap();
        let reported = experiment.support().points();
        let places: Vec<[f64; 2]> = reported.iter().map(|p| [p[0] - shift, p[1]]).collect();
        let (observer, inside) = Locator::new(&solution.mesh).observe(&places);
        let seen: Vec<usize> = (0..places.len()).filter(|&k| inside[k]).collect();
        assert!(seen.len() > places.len() * 9 / 10);
        let expected: Field = observer
            .displacement(&solution.nodal)
            .iter()
            .map(|u| [-u[1], u[0]])
            .collect();
        let places: Vec<[f64; 2]> = seen.iter().map(|&k| reported[k]).collect();
        let found: Field = seen.iter().map(|&k| predicted[k]).collect();
        let window = PointSet::anywhere(&places, &[]);
        let [found, expected] = [found, expected].map(|u| gauged(Gauge::Window, &window, &u));
        let error = largest(&combine(1.0, &found, -1.0, &expected)) / largest(&expected);
        assert!(error < 1e-9, "{size} {shift}: {error:e}");
    }
}
