//! The strip of the article (Gogu et al. 2013), as a test of the finite elements.

use plychain::fem::Setup;
use plychain::laminate::{LoadSpec, SpecimenSpec};

/// Of this length, 25 mm wide, [45, -45, 0]s, with a hole of this diameter about this centre, mm.
pub fn strip(length: f64, diameter: f64, center: [f64; 2]) -> SpecimenSpec {
    let value = serde_json::json!({
        "length_mm": length, "width_mm": 25.0, "hole": { "diameter_mm": diameter, "center_mm": center },
        "layup_deg": [45, -45, 0, 0, -45, 45], "thickness_mm": { "mean": 0.78, "sd": 0.005 }
    });
    serde_json::from_value(value).expect("a specimen")
}

/// The nominal test of one 200 mm long, pulled by 700 N; handedness -1 turns the angles over.
pub fn setup(diameter: f64, center: [f64; 2], handedness: f64) -> Setup {
    let load = LoadSpec { force_n: 700.0 };
    Setup::nominal(&strip(200.0, diameter, center), &load, handedness)
}
