//! Fields of noise alone, of any window, spacing and correlation length that one field can tell from an error of the model: nothing is
//! found in them, and the noise is measured for what it is.

use plychain::identify::{inverse_problem, prepare};
use plychain::progress::Silent;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use crate::common::{changed, set_coarse};
use crate::patterns::with;
use crate::tracing::{Noise, measured_with, traced};

/// A window of about `side` mm on a plate in proportion, in `grid` x `grid` points, with noise correlated over `length` mm.
struct Null {
    side: f64,
    grid: usize,
    length: f64,
}

/// Ratio of the noise found to the 10 nm that were put in, for u1 and u2; whether anything was found.
fn judged(case: &Null, seed: u64) -> ([f64; 2], Vec<String>) {
    let file = changed("openhole.json", |m| {
        set_coarse(m);
        let specimen = &mut m["experiments"][0]["specimen"];
        let scale = case.side / 24.3;
        specimen["width_mm"] = (25.0 * scale).into();
        specimen["length_mm"] = (200.0 * scale).into();
        specimen["hole"]["diameter_mm"] = (4.0 * scale).into();
        // the same stress
        m["experiments"][0]["load"]["force_N"] = (700.0 * scale).into();
        m["reduced_model"]
            .as_object_mut()
            .unwrap()
            .remove("reference");
    });
    let noise = if case.length > 0.0 {
        Noise::Correlated(case.length)
    } else {
        Noise::White
    };
    let model = measured_with(&file, case.grid, &[], noise, seed);
    let prepared = prepare(&model, &Silent).unwrap();
    let found = inverse_problem(&model, prepared, &Silent).unwrap().noise;
    let ratio = [0, 1].map(|c| found.point_sd_nm(c) / 10.0);
    let (accepted, last) = traced(&model);
    let mut said: Vec<String> = accepted
        .iter()
        .map(|(name, _)| (*name).to_string())
        .collect();
    said.extend(last.suspect.reasons.iter().cloned());
    (ratio, said)
}

fn judge(cases: &[Null], seeds: std::ops::Range<u64>) {
    let mut faults = Vec::new();
    for case in cases {
        let mut ratios = Vec::new();
        for seed in seeds.clone() {
            let (ratio, said) = judged(case, 900 + seed);
            println!(
                "{} mm, {} points a side, {} mm, seed {seed}: noise {ratio:.3?} {said:?}",
                case.side, case.grid, case.length
            );
            ratios.extend(ratio);
            if !said.is_empty() {
                faults.push(format!(
                    "{} mm, {} mm, seed {seed}: {said:?}",
                    case.side, case.length
                ));
            }
        }
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let areas = (case.side / case.length.max(1e-3)).powi(2);
        let most = if areas < 300.0 { 0.1 } else { 0.05 };
        if (mean - 1.0).abs() > most {
            faults.push(format!(
                "{} mm, {} mm: noise {mean:.3} times what it is",
                case.side, case.length
            ));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// The shortest and the longest correlation of small, ordinary and large windows.
#[test]
#[ignore = "slow: run by .ci/run"]
fn noise_is_measured_and_nothing_is_found_in_any_window() {
    let cases = [
        Null {
            side: 12.0,
            grid: 61,
            length: 1.0,
        },
        Null {
            side: 24.3,
            grid: 61,
            length: 2.3,
        },
        Null {
            side: 80.0,
            grid: 61,
            length: 3.0,
        },
    ];
    judge(&cases, 0..1);
}

#[test]
#[ignore = "30 fields, 10 minutes"]
fn noise_is_measured_and_nothing_is_found_at_any_spacing() {
    let case = |side: f64, grid: usize, length: f64| Null { side, grid, length };
    let cases = [
        case(12.0, 13, 0.0),
        case(12.0, 121, 0.1),
        case(12.0, 301, 0.3),
        case(12.0, 121, 1.1),
        case(24.3, 601, 0.1),
        case(24.3, 121, 0.3),
        case(24.3, 121, 1.0),
        case(24.3, 121, 2.3),
        case(80.0, 81, 0.0),
        case(80.0, 161, 1.0),
        case(80.0, 81, 3.0),
        case(80.0, 161, 3.0),
    ];
    judge(&cases, 1..3);
}

/// Noise whose sd grows by a factor 1.5 from the middle of the field to its corners: nothing is found, and its size is the mean one's.
#[test]
#[ignore = "slow: run by .ci/run"]
fn noise_that_varies_over_the_field_is_noise() {
    let mut rng = Pcg64Dxsm::seed_from_u64(77);
    let mut square = [0.0, 0.0];
    let varying = |[x, y]: [f64; 2]| {
        let sd = 8.0 * (1.0 + 0.5 * x.hypot(y) / 17.2);
        square = [square[0] + sd * sd, square[1] + 1.0];
        [(); 2].map(|()| {
            let z: f64 = StandardNormal.sample(&mut rng);
            sd * z
        })
    };
    let model = with(Noise::Of(0.01), 950, varying);
    let mean = (square[0] / square[1]).sqrt();
    let prepared = prepare(&model, &Silent).unwrap();
    let found = inverse_problem(&model, prepared, &Silent).unwrap().noise;
    for c in 0..2 {
        let ratio = found.point_sd_nm(c) / mean;
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }
    let (accepted, last) = traced(&model);
    assert!(accepted.is_empty(), "{accepted:?}");
    assert!(
        last.suspect.reasons.is_empty(),
        "{:?}",
        last.suspect.reasons
    );
}
