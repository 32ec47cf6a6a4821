//! Regions of a mesh with a layup, an orientation or a thickness of their own: closed forms of lamination theory, the plate that is all
//! one region, the reduced basis, what is refused, and an identification.

use std::sync::Arc;

use plychain::effect::{self, Acting, limit::alter_checked};
use plychain::error::Result;
use plychain::fem::verify::without_rigid_motion;
use plychain::fem::{Bump, Locator, Plate, Setup, View, Yield};
use plychain::geometry::Density;
use plychain::geometry::imported::{ImportedPlate, Kind, MeshSpec};
use plychain::laminate::{LoadSpec, Material, Ply, SpecimenSpec, abd};
use serde_json::{Value, json};

use super::model::{KINDS, Model, grid};
use super::plate::{difference, exported, part, pulled, specimen, swap};
use super::writers::{inp, msh22, msh41};
use crate::program::{fresh, identify, plychain, posterior, succeed};

const PLY: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

const LENGTH: f64 = 60.0;
const WIDTH: f64 = 4.0;

/// A strip along x from the origin, in halves along it (`left`, `right`) and across it (`lower`, `upper`).
fn strip(kind: Kind, counts: [usize; 2]) -> Model {
    let mut model = grid(kind, counts, false, &|u, v| [LENGTH * u, WIDTH * v]);
    let middle = |nodes: &[usize], k: usize| {
        let sum: f64 = nodes.iter().map(|n| model.nodes[*n][k]).sum();
        sum / nodes.len() as f64
    };
    let halves = [
        ("left", 0, 1.0),
        ("right", 0, -1.0),
        ("lower", 1, 1.0),
        ("upper", 1, -1.0),
    ];
    for (name, k, sign) in halves {
        let half = 0.5 * [LENGTH, WIDTH][k];
        let is_in = |(_, nodes): &&(usize, &Vec<usize>)| sign * (half - middle(nodes, k)) > 0.0;
        let cells = model.cells.iter().map(|(_, nodes)| nodes).enumerate();
        let cells: Vec<usize> = cells.filter(|c| is_in(&c)).map(|(cell, _)| cell).collect();
        model.regions.insert(name.into(), cells);
    }
    model
}

/// Tension by tractions at both ends.
fn tension(regions: Value) -> Value {
    json!({ "file": "", "regions": regions,
        "load": [{ "edge": "u1", "direction": [1, 0] }, { "edge": "u0", "direction": [-1, 0] }] })
}

/// The same by grips, which pull the ends as one.
fn gripped(regions: Value) -> Value {
    json!({ "file": "", "regions": regions,
        "load": { "edge": "u1", "direction": [1, 0], "spread": "grip" }, "supports": [{ "edge": "u0" }] })
}

fn stack(layup_deg: &[f64], thickness_mm: f64) -> SpecimenSpec {
    serde_json::from_value(json!({
        "layup_deg": layup_deg, "thickness_mm": { "mean": thickness_mm, "sd": 0.0 }
    }))
    .unwrap()
}

/// A test of a mesh loaded along x.
fn along_x(model: &Model, spec: Value, specimen: &SpecimenSpec) -> Result<Setup> {
    let part = part("regions.msh", &msh41(model, false), spec)?;
    let stacks = part.spec.stacks();
    Ok(Setup {
        geometry: Arc::new(ImportedPlate::new(part, &|v| v)),
        ..Setup::nominal(specimen, &LoadSpec { force_n: 700.0 }, 1.0).with_regions(&stacks)
    })
}

/// Nodal displacements of the mesh, without rigid motion.
fn solved(setup: &Setup, ply: &Ply, density: f64) -> Vec<[f64; 2]> {
    let plate = Plate::new(setup, Density(density)).unwrap();
    let solution = plate.solve_full_order(setup, ply).unwrap();
    still(&plate, &solution.nodal)
}

