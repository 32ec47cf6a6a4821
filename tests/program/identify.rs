//! Identification end to end: known truths, independent fields, measured data.

use serde_json::Value;

use crate::common::{
    changed, coarse, fresh, identify, model, posterior, set_coarse, shared, succeed,
};

const CONSTANTS: [&str; 4] = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

/// Simulate a model without undeclared effects; returns the data's folder.
fn simulate(model: &str, truth: [f64; 4], seed: u64, extra: &[&str]) -> String {
    let out = fresh("data").display().to_string();
    let sets: Vec<String> = CONSTANTS
        .iter()
        .zip(truth)
        .map(|(name, value)| format!("{name}={value}"))
        .collect();
    let seed = seed.to_string();
    let mut arguments = vec!["simulate", model, "--seed", &seed, "--out", &out];
    for set in &sets {
        arguments.extend(["--set", set]);
    }
    arguments.extend(extra);
    succeed(&arguments);
    out
}

/// Twelve constants at 3 sd: with normal errors a false alarm in 3 % of versions of this test; the intervals also carry the
/// thickness and the article's 0.4 %, which these data do not use up. The residual's RMS has a relative
/// standard error of 0.6 %, the noise estimate 0.8 %.
#[test]
fn truth_without_undeclared_effects_is_recovered() {
    recovered(&coarse());
}

#[test]
#[ignore = "the default mesh, 1 minute"]
fn truth_without_undeclared_effects_is_recovered_on_the_default_mesh() {
    recovered(&model("openhole.json"));
}

fn recovered(file: &str) {
    for (seed, truth) in [
        (1, [145.0, 7.1, 0.31, 4.1]),
        (2, [155.0, 7.9, 0.35, 4.9]),
        (3, [172.0, 8.2, 0.33, 4.5]),
    ] {
        let data = simulate(
            file,
            truth,
            seed,
            &["--grid", "121", "--effect", "rigid_translation=1.5,-0.7"],
        );
        let round = identify(file, &["--data", &data]);
        for (name, truth) in CONSTANTS.iter().zip(truth) {
            let (mean, sd) = posterior(&round, name);
            assert!(
                (mean - truth).abs() < 3.0 * sd,
                "seed {seed}: {name} {mean} +- {sd}, truth {truth}"
            );
        }
        for component in ["u1", "u2"] {
            let rms = number(&round["residual"]["rms_nm"][component]);
            let noise = number(&round["residual"]["noise_nm"][component]);
            assert!(
                (rms / noise - 1.0).abs() < 0.03,
                "seed {seed}: residual {rms} nm, noise {noise} nm"
            );
            assert!(
                (noise / 10.0 - 1.0).abs() < 0.04,
                "seed {seed}: noise {noise} nm, truth 10 nm"
            );
        }
        assert_eq!(round["convergence"]["converged"], true);
        let (tx, ty) = (
            &round["effect_amplitudes"]["rigid_translation.tx_um"],
            &round["effect_amplitudes"]["rigid_translation.ty_um"],
        );
        for (amplitude, truth) in [(tx, 1.5), (ty, -0.7)] {
            let z = (number(&amplitude["mean"]) - truth) / number(&amplitude["sd"]);
            assert!(
                z.abs() < 4.0,
                "seed {seed}: translation {amplitude}, truth {truth}"
            );
        }
    }
}

/// Correlated noise must not fake certainty: n_eff far below the number of points, and the truth still held.
#[test]
#[ignore = "slow: run by .ci/run"]
fn correlated_noise_counts_for_what_it_is_worth() {
    let truth = [150.0, 7.5, 0.33, 4.6];
    let data = simulate(
        &coarse(),
        truth,
        7,
        &["--grid", "121", "--correlation-mm", "1"],
    );
    let round = identify(&coarse(), &["--data", &data]);
    let (n, n_eff) = (
        number(&round["residual"]["n"]),
        number(&round["residual"]["n_eff"]),
    );
    assert!(
        n_eff < 0.1 * n,
        "{n} points of noise correlated over 1 mm count as {n_eff}"
    );
    for (name, truth) in CONSTANTS.iter().zip(truth) {
        let (mean, sd) = posterior(&round, name);
        assert!(
            (mean - truth).abs() < 3.5 * sd,
            "{name} {mean} +- {sd}, truth {truth}"
        );
    }
}

#[test]
#[ignore = "needs ../shared"]
fn independent_field_with_noise_is_bracketed() {
    let data = shared("open-hole-reference/noisy-none");
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(data.join("truth.json")).unwrap()).unwrap();
    let round = identify(&model("openhole.json"), &["--data", data.to_str().unwrap()]);
    for name in CONSTANTS {
        let (mean, sd) = posterior(&round, name);
        let truth = number(&truth[name]);
        assert!(
            (mean - truth).abs() < 3.0 * sd,
            "{name} {mean} +- {sd}, truth {truth}"
        );
    }
}

/// The noise-free reference fields of another code, identified with misalignment and bending declared.
#[test]
#[ignore = "needs ../shared"]
fn declared_mechanical_effects_are_sampled_with_the_right_sign() {
    for (folder, effect, parameter, truth) in [
        (
            "load-misalignment",
            "load_misalignment",
            "load_misalignment.angle_deg",
            1.0,
        ),
        (
            "in-plane-bending",
            "in_plane_bending",
            "in_plane_bending.eccentricity_mm",
            0.2,
        ),
    ] {
        let data = shared(&format!("open-hole-reference/{folder}"));
        let file = fresh("model.json");
        let text = std::fs::read_to_string(model("openhole.json")).unwrap();
        let text = text.replace(
            "[\"rigid_translation\"]",
            &format!("[\"rigid_translation\", \"rigid_rotation\", \"{effect}\"]"),
        );
        std::fs::write(&file, text).unwrap();
        let round = identify(file.to_str().unwrap(), &["--data", data.to_str().unwrap()]);
        let amplitude = number(&round["effect_amplitudes"][parameter]["mean"]);
        assert!(
            (amplitude / truth - 1.0).abs() < 0.02,
            "{parameter} {amplitude}, truth {truth}"
        );
        for (name, truth) in CONSTANTS.iter().zip([140.0, 7.9, 0.33, 5.0]) {
            // without noise the codes differ by their discretisations
            let (mean, _) = posterior(&round, name);
            assert!(
                (mean / truth - 1.0).abs() < 1e-3,
                "{effect}: {name} {mean}, truth {truth}"
            );
        }
    }
}

