//! Load series of image correlation through whole loops: reference data of an independent program, and series whose camera, subsets and
//! noise are simulated a second time (`tests/dic`). No wrong name, and the intervals to quote hold the constants.

use plychain::experiment::series::Law;
use plychain::infer::Model;
use plychain::trace::Status;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::dic::cases::{Kind, campaign, case};
use crate::dic::folder::{SERIES, SINGLE};
use crate::dic::ordinary::{ORDINARY, ordinary};
use crate::loops::{Case, Ended, all, looped};
use crate::program::{fresh, set_coarse, shared};

/// A series' loop with what acted in it.
struct Judged {
    ended: Ended,
    /// Names of what acted.
    truth: Vec<String>,
    foreign: bool,
}

impl Judged {
    /// Every true effect is named or grouped and no other is; a culprit of no dictionary leaves the account open.
    fn is_right(&self) -> bool {
        if self.foreign {
            return self.ended.status == Status::Unexplained;
        }
        self.truth.iter().all(|name| self.ended.names(name)) && !self.is_wrong()
    }

    /// An effect is named, alone, that did not act.
    fn is_wrong(&self) -> bool {
        let mut groups = self.ended.alias_groups.iter();
        self.ended.status == Status::Closed
            && self.ended.effects.iter().any(|e| {
                let grouped =
                    groups.any(|g| g.contains(e) && g.iter().any(|n| self.truth.contains(n)));
                !self.truth.contains(e) && !grouped
            })
    }
}

fn summary(judged: &[Judged]) {
    for j in judged {
        let right = if j.is_right() { "right" } else { "-" };
        let wrong = if j.is_wrong() { "WRONG" } else { "" };
        println!("{right:6}{wrong:6} {:?} {}", j.truth, j.ended.line());
    }
    let held: usize = judged.iter().map(|j| j.ended.held()).sum();
    let count: usize = judged.iter().map(|j| j.ended.truth.len()).sum();
    let z2: f64 = judged.iter().flat_map(|j| j.ended.z()).map(|z| z * z).sum();
    println!(
        "{} of {} right, {} wrong names, {held} of {count} constants held, rms z {:.2}",
        judged.iter().filter(|j| j.is_right()).count(),
        judged.len(),
        judged.iter().filter(|j| j.is_wrong()).count(),
        (z2 / count as f64).sqrt()
    );
}

#[test]
fn laws_go_over_the_steps_as_they_say() {
    let loads = [0.25, 0.5, 1.0, 0.0];
    let of = |law: Law| law.weights(&loads);
    assert_eq!(of(Law::Constant), [[1.0; 4]]);
    assert_eq!(of(Law::Load), [loads]);
    assert_eq!(of(Law::Kept), [[0.25, 0.5, 1.0, 1.0]]);
    assert_eq!(of(Law::Drift), [[1.0 / 3.0, 2.0 / 3.0, 1.0, 4.0 / 3.0]]);
    let seated = &of(Law::Seated)[0];
    assert!((seated[2] - 1.0 / 1.05).abs() < 1e-15 && seated[3] == 0.0);
    assert_eq!(of(Law::Free).len(), 4);
    assert_eq!(of(Law::Free)[1], [0.0, 1.0, 0.0, 0.0]);
}

/// A model of a folder of reference data, as its analyst would declare it.
fn declared(folder: &str) -> (String, Vec<f64>) {
    let read = |file: &str| -> Value {
        let path = shared(&format!("dic-reference/{folder}/{file}"));
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
    };
    let (declared, truth) = (read("declared.json"), read("truth.json"));
    let isotropic = declared["material"] == "isotropic";
    let prior = declared["prior"].as_object().unwrap();
    let parameters: serde_json::Map<String, Value> = prior
        .iter()
        .map(|(name, normal)| (name.clone(), json!({"prior": {"normal": normal}})))
        .collect();
    let steps: Vec<Value> = declared["steps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|step| {
            let file = step["file"].as_str().unwrap();
            let file = shared(&format!("dic-reference/{folder}/{file}"));
            json!({"file": file, "force_N": step["force_N"]})
        })
        .collect();
    let mut material = json!({
        "kind": if isotropic { "isotropic" } else { "ply" },
        "parameters": parameters,
    });
    if isotropic {
        material["yield_MPa"] = json!({"mean": 290, "sd": 30});
        material["expansion_per_K"] = json!([12e-6, 12e-6]);
    }
    let model = json!({
        "schema": "plychain-model/2",
        "name": folder,
        "material": material,
        "experiments": [{
            "name": "tension",
            "kind": "field",
            "specimen": declared["specimen"],
            "measurement": {
                "format": "csv",
                "columns": {"x": "x_mm", "y": "y_mm", "ux": "u_mm", "uy": "v_mm"},
                "units": {"coordinates": "mm", "displacements": "mm"},
                "loading_axis": declared["loading_axis"],
                "hole_center_in_data_mm": [0, 0],
                "image_correlation": declared["image_correlation"],
            },
            "steps": steps,
            "effects": ["rigid_translation", "rigid_rotation"],
        }],
        "reduced_model": {"snapshots": 200, "modes": 4, "degree": 3},
        "likelihood": {"model_error_fraction": 0.0},
    });
    let names: &[&str] = if isotropic {
        &["E_GPa", "nu"]
    } else {
        &["E1_GPa", "E2_GPa", "nu12", "G12_GPa"]
    };
    let constants = names
        .iter()
        .map(|n| truth["constants"][n].as_f64().unwrap());
    (model.to_string(), constants.collect())
}

