//! Diagnostics against processes of known autocorrelation and against ArviZ.

use std::io::Write;
use std::process::Stdio;

use crate::common::python;
use plychain::chain::{Draws, ScalarDraws};
use plychain::diagnose::{
    Rule, diagnose, ess_bulk, ess_mean, ess_quantile, ess_tail, mcse_mean, mcse_quantile, mcse_sd,
    rhat, tau, weigh,
};
use plychain::sample::{Key, Stream};

/// Stationary AR(1) chains x_t = a x_{t-1} + e_t of unit innovation variance.
fn ar1(a: f64, chains: usize, draws: usize, seed: u64) -> ScalarDraws {
    let mut values = Vec::with_capacity(chains * draws);
    for chain in 0..chains {
        let mut rng = Stream::at(Key { seed, ensemble: 0 }, chain as u64, 0);
        let mut x = rng.normal() / (1.0 - a * a).sqrt();
        for _ in 0..draws {
            values.push(x);
            x = a * x + rng.normal();
        }
    }
    ScalarDraws::of_chains(values, draws)
}

/// Draws of N(0, 1) weighed for N(0.5, 1): the mean moves by 0.5, 1 / E[w^2] = exp(-0.25) of the draws are effective, and over many sets
/// the shifts scatter by their stated errors.
#[test]
fn weights_move_a_mean_by_what_they_should() {
    const SETS: usize = 400;
    const DRAWS: usize = 500;
    let mut rng = Stream::at(
        Key {
            seed: 11,
            ensemble: 0,
        },
        0,
        0,
    );
    let (mut shifts, mut errors, mut shares) = (Vec::new(), 0.0, 0.0);
    for _ in 0..SETS {
        let points: Vec<[f64; 2]> = (0..DRAWS).map(|_| [rng.normal(), rng.normal()]).collect();
        let logs: Vec<f64> = points.iter().map(|x| 0.5 * x[0] - 0.125).collect();
        let points: Vec<&[f64]> = points.iter().map(|x| &x[..]).collect();
        let found = weigh(&points, &logs);
        assert_eq!(found.impossible, 0);
        let [_, beside] = [found.shifts[0], found.shifts[1]];
        assert!(beside[0].abs() < 5.0 * beside[1], "{beside:?}");
        shifts.push(found.shifts[0][0]);
        errors += found.shifts[0][1] / SETS as f64;
        shares += found.effective / SETS as f64;
    }
    let mean = shifts.iter().sum::<f64>() / SETS as f64;
    let variance = shifts.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (SETS - 1) as f64;
    let scatter = variance.sqrt();
    println!("{mean} scatter {scatter} stated {errors} effective {shares}");
    // a ratio of means is off by a part in the number of draws
    assert!((mean - 0.5).abs() < 4.0 * scatter / (SETS as f64).sqrt() + 1.0 / DRAWS as f64);
    // four standard errors of a scatter of 400 values
    assert!((errors / scatter - 1.0).abs() < 4.0 / (2.0 * SETS as f64).sqrt());
    let expected = (-0.25_f64).exp();
    assert!((shares - expected).abs() < 0.01, "{shares} {expected}");
}

#[test]
fn draws_that_a_density_does_not_have_weigh_nothing() {
    let points: Vec<[f64; 1]> = (0..100).map(|k| [f64::from(k) - 49.5]).collect();
    let points: Vec<&[f64]> = points.iter().map(|x| &x[..]).collect();
    let half = |x: &&[f64]| if x[0] < 0.0 { f64::NEG_INFINITY } else { 0.0 };
    let found = weigh(&points, &points.iter().map(half).collect::<Vec<_>>());
    assert_eq!((found.impossible, found.effective), (50, 0.5));
    assert_eq!(found.shifts[0][0], 25.0);
    let none = weigh(&points, &[f64::NEG_INFINITY; 100]);
    assert_eq!((none.impossible, none.effective), (100, 0.0));
    assert_eq!(none.shifts, [[0.0; 2]]);
}

