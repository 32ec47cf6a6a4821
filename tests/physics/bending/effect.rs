//! What `out_of_plane_bending` shows of a specimen with and without a hole, with and without a camera at a distance.

use nalgebra::{Matrix3, Vector3};
use plychain::effect::{Effect, Scene, find};
use plychain::experiment::{FieldExperiment, FieldTest, Mechanics, Places};
use plychain::infer::{Model, experiment_over};
use plychain::laminate::PlateStiffness;

use crate::common::{changed, root};
use crate::reduce::{scene, small_test};

type Field = Vec<[f64; 2]>;

const WINDOW: [[f64; 2]; 2] = [[-8.0, -6.0], [4.0, 10.0]];

fn bending() -> &'static dyn Effect {
    find("test", "out_of_plane_bending").unwrap()
}

fn test(hole: bool, length_mm: f64) -> FieldTest {
    let mut test = small_test();
    test.window = WINDOW;
    test.specimen.length_mm = length_mm;
    if !hole {
        test.specimen.hole = None;
    }
    test
}

/// Scene of a test with a camera at a distance.
fn seen_from(test: &FieldTest, camera_distance_mm: Option<f64>) -> Scene {
    Scene {
        camera_distance_mm,
        ..scene(test)
    }
}

fn lattice([low, high]: [[f64; 2]; 2]) -> Field {
    let at = |k: usize, i: u32| low[k] + (high[k] - low[k]) * (f64::from(i) + 0.5) / 60.0;
    (0..60)
        .flat_map(|i| (0..60).map(move |j| [at(0, i), at(1, j)]))
        .filter(|p| p[0].hypot(p[1]) > 2.0)
        .collect()
}

fn added(test: &FieldTest, distance: Option<f64>, points: &Field, amplitude: [f64; 2]) -> Field {
    let experiment = FieldExperiment::new(test.clone(), seen_from(test, distance)).unwrap();
    let (sight, inside) = experiment.locate(points, &[]);
    assert!(inside.iter().all(|inside| *inside));
    experiment.added(bending(), &amplitude, &sight).unwrap()
}

