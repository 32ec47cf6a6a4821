//! The compiled posterior: the formula's value, and the same bits however points are grouped.

use nalgebra::{DMatrix, DVector};

use plychain::diagnose::{Rule, diagnose};
use plychain::infer::Posterior;
use plychain::reduce::monomial;
use plychain::sample::{Ensemble, Quiet, Schedule, Start, Stream, run};
use plychain::sample::{LogDensity, laplace};

use crate::common::tabulated::Tabulated;

/// The log posterior by the formula as it stands: all monomials, a dense covariance, its Cholesky factor.
fn dense(table: &Tabulated, x: &[f64]) -> f64 {
    let point = [x[0], x[1], x[2], x[3], table.t0];
    let z: Vec<f64> = (0..5)
        .map(|i| (point[i] - table.mid[i]) / table.half[i])
        .collect();
    let k = table.alpha_measured.len();
    let mut r = DVector::from_column_slice(&table.alpha_measured);
    let mut slope = DVector::zeros(k);
    for (e, c) in table.exponents.iter().zip(&table.coefficients) {
        let c = DVector::from_column_slice(c);
        r -= monomial(e, &z) * &c;
        if e[4] > 0 {
            let mut lower = e.clone();
            lower[4] -= 1;
            let per_h = table.t0 / table.h0 / table.half[4];
            slope += f64::from(e[4]) * monomial(&lower, &z) * per_h * c;
        }
    }
    let covariance = DMatrix::from_diagonal(&DVector::from_column_slice(&table.variance))
        + table.sigma_h.powi(2) * &slope * slope.transpose();
    let cholesky = covariance.cholesky().unwrap();
    let tau = std::f64::consts::TAU.ln();
    let prior: f64 = (0..4)
        .map(|i| {
            let sd = table.prior.sd[i];
            -0.5 * (((x[i] - table.prior.mean[i]) / sd).powi(2) + tau) - sd.ln()
        })
        .sum();
    let whitened = cholesky.solve(&r).dot(&r);
    prior - 0.5 * (whitened + cholesky.ln_determinant() + k as f64 * tau)
}

/// Points about the prior, some of them inadmissible.
fn cloud(posterior: &Posterior, count: usize) -> Vec<f64> {
    let key = plychain::sample::Key {
        seed: 5,
        ensemble: 0,
    };
    let mut rng = Stream::at(key, 0, 0);
    let (centre, sd) = posterior.start();
    let point = |_| {
        centre
            .iter()
            .zip(&sd)
            .map(|(c, s)| c + 4.0 * s * rng.normal())
            .collect::<Vec<_>>()
    };
    let mut points: Vec<f64> = (0..count).flat_map(point).collect();
    points[1] = -1.0;
    points[4] = f64::NAN;
    points
}

/// Whether E1, E2, nu12, G12 are those of a ply.
fn admissible(x: &[f64]) -> bool {
    x[0] > 0.0 && x[1] > 0.0 && x[3] > 0.0 && x[2] * x[2] < x[0] / x[1]
}

#[test]
fn the_formula_to_1e_9() {
    let table = Tabulated::load();
    let posterior = table.posterior();
    for t in &table.test_points {
        let found = posterior.value(&t.p).unwrap() + table.constant();
        assert!(
            (found - t.logp).abs() <= 1e-9,
            "{:?}: {found} {}",
            t.p,
            t.logp
        );
    }
    for x in cloud(&posterior, 100).chunks_exact(4).skip(2) {
        let (found, truth) = (
            posterior.value(x).unwrap() + table.constant(),
            dense(&table, x),
        );
        if admissible(x) {
            assert!(
                (found - truth).abs() <= 1e-9 * truth.abs().max(1.0),
                "{x:?}: {found} {truth}"
            );
        } else {
            assert_eq!(found, f64::NEG_INFINITY);
        }
    }
}

/// The derivative by the thickness has monomials that the table need not have.
#[test]
fn a_table_without_its_lower_monomials() {
    let mut table = Tabulated::load();
    let kept: Vec<usize> = (0..table.exponents.len())
        .filter(|&m| table.exponents[m][4] > 0)
        .collect();
    table.exponents = kept.iter().map(|&m| table.exponents[m].clone()).collect();
    table.coefficients = kept
        .iter()
        .map(|&m| table.coefficients[m].clone())
        .collect();
    let posterior = table.posterior();
    for x in cloud(&posterior, 20).chunks_exact(4).skip(2) {
        let (found, truth) = (
            posterior.value(x).unwrap() + table.constant(),
            dense(&table, x),
        );
        if admissible(x) {
            let close = (found - truth).abs() <= 1e-9 * truth.abs().max(1.0);
            assert!(close, "{x:?}: {found} {truth}");
        } else {
            assert_eq!(found, f64::NEG_INFINITY);
        }
    }
}

#[test]
fn the_same_bits_in_any_company() {
    let table = Tabulated::load();
    let posterior = table.posterior();
    let points = cloud(&posterior, 53);
    let alone: Vec<u64> = points
        .chunks_exact(4)
        .map(|x| posterior.value(x).unwrap().to_bits())
        .collect();
    assert_eq!(f64::from_bits(alone[0]), f64::NEG_INFINITY);
    assert_eq!(f64::from_bits(alone[1]), f64::NEG_INFINITY);
    for size in [1, 2, 7, 16, 17, 32, 53] {
        let mut out = vec![0.0; 53];
        for (xs, out) in points.chunks(4 * size).zip(out.chunks_mut(size)) {
            let columns: Vec<f64> = (0..4)
                .flat_map(|k| xs.iter().skip(k).step_by(4).copied())
                .collect();
            posterior.values(&columns, out).unwrap();
        }
        let together: Vec<u64> = out.iter().map(|v| v.to_bits()).collect();
        assert_eq!(alone, together, "in batches of {size}");
    }
}

#[test]
fn moments_of_a_tabulated_posterior() {
    let table = Tabulated::load();
    let known = &table.reference;
    let posterior = table.posterior();
    let (centre, sd) = posterior.start();
    let mode = laplace(&posterior, &centre, &sd).unwrap();
    let start = Start::Ball {
        centre: &mode.mode,
        covariance: &mode.covariance,
        spread: 2.0,
    };
    let rule = Rule {
        ess: 5000.0,
        ..Rule::default()
    };
    let sampler = Ensemble::default();
    let draws = run(
        &posterior,
        &sampler,
        &start,
        &Schedule::default(),
        &rule,
        &Quiet,
    )
    .unwrap()
    .draws;
    let verdict = diagnose(&draws, &rule);
    assert!(verdict.converged, "{}", verdict.line());
    for (k, row) in verdict.rows.iter().enumerate() {
        assert!(
            (row.mean - known.mean[k]).abs() < 4.0 * row.mcse_mean,
            "{row:?}"
        );
        assert!((row.sd - known.sd[k]).abs() < 4.0 * row.mcse_sd, "{row:?}");
    }
}
