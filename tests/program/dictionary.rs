//! The dictionary of effects at the border: the model file's keys, `effects`, and `simulate` of every kind.

use std::fs;
use std::path::{Path, PathBuf};

use plychain::effect::EFFECTS;
use plychain::parameter::{Parameter, ParameterKind};
use serde_json::Value;

use crate::common::{changed, coarse, fresh, model, refused, succeed};

fn dictionary(model: &str) -> Vec<Value> {
    let text = succeed(&["effects", model, "--json"]);
    serde_json::from_str::<Value>(&text)
        .unwrap()
        .as_array()
        .unwrap()
        .clone()
}

fn entry<'a>(dictionary: &'a [Value], name: &str) -> &'a Value {
    dictionary.iter().find(|e| e["name"] == name).unwrap()
}

#[test]
fn plausible_sizes_of_a_model_are_checked() {
    for (name, value, words) in [
        (
            "uniform_strain.ezz_microstrain",
            50.0,
            &["plausible", "ezz", "uniform_strain.exx_microstrain"][..],
        ),
        (
            "magnification.percent",
            0.0,
            &["magnification.percent", "above 0"],
        ),
        ("magnification.percent", -1.0, &["-1", "above 0"]),
    ] {
        let file = changed("openhole.json", |m| {
            m["experiments"][0]["plausible"][name] = value.into();
        });
        refused(&["effects", &file], words);
    }
    let text = std::fs::read_to_string(model("openhole.json")).unwrap();
    for (plausible, word) in [
        (
            r#"{ "magnification.percent": 1, "magnification.percent": 2 }"#,
            "second magnification.percent",
        ),
        (r#"{ "magnification.percent": "big" }"#, "big"),
    ] {
        let file = fresh("twice.json");
        let text = text.replace(
            "\"gauge\"",
            &format!("\"plausible\": {plausible}, \"gauge\""),
        );
        std::fs::write(&file, text).unwrap();
        refused(&["effects", file.to_str().unwrap()], &["twice.json", word]);
    }
}

#[test]
fn declared_effects_must_be_able_to_act() {
    let imaged = changed("steel-s235.json", |m| {
        m["experiments"][0]["effects"] = serde_json::json!(["phase_shift_error"]);
    });
    refused(
        &["identify", &imaged],
        &["phase_shift_error", "fringe_frequency"],
    );
    let cold = changed("steel-s235.json", |m| {
        m["experiments"][0]["effects"] = serde_json::json!(["thermal_strain"]);
        m["material"]
            .as_object_mut()
            .unwrap()
            .remove("expansion_per_K");
    });
    refused(&["identify", &cold], &["thermal_strain", "expansion_per_K"]);
}

#[test]
fn the_dictionary_shows_every_effect_within_a_hundred_columns() {
    for of in [None, Some(model("steel-s235.json"))] {
        let mut arguments = vec!["effects"];
        arguments.extend(of.as_deref());
        let text = succeed(&arguments);
        for line in text.lines() {
            assert!(line.chars().count() <= 100, "too long: {line}");
        }
        for effect in plychain::effect::EFFECTS {
            assert!(text.contains(effect.name()), "{}", effect.name());
            for parameter in effect.parameters() {
                assert!(text.contains(parameter.name), "{}", parameter.name);
            }
        }
    }
}

#[test]
fn the_dictionary_of_a_model_has_its_sizes_and_obstacles() {
    let file = changed("openhole.json", |m| {
        m["experiments"][0]["plausible"]["uniform_strain.eyy_microstrain"] = 44.0.into();
        m["experiments"][0]["candidates"] = serde_json::json!(["uniform_strain"]);
    });
    let moire = dictionary(&file);
    let strain = entry(&moire, "uniform_strain");
    assert_eq!(strain["parameters"][0]["plausible"], 10.0);
    assert_eq!(strain["parameters"][1]["plausible"], 44.0);
    assert_eq!(strain["parameters"][1]["unit"], "microstrain");
    assert_eq!(strain["candidate"], true);
    assert_eq!(entry(&moire, "magnification")["candidate"], false);
    assert_eq!(entry(&moire, "rigid_translation")["declared"], true);
    // a laminate does not yield, fringes know neither grey values nor motion towards the camera, and a strip's ends are loaded uniformly
    let cannot = |e: &Value| {
        let name = e["name"].as_str().unwrap();
        // plies of two different angles to the load have one share
        let elsewhere = [
            "yielding",
            "anisotropy",
            "interpolation_bias",
            "subset_size",
            "ply_share_2",
        ]
        .contains(&name);
        let elsewhere = elsewhere || name.starts_with("load_introduction_");
        // one load has no other to be compared with
        let kind = e["kind"].as_str().unwrap();
        let elsewhere = elsewhere || kind.contains("as of another force");
        elsewhere || name.starts_with("out_of_plane_") && name != "out_of_plane_bending"
    };
    assert!(moire.iter().all(|e| e["cannot_act"].is_null() != cannot(e)));
    let steel = dictionary(&model("steel-s235.json"));
    for name in ["phase_shift_error", "fringe_order_jump"] {
        let reason = entry(&steel, name)["cannot_act"].as_str().unwrap();
        assert!(
            reason.contains("fringe_frequency_per_mm"),
            "{name}: {reason}"
        );
    }
    assert!(entry(&steel, "thermal_strain")["cannot_act"].is_null());
    let units: Vec<_> = ["out_of_plane_bending", "lens_distortion", "thermal_strain"]
        .iter()
        .map(|name| {
            let parameters = entry(&steel, name)["parameters"].as_array().unwrap();
            parameters.last().unwrap()["unit"].clone()
        })
        .collect();
    assert_eq!(units, ["1/(m mm)", "mm", "K"]);
}

/// One file of a simulated measurement, as numbers.
fn simulated(effects: &[&str], file: &str) -> Vec<f64> {
    let mut arguments = String::from("--grid 41 --noise-nm 0");
    for effect in effects {
        arguments += &format!(" --effect {effect}");
    }
    let folder = crate::common::simulated(&coarse(), &arguments);
    std::fs::read_to_string(folder.join(file))
        .unwrap()
        .split_whitespace()
        .map(|v| v.parse().unwrap())
        .collect()
}

/// Largest difference from what is expected, um, over the points that are measured.
fn apart(a: &[f64], b: impl Iterator<Item = f64>) -> f64 {
    let pairs = a.iter().zip(b).filter(|(a, _)| !a.is_nan());
    let differences: Vec<f64> = pairs.map(|(a, b)| (a - b).abs()).collect();
    assert!(differences.len() > 1500);
    differences.into_iter().fold(0.0, f64::max)
}

/// U is the displacement along y in um. What is recorded contains everything before it: the ripple's argument has the
/// strain and the translation that were added.
#[test]
fn simulated_effects_act_in_the_stated_order() {
    let (x, y) = (simulated(&[], "X.txt"), simulated(&[], "Y.txt"));
    let plain = simulated(&[], "U.txt");
    let added = ["uniform_strain=0,100,50", "rigid_translation=0.05,0.1"];
    let with = simulated(&added, "U.txt");
    let expected: Vec<f64> = (0..x.len())
        .map(|i| plain[i] + 0.1 * y[i] + 0.05 * x[i] + 0.1)
        .collect();
    assert!(apart(&with, expected.iter().copied()) < 1e-4);
    let all = [added[0], added[1], "phase_shift_error=20,-30,20,-30"];
    let ripple = expected.iter().map(|u| {
        let phase = 4.0 * std::f64::consts::PI * 2400.0 * u / 1000.0;
        u + 0.020 * phase.sin() - 0.030 * phase.cos()
    });
    assert!(apart(&simulated(&all, "U.txt"), ripple) < 2e-3);
    let jump = simulated(&["fringe_order_jump=0,-2,5,4,3"], "U.txt");
    let expected = (0..x.len()).map(|i| {
        let inside = (x[i] - 5.0).hypot(y[i] - 4.0) <= 3.0;
        plain[i] - if inside { 2000.0 / 2400.0 } else { 0.0 }
    });
    assert!(apart(&jump, expected) < 1e-4);
}

#[test]
fn simulate_refuses_what_cannot_be() {
    let (moire, steel) = (model("openhole.json"), model("steel-s235.json"));
    for (file, effect, words) in [
        (
            &moire,
            "fringe_order_jump=0.5,0,0,0,3",
            &["whole", "0.5"][..],
        ),
        (&moire, "fringe_order_jump=1,0,0,0,0", &["radius"]),
        (
            &moire,
            "uniform_strain=1",
            &["exx_microstrain,eyy_microstrain"],
        ),
        (&moire, "magnification=50", &["20", "50"]),
        (&steel, "phase_shift_error=1,1,1,1", &["fringe_frequency"]),
    ] {
        let out = fresh("out").display().to_string();
        refused(
            &["simulate", file, "--out", &out, "--effect", effect],
            words,
        );
    }
}

/// What is special about an effect it says itself: nothing else asks for its name.
#[test]
fn no_effect_is_known_by_name_outside_its_room() {
    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && path.file_name().unwrap() != "effect" {
                sources(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    sources(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("src"),
        &mut found,
    );
    assert!(found.len() > 300, "only {} files seen", found.len());
    for path in found {
        let text = fs::read_to_string(&path).unwrap();
        let code = text.lines().map(|l| l.split("//").next().unwrap());
        for (line, code) in code.enumerate() {
            for effect in EFFECTS.iter().map(|e| e.name()) {
                // a literal, a constant, the key of an amplitude
                let constant = format!("effect::{}", effect.to_uppercase());
                let forms = [format!("\"{effect}\""), format!("\"{effect}."), constant];
                let named = forms.iter().any(|form| code.contains(form.as_str()));
                assert!(!named, "{}:{}: {effect}", path.display(), line + 1);
            }
            assert!(
                !code.contains("\"rigid_\""),
                "{}:{}",
                path.display(),
                line + 1
            );
        }
    }
}

/// A parameter is what its name says, and its name is what it is: over all effects, in a step and under a law.
#[test]
fn names_of_parameters_say_what_they_are() {
    for effect in EFFECTS {
        for parameter in effect.parameters() {
            let amplitude = Parameter::amplitude(effect.name(), parameter.name);
            let law = || Some("free".to_string());
            let stepped = amplitude.clone().in_step("2.5 kN, second visit");
            for one in [
                amplitude.clone(),
                amplitude.under(law()),
                stepped.clone(),
                stepped.under(law()),
            ] {
                assert_eq!(Parameter::read(&one.name()), one);
                assert!(one.is_amplitude() && !one.is_modulus());
                assert_eq!(one.effect.as_deref(), Some(effect.name()));
            }
        }
        let acts = Parameter::acts(effect.name());
        assert_eq!(Parameter::read(&acts.name()), acts);
    }
    for (name, kind, unit, modulus) in [
        ("E1_GPa", ParameterKind::Constant, "GPa", true),
        ("nu12", ParameterKind::Constant, "", false),
        ("noise_nm", ParameterKind::Noise, "nm", false),
        ("thickness_mm", ParameterKind::Thickness, "mm", false),
        ("force_2.5 kN", ParameterKind::Load, "N", false),
        (
            "force_percent in 2.5 kN",
            ParameterKind::LoadError,
            "percent",
            false,
        ),
        ("effect_size", ParameterKind::Hyper, "", false),
        ("answer", ParameterKind::Choice, "", false),
    ] {
        let one = Parameter::read(name);
        assert_eq!(
            (one.kind, one.is_modulus(), one.name()),
            (kind, modulus, name.to_string())
        );
        assert_eq!(one.unit(), unit, "{name}");
    }
    for (name, unit) in [
        ("lens.gradient_per_m_per_mm", "1/(m mm)"),
        ("a.percent_at_12mm", "percent"),
    ] {
        let found = Parameter::read(name).unit();
        assert_eq!(found, unit, "{name}");
    }
}