fn rms(field: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = field.map(|v| v * v).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn difference(a: &Field, b: &Field) -> f64 {
    rms(a
        .iter()
        .flatten()
        .zip(b.iter().flatten())
        .map(|(a, b)| a - b))
}

#[test]
fn a_plate_without_a_hole_bends_in_closed_form() {
    let points = lattice(WINDOW);
    for (amplitude, thickness, tolerance) in [
        ([0.025, 0.0], 0.78, 1e-6),
        ([0.0, 0.0025], 0.78, 1e-6),
        ([0.0, 0.0025], 0.078, 1e-6),
    ] {
        let mut test = test(false, 120.0);
        test.specimen.thickness_mm.mean = thickness;
        let scene = seen_from(&test, None);
        let found = added(&test, None, &points, amplitude);
        let plain: Field = points
            .iter()
            .map(|&p| bending().displacement(&amplitude, &scene, p))
            .collect();
        let error = difference(&found, &plain) / rms(plain.into_iter().flatten());
        println!("{amplitude:?}: {error:e}");
        assert!(error < tolerance, "{amplitude:?}: {error:e}");
    }
}

/// Far from the hole the face's strain is that of the gross section; at its edge it is concentrated.
#[test]
fn a_hole_changes_the_strain_beside_it_alone() {
    let mut test = test(true, 160.0);
    test.density = plychain::geometry::Density(0.4);
    let scene = seen_from(&test, None);
    let half = 0.5 * scene.setup.thickness;
    let strain = |s: f64, t: f64| {
        let step = 0.05;
        let pair = vec![[s - step, t], [s + step, t]];
        let u = added(&test, None, &pair, [1.0, 0.0]);
        (u[1][0] - u[0][0]) / (2.0 * step) / (half * 1e-3)
    };
    for s in [-55.0, 50.0] {
        assert!((strain(s, 3.0) - 1.0).abs() < 2e-3, "{}", strain(s, 3.0));
    }
    let edge = strain(0.0, 2.001);
    println!("strain at the edge {edge}");
    assert!((1.2..3.0).contains(&edge), "{edge}");
}

#[test]
fn the_field_is_linear_in_both_amplitudes() {
    let test = test(true, 60.0);
    let points = lattice(WINDOW);
    let of = |amplitude| added(&test, Some(500.0), &points, amplitude);
    let (a, b, both) = (of([0.02, 0.0]), of([0.0, -0.003]), of([0.04, -0.003]));
    let sum: Field = a
        .iter()
        .zip(&b)
        .map(|(a, b)| [0, 1].map(|c| 2.0 * a[c] + b[c]))
        .collect();
    assert!(difference(&both, &sum) < 1e-12 * rms(sum.into_iter().flatten()));
}

/// The camera's report is the projection of the face's points in space, about the middle of the window, where the deflection is that of
/// plate theory without the plane through it.
#[test]
fn the_deflection_is_seen_in_perspective() {
    let test = test(false, 120.0);
    let distance = 400.0;
    let points = lattice(WINDOW);
    let amplitude = [0.05, 0.0];
    let [face, seen] = [None, Some(distance)].map(|z| added(&test, z, &points, amplitude));
    let scene = seen_from(&test, None);
    let plate = PlateStiffness::of(&scene.ply, &scene.setup.angles, scene.setup.thickness);
    let kappa = plate.curvature(&Vector3::x());
    let kappa = kappa * (amplitude[0] * 1e-3 / kappa[0]);
    let raw = |[s, t]: [f64; 2]| -0.5 * (kappa[0] * s * s + kappa[1] * t * t + kappa[2] * s * t);
    let everywhere: Field = {
        let at = |k: usize, i: u32| {
            WINDOW[0][k] + (WINDOW[1][k] - WINDOW[0][k]) * (f64::from(i) + 0.5) / 100.0
        };
        let line = (0..100).flat_map(|i| (0..100).map(move |j| [i, j]));
        line.map(|[i, j]| [at(0, i), at(1, j)]).collect()
    };
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &p in &everywhere {
        let row = Vector3::new(1.0, p[0], p[1]);
        gram += row * row.transpose();
        right += row * raw(p);
    }
    let plane = gram.try_inverse().unwrap() * right;
    let centre = [0, 1].map(|k| 0.5 * (WINDOW[0][k] + WINDOW[1][k]));
    let projected: Field = points
        .iter()
        .zip(&face)
        .map(|(&p, u)| {
            let w = raw(p) - plane.dot(&Vector3::new(1.0, p[0], p[1]));
            [0, 1].map(|k| {
                let from = p[k] + u[k] - centre[k];
                centre[k] + from * distance / (distance - w) - p[k]
            })
        })
        .collect();
    let perspective: Field = seen
        .iter()
        .zip(&face)
        .map(|(a, b)| [a[0] - b[0], a[1] - b[1]])
        .collect();
    let error = difference(&seen, &projected) / rms(perspective.into_iter().flatten());
    println!("projection {error:e}");
    assert!(error < 3e-3, "{error:e}");
}

#[test]
fn the_camera_of_a_model_is_that_of_its_scene() {
    let distance = |images: serde_json::Value| {
        let path = changed("openhole.json", |m| {
            let measurement = m["experiments"][0]["measurement"].as_object_mut().unwrap();
            measurement.remove("fringe_frequency_per_mm");
            measurement.insert("image_correlation".into(), images.clone());
        });
        let model = Model::load(std::path::Path::new(&path)).unwrap();
        model.scene().camera_distance_mm
    };
    let declared = serde_json::json!({ "subset_mm": 1.0, "camera_distance_mm": 750.0 });
    assert_eq!(distance(declared), Some(750.0));
    // ten times 25 mm
    let without = serde_json::json!({ "subset_mm": 1.0 });
    assert_eq!(distance(without), Some(250.0));
    let plain = Model::load(&root().join("models/openhole.json")).unwrap();
    assert_eq!(plain.scene().camera_distance_mm, None);
}

/// Of a plate without a hole, whose deflection along the load is -curvature s^2 / 2 but for a plane, a camera that looks about a place
/// farther by a mm sees the perspective less by w / Z.
#[test]
fn a_camera_off_the_middle_sees_the_deflection() {
    let test = test(false, 120.0);
    let at = |distance| FieldExperiment::new(test.clone(), seen_from(&test, distance)).unwrap();
    let experiment = at(Some(500.0));
    let points = vec![[-6.0, 2.0], [-2.0, 2.0], [2.0, 2.0]];
    let sight = experiment.locate(&points, &[]).0;
    let off = |amplitude: [f64; 2]| {
        let found = experiment.off_axis(bending(), &amplitude, &sight);
        found.unwrap().unwrap()
    };
    let [a, b, c] = off([0.1, 0.0])[..] else {
        panic!("three points")
    };
    let second = (a - 2.0 * b + c) / 16.0;
    assert!((second / (1e-4 / 500.0) - 1.0).abs() < 1e-4, "{second:e}");
    assert!(off([0.0; 2]).iter().all(|share| *share == 0.0));
    let none = at(None).off_axis(bending(), &[0.1, 0.0], &sight).unwrap();
    assert_eq!(none, None);
    let other = find("test", "uniform_strain").unwrap();
    let none = experiment.off_axis(other, &[1.0; 3], &sight).unwrap();
    assert_eq!(none, None);
}

/// A specimen far from the prior means bends as it does and not as they would, in what is simulated and in what was found of it.
#[test]
fn a_specimen_bends_by_its_own_constants() {
    let plain = changed("openhole.json", |m| {
        let specimen = m["experiments"][0]["specimen"].as_object_mut().unwrap();
        specimen.remove("hole");
    });
    let mut model = Model::load(std::path::Path::new(&plain)).unwrap();
    let own = [150.0, 9.0, 0.28, 5.4];
    model.nominal = Some(own.to_vec());
    let window = [[-12.15; 2], [12.15; 2]];
    let experiment = experiment_over(&model, window, 1.0).unwrap();
    let points = lattice(window);
    let sight = experiment.locate(&points, &[]).0;
    let found = experiment.added(bending(), &[0.04, 0.0], &sight).unwrap();
    let off = |scene: &Scene| {
        let plain = points
            .iter()
            .map(|&p| bending().displacement(&[0.04, 0.0], scene, p));
        let plain: Field = plain.collect();
        difference(&found, &plain) / rms(plain.into_iter().flatten())
    };
    let by_own = off(&model.scene());
    model.nominal = None;
    let by_means = off(&model.scene());
    println!("{by_own} of its own, {by_means} of the prior means");
    assert!(by_own < 3e-3 && by_means > 0.03);
}

/// What a hole changes in the default model's window: printed, and bounded to what plates with a hole of a sixth of their width do.
#[test]
fn a_hole_changes_the_default_field_by_some_percent() {
    let model = Model::load(&root().join("models/openhole.json")).unwrap();
    let scene = model.scene();
    let window = [[-12.15; 2], [12.15; 2]];
    let experiment = experiment_over(&model, window, 1.0).unwrap();
    let points = lattice(window);
    let sight = experiment.locate(&points, &[]).0;
    // the part that grows along the load is that of a plate without a hole
    for (amplitude, least) in [([0.025, 0.0], 0.005), ([0.0, 0.0025], 0.0)] {
        let found = experiment.added(bending(), &amplitude, &sight).unwrap();
        let plain: Field = points
            .iter()
            .map(|&p| bending().displacement(&amplitude, &scene, p))
            .collect();
        let share = difference(&found, &plain) / rms(plain.iter().flatten().copied());
        let size = rms(plain.into_iter().flatten());
        println!("{amplitude:?}: hole adds {share} of {size:e} mm");
        let pair = vec![[-0.02, 2.001], [0.02, 2.001]];
        let pair = experiment.locate(&pair, &[]).0;
        let u = experiment.added(bending(), &amplitude, &pair).unwrap();
        println!("strain at the edge {:e}", (u[1][0] - u[0][0]) / 0.04);
        assert!((least..0.5).contains(&share), "{share}");
    }
}
