//! Specimens with regions of a stack of their own as a whole: the reduced basis, what is refused and why, model files, an identification.

use std::sync::Arc;

use plychain::effect;
use plychain::fem::{Certificate, Locator, Plate, Setup, TOLERANCE, View, span};
use plychain::geometry::Density;
use plychain::infer::Model as ModelFile;
use plychain::laminate::{LoadSpec, Material, Ply};
use plychain::mesh_files::{ElementKind, ImportedPlate, MeshSpec};
use plychain::trace::Status;
use serde_json::{Value, json};

use super::model::Model;
use super::plate::{difference, exported, part, pulled, specimen, swap};
use super::regions::{PLY, along_x, sheet, stack, still, tension};
use super::writers::{msh22, msh41};
use crate::common::{changed, coarse, fresh, plychain, simulated};
use crate::loops::looped;

/// A strip with a hole as Q8 elements; what lies beyond 7 mm from the hole along the load, on either side, is a region.
fn holed() -> Model {
    let own = Setup::nominal(&specimen(), &LoadSpec { force_n: 700.0 }, -1.0);
    let mesh = own.geometry.mesh(&own.geometry.counts(Density(0.4)));
    let mut model = exported(&mesh, false);
    // the mesh's y runs along the load from the hole at -7
    for (name, sign) in [("tab", 1.0), ("other", -1.0)] {
        let beyond = |nodes: &[usize]| {
            nodes
                .iter()
                .all(|n| sign * (model.nodes[*n][1] + 7.0) > 7.0)
        };
        let cells = model.cells.iter().enumerate();
        let cells = cells
            .filter(|(_, (_, nodes))| beyond(nodes))
            .map(|(k, _)| k);
        let cells: Vec<usize> = cells.collect();
        assert!(!cells.is_empty());
        model.regions.insert(name.into(), cells);
    }
    model
}

fn holed_setup(regions: &Value) -> Setup {
    let mut spec = pulled();
    spec["regions"] = regions.clone();
    let part = part("holed.msh", &msh22(&holed(), true), spec).unwrap();
    let stacks = part.spec.stacks();
    Setup {
        geometry: Arc::new(ImportedPlate::new(part, &swap)),
        ..Setup::nominal(&specimen(), &LoadSpec { force_n: 700.0 }, -1.0).with_regions(&stacks)
    }
}

#[test]
fn the_reduced_basis_of_two_stacks_keeps_its_bound() {
    let regions = json!({
        "tab": { "layup_deg": [0, 90, 90, 0], "thickness_mm": 1.4 }, "other": { "rotation_deg": 25 } });
    let setup = holed_setup(&regions);
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    // +- 15 %, without a pattern
    let share = |k: usize, root: f64| 0.3 * ((k as f64 * root.sqrt()).fract() - 0.5);
    let at = |k: usize| Ply {
        e1: PLY.e1 * (1.0 + share(k, 2.0)),
        e2: PLY.e2 * (1.0 + share(k, 3.0)),
        nu12: PLY.nu12 * (1.0 + share(k, 5.0)),
        g12: PLY.g12 * (1.0 + share(k, 7.0)),
    };
    let tests: Vec<(Setup, Ply)> = (0..200).map(|k| (setup.clone(), at(k))).collect();
    span(&plate, &tests, 1).unwrap();
    let points: Vec<[f64; 2]> = (0..60)
        .map(|k| [-25.0 + 0.83 * f64::from(k), 3.0 + 0.1 * f64::from(k % 7)])
        .collect();
    let observer = Locator::new(&plate.mesh).observe_extended(&points);
    let basis = plate.basis_for(&setup, &PLY).unwrap();
    let view = View::new(&plate, basis, &plate.mesh, observer, Vec::new()).unwrap();
    let mut worst = [0.0_f64; 4];
    for k in 300..340 {
        let c = Certificate::of(&plate, &setup, &at(k), &view)
            .unwrap()
            .unwrap();
        assert!(c.error <= c.bound && c.largest_mm <= c.bound_mm, "{c:?}");
        let seen = [c.bound, c.error, c.effectivity(), c.solutions as f64];
        worst = [0, 1, 2, 3].map(|i| worst[i].max(seen[i]));
    }
    let [bound, error, effectivity, solutions] = worst;
    println!(
        "three stacks: {solutions} solutions, bound {bound:.1e}, error {error:.1e}, effectivity {effectivity:.2}"
    );
    assert!(bound < TOLERANCE && effectivity < 5.0);
    // and what it answers is the field
    let answered = plate.solve(&setup, &PLY).unwrap().nodal;
    let full = plate.solve_full_order(&setup, &PLY).unwrap().nodal;
    assert!(answered != full, "it was solved");
    let off = difference(&still(&plate, &answered), &still(&plate, &full));
    assert!(off < 1e-6, "{off:e}");
}

