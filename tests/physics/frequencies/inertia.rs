//! Sensitivities, the air's mass, point masses.

use plychain::experiment::frequencies::{
    PlateEdge, PlateParameter, PlateSupports, Ritz, Settings, Theory, TransverseShear,
    VibratingPlate, Weight,
};
use plychain::laminate::Ply;

use super::support::Lowest;

/// All parameters of a laminate.
const PARAMETERS: [PlateParameter; 12] = [
    PlateParameter::E1,
    PlateParameter::E2,
    PlateParameter::Nu12,
    PlateParameter::G12,
    PlateParameter::G13,
    PlateParameter::G23,
    PlateParameter::Thickness,
    PlateParameter::Length,
    PlateParameter::Width,
    PlateParameter::Weight,
    PlateParameter::AirDensity,
    PlateParameter::PointMass,
];

fn plate(weight: Weight, layup_deg: &[f64]) -> VibratingPlate {
    VibratingPlate {
        length: 200.0,
        width: 150.0,
        thickness: 3.0,
        weight,
        ply: Ply {
            e1: 150e3,
            e2: 10e3,
            nu12: 0.3,
            g12: 5e3,
        },
        transverse: TransverseShear::default(),
        angles: layup_deg.iter().map(|a| a.to_radians()).collect(),
        air_density: 1.2e-12,
        point_mass: 1e-6,
    }
}

