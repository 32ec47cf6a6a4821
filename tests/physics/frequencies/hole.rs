//! Plates with a hole: finite elements beside polynomials, limits, and what is refused.

use std::f64::consts::PI;

use super::support::*;
use nalgebra::{DMatrix, DVector};
use plychain::experiment::frequencies::{
    FrequenciesSpec, PlateSupports, Ritz, Settings, Theory, VibratingPlate,
};
use plychain::fem::Vibrating;
use plychain::geometry::{Density, Geometry, Outline, StripWithHole};
use plychain::laminate::Ply;
use serde_json::{Value, json};

/// A square plate of 200 mm, 1 mm thick, of a density.
fn spec(hole: Value, support: &str) -> FrequenciesSpec {
    let exactly = |mean: f64| json!({ "mean": mean, "sd": 0.0 });
    let mut file = json!({
        "name": "plate", "kind": "frequencies",
        "specimen": { "length_mm": exactly(200.0), "width_mm": exactly(200.0), "thickness_mm": exactly(1.0),
            "layup_deg": [0, 90, 90, 0], "density_kg_m3": exactly(1600.0) },
        "support": support, "frequencies_Hz": [40.0, 60.0, 80.0, 100.0, 160.0, 190.0], "sd_percent": 0.1, "air_kg_m3": exactly(0.0)
    });
    if !hole.is_null() {
        file["specimen"]["hole"] = hole;
    }
    serde_json::from_value(file).unwrap()
}

fn ply() -> Ply {
    Ply {
        e1: 60e3,
        e2: 12e3,
        nu12: 0.3,
        g12: 5e3,
    }
}

/// The lowest frequencies, Hz.
fn found(spec: &FrequenciesSpec, count: usize) -> Vec<f64> {
    let plate = spec.plate(ply());
    let ritz = spec.ritz(&plate).unwrap();
    let modes = ritz.modes(&plate.coefficients(), count).unwrap();
    modes.iter().map(|m| m.frequency_hz()).collect()
}

fn centred(diameter_mm: f64) -> Value {
    json!({ "diameter_mm": diameter_mm, "center_mm": [0.0, 0.0] })
}

/// Where edges are held no layer is left to polynomials alone: finite elements with next to no hole have the frequencies of Ritz.
#[test]
fn finite_elements_of_a_plate_without_a_hole_agree_with_ritz() {
    for edge in [HELD, CLAMPED] {
        let plate = VibratingPlate {
            thickness: 4.0,
            ..carbon(&[0.0, 90.0, 90.0, 0.0])
        };
        let settings = Settings {
            supports: PlateSupports::all(edge),
            ..Settings::free(Theory::Sheared)
        };
        let ritz = Ritz::new(&settings).unwrap();
        let expected = ritz.frequencies_hz(&plate, 6).unwrap();
        let strip = StripWithHole {
            outline: Outline {
                s: [-100.0, 100.0],
                t: [-100.0, 100.0],
                clamp: None,
            },
            radius: 0.2,
        };
        let mesh = strip.mesh(&strip.counts(Density(0.5)));
        let mut pinned = Vec::new();
        for (node, point) in mesh.nodes.iter().enumerate() {
            for (axis, place) in point.iter().enumerate() {
                if (place.abs() - 100.0).abs() < 1e-9 {
                    let held = if edge == CLAMPED {
                        vec![0, 1, 2]
                    } else {
                        vec![0, 2 - axis]
                    };
                    pinned.extend(held.iter().map(|c| 3 * node + c));
                }
            }
        }
        pinned.sort_unstable();
        pinned.dedup();
        let start = DMatrix::from_fn(3 * mesh.nodes.len(), 12, |row, column| {
            let [x, y] = mesh.nodes[row / 3].map(|c| PI * (c / 200.0 + 0.5));
            let (m, n) = ((column % 4 + 1) as f64, (column / 4 + 1) as f64);
            if row % 3 == 0 {
                (m * x).sin() * (n * y).sin()
            } else {
                0.0
            }
        });
        let vibrating = Vibrating {
            mesh: &mesh,
            plate: plate.stiffness(),
            mass_per_area: plate.mass_per_area(),
            thickness: plate.thickness,
            pinned: &pinned,
        };
        let modes = vibrating.modes(&start, 1e3, 6).unwrap();
        let found: Vec<f64> = modes.lambda[..6]
            .iter()
            .map(|l| l.sqrt() / (2.0 * PI))
            .collect();
        assert_close(&found, &expected, 3e-4);
    }
}