/// Effects that know one stack only are left out with the reason, and so are changes of a hole at which regions meet.
#[test]
fn effects_that_need_one_stack_are_left_out_where_there_are_more() {
    let model = ModelFile::load(std::path::Path::new(&coarse())).unwrap();
    let scene = |setup: Setup, material: Material| effect::Scene {
        setup,
        material,
        expansion_per_k: Some([0.0, 3e-5]),
        ..model.scene()
    };
    let reason = |scene: &effect::Scene, name: &str| {
        effect::why_not(effect::find("test", name).unwrap(), scene)
    };
    let thick = scene(
        holed_setup(&json!({ "tab": { "thickness_mm": 2.0 } })),
        Material::Ply,
    );
    let turned = scene(
        holed_setup(&json!({ "tab": { "rotation_deg": 9 } })),
        Material::Ply,
    );
    let other = scene(
        holed_setup(&json!({ "tab": { "layup_deg": [0] } })),
        Material::Ply,
    );
    let refused = |scene: &effect::Scene, names: &[&str]| {
        for name in names {
            let why = reason(scene, name);
            assert!(
                why.is_some_and(|w| w.contains("regions of the mesh")),
                "{name}: {why:?}"
            );
        }
    };
    let kept = |scene: &effect::Scene, names: &[&str]| {
        for name in names {
            assert_eq!(reason(scene, name), None, "{name}");
        }
    };
    let always = [
        "ply_misorientation",
        "thickness_taper",
        "shear_nonlinearity",
        "hole_size",
        "hole_edge_damage",
    ];
    let plies = ["single_ply_misorientation_1"];
    let expands = ["thermal_strain", "thermal_gradient"];
    for all in [&thick, &turned, &other] {
        refused(all, &["out_of_plane_bending"]);
        kept(all, &always);
    }
    kept(&thick, &[&plies[..], &expands].concat());
    kept(&turned, &plies);
    refused(&turned, &expands);
    refused(&other, &[&plies[..], &expands].concat());
    let mut metal = scene(thick.setup.clone(), Material::Isotropic);
    metal.setup.yield_stress = Some(300.0);
    refused(&metal, &["yielding"]);
    // halves that meet at the hole
    let mut model = holed();
    let half = |nodes: &Vec<usize>| nodes.iter().all(|n| model.nodes[*n][0] < 3.0 + 1e-9);
    let cells = model
        .cells
        .iter()
        .enumerate()
        .filter(|(_, (_, nodes))| half(nodes));
    let cells: Vec<usize> = cells.map(|(k, _)| k).collect();
    model.regions.insert("half".into(), cells);
    let mut spec = pulled();
    spec["regions"] = json!({ "half": { "thickness_mm": 1.0 } });
    let part = part("half.msh", &msh41(&model, true), spec).unwrap();
    let stacks = part.spec.stacks();
    let nominal = Setup::nominal(&specimen(), &LoadSpec { force_n: 700.0 }, -1.0);
    let halves = Setup {
        geometry: Arc::new(ImportedPlate::new(part, &swap)),
        ..nominal.with_regions(&stacks)
    };
    let halves = scene(halves, Material::Ply);
    refused(&halves, &["hole_size", "hole_offset"]);
    kept(&halves, &["hole_edge_damage"]);
}

/// A hole that moves takes no region with it.
#[test]
fn joints_stay_where_they_are_when_the_hole_moves() {
    let setup =
        holed_setup(&json!({ "tab": { "thickness_mm": 2.0 }, "other": { "rotation_deg": 3 } }));
    let mut moved = setup.clone();
    moved.morph.hole_offset = [0.3, -0.2];
    moved.morph.hole_size = 1.1;
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    let mesh = plate.mesh_of(&moved).unwrap();
    assert_eq!(mesh.region, plate.mesh.region);
    assert!(plate.mesh.region.contains(&2));
    for e in 0..mesh.elements.len() {
        if mesh.region_of(e) == 0 {
            continue;
        }
        // the origin stays in the hole's centre
        for (a, b) in mesh.corners(e).iter().zip(plate.mesh.corners(e)) {
            assert!((a[0] - b[0] + 0.3).abs() < 1e-12 && (a[1] - b[1] - 0.2).abs() < 1e-12);
        }
    }
}

