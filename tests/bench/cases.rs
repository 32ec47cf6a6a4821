//! What whole loops cost, stage by stage: `cargo bench --bench cases`, or with model files of your own after `--`. To compare two
//! versions, run them in turn on one machine.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// One field, two experiments, and two meshes of other programs: a plate with holes, an off-axis coupon in grips.
const CASES: [&str; 4] = [
    "models/openhole.json",
    "models/openhole-and-plate.json",
    "models/two-holes.json",
    "models/oblique.json",
];

fn main() {
    let given: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .collect();
    let cases = match given.is_empty() {
        true => CASES.map(String::from).to_vec(),
        false => given,
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for case in cases {
        let model = root.join(&case);
        let folder = tempfile::tempdir().unwrap();
        let began = Instant::now();
        let ran = Command::new(env!("CARGO_BIN_EXE_plychain"))
            .current_dir(&folder)
            .args(["loop", "--quiet", "--timings", "--out", "run"])
            .arg(&model)
            .output()
            .unwrap();
        let wall_s = began.elapsed().as_secs_f64();
        println!("{case}: {wall_s:.1} s, {}", ran.status);
        let said = String::from_utf8_lossy(&ran.stdout);
        let table = said.split("What each stage cost").nth(1);
        println!("{}", table.unwrap_or_default());
    }
}
