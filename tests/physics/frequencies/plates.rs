//! Natural frequencies against closed forms and published values.

use super::support::*;
use nalgebra::{Matrix3, SymmetricEigen};
use plychain::experiment::frequencies::{PlateSupports, Ritz, Settings, Theory, VibratingPlate};

#[test]
fn a_free_isotropic_square_has_the_known_frequencies() {
    let ritz = thin(16, PlateSupports::all(FREE));
    let found = factors(&ritz, &isotropic(10.0), 6);
    let known = [13.4682, 19.5961, 24.2702, 34.8009, 34.8009, 61.0932];
    for (f, k) in found.iter().zip(known) {
        assert!((f - k).abs() < 0.6e-4, "{found:?}");
    }
    assert!((found[3] / found[4] - 1.0).abs() < 1e-12);
}

#[test]
fn the_issues_laminates_have_the_known_frequencies() {
    let cases: [(&[f64], [f64; 6]); 3] = [
        (
            &[0.0],
            [93.5525, 128.5129, 230.4254, 354.2160, 455.2267, 498.6052],
        ),
        (
            &[0.0, 90.0, 90.0, 0.0],
            [95.1413, 213.4492, 288.0010, 468.9905, 505.5094, 589.4063],
        ),
        (
            &[45.0, -45.0, 0.0, 0.0, -45.0, 45.0],
            [160.4210, 217.0472, 341.0662, 482.5552, 500.8136, 706.4914],
        ),
    ];
    let (fine, usual) = (
        thin(20, PlateSupports::all(FREE)),
        thin(12, PlateSupports::all(FREE)),
    );
    for (layup, known) in cases {
        let found = fine.frequencies_hz(&carbon(layup), 6).unwrap();
        for (f, k) in found.iter().zip(known) {
            assert!((f - k).abs() < 1e-4 + 0.5e-4, "{layup:?}: {found:?}");
        }
        assert_close(
            &usual.frequencies_hz(&carbon(layup), 6).unwrap(),
            &known,
            1.3e-5,
        );
    }
}

#[test]
fn simply_supported_plates_have_their_closed_form() {
    let ritz = thin(12, PlateSupports::all(HELD));
    let pi2 = std::f64::consts::PI.powi(2);
    let known = [2.0, 5.0, 5.0, 8.0, 10.0, 10.0, 13.0].map(|s| pi2 * s);
    assert_close(&factors(&ritz, &isotropic(10.0), 7), &known, 1e-6);
    let plate = VibratingPlate {
        width: 140.0,
        ..carbon(&[0.0, 90.0, 90.0, 0.0])
    };
    let d = plychain::laminate::abd(&plate.ply, &plate.angles, plate.thickness).d;
    let mut known = Vec::new();
    for m in 1..5 {
        for n in 1..5 {
            let (p, q) = (m as f64 / plate.length, n as f64 / plate.width);
            let twist = 2.0 * (d[(0, 1)] + 2.0 * d[(2, 2)]) * p * p * q * q;
            let k = d[(0, 0)] * p.powi(4) + twist + d[(1, 1)] * q.powi(4);
            known.push(0.5 * std::f64::consts::PI * (k / plate.mass_per_area()).sqrt());
        }
    }
    known.sort_by(f64::total_cmp);
    assert_close(&ritz.frequencies_hz(&plate, 6).unwrap(), &known, 1e-6);
}

#[test]
fn held_and_clamped_edges_have_the_published_factors() {
    // Leissa, J. Sound Vib. 31 (1973) 257: the first five are his Levy solutions; the others converged values of the literature
    let cases: [(PlateSupports, &[f64], f64); 8] = [
        (
            PlateSupports {
                x: [HELD; 2],
                y: [CLAMPED; 2],
            },
            &[28.9509, 54.7431, 69.3270],
            1e-5,
        ),
        (
            PlateSupports {
                x: [HELD; 2],
                y: [FREE; 2],
            },
            &[9.6314, 16.1348, 36.7256],
            1e-5,
        ),
        (
            PlateSupports {
                x: [HELD; 2],
                y: [CLAMPED, FREE],
            },
            &[12.6874, 33.0651, 41.7019],
            1e-5,
        ),
        (
            PlateSupports {
                x: [HELD; 2],
                y: [HELD, FREE],
            },
            &[11.6845, 27.7563, 41.1967],
            1e-5,
        ),
        (
            PlateSupports {
                x: [HELD; 2],
                y: [CLAMPED, HELD],
            },
            &[23.6463, 51.6743, 58.6464],
            1e-5,
        ),
        (
            PlateSupports::all(CLAMPED),
            &[35.9852, 73.3938, 73.3938, 108.217],
            1e-5,
        ),
        (
            PlateSupports {
                x: [CLAMPED, FREE],
                y: [FREE; 2],
            },
            &[3.471, 8.507, 21.285, 27.199, 30.96],
            2e-4,
        ),
        (
            PlateSupports {
                x: [HELD, FREE],
                y: [HELD, FREE],
            },
            &[3.367, 17.316],
            1e-3,
        ),
    ];
    for (supports, known, relative) in cases {
        let found = factors(&thin(16, supports), &isotropic(10.0), known.len());
        assert_close(&found, known, relative);
        // turned by 90 degrees, and mirrored
        let turned = PlateSupports {
            x: supports.y,
            y: supports.x,
        };
        assert_close(
            &factors(&thin(16, turned), &isotropic(10.0), known.len()),
            &found,
            1e-9,
        );
        let [[a, b], [c, d]] = [supports.x, supports.y];
        let mirrored = PlateSupports {
            x: [b, a],
            y: [d, c],
        };
        assert_close(
            &factors(&thin(16, mirrored), &isotropic(10.0), known.len()),
            &found,
            1e-9,
        );
    }
}

