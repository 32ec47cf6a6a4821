//! Plates of metal that yield: closed forms, the flow rule integrated independently, equilibrium, invariances, convergence, energy.

mod effect;
mod reference;
mod table;

use nalgebra::{Matrix3, Vector3};
use plychain::fem::element::{self, GAUSS};
use plychain::fem::{J2, Locator, Plastic, Plate, Setup, Yield, YieldFrame, end_forces};
use plychain::field::rigid;
use plychain::geometry::Density;
use plychain::laminate::{LoadSpec, Ply, SpecimenSpec};

use crate::verify::window_points;
use serde_json::json;

/// Steel, MPa.
const E: f64 = 214e3;
const NU: f64 = 0.28;
const YIELD: f64 = 270.0;
const HARDENING: f64 = 1800.0;

/// Half of the square about the hole in which fields are compared, mm.
const HALF: f64 = 9.3;

fn steel() -> Ply {
    Ply::isotropic(E, NU)
}

/// A strip of 80 x 20 x 2 mm with a hole of 8 mm or without one, under a force of so many times the gross section's yield force.
fn strip(hole: bool, level: f64) -> Setup {
    let mut specimen =
        json!({ "length_mm": 80.0, "width_mm": 20.0, "thickness_mm": { "mean": 2.0, "sd": 0.0 } });
    if hole {
        specimen["hole"] = json!({ "diameter_mm": 8.0, "center_mm": [0.0, 0.0] });
    }
    let specimen: SpecimenSpec = serde_json::from_value(specimen).unwrap();
    let load = LoadSpec {
        force_n: level * YIELD * 40.0,
    };
    Setup {
        yield_stress: Some(YIELD),
        yielding: Some(Yield {
            share: 1.0,
            stress: YIELD,
            hardening: HARDENING / E,
        }),
        ..Setup::nominal(&specimen, &load, 1.0)
    }
}

