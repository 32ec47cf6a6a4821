//! What the calibration of the loop draws.

use plychain::infer::Model;
use plychain::validate::drawn::{Acts, Drawn};
use plychain::validate::replicates::ReplicatePlan;

/// The response goes with the load over the thickness: its scale has the prior sd that the posterior gives it, of the load cell's and of
/// the micrometer's.
#[test]
fn the_scale_of_the_response_is_drawn_with_its_prior() {
    const DRAWS: usize = 4000;
    let model = Model::load(std::path::Path::new("models/openhole.json")).unwrap();
    let plan = ReplicatePlan {
        replicates: DRAWS,
        correlation_mm: 0.0,
        seed: 3,
        grid: 61,
        share: None,
    };
    let thickness = model.experiment().specimen.thickness_mm;
    let scale = |k: usize| {
        let truth = Drawn::new(&model, &plan, Acts::Expected, k, 0).truth;
        let load = truth.effects.iter().find(|a| a.effect.is_force_scale());
        (1.0 + 0.01 * load.unwrap().amplitude[0]) * thickness.mean / truth.thickness_mm
    };
    let scales: Vec<f64> = (0..DRAWS).map(scale).collect();
    let n = DRAWS as f64;
    let mean = scales.iter().sum::<f64>() / n;
    let variance = scales.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let sd = model.loaded_thickness_mm().sd / thickness.mean;
    assert!(
        (variance.sqrt() / sd - 1.0).abs() < 4.0 / (2.0 * n).sqrt(),
        "{} {sd}",
        variance.sqrt()
    );
    assert!((mean - 1.0).abs() < 4.0 * sd / n.sqrt() + sd * sd, "{mean}");
}