#[test]
fn regions_that_cannot_be_are_refused() {
    let model = sheet(ElementKind::Q8, [8, 4], [30.0, 10.0]);
    let own = stack(&[0.0, 90.0], 0.8);
    let refused = |regions: Value, words: &[&str]| {
        let error = along_x(&model, tension(regions), &own).err().unwrap();
        assert_eq!(error.exit_code(), 1);
        for word in words {
            assert!(error.to_string().contains(word), "{word}: {error}");
        }
    };
    let thick = json!({ "thickness_mm": 2.0 });
    refused(
        json!({ "uper": thick }),
        &[
            "mesh.regions",
            "uper",
            "all",
            "half",
            "left",
            "lower",
            "right",
            "upper",
        ],
    );
    refused(
        json!({ "left": thick, "upper": { "thickness_mm": 3.0 } }),
        &["mesh.regions", "left", "upper"],
    );
    refused(json!({ "left": {} }), &["mesh.regions.left", "layup_deg"]);
    for h in [0.0, -1.0] {
        refused(
            json!({ "left": { "thickness_mm": h } }),
            &["mesh.regions.left.thickness_mm"],
        );
    }
    refused(
        json!({ "left": { "layup_deg": [] } }),
        &["mesh.regions.left.layup_deg"],
    );
    // regions that overlap and agree are one
    let same = json!({ "left": thick, "upper": thick });
    let setup = along_x(&model, tension(same), &own).unwrap();
    assert_eq!(setup.regions.len(), 1);
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    assert_eq!(plate.mesh.region.iter().filter(|r| **r == 1).count(), 24);
    // a test that does not know of them is no test of this mesh
    let unaware = Setup {
        regions: Vec::new(),
        ..setup.clone()
    };
    assert!(plate.solve(&unaware, &PLY).is_err());
    assert!(plate.factor().factorise(&setup.membrane(&PLY)).is_err());

    let unknown = json!({ "file": "", "load": { "edge": "u1", "direction": [1, 0] }, "regions": { "left": { "layup": [0] } } });
    assert!(serde_json::from_value::<MeshSpec>(unknown).is_err());
    for (key, value) in [("layup_deg", json!([0])), ("rotation_deg", json!(10))] {
        let spec: MeshSpec =
            serde_json::from_value(tension(json!({ "left": { key: value } }))).unwrap();
        assert!(spec.validate_material(Material::Ply).is_ok());
        let error = spec
            .validate_material(Material::Isotropic)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(&format!("mesh.regions.left.{key}")),
            "{error}"
        );
    }
    let spec: MeshSpec = serde_json::from_value(tension(json!({ "left": thick }))).unwrap();
    assert!(spec.validate_material(Material::Isotropic).is_ok());
}

/// The model file of the holed strip with two regions, and what `build` says of it.
fn model_file(regions: &Value) -> String {
    let mesh = fresh("regions.msh");
    std::fs::write(&mesh, msh41(&holed(), true)).unwrap();
    changed("two-holes.json", |m| {
        let experiment = &mut m["experiments"][0];
        experiment["specimen"] = json!({
            "layup_deg": [45, -45, 0, 0, -45, 45], "thickness_mm": { "mean": 0.78, "sd": 0.005 } });
        experiment["mesh"] = pulled();
        experiment["mesh"]["file"] = json!(mesh);
        experiment["mesh"]["regions"] = regions.clone();
        experiment["measurement"]["hole_center_in_data_mm"] = json!([0.0, 0.0]);
        experiment["window_mm"] = json!([[-10, -20], [10, 20]]);
    })
}

/// The regions belong to a model file, and to its messages.
#[test]
fn a_model_file_tells_its_regions() {
    for regions in [json!({}), json!({ "tab": { "thickness_mm": 1.5 } })] {
        let model = ModelFile::load(model_file(&regions).as_ref()).unwrap();
        let written = model.file.to_json().unwrap();
        let read = written["experiments"][0]["mesh"].get("regions").cloned();
        assert_eq!(read.is_some(), !regions.as_object().unwrap().is_empty());
    }
    let wrong = model_file(&json!({ "tba": { "thickness_mm": 1.5 } }));
    let output = plychain(&["build", &wrong]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said.contains("tba") && said.contains("tab, ") || said.contains(", tab"),
        "{said}"
    );
}

/// A sheet of two laminates, simulated on a finer mesh and pulled at an angle: the loop closes, and all constants are held.
#[test]
#[ignore = "slow: run by .ci/run"]
fn the_loop_of_a_specimen_with_two_regions_closes() {
    let mesh = fresh("sheet.msh");
    let model = sheet(ElementKind::Q8, [72, 30], [60.0, 25.0]);
    std::fs::write(&mesh, msh41(&model, true)).unwrap();
    let mut spec = tension(json!({
        "left": { "layup_deg": [0, 90, 90, 0], "thickness_mm": 1.2 }, "right": { "rotation_deg": 30 } }));
    spec["file"] = json!(mesh);
    spec["origin_mm"] = json!([30.0, 12.5]);
    let file = changed("two-holes.json", |m| {
        let experiment = &mut m["experiments"][0];
        experiment["mesh"] = spec.clone();
        experiment["mesh_density"] = json!(1);
        experiment["measurement"]["loading_axis"] = json!("x");
        experiment["window_mm"] = json!([[-12, -12], [12, 12]]);
    });
    let out = simulated(
        &file,
        "--grid 81 --noise-nm 20 --seed 5 --effect load_misalignment=1 \
         --set E1_GPa=150 --set E2_GPa=8.1 --set nu12=0.32 --set G12_GPa=4.8",
    );
    let model = ModelFile::load(&out.join("model.json")).unwrap();
    let ended = looped("two regions", &model, &[150.0, 8.1, 0.32, 4.8]);
    println!("{}", ended.line());
    assert_eq!(ended.status, Status::Closed, "{}", ended.line());
    assert!(ended.names("load_misalignment"), "{}", ended.line());
    assert_eq!(ended.held(), 4, "{}", ended.line());
}
