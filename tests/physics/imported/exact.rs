//! Imported meshes against closed forms: a disc, a hole in a wide plate, a strip in grips.

use std::sync::Arc;

use plychain::error::Result;
use plychain::fem::{Locator, Plate, Setup};
use plychain::geometry::Density;
use plychain::laminate::{LoadSpec, Ply, SpecimenSpec};
use plychain::mesh_files::{ElementKind, ImportedPlate, Part};

use crate::verify::without_rigid_motion;
use serde_json::json;

use super::model::Model;
use super::plate::{difference, exported, part, pulled, specimen, swap};
use super::writers::{inp, msh41};

/// A disc of T6 about the middle and Q8 around, in sectors, with the arcs `top` and `bottom` of so many sectors each.
fn disc(radius: f64, rings: usize, sectors: usize, loaded: usize) -> Model {
    let mut model = Model::default();
    let mut node = |r: f64, turn: f64| {
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        model.nodes.push([r * cos, r * sin, 0.0]);
        model.nodes.len() - 1
    };
    let middle = node(0.0, 0.0);
    let step = radius / rings as f64;
    // at half rings, corners and middles of sectors
    let lattice: Vec<Vec<usize>> = (1..=2 * rings)
        .map(|i| {
            let places = (0..2 * sectors).map(|j| {
                let used = i % 2 == 0 || j % 2 == 0;
                let turn = j as f64 / (2 * sectors) as f64;
                if used {
                    node(0.5 * step * i as f64, turn)
                } else {
                    usize::MAX
                }
            });
            places.collect()
        })
        .collect();
    let at = |i: usize, j: usize| lattice[i - 1][j % (2 * sectors)];
    for j in (0..2 * sectors).step_by(2) {
        let first = vec![
            middle,
            at(2, j),
            at(2, j + 2),
            at(1, j),
            at(2, j + 1),
            at(1, j + 2),
        ];
        model.cells.push((ElementKind::T6, first));
        for i in (2..2 * rings).step_by(2) {
            let corners = [at(i, j), at(i + 2, j), at(i + 2, j + 2), at(i, j + 2)];
            let middles = [
                at(i + 1, j),
                at(i + 2, j + 1),
                at(i + 1, j + 2),
                at(i, j + 1),
            ];
            model
                .cells
                .push((ElementKind::Q8, [corners, middles].concat()));
        }
    }
    for (name, quarter) in [("top", 1), ("bottom", 3)] {
        let first = quarter * sectors / 4 - loaded / 2;
        let line = |s: usize| {
            let j = 2 * (first + s);
            vec![at(2 * rings, j), at(2 * rings, j + 2), at(2 * rings, j + 1)]
        };
        model
            .edges
            .insert(name.into(), (0..loaded).map(line).collect());
    }
    model
}

/// Strains (e11, e22, 2 e12) at points.
pub fn strains(setup: &Setup, ply: &Ply, points: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let plate = Plate::new(setup, Density::DEFAULT).unwrap();
    let solution = plate.solve(setup, ply).unwrap();
    let (observer, inside) = Locator::new(&solution.mesh).observe(points);
    assert!(inside.iter().all(|x| *x));
    let gradients = observer.gradient(&solution.nodal);
    let of = |g: &[[f64; 2]; 2]| [g[0][0], g[1][1], g[0][1] + g[1][0]];
    gradients.iter().map(of).collect()
}

/// A sheet of one isotropic ply.
pub fn sheet(part: Part, force_n: f64, thickness: f64) -> Setup {
    Setup {
        geometry: Arc::new(ImportedPlate::new(part, &|v| v)),
        angles: vec![0.0],
        thickness,
        handedness: 1.0,
        ..Setup::nominal(&specimen(), &LoadSpec { force_n }, 1.0)
    }
}

/// Stresses (s11, s22, s12) of a disc pressed along direction 2 by two forces: two half-planes' and a uniform tension (Hertz; Timoshenko and
/// Goodier, art. 41).
fn pressed_disc(radius: f64, force_per_mm: f64, [x, y]: [f64; 2]) -> [f64; 3] {
    let unit = 2.0 * force_per_mm / std::f64::consts::PI;
    let [above, below] = [radius - y, radius + y].map(|d| (d, (x * x + d * d).powi(2)));
    let sum = |f: &dyn Fn(f64) -> f64| f(above.0) / above.1 + f(below.0) / below.1;
    let uniform = 0.5 / radius;
    [
        -unit * (sum(&|d| d * x * x) - uniform),
        -unit * (sum(&|d| d.powi(3)) - uniform),
        unit * x * (above.0.powi(2) / above.1 - below.0.powi(2) / below.1),
    ]
}

