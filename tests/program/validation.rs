//! Other ways to a posterior agree with it, bad input is refused, and simulated measurements of known truth are covered.

mod calibration;

use plychain::noise::matern_pair;
use plychain::numeric::{hermite, legendre};
use plychain::posterior::PosteriorDensity;
use plychain::sample::{Laplace, LogDensity, laplace};
use plychain::validate::coverage::{band, kolmogorov};
use plychain::validate::grid::{PosteriorGrid, automatic, check_bounds};
use plychain::validate::thickness;
use rand::SeedableRng;
use rand_pcg::Pcg64Dxsm;
use serde_json::Value;

use crate::common::{changed, coarse, fresh, inverse, refused, set_coarse, succeed};

fn posterior() -> (PosteriorDensity, Laplace, Vec<[f64; 2]>) {
    let posterior = inverse().posed.density.clone();
    let (centre, sd) = posterior.start();
    let mode = laplace(&posterior, &centre, &sd).unwrap();
    let d = posterior.dim();
    let sd: Vec<f64> = (0..4).map(|k| mode.covariance[k * d + k].sqrt()).collect();
    let bounds = automatic(&posterior, &mode.mode, &sd);
    (posterior, mode, bounds)
}

#[test]
fn gauss_hermite_rules_have_the_moments_of_the_normal() {
    for nodes in [5, 7] {
        let rule = hermite(nodes);
        let mut expected = 1.0;
        for power in 0..2 * rule.len() as i32 {
            let moment: f64 = rule.iter().map(|(z, w)| w * z.powi(power)).sum();
            let exact = if power % 2 == 0 { expected } else { 0.0 };
            assert!(
                (moment - exact).abs() < 1e-12 * expected.max(1.0),
                "{power}: {moment}"
            );
            if power % 2 == 0 {
                expected *= f64::from(power + 1);
            }
        }
    }
}

#[test]
fn gauss_legendre_rules_integrate_powers() {
    for nodes in 1..8 {
        for power in 0..2 * nodes as i32 {
            let moment: f64 = legendre(nodes).iter().map(|(x, w)| w * x.powi(power)).sum();
            assert!((moment * f64::from(power + 1) - 1.0).abs() < 1e-13);
        }
    }
}

/// The trapezoid rule over a smooth density converges faster than any power: more nodes and wider bounds change nothing.
#[test]
fn grid_converges() {
    let (posterior, mode, bounds) = posterior();
    let grid = PosteriorGrid::new(&posterior, &mode, &bounds, 25).unwrap();
    let finer = PosteriorGrid::new(&posterior, &mode, &bounds, 33).unwrap();
    assert!(grid.warnings.is_empty(), "{:?}", grid.warnings);
    let other = &finer.moments;
    assert!((other.log_evidence - grid.moments.log_evidence).abs() < 1e-2);
    for k in 0..4 {
        let off = (other.mean[k] - grid.moments.mean[k]) / grid.moments.sd[k];
        let ratio = other.sd[k] / grid.moments.sd[k];
        assert!(
            off.abs() < 1e-3 && (ratio - 1.0).abs() < 1e-3,
            "{k}: {off} sd, {ratio}"
        );
    }
    for marginal in &grid.marginals {
        let total: f64 = marginal.iter().map(|m| m.1).sum();
        assert!((total - 1.0).abs() < 1e-9);
    }
}

#[test]
fn grid_says_when_it_is_too_coarse_or_too_narrow() {
    let (posterior, mode, bounds) = posterior();
    let wide: Vec<[f64; 2]> = bounds
        .iter()
        .map(|[a, b]| [(a - 1.5 * (b - a)).max(0.1 * a), b + 1.5 * (b - a)])
        .collect();
    let coarse = PosteriorGrid::new(&posterior, &mode, &wide, 9).unwrap();
    assert!(
        coarse.warnings.iter().any(|w| w.contains("too coarse")),
        "{:?}",
        coarse.warnings
    );
    let mut narrow = bounds.clone();
    narrow[0][1] = mode.mode[0];
    let narrow = PosteriorGrid::new(&posterior, &mode, &narrow, 17).unwrap();
    let said = &narrow.warnings;
    assert!(
        said.iter().any(|w| w.contains("too narrow for E1_GPa")),
        "{said:?}"
    );
    // a cut that the prior itself makes is no fault of the grid
    let mut marginals = posterior.marginals().to_vec();
    marginals[0].truncate = Some([bounds[0][0], mode.mode[0]]);
    let cut = posterior.with_marginals(marginals);
    let mut bounds = bounds;
    bounds[0][1] = mode.mode[0];
    assert!(
        PosteriorGrid::new(&cut, &mode, &bounds, 17)
            .unwrap()
            .warnings
            .is_empty()
    );
}