/// A plate that is weighed lacks the hole's mass already; what the hole does falls with its area, and with it the difference to the plate without.
#[test]
fn what_a_hole_does_falls_with_its_area() {
    let bare = found(&spec(Value::Null, "free"), 4);
    let shift = |diameter: f64| -> Vec<f64> {
        let holed = found(&spec(centred(diameter), "free"), 4);
        holed.iter().zip(&bare).map(|(h, b)| h / b - 1.0).collect()
    };
    let (large, small) = (shift(16.0), shift(8.0));
    for (large, small) in large.iter().zip(&small) {
        // what the hole takes from the mass nearly cancels in some modes
        let allowed = 0.1 * large.abs() + 5e-5;
        assert!((large - 4.0 * small).abs() < allowed, "{large} {small}");
        assert!(large.abs() < 0.02, "{large}");
    }
    assert!(large.iter().any(|v| v.abs() > 2e-3), "{large:?}");
}

/// Rayleigh-Ritz for a thin free plate with a hole, written for this test: products of Legendre polynomials, the energies those of the square less
/// those of the circle by quadrature.
fn by_polynomials(plate: &VibratingPlate, radius: f64, order: usize, count: usize) -> Vec<f64> {
    let d = plate.stiffness().bending;
    let half = 0.5 * plate.length;
    let unknowns = order * order;
    let (mut k, mut m) = (
        DMatrix::zeros(unknowns, unknowns),
        DMatrix::zeros(unknowns, unknowns),
    );
    let mut add = |x: f64, y: f64, weight: f64| {
        let (p, q) = (legendre(x / half, order), legendre(y / half, order));
        let row = |dx: usize, dy: usize| {
            let scale = half.powi(-((dx + dy) as i32));
            DVector::from_fn(unknowns, |i, _| p[i / order][dx] * q[i % order][dy] * scale)
        };
        let w = row(0, 0);
        m.ger(weight * plate.mass_per_area(), &w, &w, 1.0);
        let strains = [-row(2, 0), -row(0, 2), -2.0 * row(1, 1)];
        for i in 0..3 {
            for j in 0..3 {
                if d[(i, j)] != 0.0 {
                    k.ger(weight * d[(i, j)], &strains[i], &strains[j], 1.0);
                }
            }
        }
    };
    let nodes: Vec<(f64, f64)> = plychain::numeric::legendre(28)
        .into_iter()
        .map(|(x, w)| (2.0 * x - 1.0, 2.0 * w))
        .collect();
    for (a, wa) in &nodes {
        for (b, wb) in &nodes {
            add(half * a, half * b, wa * wb * half * half);
        }
    }
    // the radius by the same nodes, the angle evenly
    for (a, wa) in &nodes {
        let r = 0.5 * radius * (a + 1.0);
        for step in 0..64 {
            let angle = 2.0 * PI * f64::from(step) / 64.0;
            let (sin, cos) = angle.sin_cos();
            add(r * cos, r * sin, -wa * 0.5 * radius * r * 2.0 * PI / 64.0);
        }
    }
    let root = m.cholesky().unwrap().l();
    let half_way = root.solve_lower_triangular(&k).unwrap();
    let whole = root.solve_lower_triangular(&half_way.transpose()).unwrap();
    let mut lambda: Vec<f64> = whole.symmetric_eigenvalues().iter().copied().collect();
    lambda.sort_by(f64::total_cmp);
    // after three rigid motions
    lambda[3..3 + count]
        .iter()
        .map(|l| l.sqrt() / (2.0 * PI))
        .collect()
}