fn plate(setup: &Setup, density: f64) -> Plate {
    Plate::new(setup, Density(density)).unwrap()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// A nodal field in the window about the hole without its rigid motion, both components of every point.
fn in_window(plate: &Plate, nodal: &[f64]) -> Vec<f64> {
    let points = window_points(&*plate.geometry, HALF);
    let (observer, inside) = Locator::new(&plate.mesh).observe(&points);
    assert!(inside.iter().all(|x| *x));
    let u = observer.displacement(nodal);
    let motion = rigid::fit(&points, &u);
    let pairs = points.iter().zip(&u);
    pairs
        .flat_map(|(&p, u)| {
            let m = motion.at(p);
            [u[0] - m[0], u[1] - m[1]]
        })
        .collect()
}

/// A uniform strip is a tension test: on the bilinear curve while it is loaded, along the elastic slope while it is unloaded, and, with
/// isotropic hardening, yielding again in compression at the stress that was reached in tension.
#[test]
fn a_plain_strip_follows_the_bilinear_law() {
    let setup = strip(false, 1.2);
    let plate = plate(&setup, 0.2);
    let history = [0.5, 0.9, 1.0, 0.3, 0.0, 0.95, 1.1, -0.5, -1.2];
    let frames = plate.yielding(&setup, &steel(), &history, 1.0).unwrap();
    let observer = Locator::new(&plate.mesh).observe(&[[3.1, -2.2]]).0;
    let (mut plastic, mut limit) = (0.0, YIELD);
    for (factor, frame) in history.into_iter().zip(frames) {
        let stress: f64 = 1.2 * YIELD * factor;
        if stress.abs() > limit {
            plastic += stress.signum() * (stress.abs() - limit) / HARDENING;
            limit = stress.abs();
        }
        let wanted = [stress / E + plastic, -NU * stress / E - 0.5 * plastic];
        let gradient = observer.gradient(&frame.nodal)[0];
        for k in 0..2 {
            let error = (gradient[k][k] - wanted[k]).abs() / (YIELD / E);
            assert!(error < 1e-6, "{factor}: {error:e}");
        }
        assert!((frame.stresses[0] - Vector3::new(stress, 0.0, 0.0)).norm() < 1e-4);
    }
}

/// The rate equations of the flow rule, dep = dl n with n = 3/2 (deviator) / s_vm and f = s_vm - (sigma_y + H l) = 0, by the midpoint rule
/// over many small steps; written for the 3 x 3 stress with s33 = 0.
fn by_rates(law: &J2, path: &[Vector3<f64>], steps: usize) -> (Vector3<f64>, f64) {
    let (e, nu) = (law.young, law.poisson);
    let d = Matrix3::new(1.0, nu, 0.0, nu, 1.0, 0.0, 0.0, 0.0, 0.5 * (1.0 - nu))
        * (e / (1.0 - nu * nu));
    // (normal for engineering strains, von Mises stress) from the deviator of the full stress
    let normal = |s: &Vector3<f64>| {
        let full = Matrix3::new(s.x, s.z, 0.0, s.z, s.y, 0.0, 0.0, 0.0, 0.0);
        let deviator = full - Matrix3::identity() * (full.trace() / 3.0);
        let size = (1.5 * deviator.norm_squared()).sqrt();
        let n = deviator * (1.5 / size);
        (Vector3::new(n[(0, 0)], n[(1, 1)], 2.0 * n[(0, 1)]), size)
    };
    let rate = |s: &Vector3<f64>, length: f64, de: &Vector3<f64>| {
        let (n, size) = normal(s);
        let elastic = d * de;
        let loading = n.dot(&elastic);
        if size < law.yield_stress + law.hardening * length || loading <= 0.0 {
            return (elastic, 0.0);
        }
        let dl = loading / (n.dot(&(d * n)) + law.hardening);
        (elastic - d * n * dl, dl)
    };
    let (mut stress, mut length) = (Vector3::zeros(), 0.0);
    for ends in path.windows(2) {
        let de = (ends[1] - ends[0]) / steps as f64;
        for _ in 0..steps {
            let (ds, dl) = if stress == Vector3::zeros() {
                (d * de, 0.0)
            } else {
                rate(&stress, length, &de)
            };
            let (ds, dl) = rate(&(stress + ds * 0.5), length + 0.5 * dl, &de);
            stress += ds;
            length += dl;
        }
    }
    (stress, length)
}

#[test]
fn the_flow_rule_agrees_with_its_rate_equations() {
    let law = J2 {
        young: E,
        poisson: NU,
        yield_stress: YIELD,
        hardening: HARDENING,
    };
    let point = |x: f64, y: f64, z: f64| Vector3::new(x, y, z) * 1e-3;
    for path in [
        vec![point(0.0, 0.0, 0.0), point(4.0, 1.0, 0.0)],
        vec![point(0.0, 0.0, 0.0), point(3.0, 2.5, -2.0)],
        vec![
            point(0.0, 0.0, 0.0),
            point(4.0, -1.0, 3.0),
            point(4.0, 2.0, -1.0),
            point(1.0, 2.0, -1.0),
        ],
    ] {
        let (wanted, length) = by_rates(&law, &path, 20_000);
        let mut plastic = Plastic::default();
        for ends in path.windows(2) {
            for k in 1..=20_000 {
                let strain = ends[0] + (ends[1] - ends[0]) * (f64::from(k) / 20_000.0);
                plastic = law.advance(&plastic, &strain);
            }
        }
        let found = law.stress_at(path.last().unwrap(), &plastic);
        assert!(length > 1e-3);
        assert!((found - wanted).norm() < 1e-3 * YIELD, "{found} {wanted}");
        assert!((plastic.equivalent / length - 1.0).abs() < 1e-3);
    }
}

/// Nodal forces of stresses at the Gauss points, assembled here, and the free ends of the plate's load.
fn internal_forces(plate: &Plate, setup: &Setup, frame: &YieldFrame) -> Vec<f64> {
    let mut force = vec![0.0; plate.mesh.unknowns()];
    let mut stresses = frame.stresses.iter();
    for (e, nodes) in plate.mesh.elements.iter().enumerate() {
        for (a, wa) in GAUSS {
            for (b, wb) in GAUSS {
                let (gradient, det) = element::physical_gradient(&plate.mesh.corners(e), a, b);
                let n = stresses.next().unwrap() * (setup.thickness * wa * wb * det);
                for (&node, [g1, g2]) in nodes.iter().zip(gradient) {
                    force[2 * node as usize] += g1 * n.x + g2 * n.z;
                    force[2 * node as usize + 1] += g2 * n.y + g1 * n.z;
                }
            }
        }
    }
    force
}

#[test]
fn converged_stresses_balance_the_load_within_the_yield_surface() {
    let setup = strip(true, 0.65);
    let plate = plate(&setup, 0.35);
    let frames = plate
        .yielding(&setup, &steel(), &[0.7, 1.0, 0.0], 1.0)
        .unwrap();
    let load = end_forces(&plate.mesh, &setup.load);
    for frame in &frames {
        let load: Vec<f64> = load.iter().map(|f| frame.factor * f).collect();
        let rest = largest(&less(&internal_forces(&plate, &setup, frame), &load));
        let size = largest(&end_forces(&plate.mesh, &setup.load));
        assert!(rest < 1e-8 * size, "{}: {rest:e}", frame.factor);
        let mut flowing = 0;
        for (s, equivalent) in frame.stresses.iter().zip(&frame.equivalent) {
            let mises = (s.x * s.x - s.x * s.y + s.y * s.y + 3.0 * s.z * s.z).sqrt();
            let excess = mises - YIELD - HARDENING * equivalent;
            assert!(excess < 1e-6 * YIELD, "{}: {excess}", frame.factor);
            flowing += usize::from(*equivalent > 0.0);
        }
        assert!(flowing > frame.stresses.len() / 50);
    }
}

#[test]
fn plasticity_has_no_scale_of_its_own() {
    let setup = strip(true, 0.6);
    let plate = plate(&setup, 0.25);
    let part = |setup: &Setup, ply: &Ply| {
        let frames = plate.yielding(setup, ply, &[1.0], 1.0).unwrap();
        frames[0].plastic_part.clone()
    };
    let nominal = part(&setup, &steel());
    let mut other = setup.clone();
    let (stress, thickness, modulus) = (0.4, 1.7, 0.33);
    other.thickness *= thickness;
    other.load = other.load.times(stress * thickness);
    other.yielding = other.yielding.map(|y| Yield {
        stress: stress * y.stress,
        ..y
    });
    let scaled = part(&other, &Ply::isotropic(modulus * E, NU));
    let expected: Vec<f64> = nominal.iter().map(|u| u * stress / modulus).collect();
    let error = largest(&less(&scaled, &expected)) / largest(&expected);
    assert!(error < 1e-6, "{error:e}");
}

/// Increments four times smaller, and a mesh finer by a half, change the plastic part by less than four per mille and two per cent of its size.
#[test]
#[ignore = "slow: run by .ci/run"]
fn the_plastic_part_converges_with_increments_and_mesh() {
    for level in [0.45, 0.55] {
        let setup = strip(true, level);
        let solve = |plate: &Plate, finer: f64| {
            let frames = plate.yielding(&setup, &steel(), &[1.0], finer).unwrap();
            in_window(plate, &frames[0].plastic_part)
        };
        let [coarse, fine] = [0.5, 0.75].map(|density| plate(&setup, density));
        let usual = solve(&coarse, 1.0);
        let small = solve(&coarse, 4.0);
        let mesh = solve(&fine, 1.0);
        let [increments, mesh] =
            [&small, &mesh].map(|u| largest(&less(u, &usual)) / largest(&usual));
        println!("level {level}: increments {increments:.1e}, mesh {mesh:.1e}");
        assert!(increments < 4e-3, "{level}: {increments}");
        // of coarse meshes; that of the default is finer than both
        assert!(mesh < 2e-2, "{level}: {mesh}");
    }
}

/// The load's work is the elastic energy and what the flow takes, sigma_y l + H l^2 / 2 a volume; the plate softens as it yields.
#[test]
fn work_is_energy_and_dissipation() {
    let setup = strip(true, 0.6);
    let plate = plate(&setup, 0.25);
    let factors: Vec<f64> = (1..=60).map(|k| f64::from(k) / 60.0).collect();
    let frames = plate.yielding(&setup, &steel(), &factors, 1.0).unwrap();
    let load = end_forces(&plate.mesh, &setup.load);
    let stretch = |f: &YieldFrame| load.iter().zip(&f.nodal).map(|(f, u)| f * u).sum::<f64>();
    let (mut work, mut before) = (0.0, [0.0; 2]);
    let mut compliance = 0.0;
    for frame in &frames {
        let now = [frame.factor, stretch(frame)];
        work += 0.5 * (before[0] + now[0]) * (now[1] - before[1]);
        let slope = (now[1] - before[1]) / (now[0] - before[0]);
        assert!(slope > compliance * (1.0 - 1e-8), "{}", frame.factor);
        (compliance, before) = (slope, now);
    }
    let last = &frames[frames.len() - 1];
    let mut stored = 0.0;
    let mut dissipated = 0.0;
    let mut points = last.stresses.iter().zip(&last.equivalent);
    for e in 0..plate.mesh.elements.len() {
        for (a, wa) in GAUSS {
            for (b, wb) in GAUSS {
                let det = element::physical_gradient(&plate.mesh.corners(e), a, b).1;
                let volume = setup.thickness * wa * wb * det;
                let (s, l) = points.next().unwrap();
                let normal = s.x * s.x + s.y * s.y - 2.0 * NU * s.x * s.y;
                stored += volume * (normal + 2.0 * (1.0 + NU) * s.z * s.z) / (2.0 * E);
                dissipated += volume * (YIELD * l + 0.5 * HARDENING * l * l);
            }
        }
    }
    let error = (work - stored - dissipated) / dissipated;
    println!("work {work}, stored {stored}, dissipated {dissipated}: {error:e}");
    assert!(dissipated > 0.01 * stored);
    assert!(error.abs() < 5e-3, "{error}");
}

/// Unloading is taken as elastic. The stress beside the hole falls by 3.75 times the nominal one and yields again in compression where that
/// exceeds twice the yield stress, from a level of 0.53; what it changes stays small up to where the ligaments flow.
#[test]
fn yielding_again_on_unloading_changes_little() {
    for (level, most) in [(0.45, 1e-9), (0.55, 1e-3), (0.65, 0.02)] {
        let setup = strip(true, level);
        let plate = plate(&setup, 0.35);
        let frames = plate.yielding(&setup, &steel(), &[1.0, 0.0], 1.0).unwrap();
        let [peak, unloaded] = [0, 1].map(|k| in_window(&plate, &frames[k].plastic_part));
        let change = largest(&less(&peak, &unloaded));
        let share = change / largest(&peak);
        println!(
            "level {level}: plastic part {:.2} um, changes by {:.3} um ({share:.1e}) on unloading",
            1e3 * largest(&peak),
            1e3 * change
        );
        assert!(share < most, "{level}: {share}");
    }
}