#[test]
fn rigid_motions_are_left_out_by_their_supports() {
    let one = PlateSupports {
        x: [FREE; 2],
        y: [FREE, HELD],
    };
    for (supports, lowest) in [(PlateSupports::all(FREE), 13.468), (one, 6.644)] {
        for theory in [Theory::Thin, Theory::Sheared] {
            // in the thin limit every theory has the same lowest mode, and nothing below it
            let settings = Settings {
                supports,
                ..Settings::free(theory)
            };
            let found = factors(&Ritz::new(&settings).unwrap(), &isotropic(1.0), 1);
            assert!(
                (found[0] / lowest - 1.0).abs() < 3e-3,
                "{theory:?} {found:?}"
            );
        }
    }
    let settings = Settings {
        order: 3,
        ..Settings::free(Theory::Thin)
    };
    let all = Ritz::new(&settings)
        .unwrap()
        .frequencies_hz(&isotropic(1.0), 100);
    assert_eq!(all.unwrap().len(), 9 - 3);
}

/// Frequencies (Hz) of a simply supported shear-deformable plate without D16, D26, S12 (Navier).
fn navier(plate: &VibratingPlate) -> Vec<f64> {
    let d = plychain::laminate::abd(&plate.ply, &plate.angles, plate.thickness).d;
    let s =
        plychain::laminate::transverse(plate.g13(), plate.g23(), &plate.angles, plate.thickness);
    let (m0, m2) = (
        plate.mass_per_area(),
        plate.mass_per_area() * plate.thickness.powi(2) / 12.0,
    );
    let mut found = Vec::new();
    for m in 1..6 {
        for n in 1..6 {
            let p = std::f64::consts::PI * m as f64 / plate.length;
            let q = std::f64::consts::PI * n as f64 / plate.width;
            let couple = (d[(0, 1)] + d[(2, 2)]) * p * q;
            let k = Matrix3::new(
                s[(0, 0)] * p * p + s[(1, 1)] * q * q,
                s[(0, 0)] * p,
                s[(1, 1)] * q,
                s[(0, 0)] * p,
                d[(0, 0)] * p * p + d[(2, 2)] * q * q + s[(0, 0)],
                couple,
                s[(1, 1)] * q,
                couple,
                d[(2, 2)] * p * p + d[(1, 1)] * q * q + s[(1, 1)],
            );
            let scale = Matrix3::from_diagonal(
                &nalgebra::Vector3::new(m0, m2, m2).map(|m: f64| 1.0 / m.sqrt()),
            );
            let lowest = SymmetricEigen::new(scale * k * scale).eigenvalues.min();
            found.push(lowest.sqrt() / std::f64::consts::TAU);
        }
    }
    found.sort_by(f64::total_cmp);
    found
}

#[test]
fn shear_and_rotary_inertia_have_naviers_closed_form() {
    let settings = Settings {
        supports: PlateSupports::all(HELD),
        ..Settings::free(Theory::Sheared)
    };
    let ritz = Ritz::new(&settings).unwrap();
    let cross_ply = VibratingPlate {
        thickness: 12.0,
        width: 150.0,
        ..carbon(&[0.0, 90.0, 90.0, 0.0])
    };
    for plate in [isotropic(100.0), cross_ply] {
        assert_close(
            &ritz.frequencies_hz(&plate, 6).unwrap(),
            &navier(&plate),
            1e-6,
        );
    }
}

#[test]
fn torsion_of_a_long_strip_is_saint_venants() {
    // f_n = n / (2 L) sqrt(G J / I_p), J = b h^3 (1/3 - 0.21 h/b), to the strip's own bending of sections
    let plate = VibratingPlate {
        length: 4000.0,
        width: 100.0,
        thickness: 5.0,
        ..isotropic(5.0)
    };
    let settings = Settings {
        edge_layers: Some(plate.edge_layers()),
        order: 8,
        ..Settings::free(Theory::Sheared)
    };
    let ritz = Ritz::new(&settings).unwrap();
    let modes = ritz.modes(&plate.coefficients(), 12).unwrap();
    let torsion = modes.iter().find(|m| ritz.label(m) == [1, 1]).unwrap();
    let (b, h) = (plate.width, plate.thickness);
    let j = b * h.powi(3) * (1.0 / 3.0 - 0.21 * h / b);
    let polar = b * h * (b * b + h * h) / 12.0;
    let known = 0.5 / plate.length * (plate.ply.g12 * j / (7.85e-9 * polar)).sqrt();
    assert_close(&[torsion.frequency_hz()], &[known], 1.5e-3);
}