#[test]
#[ignore = "needs ../shared, five series, 5 minutes"]
fn reference_series_are_read_right() {
    let cases: [(&str, &[&str]); 5] = [
        ("still", &[]),
        ("tilt-with-load", &["out_of_plane_rotation"]),
        ("lens", &["lens_distortion"]),
        (
            "hole-and-approach",
            &["hole_size", "out_of_plane_translation"],
        ),
        ("yield", &["yielding"]),
    ];
    let judged: Vec<Judged> = cases
        .iter()
        .map(|(folder, acts)| {
            let (model, truth) = declared(folder);
            let model = Model::parse(&model, "model.json".as_ref()).unwrap();
            Judged {
                ended: looped(folder, &model, &truth),
                truth: acts.iter().map(|name| (*name).to_string()).collect(),
                foreign: false,
            }
        })
        .collect();
    summary(&judged);
    for j in &judged {
        assert!(!j.is_wrong(), "{}", j.ended.line());
        assert!(j.is_right(), "{}", j.ended.line());
        assert_eq!(j.ended.held(), j.ended.truth.len(), "{}", j.ended.line());
    }
}

/// A simulated series, written to a folder of its own, read back and closed; and what acted in it.
fn simulated(kind: &Kind, laminate: bool, seed: u64) -> Judged {
    let series = case(kind, laminate, seed);
    let folder = fresh(&format!("series-{seed}"));
    let truth = series.write(&series.observed(), &folder);
    let model = Model::load(&folder.join(SERIES)).unwrap();
    let foreign = matches!(kind, Kind::Foreign(_));
    let many = matches!(kind, Kind::Many);
    let constants: Vec<f64> = truth.constants.iter().map(|(_, x)| *x).collect();
    let ended = looped(&truth.name, &model, &constants);
    Judged {
        ended,
        truth: if foreign || many {
            Vec::new()
        } else {
            truth.effects.iter().map(|e| e.name.clone()).collect()
        },
        foreign,
    }
}

#[test]
#[ignore = "by hand: 57 series, an hour"]
fn simulated_series_are_read_right() {
    let series = campaign();
    let judged: Vec<Judged> = series
        .par_iter()
        .map(|(kind, laminate, seed)| simulated(kind, *laminate, *seed))
        .collect();
    summary(&judged);
    let wrong = judged.iter().filter(|j| j.is_wrong() && !j.foreign).count();
    assert_eq!(wrong, 0);
    let held: usize = judged.iter().map(|j| j.ended.held()).sum();
    let count: usize = judged.iter().map(|j| j.ended.truth.len()).sum();
    assert!(held as f64 >= 0.93 * count as f64, "{held} of {count}");
}

/// Single fields with what is ordinary in image correlation: the last step alone, as most users measure.
#[test]
#[ignore = "by hand: 80 fields, half an hour"]
fn ordinary_single_fields_are_not_misread() {
    let cases: Vec<Case> = ORDINARY
        .iter()
        .flat_map(|what| (0..10).map(move |seed| (*what, seed)))
        .map(|(what, seed)| -> Case {
            Box::new(move || {
                let series = ordinary(what, 10.0, 100 + seed);
                let folder = fresh(&format!("ordinary-{what:?}-{seed}"));
                let truth = series.write(&series.observed(), &folder);
                let text = std::fs::read_to_string(folder.join(SINGLE)).unwrap();
                let mut model: Value = serde_json::from_str(&text).unwrap();
                set_coarse(&mut model);
                let model = Model::parse(&model.to_string(), &folder.join(SINGLE)).unwrap();
                let constants: Vec<f64> = truth.constants.iter().map(|(_, x)| *x).collect();
                looped(&format!("{what:?} {seed}"), &model, &constants)
            })
        })
        .collect();
    let ended = all(&cases);
    let held: usize = ended.iter().map(Ended::held).sum();
    let count: usize = ended.iter().map(|e| e.truth.len()).sum();
    println!("{held} of {count} held");
    assert!(held as f64 >= 0.93 * count as f64, "{held} of {count}");
    let worst = ended.iter().map(Ended::worst).fold(0.0, f64::max);
    assert!(worst < 5.0, "{worst}");
}
