//! The posterior to quote, sampled: against its closed form, by both samplers, to the same bits.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use plychain::chain::Draws;
use plychain::diagnose::{Rule, diagnose};
use plychain::effect::Kind;
use plychain::infer::Model;
use plychain::progress::Silent;
use plychain::report::sources::sources;
use plychain::sample::SAMPLERS;
use plychain::trace::{Explained, Quoted, explain, quote};

use crate::common::{coarse, python, succeed};
use crate::loops::options;

fn closed(model: &Model) -> Explained {
    let sampler = (SAMPLERS[0].build)();
    explain(model, 5, &|_| options(&*sampler), &Silent).unwrap()
}

fn quoted(closed: &Explained, k: usize) -> Quoted {
    let sampler = (SAMPLERS[k].build)();
    quote(&closed.rounds, false, &|_| options(&*sampler), &Silent).unwrap()
}

/// Standard errors by which the means of a variable differ.
fn apart(a: &Draws, b: &Draws) -> Vec<(String, f64)> {
    let [a, b] = [a, b].map(|d| diagnose(d, &Rule::default()).rows);
    let pairs = a.iter().zip(&b).filter(|(a, b)| a.sd + b.sd > 0.0);
    pairs
        .map(|(a, b)| {
            let error = a.mcse_mean.hypot(b.mcse_mean);
            (a.name.clone(), (a.mean - b.mean) / error)
        })
        // what acts in a handful of draws has no standard error
        .filter(|(_, z)| z.is_finite())
        .collect()
}

/// Birth and death draw every effect as often as the enumeration of subsets makes it likely, within the Monte Carlo error of draws whose
/// walkers count as one value each, and a tenth: the enumeration takes all other effects for none, the draws for small ones.
fn acts_as_often_as_likely(closed: &Explained, quoted: &Quoted) {
    let draws = &quoted.draws;
    let mut sums = [0.0; 2];
    for found in &closed.rounds.last().unwrap().tracing.candidates {
        let Some(k) = draws.index(&format!("acts.{}", found.effect.name())) else {
            // what the recording adds is corrected in the field, and enters no draw
            assert_eq!(found.effect.kind(), Kind::Recorded);
            continue;
        };
        let shares: Vec<f64> = (0..draws.chains())
            .map(|c| {
                (0..draws.draws())
                    .map(|d| draws.point(c, d)[k])
                    .sum::<f64>()
                    / draws.draws() as f64
            })
            .collect();
        let n = shares.len() as f64;
        let mean = shares.iter().sum::<f64>() / n;
        let variance = shares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let likely = found.inclusion_probability;
        let error = (variance / n).max(likely / draws.len() as f64).sqrt();
        println!(
            "{}: {likely:.5} {mean:.5} +- {error:.5}",
            found.effect.name()
        );
        assert!(
            (mean - likely).abs() < 4.5 * error + 0.1 * likely,
            "{}: {likely} {mean} +- {error}",
            found.effect.name()
        );
        sums[0] += likely;
        sums[1] += mean;
    }
    let error = (sums[0] / draws.len() as f64).sqrt();
    assert!(
        (sums[1] - sums[0]).abs() < 4.0 * error + 0.1 * sums[0],
        "{sums:?}"
    );
}

/// On a field whose effects are small the closed form is right: the chains agree with it, by either sampler, in all of some sixty variables.
#[test]
#[ignore = "slow: run by .ci/run"]
fn both_samplers_agree_with_the_closed_form() {
    let model = Model::load(coarse().as_ref()).unwrap();
    let closed = closed(&model);
    assert!(
        closed.conclusion.suspect.is_none(),
        "{}",
        closed.conclusion.text
    );
    let found = [0, 1].map(|k| quoted(&closed, k));
    let averaged = &closed.rounds.last().unwrap().tracing.averaged;
    for quoted in &found {
        let answer = &quoted.answers[0];
        assert!(answer.verdict.converged, "{}", answer.verdict.line());
        // small effects: the full model at the draws weighs them all alike
        let full = &answer.importance;
        println!("{full:?}");
        assert!(full.effective > 0.9 && full.impossible == 0, "{full:?}");
        assert!(
            full.largest().is_some_and(|(_, s)| s[0].abs() < 0.1),
            "{full:?}"
        );
        acts_as_often_as_likely(&closed, quoted);
        for (name, sampled) in quoted.intervals(std::slice::from_ref(averaged)) {
            let form = averaged[&name];
            println!("{name}: {sampled:?} {form:?}");
            let row = answer.verdict.rows.iter().find(|r| r.name == name).unwrap();
            let error = 3.0 * row.mcse_mean;
            assert!(
                (sampled.mean - form.mean).abs() < 0.1 * form.sd + error,
                "{name}"
            );
            let error = 3.0 * row.mcse_sd / form.sd;
            assert!((sampled.sd / form.sd - 1.0).abs() < 0.1 + error, "{name}");
        }
    }
    let errors = apart(&found[0].draws, &found[1].draws);
    println!("{errors:.1?}");
    assert!(errors.len() > 35, "{}", errors.len());
    let square: f64 = errors.iter().map(|(_, z)| z * z).sum();
    assert!(errors.iter().all(|(_, z)| z.abs() < 5.0));
    assert!(
        square < 3.0 * errors.len() as f64,
        "{square} of {}",
        errors.len()
    );
}

/// One seed, one posterior, for any number of threads.
#[test]
#[ignore = "slow: run by .ci/run"]
fn the_posterior_to_quote_is_the_same_for_any_number_of_threads() {
    let model = Model::load(coarse().as_ref()).unwrap();
    let closed = closed(&model);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| quoted(&closed, 0).draws)
    };
    assert_eq!(with(1), with(3));
}

