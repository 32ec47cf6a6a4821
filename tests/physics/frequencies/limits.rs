//! Natural frequencies: limits, convergence, invariances, shapes, reduced problems, refusals.

use super::support::*;
use plychain::experiment::frequencies::{
    EdgeLayers, PlateSupports, Ritz, Settings, Theory, VibratingPlate, Weight,
};
use plychain::laminate::Ply;

#[test]
fn a_sheared_plate_tends_to_a_thin_one() {
    for supports in [PlateSupports::all(FREE), PlateSupports::all(CLAMPED)] {
        let sheared = Ritz::new(&Settings {
            supports,
            ..Settings::free(Theory::Sheared)
        })
        .unwrap();
        for layup in [&[0.0][..], &[45.0, -45.0, -45.0, 45.0]] {
            let mut last = f64::INFINITY;
            for thickness in [20.0, 2.0, 0.2, 0.02] {
                let plate = VibratingPlate {
                    thickness,
                    ..carbon(layup)
                };
                // the clamped space of the sheared plate holds fewer thin shapes, 12 - 2 a side
                let order = if supports.x[0] == CLAMPED { 10 } else { 12 };
                let limit = thin(order, supports).frequencies_hz(&plate, 6).unwrap();
                let found = sheared.frequencies_hz(&plate, 6).unwrap();
                let off = found
                    .iter()
                    .zip(&limit)
                    .map(|(f, l)| (f / l - 1.0).abs())
                    .fold(0.0, f64::max);
                assert!(
                    off < 0.2 * last,
                    "{layup:?} {thickness}: {off} after {last}"
                );
                last = off;
            }
            assert!(last < 1e-5, "{last}");
        }
    }
}

#[test]
fn edge_layers_make_the_sheared_plate_converge() {
    for layup in [&[0.0][..], &[45.0, -45.0, 0.0, 0.0, -45.0, 45.0]] {
        let plate = carbon(layup);
        let with = |order, stretch: f64| {
            let layers = plate.edge_layers();
            let lengths = layers.lengths.map(|l| stretch * l);
            let edge_layers = Some(EdgeLayers { lengths, ..layers });
            let settings = Settings {
                order,
                edge_layers,
                ..Settings::free(Theory::Sheared)
            };
            Ritz::new(&settings)
                .unwrap()
                .frequencies_hz(&plate, 6)
                .unwrap()
        };
        let fine = with(16, 1.0);
        assert_close(&with(12, 1.0), &fine, 1.2e-5);
        assert_close(&with(12, 1.3), &fine, 3e-5);
        assert_close(&with(12, 0.75), &fine, 3e-5);
        // polynomials alone come down to the same values, slowly
        let mut off = f64::INFINITY;
        for order in [10, 16, 22] {
            let settings = Settings {
                order,
                ..Settings::free(Theory::Sheared)
            };
            let found = Ritz::new(&settings)
                .unwrap()
                .frequencies_hz(&plate, 1)
                .unwrap()[0];
            let now = found / fine[0] - 1.0;
            assert!(now > -1e-6 && now < 0.8 * off, "{order}: {now} after {off}");
            off = now;
        }
    }
}

#[test]
fn frequencies_fall_with_the_order() {
    let plate = carbon(&[30.0, -60.0, -60.0, 30.0]);
    let mut last = vec![f64::INFINITY; 10];
    let finest = thin(18, PlateSupports::all(FREE))
        .frequencies_hz(&plate, 10)
        .unwrap();
    for order in [6, 8, 10, 12, 14] {
        let found = thin(order, PlateSupports::all(FREE))
            .frequencies_hz(&plate, 10)
            .unwrap();
        assert!(
            found
                .iter()
                .zip(&last)
                .all(|(f, l)| *f <= l * (1.0 + 1e-10))
        );
        last = found;
    }
    assert_close(&last, &finest, 1e-5);
}