#[test]
fn sensitivities_are_the_slopes_of_finite_differences() {
    let weights = [Weight::Density(1.6e-9), Weight::Mass(1.4e-4)];
    for (theory, weight) in [(Theory::Thin, weights[0]), (Theory::Sheared, weights[1])] {
        let settings = Settings {
            order: 8,
            air_aspect: Some(200.0 / 150.0),
            point: Some([0.1, 0.3]),
            ..Settings::free(theory)
        };
        let ritz = Ritz::new(&settings).unwrap();
        for declared in [false, true] {
            let mut plate = plate(weight, &[30.0, -60.0, -60.0, 30.0]);
            if declared {
                plate.transverse = TransverseShear {
                    g13: Some(4.5e3),
                    g23: Some(3.5e3),
                    nu23: None,
                };
            }
            let modes = ritz.modes(&plate.coefficients(), 8).unwrap();
            for parameter in PARAMETERS {
                let step = 1e-5 * plate.get(parameter);
                let at = |sign: f64| {
                    let moved = plate
                        .clone()
                        .with(parameter, plate.get(parameter) + sign * step);
                    ritz.frequencies_hz(&moved, 8).unwrap()
                };
                let (low, high) = (at(-1.0), at(1.0));
                for (i, mode) in modes.iter().enumerate() {
                    let slope = ritz.sensitivities_hz(mode, &plate, &[parameter])[0];
                    let expected = (high[i] - low[i]) / (2.0 * step);
                    let scale = mode.frequency_hz() / plate.get(parameter);
                    assert!(
                        (slope - expected).abs() < 1e-6 * scale + 1e-4 * expected.abs(),
                        "{theory:?} {parameter:?} mode {i}: {slope} beside {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_pair_of_different_families_keeps_its_own_slopes() {
    // a square cross-ply plate with D11 = D22 has pairs (m, n), (n, m); E1 and the like act on both alike, the length does not
    let square = VibratingPlate {
        length: 200.0,
        width: 200.0,
        ply: Ply::isotropic(70e3, 0.3),
        point_mass: 0.0,
        air_density: 0.0,
        ..plate(Weight::Density(1.6e-9), &[0.0])
    };
    let ritz = Ritz::new(&Settings::free(Theory::Thin)).unwrap();
    let modes = ritz.modes(&square.coefficients(), 5).unwrap();
    let pair = [&modes[3], &modes[4]];
    assert!((pair[0].lambda / pair[1].lambda - 1.0).abs() < 1e-9);
    let slopes = pair.map(|m| {
        ritz.sensitivities_hz(m, &square, &[PlateParameter::Length, PlateParameter::Width])
    });
    assert!(
        (slopes[0][0] / slopes[1][1] - 1.0).abs() < 1e-6
            && (slopes[0][1] / slopes[1][0] - 1.0).abs() < 1e-6
    );
    let longer = ritz
        .frequencies_hz(&square.clone().with(PlateParameter::Length, 200.002), 5)
        .unwrap();
    let mut expected = slopes.map(|s| s[0] * 0.002 + pair[0].frequency_hz());
    expected.sort_by(f64::total_cmp);
    assert!((longer[3] - expected[0]).abs() < 1e-6 && (longer[4] - expected[1]).abs() < 1e-6);
}

/// Added mass of a plate that moves as a whole, over (pi / 4) rho a b min(a, b).
fn heave(aspect: f64) -> f64 {
    let (long, short) = (100.0 * aspect.max(1.0), 100.0 * (1.0 / aspect).max(1.0));
    let settings = Settings {
        air_aspect: Some(aspect),
        ..Settings::free(Theory::Thin)
    };
    let ritz = Ritz::new(&settings).unwrap();
    let mass = ritz.heave_added_mass(1.0, [long, short]).unwrap();
    mass / (std::f64::consts::FRAC_PI_4 * long * short * long.min(short))
}

#[test]
fn air_about_a_moving_rectangle_has_the_published_mass() {
    // DNV-RP-H103 (2011), table A-2: rectangular plates moving normal to themselves
    for (aspect, known) in [
        (1.0, 0.579),
        (1.5, 0.690),
        (2.0, 0.757),
        (3.0, 0.830),
        (5.0, 0.897),
        (10.0, 0.947),
    ] {
        let found = heave(aspect);
        assert!(
            (found / known - 1.0).abs() < 0.01,
            "{aspect}: {found} beside {known}"
        );
    }
    assert!((heave(0.5) / heave(2.0) - 1.0).abs() < 1e-9);
}

#[test]
fn air_moves_with_short_waves_as_with_an_infinite_plate() {
    // high modes of a simply supported plate: 2 rho / |k| a unit of area, less what flows about the edges
    let settings = Settings {
        supports: PlateSupports::all(PlateEdge::SimplySupported),
        air_aspect: Some(1.0),
        order: 14,
        ..Settings::free(Theory::Thin)
    };
    let ritz = Ritz::new(&settings).unwrap();
    let still = VibratingPlate {
        length: 200.0,
        width: 200.0,
        point_mass: 0.0,
        air_density: 0.0,
        ply: Ply::isotropic(70e3, 0.3),
        ..plate(Weight::Density(1.6e-9), &[0.0])
    };
    let rho = 1e-14;
    let modes = ritz.modes(&still.coefficients(), 40).unwrap();
    for (mode, sum) in modes.iter().zip([
        2.0_f64, 5.0, 5.0, 8.0, 10.0, 10.0, 13.0, 13.0, 17.0, 17.0, 18.0,
    ]) {
        let k = std::f64::consts::PI * sum.sqrt() / still.length;
        let share = 2.0 * rho / k / still.mass_per_area();
        let slope = ritz.sensitivities_hz(mode, &still, &[PlateParameter::AirDensity])[0];
        let found = -2.0 * slope * rho / mode.frequency_hz() / share;
        // the lowest modes displace volume, which reaches further than their wave
        let off = if sum < 6.0 { 0.3 } else { 0.15 };
        assert!((found - 1.0).abs() < off, "{sum}: {found}");
    }
}

#[test]
fn a_point_mass_lowers_what_moves_there() {
    let settings = Settings {
        supports: PlateSupports::all(PlateEdge::SimplySupported),
        point: Some([0.5, 0.5]),
        rotary_inertia: false,
        ..Settings::free(Theory::Thin)
    };
    let ritz = Ritz::new(&settings).unwrap();
    let bare = VibratingPlate {
        point_mass: 0.0,
        air_density: 0.0,
        ..plate(Weight::Density(1.6e-9), &[0.0, 90.0, 90.0, 0.0])
    };
    let total = bare.mass_per_area() * bare.length * bare.width;
    let loaded = VibratingPlate {
        point_mass: 1e-3 * total,
        ..bare.clone()
    };
    let (f, g) = (
        ritz.frequencies_hz(&bare, 3).unwrap(),
        ritz.frequencies_hz(&loaded, 3).unwrap(),
    );
    // modal mass is a quarter of the plate's: df / f = -2 m / M; the second mode has a node there
    assert!((g[0] / f[0] - 1.0 + 2e-3).abs() < 1e-5, "{f:?} {g:?}");
    assert!((g[1] / f[1] - 1.0).abs() < 1e-9);
}
