//! Specimens of imported meshes: the same answers as the built-in geometry, closed forms, and what holds and loads them.

use std::sync::Arc;

use plychain::error::Result;
use plychain::fem::{Locator, Plate, Setup};
use plychain::geometry::{Density, Mesh};
use plychain::infer::Model as ModelFile;
use plychain::laminate::{LoadSpec, Ply, SpecimenSpec};
use plychain::mesh_files::{ElementKind, ImportedPlate, MeshSpec, Part};

use crate::verify::without_rigid_motion;
use serde_json::json;

use super::exact::{rectangle, sheet};
use super::model::Model;
use super::writers::{inp, msh41};
use crate::common::{changed, fresh, identify, posterior, root, simulated};
use crate::loops::looped;

const PLY: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

pub fn specimen() -> SpecimenSpec {
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

pub fn swap([a, b]: [f64; 2]) -> [f64; 2] {
    [b, a]
}

/// The built-in geometry's mesh as a file would have it, in the data's axes with another origin.
pub fn exported(mesh: &Mesh, triangles: bool) -> Model {
    let nodes = mesh.nodes.iter().map(|&[s, t]| [t + 3.0, s - 7.0, 0.0]);
    let mut model = Model {
        nodes: nodes.collect(),
        ..Model::default()
    };
    for element in &mesh.elements {
        let nodes: Vec<usize> = element.iter().map(|n| *n as usize).collect();
        if !triangles {
            model.cells.push((ElementKind::Q8, nodes));
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
        model
            .cells
            .push((ElementKind::T6, vec![a, b, c, ab, bc, m]));
        model
            .cells
            .push((ElementKind::T6, vec![a, c, d, m, cd, da]));
    }
    for (name, edges) in &mesh.edges {
        let lines = edges
            .iter()
            .map(|&[a, m, b]| vec![a as usize, b as usize, m as usize]);
        model.edges.insert(name.clone(), lines.collect());
    }
    model
}

pub fn part(name: &str, text: &[u8], spec: serde_json::Value) -> Result<Part> {
    let file = fresh(name);
    std::fs::write(&file, text).unwrap();
    let mut spec: MeshSpec = serde_json::from_value(spec).unwrap();
    spec.file = file;
    Part::read(spec)
}

/// What pulls a strip along y.
pub fn pulled() -> serde_json::Value {
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

pub fn difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
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

/// A strip whose low end is clamped, widened by fillets, with a hole off its middle: that of the steel example.
#[test]
fn the_clamped_strip_s_own_mesh_from_a_file_gives_the_strip_s_field() {
    let steel: SpecimenSpec = serde_json::from_value(json!({
        "length_mm": 100.0, "width_mm": 20.0, "hole": { "diameter_mm": 8.0, "center_mm": [10.0, 0.0] },
        "clamp": { "end": "low", "width_mm": 30.0, "fillet_radius_mm": 25.0 },
        "thickness_mm": { "mean": 3.05, "sd": 0.0 }
    }))
    .unwrap();
    let own = Setup {
        angles: vec![0.0],
        ..Setup::nominal(&steel, &LoadSpec { force_n: 6482.0 }, -1.0)
    };
    let coarse = Density(0.5);
    let mesh = own.geometry.mesh(&own.geometry.counts(coarse));
    let points: Vec<[f64; 2]> = around()
        .into_iter()
        .map(|p| p.map(|x| 2.1 * x))
        .filter(|p| p[1].abs() < 9.9)
        .collect();
    let field = |setup: &Setup, density: Density| {
        let plate = Plate::new(setup, density).unwrap();
        let solution = plate.solve(setup, &Ply::isotropic(200e3, 0.28)).unwrap();
        let (observer, inside) = Locator::new(&solution.mesh).observe(&points);
        assert!(inside.iter().all(|x| *x));
        // held: rigid motion counts
        observer.displacement(&solution.nodal)
    };
    let expected = field(&own, coarse);
    let held = json!({ "file": "", "load": { "edge": "high", "direction": [0, 1] }, "supports": [{ "edge": "low" }] });
    let quads = exported(&mesh, false);
    for (name, text) in [
        ("steel.msh", msh41(&quads, true)),
        ("steel.inp", inp(&quads).into_bytes()),
    ] {
        let imported = ImportedPlate::new(part(name, &text, held.clone()).unwrap(), &swap);
        let setup = Setup {
            geometry: Arc::new(imported),
            held: None,
            ..own.clone()
        };
        let found = field(&setup, Density::DEFAULT);
        assert!(
            difference(&expected, &found) < 1e-8,
            "{name}: {}",
            difference(&expected, &found)
        );
    }
}

#[test]
fn loads_that_nothing_holds_and_edges_that_are_not_there_are_refused() {
    let alone = json!({ "file": "", "load": { "edge": "u1", "direction": [1, 0] } });
    let setup = sheet(rectangle(alone).unwrap(), 500.0, 1.5);
    let error = Plate::new(&setup, Density::DEFAULT).err().unwrap();
    assert!(error.to_string().contains("mesh.supports"), "{error}");
    assert_eq!(error.exit_code(), 1);
    let named = json!({ "file": "", "load": { "edge": "hihg", "direction": [1, 0] } });
    let error = rectangle(named).err().unwrap();
    assert!(
        error.to_string().contains("hihg") && error.to_string().contains("u1"),
        "{error}"
    );
    for (key, wrong) in [
        ("mm_per_unit", json!(0)),
        ("load", json!([])),
        ("origin_mm", json!([0])),
    ] {
        let mut spec = json!({ "file": "", "load": { "edge": "u1", "direction": [1, 0] } });
        spec[key] = wrong;
        let read = serde_json::from_value::<MeshSpec>(spec);
        assert!(
            read.is_err() || read.is_ok_and(|s| s.validate().is_err()),
            "{key}"
        );
    }
}

#[test]
fn a_larger_hole_in_a_mesh_is_that_of_the_strip() {
    let own = strip();
    let coarse = Density(0.5);
    let mesh = own.geometry.mesh(&own.geometry.counts(coarse));
    let imported = with(
        part(
            "larger.msh",
            &msh41(&exported(&mesh, false), true),
            pulled(),
        )
        .unwrap(),
    );
    let points: Vec<[f64; 2]> = around()
        .into_iter()
        .filter(|p| p[0].hypot(p[1]) > 2.2)
        .collect();
    let [expected, found] =
        [(&own, coarse), (&imported, Density::DEFAULT)].map(|(setup, density)| {
            let larger = Setup {
                morph: plychain::geometry::Morph {
                    hole_size: 1.05,
                    hole_offset: [0.1, -0.05],
                    width: 1.0,
                },
                ..setup.clone()
            };
            let plate = Plate::new(setup, density).unwrap();
            let field = |setup: &Setup| {
                let solution = plate.solve(setup, &PLY).unwrap();
                let (observer, _) = Locator::new(&solution.mesh).observe(&points);
                without_rigid_motion(&points, &observer.displacement(&solution.nodal))
            };
            let (here, there) = (field(setup), field(&larger));
            let change = here
                .iter()
                .zip(&there)
                .map(|(a, b)| [b[0] - a[0], b[1] - a[1]]);
            change.collect::<Vec<_>>()
        });
    assert!(
        difference(&expected, &found) < 0.01,
        "{}",
        difference(&expected, &found)
    );
}

/// A shipped model of a mesh is closed: what acts unseen is named, alone or in a group, and the quoted intervals hold the truth beside it.
fn closes(name: &str, acts: &str) {
    let models = root().join("models");
    let model = plychain::infer::Model::load(&models.join(format!("{name}.json"))).unwrap();
    let truth: serde_json::Value = crate::common::json(&models.join(name).join("truth.json"));
    let constants = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];
    let truth: Vec<f64> = constants
        .iter()
        .map(|c| truth["constants"][c].as_f64().unwrap())
        .collect();
    let ended = looped(name, &model, &truth);
    assert!(ended.names(acts), "{}", ended.line());
    assert_eq!(
        ended.status,
        plychain::trace::Status::Closed,
        "{}",
        ended.line()
    );
    assert_eq!(ended.held(), constants.len(), "{}", ended.line());
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn a_plate_with_two_holes_closes() {
    closes("two-holes", "load_misalignment");
}

#[test]
#[ignore = "a loop, 1 minute"]
fn an_off_axis_coupon_with_oblique_ends_closes() {
    closes("oblique", "magnification");
}

#[test]
#[ignore = "a loop, 1 minute"]
fn a_v_notched_shear_specimen_closes() {
    closes("iosipescu", "thickness_taper");
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn a_disc_under_diametral_compression_closes() {
    closes("disc", "ply_misorientation");
}

/// What halving its elements changes is said where it is more than the noise allows, with the place, and not otherwise.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_mesh_that_is_too_coarse_is_warned_of() {
    let warned = |density: f64| {
        let file = changed("iosipescu.json", |m| {
            m["experiments"][0]["mesh_density"] = density.into();
        });
        let report = identify(&file, &[]);
        report["warnings"]
            .to_string()
            .contains("The mesh is too coarse")
    };
    assert!(warned(1.0));
    assert!(!warned(2.0));
}

/// The steel example as T6 of Gmsh: the posterior of the built-in strip.
#[test]
#[ignore = "length: two samplings, 3 minutes"]
fn the_clamped_strip_as_a_mesh_gives_its_posterior() {
    let file = changed("steel-s235.json", |m| {
        let e = &mut m["experiments"][0];
        e["gauge"] = "window".into();
        e["effects"] = json!(["rigid_translation", "rigid_rotation"]);
        e["measurement"]["loading_axis"] = "y".into();
    });
    let out = simulated(
        &file,
        "--grid 81 --noise-nm 300 --set E_GPa=207 --set nu=0.29 --seed 7",
    );
    let text = std::fs::read_to_string(out.join("model.json")).unwrap();
    let own: serde_json::Value = serde_json::from_str(&text).unwrap();
    let strip = ModelFile::load(&out.join("model.json")).unwrap();
    let geometry = strip.scene().setup.geometry;
    let mesh = geometry.mesh(&geometry.counts(Density::DEFAULT));
    let triangles = exported(&mesh, true);
    let expected = identify(out.join("model.json").to_str().unwrap(), &[]);
    let path = fresh("steel.msh");
    std::fs::write(&path, msh41(&triangles, true)).unwrap();
    let mut meshed = own.clone();
    let e = &mut meshed["experiments"][0];
    e["specimen"] = json!({ "thickness_mm": { "mean": 3.05, "sd": 0.0 } });
    e["mesh"] = json!({ "file": path, "load": { "edge": "high", "direction": [0, 1] }, "supports": [{ "edge": "low" }] });
    let model = out.join("steel.json");
    std::fs::write(&model, meshed.to_string()).unwrap();
    let round = identify(model.to_str().unwrap(), &[]);
    for constant in ["E_GPa", "nu"] {
        let ((own, sd), (mean, _)) = (posterior(&expected, constant), posterior(&round, constant));
        println!(
            "{constant}: {mean:.5}, built in {own:.5} +- {sd:.5}, {:+.4} sd",
            (mean - own) / sd
        );
        assert!((mean - own).abs() < 0.05 * sd, "{constant}");
    }
}