const SCRIPT: &str = r#"
import json, sys, arviz as az, getdist, numpy as np, pandas as pd, xarray as xr
run = sys.argv[1]
report = json.load(open(f"{run}/report.json"))
tree = xr.open_datatree(f"{run}/averaged/chain.zarr", engine="zarr")
posterior = tree.posterior.to_dataset()
table = pd.read_csv(f"{run}/averaged/chain.csv")
samples = getdist.loadMCSamples(f"{run}/export", settings={"ignore_rows": 0})
summary = az.summary(az.InferenceData(posterior=posterior), var_names=list(report["averaged_posterior"]))
for name, quoted in report["averaged_posterior"].items():
    x = posterior[name].values
    assert x.shape[0] * x.shape[1] == len(table) and np.array_equal(table[name].to_numpy(), x.ravel()), name
    assert abs(x.mean() - quoted["mean"]) < 0.1 * quoted["sd"], (name, x.mean(), quoted)
    assert abs(x.std() / quoted["sd"] - 1) < 0.1, (name, x.std(), quoted)
    assert abs(samples.mean(name) - x.mean()) < 1e-6 * abs(x.mean()), name
    assert summary.loc[name, "r_hat"] < 1.05, summary
acts = [n for n in posterior if n.startswith("acts.")]
assert len(acts) > 10 and all(set(np.unique(posterior[n].values)) <= {0.0, 1.0} for n in acts), acts
names = set(samples.getParamNames().list())  # GetDist drops what does not vary within a file
assert set(report["averaged_posterior"]) <= names <= set(posterior), names
"#;

/// ArviZ, GetDist and pandas open what a loop quotes, and find in it what the report says.
#[test]
#[ignore = "needs Python"]
fn other_programs_open_what_a_loop_quotes() {
    let place = tempfile::tempdir().unwrap();
    let run = place.path().join("run");
    let run = run.to_str().unwrap();
    succeed(&["loop", &coarse(), "--out", run, "--quiet", "--csv"]);
    succeed(&["export", run, "--format", "getdist"]);
    judged_as_the_loop_did(run);
    let output = python().args(["-c", SCRIPT, run]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
}

/// `diagnose` of a loop's folder shows the constants, or all, with the loop's own verdict.
fn judged_as_the_loop_did(run: &str) {
    let read = |text: &str| -> serde_json::Value { serde_json::from_str(text).unwrap() };
    let report = read(&std::fs::read_to_string(format!("{run}/report.json")).unwrap());
    let answers = report["quoted"]["answers"].as_array().unwrap();
    let content = answers.iter().all(|a| a["converged"] == true);
    let of = |verdict: &serde_json::Value| -> Vec<String> {
        verdict["parameters"]
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect()
    };
    let constants = read(&succeed(&["diagnose", run, "--json"]));
    let quoted = report["averaged_posterior"].as_object().unwrap();
    assert_eq!(of(&constants), quoted.keys().cloned().collect::<Vec<_>>());
    let all = read(&succeed(&["diagnose", run, "--all", "--json"]));
    assert!(of(&all).len() > 10 && of(&all).contains(&of(&constants)[0]));
    assert_eq!([&constants["converged"], &all["converged"]], [content; 2]);
}

/// Sums of independent normals have shares of the variance that are known. A variable of no influence has none.
#[test]
fn the_width_of_an_interval_is_shared_among_its_sources() {
    let names = [
        "E1_GPa",
        "nu12",
        "thickness_mm",
        "hole_offset.dx_mm",
        "hole_offset.dy_mm",
        "hole_size.diameter_percent",
        "noise_length_1_mm",
    ];
    let (chains, draws) = (4, 20_000);
    let mut random = Pcg64::seed_from_u64(11);
    let mut values = Vec::new();
    for _ in 0..chains * draws {
        let z: Vec<f64> = (0..6).map(|_| random.sample(StandardNormal)).collect();
        // variances 25 = 9 + 4 + 4 + 8; and 4 = 3 + 1
        let e1 = 140.0 + 3.0 * z[0] + 2.0 * z[1] + 2.0 * z[2] + 8f64.sqrt() * z[3];
        let nu12 = 0.3 + 0.01 * (3f64.sqrt() * z[1] + z[4]);
        values.extend([
            e1,
            nu12,
            0.78 + 0.005 * z[0],
            z[1],
            -4.0 * z[2],
            z[5],
            1.0 + z[3].abs(),
        ]);
    }
    let lp = vec![0.0; chains * draws];
    let names: Vec<String> = names.iter().map(|n| n.to_string()).collect();
    let constants = [&names[0], &names[1]];
    let draws = Draws::new(names.clone(), (0..chains).collect(), values, lp).unwrap();
    let found = sources(&draws, &constants);
    let named: Vec<&str> = found.iter().map(|s| s.source.as_str()).collect();
    assert_eq!(named, ["hole_offset", "thickness_mm", "rest"]);
    let expected = [[8.0 / 25.0, 0.75], [9.0 / 25.0, 0.0], [8.0 / 25.0, 0.25]];
    for (source, expected) in found.iter().zip(expected) {
        for (share, expected) in source.of_variance.values().zip(expected) {
            // a correlation's standard error is (1 - R2) / sqrt(n), a share's at most twice that
            let error = 2.0 / (chains as f64 * 20_000.0).sqrt();
            assert!(
                (share - expected).abs() < 4.0 * error,
                "{} {share}",
                source.source
            );
        }
    }
    // too few draws say nothing
    let few = draws.every(5000).unwrap();
    assert!(sources(&few, &constants).is_empty());
}
