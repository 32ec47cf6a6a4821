//! What a calibration draws.

use plychain::effect::force_scale;
use plychain::infer::Model;
use plychain::validate::drawn::Drawn;
use plychain::validate::plan::CalibrationPlan;

const DRAWS: usize = 4000;

fn plan(closes_loop: bool) -> CalibrationPlan {
    CalibrationPlan {
        replicates: DRAWS,
        correlation_mm: 0.0,
        seed: 3,
        grid: 61,
        closes_loop,
        withheld: false,
        effects: None,
        share: [1, 1],
    }
}

/// Mean and sd of some values.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, variance.sqrt())
}

/// The response goes with the load over the thickness: its scale has the prior sd that the posterior gives it, of the load cell's and of
/// the micrometer's.
#[test]
fn the_scale_of_the_response_is_drawn_with_its_prior() {
    let model = Model::load(std::path::Path::new("models/openhole.json")).unwrap();
    let thickness = model.experiment().specimen.thickness_mm;
    let scale = |k: usize| {
        let truth = Drawn::new(&model, &plan(true), k, 0).truth;
        let load = truth.effects.iter().find(|a| a.effect.is_force_scale());
        (1.0 + 0.01 * load.unwrap().amplitude[0]) * thickness.mean / truth.thickness_mm
    };
    let scales: Vec<f64> = (0..DRAWS).map(scale).collect();
    let n = DRAWS as f64;
    let (mean, found) = moments(&scales);
    let load = 0.01 * model.prior_sd(force_scale(), 0).unwrap();
    let sd = load.hypot(thickness.sd / thickness.mean);
    assert!(
        (found / sd - 1.0).abs() < 4.0 / (2.0 * n).sqrt(),
        "{found} {sd}"
    );
    assert!((mean - 1.0).abs() < 4.0 * sd / n.sqrt() + sd * sd, "{mean}");
}

/// A declared effect acts with an amplitude of its prior, and nothing else does where the model alone is calibrated.
#[test]
fn declared_effects_are_drawn_with_their_priors() {
    let text = std::fs::read_to_string("models/openhole.json").unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["experiments"][0]["effects"] =
        serde_json::json!(["rigid_translation", "rigid_rotation", "load_misalignment"]);
    value["experiments"][0]["plausible"] =
        serde_json::json!({ "load_misalignment.angle_deg": 0.25 });
    let model = Model::parse(
        &value.to_string(),
        std::path::Path::new("models/openhole.json"),
    );
    let model = model.unwrap();
    let angle = |k: usize| {
        let drawn = Drawn::new(&model, &plan(false), k, 0);
        assert!(drawn.acted.is_empty());
        let truths = drawn.truths(&model);
        let found = truths
            .iter()
            .find(|(name, _)| name == "load_misalignment.angle_deg");
        found.unwrap().1
    };
    let angles: Vec<f64> = (0..DRAWS).map(angle).collect();
    let n = DRAWS as f64;
    let (mean, sd) = moments(&angles);
    assert!(mean.abs() < 4.0 * 0.25 / n.sqrt(), "{mean}");
    assert!((sd / 0.25 - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{sd}");
}
