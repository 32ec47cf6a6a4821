//! Wrong inputs that people make, each with the sentence that names it, before anything is sampled.
//!
//! The truth is E1 135, E2 9.4, nu12 0.31, G12 4.8 GPa, one moire field around a hole of 6 mm; the list is that of an experimenter who tried
//! the program. A right input, and a load that leans, raise no doubt.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use serde_json::{Value, json};

use crate::common::{changed, fresh, plychain, simulated};
use crate::common::{json, read};

/// A prior as a handbook has it.
fn prior(mean: f64, sd: f64) -> Value {
    json!({ "prior": { "normal": { "mean": mean, "sd": sd } } })
}

/// The test as it was: the material's priors are a handbook's.
fn declare(model: &mut Value, layup: &Value) {
    model["name"] = "coupon".into();
    model["material"]["parameters"] = json!({
        "E1_GPa": prior(140.0, 14.0), "E2_GPa": prior(9.0, 0.9), "nu12": prior(0.3, 0.03), "G12_GPa": prior(5.0, 0.5),
    });
    let experiment = &mut model["experiments"][0];
    experiment["specimen"]["hole"]["diameter_mm"] = 6.0.into();
    experiment["specimen"]["width_mm"] = 30.0.into();
    experiment["specimen"]["thickness_mm"] = json!({ "mean": 0.9, "sd": 0.005 });
    experiment["specimen"]["layup_deg"] = layup.clone();
    experiment["load"]["force_N"] = 900.0.into();
    experiment["effects"] = json!(["rigid_translation", "rigid_rotation"]);
    experiment["mesh_density"] = 0.3.into();
}

const TRUTH: &str =
    "--set E1_GPa=135 --set E2_GPa=9.4 --set nu12=0.31 --set G12_GPa=4.8 --grid 61 --noise-nm 10";

/// The measurement of a balanced laminate, and that of one that is not.
fn measured(balanced: bool) -> &'static Path {
    static FOLDERS: [OnceLock<PathBuf>; 2] = [OnceLock::new(), OnceLock::new()];
    FOLDERS[usize::from(balanced)].get_or_init(|| {
        let layup = match balanced {
            true => json!([45, -45, 0, 0, -45, 45]),
            false => json!([30, -45, 0, 0, -45, 30]),
        };
        let model = changed("openhole.json", |m| declare(m, &layup));
        simulated(&model, TRUTH)
    })
}

/// What is wrong: how the model file, and the measurement's files, were changed.
struct Wrong {
    name: &'static str,
    /// Words of the sentence that names the cause.
    says: &'static [&'static str],
    balanced: bool,
    change: fn(&mut Value),
    /// What is done to each number of some files.
    files: &'static [&'static str],
    number: fn(f64) -> f64,
    /// Text of the model file and what stands in its place.
    spoilt: [&'static str; 2],
}

const PLAIN: Wrong = Wrong {
    name: "",
    says: &[],
    balanced: true,
    change: |_| {},
    files: &[],
    number: |v| v,
    spoilt: [""; 2],
};

fn specimen(model: &mut Value) -> &mut Value {
    &mut model["experiments"][0]["specimen"]
}

fn force(model: &mut Value) -> &mut Value {
    &mut model["experiments"][0]["load"]["force_N"]
}

/// The folder of a measurement with its model, both changed.
fn folder(wrong: &Wrong) -> PathBuf {
    let folder = fresh("wrong");
    crate::common::copy(measured(wrong.balanced), &folder);
    std::fs::remove_file(folder.join("truth.json")).unwrap();
    let mut model = json(&folder.join("model.json"));
    (wrong.change)(&mut model);
    let [right, spoilt] = wrong.spoilt;
    let text = match right.is_empty() {
        true => model.to_string(),
        false => model.to_string().replace(right, spoilt),
    };
    std::fs::write(folder.join("model.json"), text).unwrap();
    for name in wrong.files {
        let text = read(&folder.join(name));
        let line = |line: &str| {
            let numbers = line.split_whitespace();
            let numbers = numbers.map(|v| (wrong.number)(v.parse().unwrap()).to_string());
            numbers.collect::<Vec<_>>().join(" ")
        };
        let lines: Vec<String> = text.lines().map(line).collect();
        std::fs::write(folder.join(name), lines.join("\n")).unwrap();
    }
    folder
}