#[test]
fn draws_of_the_grid_have_its_moments() {
    let (posterior, mode, bounds) = posterior();
    let grid = PosteriorGrid::new(&posterior, &mode, &bounds, 17).unwrap();
    let draws = grid.draws(4, 2500).unwrap();
    assert_eq!((draws.chains(), draws.draws()), (4, 2500));
    for k in 0..4 {
        let values = draws.series(k).values;
        let (mean, sd) = (grid.moments.mean[k], grid.moments.sd[k]);
        assert!((plychain::diagnose::mean(&values) - mean).abs() < 0.05 * sd);
        assert!((plychain::diagnose::sd(&values) / sd - 1.0).abs() < 0.03);
    }
}

#[test]
fn impossible_bounds_are_refused() {
    let (posterior, _, bounds) = posterior();
    let with = |k: usize, pair: [f64; 2]| {
        let mut bounds = bounds.clone();
        bounds[k] = pair;
        check_bounds(&posterior, &bounds).unwrap_err().to_string()
    };
    assert!(with(1, [9.0, 6.0]).contains("E2_GPa"));
    assert!(with(3, [-1.0, 6.0]).contains("G12_GPa"));
    assert!(with(2, [8.0, 9.0]).contains("admissible"));
    assert!(with(0, [f64::NAN, 6.0]).contains("E1_GPa"));
}

/// 200 nodes: the largest of as many standard normals exceeds 4 in 1 % of cases. Over 16 seeds it did twice (4.16 and 4.54,
/// RMS 1.06): the standard errors are estimates themselves, and of the dependence on the thickness the analytic marginal
/// keeps the first order, which leaves some thousandths of a log likelihood (RMS 1.03, 1.06, 1.15 with 1000, 4000, 16000
/// samples).
#[test]
fn monte_carlo_over_the_thickness_agrees_with_the_analytic_marginal() {
    let (_, mode, bounds) = posterior();
    let noise = mode.mode.get(4).copied();
    let progress = plychain::progress::Silent;
    let found =
        thickness::compare(&inverse().posed, &bounds, noise, [200, 4000], 3, &progress).unwrap();
    assert_eq!(found.differences.len(), 200);
    assert!(found.worst() < 4.2, "{}", found.worst());
    assert!((0.7..1.3).contains(&found.rms()), "{}", found.rms());
}

/// Variance and correlation of the simulated noise, over fields.
#[test]
fn matern_fields_have_their_covariance() {
    let mut rng = Pcg64Dxsm::seed_from_u64(5);
    let (shape, spacing, l) = ([24, 31], [0.3, 0.4], 1.0);
    let mut products: Vec<[f64; 3]> = Vec::new();
    for _ in 0..400 {
        for field in matern_pair(shape, spacing, l, &mut rng) {
            let at = |i: usize, j: usize| field[i * shape[1] + j];
            products.push([
                at(3, 4) * at(3, 4),
                at(3, 4) * at(6, 4),
                at(3, 4) * at(5, 6),
            ]);
        }
    }
    let kernel = |d: f64| (1.0 + 3_f64.sqrt() * d / l) * (-(3_f64.sqrt()) * d / l).exp();
    let expected = [1.0, kernel(0.9), kernel(0.6_f64.hypot(0.8))];
    for (k, expected) in expected.into_iter().enumerate() {
        let n = products.len() as f64;
        let mean = products.iter().map(|p| p[k]).sum::<f64>() / n;
        // variance of a product of unit normals of correlation c: 1 + c^2
        let error = ((1.0 + expected * expected) / n).sqrt();
        assert!(
            (mean - expected).abs() < 4.0 * error,
            "{k}: {mean}, expected {expected}"
        );
    }
}