#[test]
fn turning_plate_and_layup_by_90_degrees_changes_nothing() {
    for theory in [Theory::Thin, Theory::Sheared] {
        let supports = PlateSupports {
            x: [CLAMPED, FREE],
            y: [HELD, FREE],
        };
        let turned = PlateSupports {
            x: [FREE, HELD],
            y: [CLAMPED, FREE],
        };
        let plate = VibratingPlate {
            width: 130.0,
            ..carbon(&[20.0, -50.0, -50.0, 20.0])
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        let other = VibratingPlate {
            length: plate.width,
            width: plate.length,
            angles: plate.angles.iter().map(|a| a + quarter).collect(),
            ..plate.clone()
        };
        let of = |supports, plate: &VibratingPlate| {
            let settings = Settings {
                supports,
                ..Settings::free(theory)
            };
            Ritz::new(&settings)
                .unwrap()
                .frequencies_hz(plate, 8)
                .unwrap()
        };
        assert_close(&of(supports, &plate), &of(turned, &other), 1e-9);
    }
}

#[test]
fn shapes_are_sines_of_a_simply_supported_plate_and_have_their_parity() {
    let ritz = thin(12, PlateSupports::all(HELD));
    let plate = VibratingPlate {
        width: 700.0,
        ..isotropic(10.0)
    };
    let modes = ritz.modes(&plate.coefficients(), 3).unwrap();
    let points = [[0.1, 0.2], [0.35, 0.5], [0.8, 0.9]];
    let pi = std::f64::consts::PI;
    for (mode, m) in modes.iter().zip([1.0, 2.0]) {
        let w = ritz.deflection(mode, &points);
        let sine = |[s, t]: [f64; 2]| (m * pi * s).sin() * (pi * t).sin();
        let scale = w[0] / sine(points[0]);
        // unit modal mass: the mean of sin^2 sin^2 is 1/4
        let mass = plate.mass_per_area() * plate.length * plate.width / 4.0;
        assert_close(&[scale * scale * mass], &[1.0], 1e-6);
        assert!(
            w.iter()
                .zip(points)
                .all(|(w, p)| (w - scale * sine(p)).abs() < 1e-5 * scale.abs())
        );
    }
    let ritz = Ritz::new(&Settings::free(Theory::Sheared)).unwrap();
    let plate = carbon(&[45.0, -45.0, 0.0, 0.0, -45.0, 45.0]);
    for mode in ritz.modes(&plate.coefficients(), 10).unwrap() {
        let w = ritz.deflection(&mode, &[[0.1, 0.15], [0.9, 0.85]]);
        let sign = if mode.odd.unwrap() { -1.0 } else { 1.0 };
        assert!((w[0] - sign * w[1]).abs() < 1e-8 * w[0].abs().max(w[1].abs()));
    }
}

#[test]
fn a_reduced_problem_is_exact_at_its_designs_and_close_between() {
    let plate = carbon(&[45.0, -45.0, 0.0, 0.0, -45.0, 45.0]);
    let settings = Settings {
        edge_layers: Some(plate.edge_layers()),
        order: 10,
        ..Settings::free(Theory::Sheared)
    };
    let ritz = Ritz::new(&settings).unwrap();
    let with = |e2: f64, g12: f64| {
        let ply = Ply {
            e2,
            g12,
            ..plate.ply
        };
        VibratingPlate {
            ply,
            ..plate.clone()
        }
    };
    let designs = [
        (10e3, 5e3),
        (8e3, 4e3),
        (12e3, 4e3),
        (8e3, 6e3),
        (12e3, 6e3),
    ]
    .map(|(e2, g12)| with(e2, g12).coefficients());
    let small = ritz.reduced(&designs, 8).unwrap();
    assert_close(
        &small.frequencies_hz(&plate, 10).unwrap(),
        &ritz.frequencies_hz(&plate, 10).unwrap(),
        1e-9,
    );
    let between = with(9.1e3, 5.4e3);
    assert_close(
        &small.frequencies_hz(&between, 10).unwrap(),
        &ritz.frequencies_hz(&between, 10).unwrap(),
        1e-6,
    );
    let modes = [&small, &ritz].map(|r| r.modes(&plate.coefficients(), 10).unwrap());
    for (a, b) in modes[0].iter().zip(&modes[1]) {
        let points = [[0.05, 0.1], [0.7, 0.2]];
        let (u, v) = (small.deflection(a, &points), ritz.deflection(b, &points));
        let sign = (u[0] * v[0]).signum();
        assert!(
            u.iter()
                .zip(&v)
                .all(|(u, v)| (u - sign * v).abs() < 1e-4 * v.abs().max(1.0))
        );
    }
}

#[test]
fn wrong_input_is_refused_with_its_place() {
    let ritz = thin(4, PlateSupports::all(FREE));
    let refused = |plate: VibratingPlate, place: &str| {
        let error = ritz.frequencies_hz(&plate, 3).unwrap_err();
        assert!(error.to_string().contains(place), "{error}");
        assert_eq!(error.exit_code(), 1);
    };
    refused(carbon(&[0.0, 90.0]), "layup_deg");
    refused(
        VibratingPlate {
            thickness: 0.0,
            ..carbon(&[0.0])
        },
        "thickness_mm",
    );
    refused(
        VibratingPlate {
            weight: Weight::Mass(f64::NAN),
            ..carbon(&[0.0])
        },
        "mass_g",
    );
    let ply = Ply {
        nu12: 5.0,
        ..carbon(&[0.0]).ply
    };
    refused(
        VibratingPlate {
            ply,
            ..carbon(&[0.0])
        },
        "material",
    );
    assert!(
        Ritz::new(&Settings {
            order: 1,
            ..Settings::free(Theory::Thin)
        })
        .is_err()
    );
}

#[test]
fn air_without_its_matrix_is_refused() {
    let plate = VibratingPlate {
        air_density: 1.2e-12,
        ..carbon(&[0.0])
    };
    assert!(
        thin(6, PlateSupports::all(FREE))
            .frequencies_hz(&plate, 3)
            .is_err()
    );
}