/// tau = (1 + a) / (1 - a) = 19. Madras & Sokal: var(tau)/tau^2 = 2 (2 M + 1) / n, M = 5 tau: 0.7 % here; five sd
/// allowed (false alarm 6e-7), and 0.7 % of bias by the window.
#[test]
fn ar1_has_tau_19_and_known_ess() {
    let series = ar1(0.9, 16, 500_000, 1);
    let n = 16.0 * 500_000.0f64;
    let spread = (2.0 * (2.0 * 5.0 * 19.0 + 1.0) / n).sqrt();
    assert!(
        (tau(&series) / 19.0 - 1.0).abs() < 5.0 * spread + 0.007,
        "{}",
        tau(&series)
    );
    let ess = ess_mean(&series);
    assert!((ess * 19.0 / n - 1.0).abs() < 0.05, "{ess}");
    let truth = (1.0f64 / (1.0 - 0.81)).sqrt() * (19.0 / n).sqrt();
    assert!((mcse_mean(&series) / truth - 1.0).abs() < 0.05);
}

/// An independent series has tau 1 and ESS n; an alternating one is worth more than n.
#[test]
fn white_and_antithetic_series() {
    let white = ar1(0.0, 4, 20_000, 2);
    assert!((tau(&white) - 1.0).abs() < 0.1);
    assert!((ess_bulk(&white) / 80_000.0 - 1.0).abs() < 0.1);
    let antithetic = ar1(-0.5, 4, 20_000, 3);
    assert!(ess_mean(&antithetic) > 160_000.0);
    assert!((tau(&antithetic) - 1.0 / 3.0).abs() < 0.1);
}

/// Walkers of one ensemble that disagree with each other are one group: R-hat must not compare them, but it must
/// compare ensembles.
#[test]
fn rhat_compares_ensembles_not_walkers() {
    let mut series = ar1(0.0, 8, 2000, 4);
    for (k, value) in series.values.iter_mut().enumerate() {
        *value += if (k / 2000) % 2 == 0 { 3.0 } else { -3.0 };
    }
    assert!(rhat(&series) > 1.5);
    series.ensemble = vec![0, 0, 1, 1, 2, 2, 3, 3];
    assert!(rhat(&series) < 1.01, "{}", rhat(&series));
    series.ensemble = vec![0, 1, 0, 1, 0, 1, 0, 1];
    assert!(rhat(&series) > 1.5);
}

/// Different scale, same location: only the folded R-hat sees it.
#[test]
fn folded_rhat_sees_scale() {
    let mut series = ar1(0.0, 4, 1000, 5);
    series.values[..1000].iter_mut().for_each(|v| *v *= 3.0);
    assert!(rhat(&series) > 1.05, "{}", rhat(&series));
}

#[test]
fn nan_and_constants_are_nan_and_not_converged() {
    let good = ar1(0.0, 4, 1000, 6);
    let mut holed = good.clone();
    holed.values[17] = f64::NAN;
    let constant = ScalarDraws::of_chains(vec![0.1; 4000], 1000);
    let short = ar1(0.0, 4, 3, 7);
    for series in [&holed, &constant, &short] {
        let all = [rhat, ess_bulk, ess_tail, ess_mean, mcse_mean, mcse_sd, tau];
        assert!(all.iter().all(|f| f(series).is_nan()));
        assert!(mcse_quantile(series, 0.5).is_nan());
    }
    // what never moves is no chain; beside others that move it has no spread, whatever rounding makes of its sd
    for fixed in [0.1, 0.5, 3.7] {
        let judged = |names: &[&str], values: Vec<f64>| {
            let names = names.iter().map(|n| (*n).to_string()).collect();
            let draws = Draws::new(names, (0..4).collect(), values, vec![0.0; 4000]).unwrap();
            diagnose(&draws, &Rule::default())
        };
        let alone = judged(&["stuck"], vec![fixed; 4000]);
        assert!(
            !alone.converged && alone.reasons[0].starts_with("stuck: "),
            "{alone}"
        );
        let beside = good.values.iter().flat_map(|&v| [v, fixed]).collect();
        let beside = judged(&["a", "fixed"], beside);
        assert!(beside.converged && beside.rows[1].sd == 0.0, "{beside}");
        assert!(beside.rhat_max().is_nan());
    }
}

