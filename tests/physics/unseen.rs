//! What one field cannot show at its plausible size: the intervals to quote have it all the same.

use plychain::infer::Model;
use plychain::trace::Status;
use serde_json::json;

use crate::common::{changed, simulated};
use crate::loops::looped;

const TRUTH: [f64; 2] = [207.0, 0.29];

/// A steel strip without a hole under 200 MPa, correlated over 1.5 mm with 300 nm of noise, with an effect.
fn strained(effect: &str) -> std::path::PathBuf {
    let model = changed("steel-s235.json", |m| {
        let e = &mut m["experiments"][0];
        let specimen = e["specimen"].as_object_mut().unwrap();
        specimen.remove("clamp");
        specimen.remove("hole");
        e["load"]["force_N"] = json!(200.0 * 20.0 * 3.05);
        e["gauge"] = "window".into();
        e["mesh_density"] = 0.3.into();
        e["effects"] = json!(["rigid_translation", "rigid_rotation"]);
        e["measurement"]["image_correlation"] = json!({ "subset_mm": 1.5 });
    });
    let arguments = "--grid 31 --noise-nm 300 --set E_GPa=207 --set nu=0.29 --seed 3 --effect";
    simulated(&model, &format!("{arguments} {effect}"))
}

/// In a uniform strain a change of temperature is a change of E and nu, and no residual says which: what can be seen there does not make
/// it small.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_temperature_that_uniform_strain_hides_is_in_the_intervals() {
    let folder = strained("thermal_strain=5");
    let model = Model::load(&folder.join("model.json")).unwrap();
    let ended = looped("5 K unseen", &model, &TRUTH);
    println!("{}", ended.line());
    assert_eq!(ended.status, Status::NothingMissing, "{}", ended.line());
    assert_eq!(ended.held(), 2, "{}", ended.line());
    // 3 K are 3.4 % of E, and 50 microstrain along the load 5 %
    let width = ended.widths().next().unwrap();
    assert!(width > 0.04, "{}", ended.line());
}