/// A correlation that reaches over more points than a torus may have is made on a coarser lattice: steps between points are as
/// small as the correlation wants them.
#[test]
fn long_correlations_are_interpolated() {
    let mut rng = Pcg64Dxsm::seed_from_u64(6);
    let (shape, h, l) = ([60, 50], 0.02, 8.0);
    let step = 3_f64.sqrt() * h / l;
    let allowed = 6.0 * (2.0 * (1.0 - (1.0 + step) * (-step).exp())).sqrt();
    for field in matern_pair(shape, [h; 2], l, &mut rng) {
        assert_eq!(field.len(), shape[0] * shape[1]);
        assert!(field.iter().all(|v| v.abs() < 6.0));
        for (k, v) in field.iter().enumerate() {
            if (k + 1) % shape[1] != 0 {
                assert!((field[k + 1] - v).abs() < allowed);
            }
            if let Some(below) = field.get(k + shape[1]) {
                assert!((below - v).abs() < allowed);
            }
        }
    }
}

#[test]
fn tests_of_uniformity_know_their_quantiles() {
    let spaced: Vec<f64> = (0..1000).map(|i| (f64::from(i) + 0.5) / 1000.0).collect();
    assert!(kolmogorov(spaced.clone()) > 0.999);
    // a shift by D of an even sample has the statistic D + 0.5/n; sqrt(n) D = 1.358 is the 5 % point
    let shift = 1.358 / 1000_f64.sqrt();
    let p = kolmogorov(spaced.iter().map(|u| (u + shift).min(1.0)).collect());
    assert!((0.03..0.06).contains(&p), "{p}");
    assert!(kolmogorov(spaced.iter().map(|u| u * u).collect()) < 1e-6);
    let [low, high] = band(200, 0.9);
    assert!(
        (165..172).contains(&low) && (188..193).contains(&high),
        "{low} {high}"
    );
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn a_run_is_validated_and_what_is_not_one_is_refused() {
    let run = fresh("run");
    let out = run.to_str().unwrap();
    let default = coarse();
    let empty = fresh("empty");
    std::fs::create_dir_all(&empty).unwrap();
    refused(&["validate", empty.to_str().unwrap()], &["run.json"]);
    // so many that the chain's own error of an sd is a third of a percent: 17 nodes miss nu12's by two
    let ess = ["--min-ess", "60000"];
    succeed(&[&["identify", &default, "--quiet", "--out", out], &ess[..]].concat());
    let text = succeed(&["validate", out, "--quiet"]);
    assert!(text.contains("83521 nodes"), "{text}");
    let value: Value =
        serde_json::from_str(&std::fs::read_to_string(run.join("validation.json")).unwrap())
            .unwrap();
    let number = |v: &Value| v.as_f64().unwrap();
    for name in ["E1_GPa", "E2_GPa", "nu12", "G12_GPa", "noise_nm"] {
        let row = &value["grid"]["parameters"][name];
        assert!(
            number(&row["mean_minus_chain_in_sd"]).abs() < 0.05,
            "{name}: {row}"
        );
        assert!(
            number(&row["sd_against_chain_percent"]).abs() < 3.0,
            "{name}: {row}"
        );
    }
    let worst = number(&value["thickness"]["worst_difference_in_standard_errors"]);
    assert!(worst < 4.2, "{worst}");
    // the grid's draws are chain files like a run's, also when it is validated again
    succeed(&["validate", out, "--quiet", "--nodes", "9"]);
    let file = run.join("grid/chain.zarr").display().to_string();
    let table = succeed(&["diagnose", &file]);
    assert!(table.contains("noise_nm"), "{table}");
    refused(
        &["validate", out, "--bounds", "E1_GPa=160:120"],
        &["E1_GPa"],
    );
    refused(
        &["validate", out, "--bounds", "E1_GPa=-160:120"],
        &["above 0"],
    );
    refused(&["validate", out, "--bounds", "E9_GPa=1:2"], &["E9_GPa"]);
    refused(&["validate", out, "--calibrate", "3"], &["model file"]);
    // a chain of another model, then none at all
    let file = run.join("model.json");
    let text = std::fs::read_to_string(&file).unwrap();
    let mut other: Value = serde_json::from_str(&text).unwrap();
    other["likelihood"]["noise_nm"] = serde_json::json!(10.0);
    std::fs::write(&file, other.to_string()).unwrap();
    refused(&["validate", out], &["as the run's model has"]);
    std::fs::write(&file, text).unwrap();
    std::fs::rename(run.join("chain.zarr"), run.join("gone")).unwrap();
    refused(&["validate", out], &["chain.zarr"]);
}
