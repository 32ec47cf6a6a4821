//! A series of an independent program: image correlation of a strip whose hole's edge yields, with its truth.

use plychain::fem::{EndLoad, Locator, Plate, Setup, Yield};
use plychain::field::{Axis, Frame, rigid};
use plychain::geometry::Density;
use plychain::laminate::{LoadSpec, Ply, SpecimenSpec};
use serde_json::Value;

use crate::common::shared;

type Field = Vec<[f64; 2]>;

/// Points of a step and displacements there, mm, data's axes.
fn step(name: &str) -> (Field, Field) {
    let text = std::fs::read_to_string(shared("dic-reference/yield").join(name)).unwrap();
    let row = |line: &str| -> Vec<f64> { line.split(',').map(|v| v.parse().unwrap()).collect() };
    let rows: Vec<Vec<f64>> = text.lines().skip(1).map(row).collect();
    (
        rows.iter().map(|r| [r[0], r[1]]).collect(),
        rows.iter().map(|r| [r[2], r[3]]).collect(),
    )
}

fn truth() -> Value {
    let file = shared("dic-reference/yield").join("truth.json");
    serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Gauss abscissae of four points on [-1, 1], with weights.
const FOUR: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
];

/// The average of a nodal field over square subsets about points of the data, data's axes.
fn over_subsets(plate: &Plate, nodal: &[f64], points: &Field, side: f64, frame: &Frame) -> Field {
    let mut places = Vec::new();
    for p in points {
        for (a, _) in FOUR {
            for (b, _) in FOUR {
                places.push(frame.point([p[0] + 0.5 * side * a, p[1] + 0.5 * side * b]));
            }
        }
    }
    let u = Locator::new(&plate.mesh)
        .observe_extended(&places)
        .displacement(nodal);
    let weights: Vec<f64> = FOUR
        .iter()
        .flat_map(|(_, wa)| FOUR.iter().map(move |(_, wb)| 0.25 * wa * wb))
        .collect();
    u.chunks(16)
        .map(|u| {
            let mean = |k: usize| u.iter().zip(&weights).map(|(u, w)| w * u[k]).sum::<f64>();
            frame.vector([mean(0), mean(1)])
        })
        .collect()
}

fn without_rigid_motion(points: &Field, u: &Field) -> Field {
    let motion = rigid::fit(points, u);
    let rest = |(&p, u): (&[f64; 2], &[f64; 2])| {
        let m = motion.at(p);
        [u[0] - m[0], u[1] - m[1]]
    };
    points.iter().zip(u).map(rest).collect()
}

fn dot(a: &Field, b: &Field) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| a * b).sum()
}

fn rms_um(u: &Field) -> f64 {
    1e3 * (dot(u, u) / (2 * u.len()) as f64).sqrt()
}

fn combine(a: &Field, by: f64, b: &Field) -> Field {
    let sum = |(a, b): (&[f64; 2], &[f64; 2])| [a[0] + by * b[0], a[1] + by * b[1]];
    a.iter().zip(b).map(sum).collect()
}

/// The displacement that a rigid motion makes of a displacement: R (x + u) + t - x.
fn moved(points: &Field, u: &Field, motion: &Value) -> Field {
    let (sin, cos) = number(&motion["theta"]).sin_cos();
    let of = |(p, u): (&[f64; 2], &[f64; 2])| {
        let [x, y] = [p[0] + u[0], p[1] + u[1]];
        [
            cos * x - sin * y + number(&motion["tx"]) - p[0],
            sin * x + cos * y + number(&motion["ty"]) - p[1],
        ]
    };
    points.iter().zip(u).map(of).collect()
}

/// With the truth's constants and yield parameters what is left of every step is its noise, and the data contain the predicted plastic part
/// once, in the steps that yield and in the unloaded frame.
#[test]
#[ignore = "needs ../shared"]
fn the_independent_series_has_this_plastic_part() {
    let truth = truth();
    let law = &truth["effects"][0];
    let constants = &truth["constants"];
    let ply = Ply::isotropic(1e3 * number(&constants["E_GPa"]), number(&constants["nu"]));
    let thickness = number(&truth["thickness_mm"]);
    let specimen: SpecimenSpec = serde_json::from_value(serde_json::json!({
        "length_mm": 80.0, "width_mm": 20.0, "hole": { "diameter_mm": 8.0, "center_mm": [0.0, 0.0] },
        "thickness_mm": { "mean": thickness, "sd": 0.0 }
    }))
    .unwrap();
    let frame = Frame {
        loading_axis: Axis::Y,
        hole_center_mm: [0.0; 2],
    };
    let nominal = Setup::nominal(&specimen, &LoadSpec { force_n: 1.0 }, frame.handedness());
    let metal = Yield {
        share: 1.0,
        stress: number(&law["sy_MPa"]),
        hardening: number(&law["H_MPa"]) / ply.e1,
    };
    let plate = Plate::new(&nominal, Density::DEFAULT).unwrap();
    let mut forces: Vec<f64> = truth["load_scale"]["true_N"]
        .as_array()
        .unwrap()
        .iter()
        .map(number)
        .collect();
    forces.push(0.0);
    let mut peak = 0.0_f64;
    for (k, force) in forces.into_iter().enumerate() {
        let name = if k < 4 {
            format!("step-0{}.csv", k + 1)
        } else {
            "unloaded.csv".into()
        };
        let (points, measured) = step(&name);
        let setup = Setup {
            load: EndLoad {
                axial: force,
                ..EndLoad::default()
            },
            peak_before: peak,
            ..nominal.clone()
        };
        peak = peak.max(force);
        let elastic = plate.solve(&setup, &ply).unwrap().nodal;
        let yields = Setup {
            yielding: Some(metal),
            ..setup
        };
        let solved = plate.solve_full_order(&yields, &ply).unwrap().nodal;
        let tabulated = plate.solve(&yields, &ply).unwrap().nodal;
        let [elastic, solved, tabulated] = [&elastic, &solved, &tabulated]
            .map(|nodal| over_subsets(&plate, nodal, &points, 1.0, &frame));
        let rest = |u: &Field| {
            let seen = moved(&points, u, &truth["rigid_motion"][k]);
            without_rigid_motion(&points, &combine(&measured, -1.0, &seen))
        };
        let part = without_rigid_motion(&points, &combine(&solved, -1.0, &elastic));
        let [without, with, by_table] = [&elastic, &solved, &tabulated].map(rest);
        let amplitude = dot(&part, &without) / dot(&part, &part);
        println!(
            "{name}: rest {:.4} um without yielding, {:.4} with, {:.4} by the table; plastic part {:.4} um, measured {amplitude:.4} times",
            rms_um(&without),
            rms_um(&with),
            rms_um(&by_table),
            rms_um(&part)
        );
        let noise = number(&truth["noise"]["total_sd_um"]);
        assert!((rms_um(&with) / noise - 1.0).abs() < 0.05, "{name}");
        assert!(
            (rms_um(&by_table) / rms_um(&with) - 1.0).abs() < 0.01,
            "{name}"
        );
        if k >= 3 {
            assert!((amplitude - 1.0).abs() < 0.1, "{name}: {amplitude}");
        }
    }
}
