use nalgebra::DMatrix;
use plychain::effect::{Acting, find};
use plychain::files::{KeptStages, to_bytes};
use plychain::posterior::Importance;
use plychain::progress::Silent;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

/// What a run that resumes finds of a value that another one kept.
fn back<T: Serialize + DeserializeOwned + Clone>(value: &T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let kept = |resume| KeptStages::within(folder.path().into(), &json!("run"), resume);
    let of = &1;
    let first = kept(false).stage("stage", of, || Ok(value.clone()), &Silent);
    first.unwrap();
    kept(true)
        .stage("stage", of, || panic!("made again"), &Silent)
        .unwrap()
}

#[test]
fn values_come_back_to_the_last_bit() {
    let odd = [f64::NAN, f64::INFINITY, -0.0, 5e-324, f64::MAX, 0.1];
    assert_eq!(back(&odd).map(f64::to_bits), odd.map(f64::to_bits));
    let matrix = DMatrix::from_fn(3, 2, |i, j| (i * 2 + j) as f64 / 3.0);
    assert_eq!(back(&matrix), matrix);
    let mixed = (Some(vec![true]), None::<u8>, String::new(), u64::MAX);
    assert_eq!(back(&mixed), mixed);
}

#[test]
fn fields_that_are_left_out_of_reports_and_effects_by_name_come_back() {
    let importance = Importance {
        draws: 8,
        impossible: 0,
        effective: 0.5,
        shift_sd: [("E1_GPa".into(), 0.1)].into_iter().collect(),
        shift_error_sd: [("E1_GPa".into(), f64::NAN)].into_iter().collect(),
        corrected: false,
        field_nm: 0.7,
        mesh_error: None,
    };
    let found = back(&importance);
    assert_eq!(to_bytes(&found).unwrap(), to_bytes(&importance).unwrap());
    let acting = Acting {
        effect: find("test", "lens_distortion").unwrap(),
        amplitude: vec![1e-4],
    };
    let found = back(&acting);
    assert_eq!(found.effect.name(), "lens_distortion");
    assert_eq!(found.amplitude, acting.amplitude);
}