/// The published calibration trusts the clamp, and misses steel by a wide margin; with a free translation it comes
/// near. Figures of an independent finite-element analysis.
#[test]
#[ignore = "length: two samplings, a minute; needs ../shared"]
fn measured_steel_gives_the_published_calibration() {
    let data = shared("steel-s235/displacements_raw.csv");
    let data = data.to_str().unwrap();
    let check = |model: &str, expected: [f64; 2], within: [f64; 2], rms: [f64; 2]| {
        let round = identify(model, &["--data", data]);
        for ((name, expected), within) in ["E_GPa", "nu"].iter().zip(expected).zip(within) {
            // an ordinary least-squares fit gave the figures; ours weighs the misfit by the noise's correlation, and is as
            // uncertain as its own sd says
            let (mean, sd) = posterior(&round, name);
            let within = within.max(1.5 * sd);
            assert!(
                (mean - expected).abs() < within,
                "{name} {mean}, expected {expected} +- {within}"
            );
        }
        for (component, expected) in ["u1", "u2"].iter().zip(rms) {
            let rms = number(&round["residual"]["rms_nm"][component]) / 1e3;
            assert!(
                (rms / expected - 1.0).abs() < 0.1,
                "{component} residual {rms} um, expected {expected} um"
            );
        }
    };
    check(
        &model("steel-s235.json"),
        [173.5, 0.07],
        [1.0, 0.02],
        [4.0, 1.1],
    );
    let file = fresh("steel.json");
    let text = std::fs::read_to_string(model("steel-s235.json")).unwrap();
    std::fs::write(
        &file,
        text.replace("\"effects\": []", "\"effects\": [\"rigid_translation\"]"),
    )
    .unwrap();
    check(
        file.to_str().unwrap(),
        [220.9, 0.31],
        [1.0, 0.01],
        [0.48, 1.01],
    );
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn both_samplers_agree_within_monte_carlo_error() {
    let [ensemble, adaptive] =
        ["ensemble", "adaptive"].map(|sampler| identify(&coarse(), &["--sampler", sampler]));
    for name in CONSTANTS.iter().chain(&["noise_nm"]) {
        let [a, b] = [&ensemble, &adaptive].map(|round| &round["posterior"][name]);
        let error = number(&a["mcse_mean"]).hypot(number(&b["mcse_mean"]));
        let difference = number(&a["mean"]) - number(&b["mean"]);
        assert!(
            difference.abs() < 4.5 * error,
            "{name}: {difference} apart, Monte Carlo error {error}"
        );
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn draws_are_the_same_bits_for_any_number_of_threads() {
    let chains = ["1", "2", "3"].map(|threads| {
        let out = fresh("run");
        let model = coarse();
        succeed(&[
            "identify",
            &model,
            "--quiet",
            "--threads",
            threads,
            "--csv",
            "--out",
            out.to_str().unwrap(),
        ]);
        std::fs::read(out.join("chain.csv")).unwrap()
    });
    assert!(chains[0].len() > 10_000);
    assert!(chains[0] == chains[1] && chains[1] == chains[2]);
}

/// A ripple in what is recorded, at twice the fringe frequency: declared, it is found within a few sd although nothing of it
/// is left in block averages, and the noise is the noise again. An undeclared misalignment does not hide it (but raises
/// the noise by itself).
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_declared_phase_shift_error_is_measured_and_taken_out() {
    let file = changed("openhole.json", |m| {
        set_coarse(m);
        m["experiments"][0]["effects"] =
            serde_json::json!(["rigid_translation", "phase_shift_error"]);
    });
    let truth = [150.0, 7.5, 0.33, 4.6];
    for (seed, amplitude, other) in [
        (11, [15.0, -6.0, 0.0, 8.0], "rigid_translation=1.1,-0.4"),
        (12, [0.0, 4.0, 0.0, 0.0], "load_misalignment=0.8"),
    ] {
        let values = amplitude.map(|a: f64| a.to_string()).join(",");
        let ripple = format!("phase_shift_error={values}");
        let extra = ["--grid", "121", "--effect", &ripple, "--effect", other];
        let data = simulate(&file, truth, seed, &extra);
        let round = identify(&file, &["--data", &data]);
        let names = ["u1_sin_nm", "u1_cos_nm", "u2_sin_nm", "u2_cos_nm"];
        for (name, truth) in names.iter().zip(amplitude) {
            let found = &round["effect_amplitudes"][format!("phase_shift_error.{name}")];
            let (mean, sd) = (number(&found["mean"]), number(&found["sd"]));
            assert!(sd < 0.4, "{name}: sd {sd} nm");
            assert!(
                (mean - truth).abs() < 4.0 * sd,
                "{name}: {mean} +- {sd} nm, truth {truth}"
            );
        }
        if other.starts_with("load_misalignment") {
            continue;
        }
        for component in ["u1", "u2"] {
            let noise = number(&round["residual"]["noise_nm"][component]);
            assert!((noise / 10.0 - 1.0).abs() < 0.04, "noise {noise} nm");
        }
    }
}