/// What `loop --strict` says on standard error, and after how many seconds it ends; it samples little.
fn said(folder: &Path) -> (String, f64) {
    let (model, out) = (folder.join("model.json"), folder.join("run"));
    let begun = Instant::now();
    let (model, out) = (model.to_str().unwrap(), out.to_str().unwrap());
    let words = "loop --strict --max-draws 400 --rounds 0 --time-limit 20";
    let words = words.split(' ').chain([model, "--out", out]);
    let output = plychain(&words.collect::<Vec<_>>());
    let text = String::from_utf8(output.stderr).unwrap();
    (text, begun.elapsed().as_secs_f64())
}

const WRONG: &[Wrong] = &[
    Wrong {
        name: "1 a key forgotten",
        says: &["missing", "thickness_mm"],
        change: |m| {
            specimen(m).as_object_mut().unwrap().remove("thickness_mm");
        },
        ..PLAIN
    },
    Wrong {
        name: "1 a key misspelt",
        says: &["specimem", "specimen"],
        spoilt: ["\"specimen\"", "\"specimem\""],
        ..PLAIN
    },
    Wrong {
        name: "2 a decimal comma",
        says: &["decimal comma"],
        spoilt: ["900.0", "900,5"],
        ..PLAIN
    },
    Wrong {
        name: "3 force in kN",
        says: &["factor of 0.001", "force in kN"],
        change: |m| *force(m) = 0.9.into(),
        ..PLAIN
    },
    Wrong {
        name: "3 thickness in um",
        says: &["specimen.thickness_mm", "in um", "0.9 mm"],
        change: |m| specimen(m)["thickness_mm"] = json!({ "mean": 900.0, "sd": 5.0 }),
        ..PLAIN
    },
    Wrong {
        name: "3 moduli in MPa",
        says: &["parameters.E1_GPa", "in MPa", "140 GPa"],
        change: |m| {
            let parameters = &mut m["material"]["parameters"];
            parameters["E1_GPa"] = prior(140e3, 14e3);
            parameters["E2_GPa"] = prior(9e3, 900.0);
        },
        ..PLAIN
    },
    Wrong {
        name: "4 mm for um",
        says: &["factor of 1000", "unit of the displacements"],
        files: &["U.txt", "V.txt"],
        number: |v| 1e-3 * v,
        ..PLAIN
    },
    Wrong {
        name: "5 coordinates in m",
        says: &["units"],
        files: &["X.txt", "Y.txt"],
        number: |v| 1e-3 * v,
        ..PLAIN
    },
    Wrong {
        name: "6 dimensions in m",
        says: &["1000 times"],
        change: |m| {
            specimen(m)["hole"]["diameter_mm"] = 0.006.into();
        },
        ..PLAIN
    },
    Wrong {
        name: "7 loading axis",
        says: &["loading axis"],
        change: |m| m["experiments"][0]["measurement"]["loading_axis"] = "x".into(),
        ..PLAIN
    },
    Wrong {
        name: "8 v alone flipped",
        says: &["across the load the wrong sign"],
        files: &["V.txt"],
        number: |v| -v,
        ..PLAIN
    },
    Wrong {
        name: "8 y flipped without v",
        says: &["along the load the wrong sign"],
        files: &["Y.txt"],
        number: |v| -v,
        ..PLAIN
    },
    Wrong {
        name: "9 pictures exchanged",
        says: &["picture exchanged"],
        files: &["U.txt", "V.txt"],
        number: |v| -v,
        ..PLAIN
    },
    Wrong {
        name: "11 hole centre",
        says: &["hole_center_in_data_mm", "largest void"],
        change: |m| {
            m["experiments"][0]["measurement"]["hole_center_in_data_mm"] = json!([2.0, 1.0])
        },
        ..PLAIN
    },
    Wrong {
        name: "12 hole doubled",
        says: &["largest void", "3.0"],
        change: |m| specimen(m)["hole"]["diameter_mm"] = 12.0.into(),
        ..PLAIN
    },
    Wrong {
        name: "13 radius for diameter",
        says: &["radius"],
        change: |m| specimen(m)["hole"]["diameter_mm"] = 3.0.into(),
        ..PLAIN
    },
    Wrong {
        name: "14 ply for laminate",
        says: &["thickness_mm", "one ply"],
        change: |m| specimen(m)["thickness_mm"]["mean"] = 0.15.into(),
        ..PLAIN
    },
    Wrong {
        name: "16 half the force",
        says: &["All moduli are low by one factor of 0.50"],
        change: |m| *force(m) = 450.0.into(),
        ..PLAIN
    },
    Wrong {
        name: "16 twice the force",
        says: &["All moduli are high by one factor of 2.00"],
        change: |m| *force(m) = 1800.0.into(),
        ..PLAIN
    },
    Wrong {
        name: "17 layup of the other axis",
        says: &["layup_deg", "other axis"],
        change: |m| specimen(m)["layup_deg"] = json!([-45, 45, 90, 90, 45, -45]),
        ..PLAIN
    },
    Wrong {
        name: "18 layup turned by 45",
        says: &["layup_deg", "45 degrees"],
        change: |m| specimen(m)["layup_deg"] = json!([90, 0, 45, 45, 0, 90]),
        ..PLAIN
    },
    Wrong {
        name: "18 layup mirrored",
        says: &["layup_deg", "mirrored"],
        balanced: false,
        change: |m| specimen(m)["layup_deg"] = json!([-30, 45, 0, 0, 45, -30]),
        ..PLAIN
    },
    Wrong {
        name: "19 template not edited",
        says: &["As in the template", "load.force_N", "prior of E1_GPa"],
        change: template,
        ..PLAIN
    },
    Wrong {
        name: "20 hole of 5 for 6 mm",
        says: &["hole.diameter_mm", "void"],
        change: |m| specimen(m)["hole"]["diameter_mm"] = 5.0.into(),
        ..PLAIN
    },
    Wrong {
        name: "nu21 for nu12",
        says: &["nu21"],
        change: |m| m["material"]["parameters"]["nu12"] = prior(0.02, 0.002),
        ..PLAIN
    },
];