#[test]
fn a_disc_under_diametral_compression_is_that_of_the_closed_form() {
    let (radius, force, thickness) = (20.0, 3000.0, 2.0);
    let ply = Ply::isotropic(70e3, 0.33);
    let model = disc(radius, 12, 192, 2);
    let spec = json!({ "file": "", "load": [
        { "edge": "top", "direction": [0, -1] }, { "edge": "bottom", "direction": [0, 1] }] });
    let setup = sheet(
        part("disc.msh", &msh41(&model, false), spec).unwrap(),
        force,
        thickness,
    );
    let points = [
        [0.0, 0.0],
        [6.0, 0.0],
        [-13.0, 0.5],
        [0.0, 9.0],
        [7.0, 6.0],
        [-4.0, -8.0],
        [12.0, -9.0],
    ];
    let largest = 3.0 * force / (std::f64::consts::PI * radius * thickness) / 70e3;
    for (point, found) in points.iter().zip(strains(&setup, &ply, &points)) {
        let [s11, s22, s12] = pressed_disc(radius, force / thickness, *point);
        let expected = [
            (s11 - 0.33 * s22) / 70e3,
            (s22 - 0.33 * s11) / 70e3,
            2.0 * 1.33 * s12 / 70e3,
        ];
        // over arcs of 2 a stresses differ by some a^2 at a radius from them (Hondros 1959), a = 1.9 degrees
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 0.005 * largest,
                "{point:?}: {found:e}, {expected:e}, {largest:e}"
            );
        }
    }
}

#[test]
fn a_hole_in_a_wide_plate_opens_as_kirsch_has_it() {
    let (width, radius, force) = (200.0, 2.0, 5000.0);
    let wide: SpecimenSpec = serde_json::from_value(json!({
        "length_mm": width, "width_mm": width, "hole": { "diameter_mm": 2.0 * radius, "center_mm": [0.0, 0.0] },
        "layup_deg": [0], "thickness_mm": { "mean": 1.0, "sd": 0.0 }
    }))
    .unwrap();
    let own = Setup::nominal(&wide, &LoadSpec { force_n: force }, -1.0);
    let mesh = own.geometry.mesh(&own.geometry.counts(Density::DEFAULT));
    let file = inp(&exported(&mesh, false)).into_bytes();
    let setup = Setup {
        geometry: Arc::new(ImportedPlate::new(
            part("wide.inp", &file, pulled()).unwrap(),
            &swap,
        )),
        ..own
    };
    let ply = Ply::isotropic(70e3, 0.33);
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    let solution = plate.solve(&setup, &ply).unwrap();
    let angles = (0..36).map(|k| std::f64::consts::TAU * f64::from(k) / 36.0);
    let near = 1.001 * radius;
    let points: Vec<[f64; 2]> = angles.map(|a| [near * a.cos(), near * a.sin()]).collect();
    let (observer, inside) = Locator::new(&solution.mesh).observe(&points);
    assert!(inside.iter().all(|x| *x));
    let found = without_rigid_motion(&points, &observer.displacement(&solution.nodal));
    // at the hole of an infinite plate in plane stress: s R / E (3 cos, -sin)
    let unit = force / width * radius / 70e3;
    let exact: Vec<[f64; 2]> = points
        .iter()
        .map(|p| [3.0 * unit * p[0] / near, -unit * p[1] / near])
        .collect();
    // the width is 50 diameters: some (1 / 50)^2
    assert!(
        difference(&exact, &found) < 0.003,
        "{}",
        difference(&exact, &found)
    );
}

/// A rectangle of 30 by 10 mm, corner at (-10, 5), whose ends along x are the edges u0 and u1.
pub fn rectangle(spec: serde_json::Value) -> Result<Part> {
    let model = super::model::rectangle(ElementKind::Q8, [12, 4]);
    part("rectangle.inp", inp(&model).as_bytes(), spec)
}

#[test]
fn a_grip_moves_as_one_and_carries_the_force() {
    let spec = json!({ "file": "", "origin_mm": [-10, 5],
        "load": { "edge": "u1", "direction": [1, 0], "spread": "grip" }, "supports": [{ "edge": "u0" }] });
    let setup = sheet(rectangle(spec).unwrap(), 500.0, 1.5);
    // without Poisson's ratio grips change nothing: u = F x / (E W h)
    let free = Ply::isotropic(2e3, 0.0);
    let [along, across, shear] = strains(&setup, &free, &[[29.0, 3.0]])[0];
    let expected = 500.0 / (2e3 * 10.0 * 1.5);
    assert!((along / expected - 1.0).abs() < 1e-9 && across.abs() < 1e-12 && shear.abs() < 1e-12);
    // with it the ends cannot contract, and the middle does
    let ply = Ply::isotropic(2e3, 0.4);
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    let solution = plate.solve(&setup, &ply).unwrap();
    let end: Vec<[f64; 2]> = (0..=8).map(|k| [30.0, 1.25 * f64::from(k)]).collect();
    let (observer, inside) = Locator::new(&solution.mesh).observe(&end);
    assert!(inside.iter().all(|x| *x));
    let u = observer.displacement(&solution.nodal);
    assert!(
        u.iter()
            .all(|v| (v[0] - u[0][0]).abs() < 1e-12 && v[1].abs() < 1e-12)
    );
    let [middle, narrow, _] = strains(&setup, &ply, &[[15.0, 5.0]])[0];
    assert!((narrow / middle + 0.4).abs() < 0.02, "{}", narrow / middle);
    // stiffer than without grips
    assert!(u[0][0] < 30.0 * expected && u[0][0] > 0.9 * 30.0 * expected);
}