fn still(plate: &Plate, nodal: &[f64]) -> Vec<[f64; 2]> {
    let u: Vec<[f64; 2]> = nodal.chunks(2).map(|u| [u[0], u[1]]).collect();
    without_rigid_motion(&plate.mesh.nodes, &u)
}

/// Strains (e11, e22, 2 e12) at points.
fn strains(setup: &Setup, ply: &Ply, points: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let plate = Plate::new(setup, Density::DEFAULT).unwrap();
    let solution = plate.solve(setup, ply).unwrap();
    let (observer, inside) = Locator::new(&solution.mesh).observe(points);
    assert!(inside.iter().all(|x| *x));
    let gradients = observer.gradient(&solution.nodal);
    let of = |g: &[[f64; 2]; 2]| [g[0][0], g[1][1], g[0][1] + g[1][0]];
    gradients.iter().map(of).collect()
}

fn radians(angles_deg: &[f64]) -> Vec<f64> {
    angles_deg.iter().map(|a| a.to_radians()).collect()
}

#[test]
fn regions_with_the_specimen_s_own_stack_change_nothing() {
    let own = stack(&[30.0, -45.0, 0.0, 10.0, 45.0], 0.78);
    let declared = json!({
        "left": { "layup_deg": [30, -45, 0, 10, 45] }, "right": { "rotation_deg": 0, "thickness_mm": 0.78 } });
    for kind in KINDS {
        let model = strip(kind, [16, 4]);
        let uniform = along_x(&model, tension(json!({})), &own).unwrap();
        let parted = along_x(&model, tension(declared.clone()), &own).unwrap();
        for density in [1.0, 2.0] {
            let [a, b] = [&uniform, &parted].map(|s| solved(s, &PLY, density));
            let off = difference(&a, &b);
            println!("{kind:?} at density {density}: {off:.1e}");
            assert!(off < 1e-12, "{kind:?}: {off:e}");
        }
    }
}

#[test]
fn two_strips_in_series_stretch_by_their_own_compliances() {
    // without Poisson's ratio the ends of both contract alike, and strains are uniform up to the joint
    let sheet = stack(&[0.0], 1.5);
    let free = Ply::isotropic(70e3, 0.0);
    for kind in KINDS {
        let thick = tension(json!({ "right": { "thickness_mm": 4.0 } }));
        let setup = along_x(&strip(kind, [12, 2]), thick, &sheet).unwrap();
        let points = [[1.0, 1.0], [29.0, 3.0], [31.0, 0.5], [58.0, 2.0]];
        for (found, h) in strains(&setup, &free, &points)
            .iter()
            .zip([1.5, 1.5, 4.0, 4.0])
        {
            let exact = 700.0 / (70e3 * WIDTH * h);
            let off = found
                .iter()
                .zip([exact, 0.0, 0.0])
                .map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max) / exact;
            assert!(off < 1e-10, "{kind:?}: {off:e}");
        }
    }
    // laminates: away from ends and joint each is under uniaxial tension, A e = (N, 0, 0)
    let regions =
        json!({ "right": { "layup_deg": [45, -45, 10], "thickness_mm": 1.1, "rotation_deg": 5 } });
    let own = stack(&[30.0, -45.0, 0.0, 90.0], 0.8);
    let setup = along_x(&strip(Kind::Q8, [90, 6]), tension(regions), &own).unwrap();
    let found = strains(
        &setup,
        &PLY,
        &[[15.0, 1.0], [15.0, 3.0], [45.0, 1.0], [45.0, 3.0]],
    );
    let left = abd(&PLY, &radians(&[30.0, -45.0, 0.0, 90.0]), 0.8).a;
    let right = abd(&PLY, &radians(&[50.0, -40.0, 15.0]), 1.1).a;
    for (found, a) in found.iter().zip([left, left, right, right]) {
        let exact = a.try_inverse().unwrap().column(0) * (700.0 / WIDTH);
        let off = found.iter().zip(exact.iter()).map(|(a, b)| (a - b).abs());
        let off = off.fold(0.0, f64::max) / exact[0];
        println!("laminates in series: {off:.1e} of the strain along the load");
        assert!(off < 1e-5, "{found:?}, {exact}");
    }
}