#[test]
fn verdict_names_what_is_wrong() {
    let series = ar1(0.99, 4, 1000, 8);
    let draws = Draws::new(
        vec!["slow".into()],
        (0..4).collect(),
        series.values,
        vec![0.0; 4000],
    );
    let verdict = diagnose(&draws.unwrap(), &Rule::default());
    assert!(!verdict.converged && verdict.line().starts_with("NOT converged: slow: "));
    assert!(
        verdict.line().contains("ESS bulk") && verdict.line().contains("tau"),
        "{verdict}"
    );
    let series = ar1(0.3, 4, 100_000, 9);
    let draws = Draws::new(
        vec!["fast".into()],
        (0..4).collect(),
        series.values,
        vec![0.0; 400_000],
    );
    let verdict = diagnose(&draws.unwrap(), &Rule::default());
    assert!(verdict.converged, "{verdict}");
}

const ARVIZ: &str = r#"
import sys, json, numpy as np
from arviz.stats import diagnostics as d
out = []
for case in json.load(sys.stdin):
    x = np.array(case)
    out.append([d._rhat_rank(x), d._ess_bulk(x), d._ess_tail(x), d._ess_mean(x), d._ess_quantile(x, 0.3),
                d._mcse_mean(x), d._mcse_sd(x), d._mcse_quantile(x, 0.1), d._mcse_quantile(x, 0.975)])
print(json.dumps(np.array(out, dtype=float).tolist()))
"#;

/// Plain chains, where our definitions and ArviZ's are the same: smooth, slow, antithetic, tied, heavy-tailed, odd
/// and short.
#[test]
#[ignore = "needs Python"]
fn agrees_with_arviz() {
    let mut cases = vec![
        ar1(0.5, 4, 1000, 20),
        ar1(0.97, 4, 999, 21),
        ar1(-0.6, 3, 500, 22),
        ar1(0.0, 1, 400, 23),
        ar1(0.2, 8, 21, 24),
        ar1(0.8, 4, 6000, 25),
    ];
    let mut tied = ar1(0.5, 4, 800, 26);
    tied.values.iter_mut().for_each(|v| *v = (*v * 2.0).round());
    cases.push(tied);
    let mut heavy = ar1(0.5, 4, 800, 27);
    heavy.values.iter_mut().for_each(|v| *v = v.powi(5));
    cases.push(heavy);
    let rows: Vec<Vec<&[f64]>> = cases
        .iter()
        .map(|s| (0..s.chains()).map(|c| s.chain(c)).collect())
        .collect();
    let mut child = python()
        .args(["-c", ARVIZ])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let input = serde_json::to_string(&rows).unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(input.as_bytes())
        .unwrap();
    let answer = child.wait_with_output().unwrap();
    let theirs: Vec<Vec<f64>> = serde_json::from_str(
        &String::from_utf8(answer.stdout)
            .unwrap()
            .replace("NaN", "-1"),
    )
    .unwrap();
    for (k, (s, theirs)) in cases.iter().zip(theirs).enumerate() {
        let ours = [
            rhat(s),
            ess_bulk(s),
            ess_tail(s),
            ess_mean(s),
            ess_quantile(s, 0.3),
            mcse_mean(s),
            mcse_sd(s),
            mcse_quantile(s, 0.1),
            mcse_quantile(s, 0.975),
        ];
        for (which, (a, b)) in ours.into_iter().zip(theirs).enumerate() {
            // ArviZ gives no R-hat of a single chain.
            if s.chains() > 1 || which > 0 {
                assert!(
                    (a - b).abs() <= 1e-6 * b.abs(),
                    "case {k}, figure {which}: {a} against {b}"
                );
            }
        }
    }
}
