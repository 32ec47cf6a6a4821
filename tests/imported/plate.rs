//! Specimens of imported meshes: the same answers as the built-in geometry, closed forms, and what holds and loads them.

use std::sync::Arc;

use plychain::error::Result;
use plychain::fem::verify::without_rigid_motion;
use plychain::fem::{Locator, Plate, Setup};
use plychain::geometry::imported::{ImportedPlate, Kind, MeshSpec, Part};
use plychain::geometry::{Density, Mesh};
use plychain::laminate::{LoadSpec, Ply, SpecimenSpec};
use serde_json::json;

use super::model::Model;
use super::writers::{inp, msh41};
use crate::program::fresh;

const PLY: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

fn specimen() -> SpecimenSpec {
    serde_json::from_value(json!({
        "length_mm": 60.0, "width_mm": 25.0, "hole": { "diameter_mm": 4.0, "center_mm": [2.0, 1.0] },
        "layup_deg": [30, -45, 0, 10, 45], "thickness_mm": { "mean": 0.78, "sd": 0.005 }
    }))
    .unwrap()
}

/// The declared strip, loaded along y.
fn strip() -> Setup {
    Setup::nominal(&specimen(), &LoadSpec { force_n: 700.0 }, -1.0)
}

fn swap([a, b]: [f64; 2]) -> [f64; 2] {
    [b, a]
}

/// The built-in geometry's mesh as a file would have it, in the data's axes with another origin.
fn exported(mesh: &Mesh, triangles: bool) -> Model {
    let nodes = mesh.nodes.iter().map(|&[s, t]| [t + 3.0, s - 7.0, 0.0]);
    let mut model = Model {
        nodes: nodes.collect(),
        ..Model::default()
    };
    for element in &mesh.elements {
        let nodes: Vec<usize> = element.iter().map(|n| *n as usize).collect();
        if !triangles {
            model.cells.push((Kind::Q8, nodes));
            continue;
        }
        // the diagonal's middle is that of the element
        let at = |k: usize| model.nodes[nodes[k]];
        let middle = [0, 1, 2].map(|c| {
            let corners: f64 = (0..4).map(|k| at(k)[c]).sum();
            let sides: f64 = (4..8).map(|k| at(k)[c]).sum();
            -0.25 * corners + 0.5 * sides
        });
        model.nodes.push(middle);
        let m = model.nodes.len() - 1;
        let [a, b, c, d, ab, bc, cd, da] = std::array::from_fn(|k| nodes[k]);
        model.cells.push((Kind::T6, vec![a, b, c, ab, bc, m]));
        model.cells.push((Kind::T6, vec![a, c, d, m, cd, da]));
    }
    for (name, edges) in &mesh.edges {
        let lines = edges
            .iter()
            .map(|&[a, m, b]| vec![a as usize, b as usize, m as usize]);
        model.edges.insert(name.clone(), lines.collect());
    }
    model
}

fn part(name: &str, text: &[u8], spec: serde_json::Value) -> Result<Part> {
    let file = fresh(name);
    std::fs::write(&file, text).unwrap();
    let mut spec: MeshSpec = serde_json::from_value(spec).unwrap();
    spec.file = file;
    Part::read(spec)
}

/// What pulls a strip along y.
fn pulled() -> serde_json::Value {
    json!({ "file": "", "load": [{ "edge": "high", "direction": [0, 2] }, { "edge": "low", "direction": [0, -1] }] })
}

fn with(part: Part) -> Setup {
    Setup {
        geometry: Arc::new(ImportedPlate::new(part, &swap)),
        ..strip()
    }
}

/// Displacements at points about the hole, without rigid motion.
fn seen(setup: &Setup, density: Density, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let plate = Plate::new(setup, density).unwrap();
    let solution = plate.solve(setup, &PLY).unwrap();
    let (observer, inside) = Locator::new(&solution.mesh).observe(points);
    assert!(inside.iter().all(|x| *x));
    without_rigid_motion(points, &observer.displacement(&solution.nodal))
}

fn around() -> Vec<[f64; 2]> {
    let rings = [2.05, 2.5, 4.0, 8.0].map(|r| (0..24).map(move |k| (r, 0.26 * f64::from(k))));
    let polar = rings.into_iter().flatten();
    polar
        .map(|(r, a): (f64, f64)| [r * a.cos(), r * a.sin()])
        .collect()
}

fn difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let largest = a.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
}

#[test]
fn the_strip_s_own_mesh_from_a_file_gives_the_strip_s_field() {
    let own = strip();
    let coarse = Density(0.5);
    let mesh = own.geometry.mesh(&own.geometry.counts(coarse));
    let expected = seen(&own, coarse, &around());
    let quads = exported(&mesh, false);
    for text in [msh41(&quads, true), inp(&quads).into_bytes()] {
        let name = if text.starts_with(b"$") {
            "strip.msh"
        } else {
            "strip.inp"
        };
        let setup = with(part(name, &text, pulled()).unwrap());
        // the hole's centre is the origin, the reflected elements are turned
        assert!((setup.geometry.hole_radius().unwrap() - 2.0).abs() < 1e-9);
        let found = seen(&setup, Density::DEFAULT, &around());
        assert!(
            difference(&expected, &found) < 1e-8,
            "{}",
            difference(&expected, &found)
        );
    }
    let triangles = exported(&mesh, true);
    let setup = with(part("strip-t6.msh", &msh41(&triangles, false), pulled()).unwrap());
    let found = seen(&setup, Density::DEFAULT, &around());
    assert!(
        difference(&expected, &found) < 1e-4,
        "{}",
        difference(&expected, &found)
    );
}