/// Specimen, load and priors of the template of `init`.
fn template(model: &mut Value) {
    let template = json(Path::new(&crate::common::model("openhole.json")));
    model["material"] = template["material"].clone();
    for key in ["specimen", "load"] {
        model["experiments"][0][key] = template["experiments"][0][key].clone();
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn wrong_inputs_are_named_before_anything_is_sampled() {
    let mut missed = Vec::new();
    let mut ask = |name: &'static str, says: &[&str], folder: &Path| {
        let (text, seconds) = said(folder);
        println!(
            "| {name} | {seconds:.1} s | {} |",
            text.trim().replace('\n', " / ")
        );
        let is_named = says.iter().all(|word| text.contains(word));
        if !is_named || folder.join("run/chain.zarr").exists() {
            missed.push(name);
        }
    };
    for wrong in WRONG {
        ask(wrong.name, wrong.says, &folder(wrong));
    }
    let exchanged = folder(&PLAIN);
    let [u, v] = ["U.txt", "V.txt"].map(|name| read(&exchanged.join(name)));
    std::fs::write(exchanged.join("U.txt"), v).unwrap();
    std::fs::write(exchanged.join("V.txt"), u).unwrap();
    ask(
        "15 u and v exchanged",
        &["two displacements exchanged"],
        &exchanged,
    );
    // a load that leans beside it: no exchange of columns is the likelier mistake
    let layup = json!([45, -45, 0, 0, -45, 45]);
    let model = changed("openhole.json", |m| declare(m, &layup));
    let leaning = simulated(&model, &format!("{TRUTH} --effect load_misalignment=0.8"));
    let mut model = json(&leaning.join("model.json"));
    *force(&mut model) = 0.9.into();
    std::fs::write(leaning.join("model.json"), model.to_string()).unwrap();
    ask(
        "3 force in kN, leaning",
        &["factor of 0.001", "force in kN"],
        &leaning,
    );
    assert!(missed.is_empty(), "{missed:?}");
}

/// Neither does a force that is 10 % too large, which no field shows.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_right_input_raises_no_doubt() {
    let large = |m: &mut Value| *force(m) = 990.0.into();
    for (balanced, change) in [(true, PLAIN.change), (false, PLAIN.change), (true, large)] {
        let right = Wrong {
            balanced,
            change,
            ..PLAIN
        };
        let (text, _) = said(&folder(&right));
        assert!(!text.contains("without doubts"), "{text}");
    }
}