/// Young's modulus along the load (MPa) and Poisson's ratio of plies at plus and minus an angle.
fn balanced(angle: f64) -> [f64; 2] {
    let compliance = abd(&PLY, &radians(&[angle, -angle]), 1.0)
        .a
        .try_inverse()
        .unwrap();
    [
        1.0 / compliance[(0, 0)],
        -compliance[(1, 0)] / compliance[(0, 0)],
    ]
}

#[test]
fn two_strips_side_by_side_share_the_load_by_their_stiffness() {
    let sheet = stack(&[0.0], 1.5);
    let free = Ply::isotropic(70e3, 0.0);
    for kind in KINDS {
        let thick = gripped(json!({ "upper": { "thickness_mm": 4.0 } }));
        let setup = along_x(&strip(kind, [12, 4]), thick, &sheet).unwrap();
        let exact = 700.0 / (70e3 * 0.5 * WIDTH * (1.5 + 4.0));
        for found in strains(&setup, &free, &[[1.0, 1.0], [20.0, 3.5], [59.0, 1.9]]) {
            let off = (found[0] - exact)
                .abs()
                .max(found[1].abs())
                .max(found[2].abs())
                / exact;
            assert!(off < 1e-10, "{kind:?}: {off:e}");
        }
    }
    // balanced laminates of one Poisson's ratio: uniform strain in both, away from the grips
    let wanted = balanced(10.0)[1];
    let (mut low, mut high) = (35.0, 89.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if balanced(middle)[1] > wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    assert!((balanced(low)[1] / wanted - 1.0).abs() < 1e-9);
    let regions = json!({ "upper": { "layup_deg": [low, -low], "thickness_mm": 2.0 } });
    let setup = along_x(
        &strip(Kind::Q8, [90, 8]),
        gripped(regions),
        &stack(&[10.0, -10.0], 0.8),
    )
    .unwrap();
    let stiffness = 0.5 * WIDTH * (balanced(10.0)[0] * 0.8 + balanced(low)[0] * 2.0);
    let exact = 700.0 / stiffness;
    for found in strains(
        &setup,
        &PLY,
        &[[30.0, 0.7], [30.0, 1.9], [30.0, 2.1], [30.0, 3.3]],
    ) {
        let [along, across, shear] = found.map(|e| e / exact);
        let off = (along - 1.0)
            .abs()
            .max((across + wanted).abs())
            .max(shear.abs());
        println!("laminates side by side: {off:.1e} of the strain along the load");
        assert!(off < 1e-4, "{along} {across} {shear}");
    }
}

/// The model turned by a quarter, counter-clockwise.
fn quarter(mut model: Model) -> Model {
    for p in &mut model.nodes {
        *p = [-p[1], p[0], p[2]];
    }
    model
}

/// A turned region is the laminate with its angles turned, and turns with the load: counter-clockwise in the data's x-y plane for either
/// loading axis.
#[test]
fn a_region_turns_counter_clockwise_in_the_data_s_plane() {
    let model = strip(Kind::T6, [16, 4]);
    let all = json!({ "all": { "rotation_deg": 20 } });
    let turned = along_x(&model, tension(all), &stack(&[0.0, 30.0], 0.8)).unwrap();
    let declared = along_x(&model, tension(json!({})), &stack(&[20.0, 50.0], 0.8)).unwrap();
    let [a, b] = [&turned, &declared].map(|s| solved(s, &PLY, 1.0));
    assert!(difference(&a, &b) < 1e-12, "{:e}", difference(&a, &b));

    let regions = json!({ "left": { "rotation_deg": 20 }, "right": { "layup_deg": [10, -40], "rotation_deg": -5 } });
    let own = stack(&[0.0, 30.0], 0.8);
    let x = along_x(&model, tension(regions.clone()), &own).unwrap();
    let spec = json!({ "file": "", "regions": regions,
        "load": [{ "edge": "u1", "direction": [0, 1] }, { "edge": "u0", "direction": [0, -1] }] });
    let part = part("quarter.inp", inp(&quarter(model)).as_bytes(), spec).unwrap();
    let stacks = part.spec.stacks();
    let y = Setup {
        geometry: Arc::new(ImportedPlate::new(part, &swap)),
        ..Setup::nominal(&own, &LoadSpec { force_n: 700.0 }, -1.0).with_regions(&stacks)
    };
    let seen = |setup: &Setup, points: &[[f64; 2]]| {
        let plate = Plate::new(setup, Density::DEFAULT).unwrap();
        let solution = plate.solve(setup, &PLY).unwrap();
        let (observer, inside) = Locator::new(&solution.mesh).observe(points);
        assert!(inside.iter().all(|x| *x));
        without_rigid_motion(points, &observer.displacement(&solution.nodal))
    };
    let points: Vec<[f64; 2]> = (0..40)
        .map(|k| [1.4 * f64::from(k) + 1.0, 0.2 + 0.9 * f64::from(k % 5)])
        .collect();
    // direction 2 is the data's x, against which the strip's width was turned
    let turned: Vec<[f64; 2]> = points.iter().map(|p| [p[0], -p[1]]).collect();
    let there = seen(&y, &turned)
        .iter()
        .map(|u| [u[0], -u[1]])
        .collect::<Vec<_>>();
    let off = difference(&seen(&x, &points), &there);
    println!("turned by a quarter: {off:.1e}");
    assert!(off < 1e-9, "{off:e}");
}

/// Every law and effect that a region takes part in: a mesh that is all one region is the specimen of its stack.
#[test]
fn a_mesh_that_is_all_one_region_is_a_specimen_of_its_stack() {
    let model = strip(Kind::Q8, [24, 4]);
    let all =
        json!({ "all": { "layup_deg": [45, -45, 20], "rotation_deg": 10, "thickness_mm": 1.2 } });
    let region = along_x(&model, tension(all), &stack(&[0.0, 90.0], 0.8)).unwrap();
    let own = along_x(
        &model,
        tension(json!({})),
        &stack(&[55.0, -35.0, 30.0], 1.2),
    )
    .unwrap();
    let acting = |name: &str, amplitude: &[f64]| Acting {
        effect: effect::find("test", name).unwrap(),
        amplitude: amplitude.to_vec(),
    };
    let cases = [
        vec![acting("ply_misorientation", &[2.0])],
        vec![acting("thickness_taper", &[3.0, -4.0])],
        vec![acting("shear_nonlinearity", &[2e-8])],
        vec![
            acting("fibre_nonlinearity", &[15.0]),
            acting("ply_misorientation", &[-1.0]),
        ],
    ];
    for effects in cases {
        let [a, b] = [&region, &own].map(|setup| {
            let mut setup = setup.clone();
            alter_checked("test", &effects, &mut setup).unwrap();
            solved(&setup, &PLY, 1.0)
        });
        let off = difference(&a, &b);
        println!("{}: {off:.1e}", effects[0].effect.name());
        assert!(off < 1e-10, "{}: {off:e}", effects[0].effect.name());
    }
    // what tracing's rival makes of a softer place, and a solution near one that is known
    let bumps = [Bump {
        center_mm: [20.0, 1.0],
        sd_mm: 5.0,
    }];
    let stiffer = Ply {
        e2: 1.02 * PLY.e2,
        ..PLY
    };
    let fields = [&region, &own].map(|setup| {
        let plate = Plate::new(setup, Density::DEFAULT).unwrap();
        let anchor = plate.anchor(setup, &PLY).unwrap();
        let (_, soft) = plate.softened(&anchor, (setup, &PLY), &bumps).unwrap();
        let near = plate.solve_near(&anchor, setup, &stiffer).unwrap().nodal;
        [still(&plate, &soft[0]), still(&plate, &near)]
    });
    for k in 0..2 {
        let off = difference(&fields[0][k], &fields[1][k]);
        assert!(off < 1e-10, "{off:e}");
    }
}

/// A metal yields where it is thin: two strips in series, without Poisson's ratio under the same stress as a strip of the thinner thickness.
#[test]
fn a_thin_region_yields_first() {
    let metal = Ply::isotropic(200e3, 0.0);
    let yields = |setup: Setup| Setup {
        yielding: Some(Yield {
            share: 1.0,
            stress: 100.0,
            hardening: 0.1,
        }),
        ..setup
    };
    let spec = tension(json!({ "right": { "thickness_mm": 3.0 } }));
    let model = strip(Kind::Q8, [12, 2]);
    let setup = yields(along_x(&model, spec, &stack(&[0.0], 1.0)).unwrap());
    let plate = Plate::new(&setup, Density::DEFAULT).unwrap();
    let frames = plate.yielding(&setup, &metal, &[1.0], 1.0).unwrap();
    // 175 MPa on the left, 58 on the right
    let plastic = 75.0 / (0.1 * 200e3);
    let gauss = frames[0]
        .equivalent
        .chunks(9)
        .zip(0..plate.mesh.elements.len());
    for (equivalent, e) in gauss {
        let middle = plate.mesh.corners(e).iter().map(|p| p[0]).sum::<f64>() / 8.0;
        // contraction by plastic flow is held back at the joint
        let near = (middle - 0.5 * LENGTH).abs() < 2.0 * WIDTH;
        let expected = if middle < 0.5 * LENGTH { plastic } else { 0.0 };
        for found in equivalent {
            let off = (found - expected).abs() / plastic;
            assert!(
                near && (*found == 0.0 || off < 0.5) || off < 1e-2,
                "{found} at {middle}"
            );
        }
    }
    // its table is of one thickness
    assert!(plate.plastic_table().is_err());
}

/// The default strip with a hole as T6 elements, with the plates beyond 8 mm from the hole along the load as regions.
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
    // +- 15 % by a lattice without a pattern
    let share = |k: usize, prime: f64| 0.3 * ((k as f64 * prime).fract() - 0.5);
    let at = |k: usize| Ply {
        e1: PLY.e1 * (1.0 + share(k, 0.754_877)),
        e2: PLY.e2 * (1.0 + share(k, 0.569_840)),
        nu12: PLY.nu12 * (1.0 + share(k, 0.430_159)),
        g12: PLY.g12 * (1.0 + share(k, 0.324_717)),
    };
    let tests: Vec<(Setup, Ply)> = (0..200).map(|k| (setup.clone(), at(k))).collect();
    plate.span(&tests, 1).unwrap();
    let points: Vec<[f64; 2]> = (0..60)
        .map(|k| [-25.0 + 0.83 * f64::from(k), 3.0 + 0.1 * f64::from(k % 7)])
        .collect();
    let observer = Locator::new(&plate.mesh).observe_extended(&points);
    let basis = plate.basis_for(&setup, &PLY).unwrap();
    let view = View::new(&plate, basis, &plate.mesh, observer, Vec::new()).unwrap();
    let mut worst = [0.0_f64; 4];
    for k in 300..340 {
        let c = plate.certify(&setup, &at(k), &view).unwrap().unwrap();
        assert!(c.error <= c.bound && c.largest_mm <= c.bound_mm, "{c:?}");
        let seen = [c.bound, c.error, c.effectivity(), c.solutions as f64];
        worst = [0, 1, 2, 3].map(|i| worst[i].max(seen[i]));
    }
    let [bound, error, effectivity, solutions] = worst;
    println!(
        "three stacks: {solutions} solutions, bound {bound:.1e}, error {error:.1e}, effectivity {effectivity:.2}"
    );
    assert!(bound < 1e-6 && effectivity < 5.0);
    // the bound of a mesh with regions in which only one stack is soft is that of the soft one
    let answered = plate.solve(&setup, &PLY).unwrap().nodal;
    let full = plate.solve_full_order(&setup, &PLY).unwrap().nodal;
    assert_ne!(answered, full);
    let off = difference(&still(&plate, &answered), &still(&plate, &full));
    assert!(off < 1e-6, "{off:e}");
}

