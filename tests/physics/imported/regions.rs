//! Regions of a mesh with a layup, an orientation or a thickness of their own: closed forms of lamination theory, and plates that are all
//! one region.

use std::sync::Arc;

use plychain::effect::{self, Acting, limit::alter_checked};
use plychain::error::Result;
use plychain::fem::{Anchor, Bump, Locator, Plate, Setup, Yield};
use plychain::geometry::Density;
use plychain::laminate::{LoadSpec, Ply, SpecimenSpec, abd};
use plychain::mesh_files::{ElementKind, ImportedPlate};

use crate::verify::without_rigid_motion;
use serde_json::{Value, json};

use super::exact::strains;
use super::model::{KINDS, Model, grid};
use super::plate::{difference, part, swap};
use super::writers::{inp, msh41};

pub const PLY: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

const LENGTH: f64 = 60.0;
const WIDTH: f64 = 4.0;

/// A slender strip along x from the origin.
fn strip(kind: ElementKind, counts: [usize; 2]) -> Model {
    sheet(kind, counts, [LENGTH, WIDTH])
}

/// Whether a place of the unit square is meant.
type Place<'a> = &'a dyn Fn([f64; 2]) -> bool;

/// A sheet along x from the origin, in halves along it (`left`, `right`) and across it (`lower`, `upper`); `core` is the half about its
/// centreline.
pub fn sheet(kind: ElementKind, counts: [usize; 2], size: [f64; 2]) -> Model {
    let mut model = grid(kind, counts, false, &|u, v| [size[0] * u, size[1] * v]);
    let parts: [(&str, Place<'_>); 5] = [
        ("left", &|[u, _]| u < 0.5),
        ("right", &|[u, _]| u > 0.5),
        ("lower", &|[_, v]| v < 0.5),
        ("upper", &|[_, v]| v > 0.5),
        ("core", &|[_, v]| (v - 0.5).abs() < 0.25),
    ];
    for (name, holds) in parts {
        let is_in = |nodes: &[usize]| {
            let sum = |k: usize| nodes.iter().map(|n| model.nodes[*n][k]).sum::<f64>();
            holds([0, 1].map(|k| sum(k) / (nodes.len() as f64 * size[k])))
        };
        let cells = model.cells.iter().enumerate();
        let own = cells.filter(|(_, (_, nodes))| is_in(nodes));
        let own = own.map(|(cell, _)| cell).collect();
        model.regions.insert(name.into(), own);
    }
    model
}

/// Tension by tractions at both ends.
pub fn tension(regions: Value) -> Value {
    json!({ "file": "", "regions": regions,
        "load": [{ "edge": "u1", "direction": [1, 0] }, { "edge": "u0", "direction": [-1, 0] }] })
}

/// The same by grips, which pull the ends as one.
fn gripped(regions: Value) -> Value {
    json!({ "file": "", "regions": regions,
        "load": { "edge": "u1", "direction": [1, 0], "spread": "grip" }, "supports": [{ "edge": "u0" }] })
}

pub fn stack(layup_deg: &[f64], thickness_mm: f64) -> SpecimenSpec {
    serde_json::from_value(json!({
        "layup_deg": layup_deg, "thickness_mm": { "mean": thickness_mm, "sd": 0.0 }
    }))
    .unwrap()
}

/// A test of a mesh loaded along x.
pub fn along_x(model: &Model, spec: Value, specimen: &SpecimenSpec) -> Result<Setup> {
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

pub fn still(plate: &Plate, nodal: &[f64]) -> Vec<[f64; 2]> {
    let u: Vec<[f64; 2]> = nodal.chunks(2).map(|u| [u[0], u[1]]).collect();
    without_rigid_motion(&plate.mesh.nodes, &u)
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
        let model = sheet(kind, [12, 8], [30.0, 20.0]);
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
    let setup = along_x(&strip(ElementKind::Q8, [90, 6]), tension(regions), &own).unwrap();
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
    // balanced laminates of one Poisson's ratio: uniform strain in both, away from the grips, which hold their contraction; about the middle of
    // the width, because what is held to one side bends the strip
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
    let regions = json!({ "core": { "layup_deg": [low, -low], "thickness_mm": 2.0 } });
    let setup = along_x(
        &strip(ElementKind::Q8, [90, 8]),
        gripped(regions),
        &stack(&[10.0, -10.0], 0.8),
    )
    .unwrap();
    let stiffness = 0.5 * WIDTH * (balanced(10.0)[0] * 0.8 + balanced(low)[0] * 2.0);
    let exact = 700.0 / stiffness;
    for found in strains(
        &setup,
        &PLY,
        &[[30.0, 0.4], [30.0, 0.9], [30.0, 1.1], [30.0, 2.3]],
    ) {
        let [along, across, shear] = found.map(|e| e / exact);
        let off = (along - 1.0)
            .abs()
            .max((across + wanted).abs())
            .max(shear.abs());
        println!("laminates side by side: {off:.1e} of the strain along the load");
        assert!(off < 1e-9, "{along} {across} {shear}");
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
    let model = sheet(ElementKind::T6, [12, 8], [30.0, 20.0]);
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
        .map(|k| [0.7 * f64::from(k) + 1.0, 1.0 + 4.4 * f64::from(k % 5)])
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
    let model = strip(ElementKind::Q8, [24, 4]);
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
        let anchor = Anchor::new(&plate, setup, &PLY, &[1.0]).unwrap();
        let (_, soft) = anchor.softened(&plate, (setup, &PLY), &bumps).unwrap();
        let near = anchor.solve_near(&plate, setup, &stiffer).unwrap().nodal;
        [still(&plate, &soft[0]), still(&plate, &near)]
    });
    for (a, b) in fields[0].iter().zip(&fields[1]) {
        let off = difference(a, b);
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
    let model = strip(ElementKind::Q8, [12, 2]);
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