/// Values, first and second derivatives of orthonormal Legendre polynomials.
fn legendre(x: f64, count: usize) -> Vec<[f64; 3]> {
    let mut p = vec![[1.0, 0.0, 0.0], [x, 1.0, 0.0]];
    for n in 1..count - 1 {
        let (a, b) = (
            (2 * n + 1) as f64 / (n + 1) as f64,
            n as f64 / (n + 1) as f64,
        );
        let [v, d, s] = p[n];
        let [v0, d0, s0] = p[n - 1];
        p.push([
            a * x * v - b * v0,
            a * (v + x * d) - b * d0,
            a * (2.0 * d + x * s) - b * s0,
        ]);
    }
    let norm = |n: usize| ((2 * n + 1) as f64 / 2.0).sqrt();
    p.iter()
        .enumerate()
        .map(|(n, v)| v.map(|v| v * norm(n)))
        .collect()
}

/// A hole that polynomials resolve, slowly and from above, moves frequencies as they say: what is left beyond them is less than they gained last.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_large_hole_moves_frequencies_as_polynomials_say() {
    // thin, so that the layer at the hole's edge, which a thin plate has not, is no matter
    let thin = |hole: Value| {
        let mut file = spec(hole, "free");
        file.specimen.thickness_mm.mean = 0.05;
        file.frequencies_hz.iter_mut().for_each(|f| *f *= 0.05);
        file
    };
    let file = thin(centred(60.0));
    let plate = file.plate(ply());
    let bare = by_polynomials(&plate, 0.0, 15, 6);
    let [rough, fine] = [15, 23].map(|order| by_polynomials(&plate, 30.0, order, 6));
    let without = found(&thin(Value::Null), 6);
    let with = found(&file, 6);
    for k in 0..6 {
        let [rough, fine] = [rough[k], fine[k]].map(|f| f / bare[k] - 1.0);
        let found = with[k] / without[k] - 1.0;
        println!("{k}: {rough} {fine} {found}");
        assert!(found < fine + 2e-4, "{k}: {fine} {found}");
        assert!(
            fine - found < 0.6 * (rough - fine) + 2e-4,
            "{k}: {rough} {fine} {found}"
        );
    }
}

/// Of a hole's effect only its size at the prior's means is used: other constants change it by less than frequencies are read to.
#[test]
fn other_constants_change_what_a_hole_does_little() {
    let shift = |scale: f64| -> Vec<f64> {
        let other = Ply {
            e1: 60e3 * scale,
            ..ply()
        };
        let of = |file: &FrequenciesSpec| {
            let plate = file.plate(other);
            let modes = file
                .ritz(&plate)
                .unwrap()
                .modes(&plate.coefficients(), 6)
                .unwrap();
            modes.iter().map(|m| m.frequency_hz()).collect::<Vec<f64>>()
        };
        let (holed, bare) = (
            of(&spec(centred(20.0), "free")),
            of(&spec(Value::Null, "free")),
        );
        holed.iter().zip(&bare).map(|(h, b)| h / b).collect()
    };
    for (stiff, usual) in shift(1.1).iter().zip(shift(1.0)) {
        println!("{stiff} {usual}");
        assert!((stiff / usual - 1.0).abs() < 5e-4, "{stiff} {usual}");
    }
}

#[test]
fn a_hole_that_no_plate_has_is_refused() {
    let refused = |hole: Value, what: &str| {
        let file = spec(hole, "free");
        let said = file.ritz(&file.plate(ply())).unwrap_err().to_string();
        assert!(said.contains(what), "{said}");
    };
    refused(centred(90.0), "specimen.hole.diameter_mm");
    refused(
        json!({ "diameter_mm": 10.0, "center_mm": [97.0, 0.0] }),
        "clear of the plate's edge",
    );
    refused(centred(-1.0), "");
}