/// Effects that know one stack only are left out with the reason, and so are changes of a hole at which regions meet.
#[test]
fn effects_that_need_one_stack_are_left_out_where_there_are_more() {
    let model =
        plychain::infer::Model::load(std::path::Path::new(&crate::program::coarse())).unwrap();
    let scene = |setup: Setup, material: Material| effect::Scene {
        setup,
        material,
        expansion_per_k: Some([0.0, 3e-5]),
        ..model.scene()
    };
    let reason = |scene: &effect::Scene, name: &str| {
        effect::obstacle(effect::find("test", name).unwrap(), scene)
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
    let model = strip(Kind::Q8, [8, 4]);
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
    crate::program::changed("two-holes.json", |m| {
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

/// The regions belong to what a reduced model is kept by, and to the messages of a model file.
#[test]
fn a_model_file_tells_its_regions() {
    let key = |regions: &Value| {
        let model = plychain::infer::Model::load(model_file(regions).as_ref()).unwrap();
        let over = model.experiment_over([[-10.0; 2], [10.0; 2]], 1.0).unwrap();
        let written = model.file.to_json().unwrap();
        let read = written["experiments"][0]["mesh"].get("regions").cloned();
        assert_eq!(read.is_some(), !regions.as_object().unwrap().is_empty());
        let mut key = over.serialisation();
        // the file differs by its name alone
        key[0] = Value::Null;
        key.to_string()
    };
    let [none, thick, thicker] = [
        json!({}),
        json!({ "tab": { "thickness_mm": 1.5 } }),
        json!({ "tab": { "thickness_mm": 1.6 } }),
    ];
    assert_eq!(key(&thick), key(&thick));
    assert_ne!(key(&none), key(&thick));
    assert_ne!(key(&thick), key(&thicker));
    let wrong = model_file(&json!({ "tba": { "thickness_mm": 1.5 } }));
    let output = plychain(&["build", &wrong]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said.contains("tba") && said.contains("tab, ") || said.contains(", tab"),
        "{said}"
    );
}

/// A specimen of two laminates, simulated on a finer mesh, is identified: all constants are held, and a model without the regions is off.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_specimen_with_two_regions_is_identified() {
    let regions = json!({
        "tab": { "layup_deg": [0, 90, 90, 0], "thickness_mm": 1.2 }, "other": { "rotation_deg": 30 } });
    let file = model_file(&regions);
    let truth = [
        ("E1_GPa", 150.0),
        ("E2_GPa", 8.1),
        ("nu12", 0.32),
        ("G12_GPa", 4.8),
    ];
    let out = fresh("simulated");
    let mut arguments = vec![
        "simulate",
        &file,
        "--grid",
        "81",
        "--noise-nm",
        "20",
        "--seed",
        "5",
        "--out",
        out.to_str().unwrap(),
    ];
    let set: Vec<String> = truth
        .iter()
        .map(|(name, value)| format!("{name}={value}"))
        .collect();
    for pair in &set {
        arguments.extend(["--set", pair]);
    }
    succeed(&arguments);
    let model = out.join("model.json");
    let round = identify(model.to_str().unwrap(), &[]);
    for (name, value) in truth {
        let (mean, sd) = posterior(&round, name);
        println!(
            "{name}: {mean:.4} +- {sd:.4}, truth {value}, {:.2} sd",
            (mean - value) / sd
        );
        assert!(
            (mean - value).abs() < 3.0 * sd,
            "{name}: {mean} +- {sd}, not {value}"
        );
    }
}
