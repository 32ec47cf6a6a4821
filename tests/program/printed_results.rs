//! Results that README.md and models/README.md print, compared with what their commands give today.

use std::path::Path;

use serde_json::Value;

use crate::common::{fresh, json, plychain_in, read, root, shared, succeed, table};
use crate::prose::{is_short, paragraphs_of_html};

/// A page may differ from a run by this share of the sd: another processor rounds otherwise, and chains are finite.
const SHARE: f64 = 0.35;

/// `139.9 +- 1.1 (95 %: ...)` as mean and sd.
fn mean_and_sd(cell: &str) -> (f64, f64) {
    let (mean, sd) = cell.split_once(" +- ").unwrap_or_else(|| panic!("{cell}"));
    let number = |text: &str| -> f64 {
        let digits = text.split([' ', ',', ')']).next().unwrap_or_default();
        digits.parse().unwrap_or_else(|e| panic!("{text}: {e}"))
    };
    (number(mean), number(sd))
}

/// Half a unit of the last digit that a number is printed with.
fn rounding(number: &str) -> f64 {
    let decimals = number.split_once('.').map_or(0, |(_, d)| d.len());
    0.5 * 10_f64.powi(-i32::try_from(decimals).unwrap())
}

/// That a cell says what a run found.
fn is_printed(what: &str, cell: &str, found: &Value) {
    let (mean, sd) = mean_and_sd(cell);
    let of = |key: &str| {
        found[key]
            .as_f64()
            .unwrap_or_else(|| panic!("{what}: {found}"))
    };
    let last = cell
        .split(" +- ")
        .nth(1)
        .unwrap()
        .split([' ', ','])
        .next()
        .unwrap();
    let near = (mean - of("mean")).abs() < SHARE * of("sd") + rounding(last);
    let as_wide = (sd - of("sd")).abs() < 0.15 * of("sd") + rounding(last);
    assert!(
        near && as_wide,
        "{what}: the page says {cell}, the run {} +- {}",
        of("mean"),
        of("sd")
    );
}

/// Name of a row's constant in reports: `E1, GPa` is `E1_GPa`.
fn constant(cell: &str) -> String {
    let cell = cell.split(" (").next().unwrap();
    cell.replace(", ", "_")
}

fn priors(model: &Value, name: &str) -> Value {
    let prior = &model["material"]["parameters"][name]["prior"]["normal"];
    assert!(prior.is_object(), "{name}");
    prior.clone()
}

/// The same numbers, to the last digit.
fn same(a: &str, found: &Value) {
    let (mean, sd) = mean_and_sd(a);
    assert_eq!(
        [mean, sd],
        ["mean", "sd"].map(|k| found[k].as_f64().unwrap()),
        "{a}"
    );
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn the_readme_prints_what_the_first_command_finds() {
    let out = fresh("printed");
    succeed(&["loop", "--quiet", "--out", &out.display().to_string()]);
    let report = json(&out.join("report.json"));
    is_short(
        "report",
        &paragraphs_of_html(&read(&out.join("report.html"))),
    );
    let page = read(&root().join("README.md"));
    let model = json(&root().join("models/openhole.json"));
    let truth = json(&root().join("models/openhole/truth.json"));
    let rows = table(&page, "| simulated with |");
    assert_eq!(rows.len(), 4);
    for row in &rows {
        let name = constant(&row[0]);
        same(&row[1], &priors(&model, &name));
        is_printed(&name, &row[2], &report["averaged_posterior"][&name]);
        assert_eq!(
            row[3].parse::<f64>().unwrap(),
            truth["constants"][&name].as_f64().unwrap()
        );
    }
    let (mean, sd) = mean_and_sd(page.split("`load_misalignment`, ").nth(1).unwrap());
    let found = &report["rounds"][1]["effect_amplitudes"]["load_misalignment.angle_deg"];
    let [m, s] = ["mean", "sd"].map(|k| found[k].as_f64().unwrap());
    assert!((mean - m).abs() < 1e-3 && (sd - s).abs() < 5e-4, "{found}");
    let left = page.split("The first fit leaves ").nth(1).unwrap();
    let left: f64 = left.split(' ').next().unwrap().parse().unwrap();
    let said = &report["rounds"][0]["residual"]["rms_nm"]["all"];
    assert!(
        (left / said.as_f64().unwrap() - 1.0).abs() < 0.05,
        "{left} {said}"
    );
}

#[test]
#[ignore = "length: a loop, 2 minutes"]
fn the_manual_prints_what_field_and_frequencies_find() {
    let page = read(&root().join("models/README.md"));
    let model = root()
        .join("models/openhole-and-plate.json")
        .display()
        .to_string();
    let out = fresh("printed-both");
    succeed(&[
        "loop",
        &model,
        "--quiet",
        "--out",
        &out.display().to_string(),
    ]);
    let report = json(&out.join("report.json"));
    let declared = json(Path::new(&model));
    let rows = table(&page, "| (simulated with) |");
    assert_eq!(rows.len(), 4);
    for row in &rows {
        let name = constant(&row[0]);
        same(&row[1], &priors(&declared, &name));
        is_printed(&name, &row[5], &report["averaged_posterior"][&name]);
    }
    let (mean, sd) = mean_and_sd(
        page.split("The loop names `magnification`, ")
            .nth(1)
            .unwrap(),
    );
    let found = &report["rounds"][1]["effect_amplitudes"]["magnification.percent"];
    let [m, s] = ["mean", "sd"].map(|k| found[k].as_f64().unwrap());
    assert!(
        (mean - m).abs() < SHARE * s + 0.005 && (sd - s).abs() < 0.15 * s + 0.005,
        "{found}"
    );
}

/// The four commands of the manual's load series, with the hole's diameter set as it says.
#[test]
#[ignore = "length: a loop over a series, 2 minutes"]
fn the_manual_prints_what_its_series_gives() {
    let page = read(&root().join("models/README.md"));
    let block = page
        .split("```sh\n")
        .find(|b| b.starts_with("plychain init rig"))
        .unwrap();
    let block = block.split("```").next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    for line in block.lines().filter(|line| line.starts_with("plychain")) {
        let line = line.split(" #").next().unwrap();
        let words: Vec<String> = line
            .split_whitespace()
            .skip(1)
            .map(|w| w.trim_matches('\'').to_string())
            .collect();
        let mut words: Vec<&str> = words.iter().map(String::as_str).collect();
        if words[0] == "loop" {
            let file = folder.path().join("coupon.json");
            let mut model = json(&file);
            model["experiments"][0]["specimen"]["hole"]["diameter_mm"] = 4.into();
            std::fs::write(&file, model.to_string()).unwrap();
            words.extend(["--out", "run"]);
        }
        let end = plychain_in(folder.path(), &words);
        assert!(
            end.status.success(),
            "{line}\n{}",
            String::from_utf8_lossy(&end.stderr)
        );
    }
    let report = json(&folder.path().join("run/report.json"));
    let rows = table(&page, "| | prior | result | simulated |");
    let e1 = rows.iter().find(|r| r[0] == "E1, GPa").unwrap();
    is_printed("E1", &e1[2], &report["averaged_posterior"]["E1_GPa"]);
    assert_eq!(
        report["verdict"]["effects"],
        serde_json::json!(["out_of_plane_rotation"])
    );
    let tilt = rows.iter().find(|r| r[0] == "tilt, mrad").unwrap();
    let (mean, sd) = mean_and_sd(&tilt[2]);
    assert!((mean - 3.0).abs() < 2.0 * sd, "{tilt:?}");
}

/// README's worked example, with the lines that it sets.
#[test]
#[ignore = "needs ../shared, 3 minutes"]
fn the_readme_prints_what_the_measured_strip_gives() {
    let page = read(&root().join("README.md"));
    let folder = tempfile::tempdir().unwrap();
    let name = "20231116_displacements_raw.csv";
    std::fs::copy(
        shared("steel-s235/displacements_raw.csv"),
        folder.path().join(name),
    )
    .unwrap();
    let run = |words: &[&str]| {
        let end = plychain_in(folder.path(), words);
        assert!(
            end.status.success(),
            "{words:?}\n{}",
            String::from_utf8_lossy(&end.stderr)
        );
    };
    run(&["init", "strip", "--like", "steel", "--csv", name]);
    let file = folder.path().join("strip.json");
    let mut model = json(&file);
    let set: Value = {
        let block = page
            .split("```json\n")
            .find(|b| b.contains("\"hole\""))
            .unwrap();
        serde_json::from_str(&format!("{{{}}}", block.split("```").next().unwrap())).unwrap()
    };
    let experiment = &mut model["experiments"][0];
    for key in ["width_mm", "hole", "thickness_mm"] {
        experiment["specimen"][key] = set[key].clone();
    }
    experiment["load"] = set["load"].clone();
    std::fs::write(&file, model.to_string()).unwrap();
    run(&["loop", "strip.json", "--quiet", "--out", "run"]);
    let report = json(&folder.path().join("run/report.json"));
    for row in table(&page, "| handbook |") {
        let name = constant(&row[0]);
        same(&row[1], &priors(&model, &name));
        is_printed(&name, &row[2], &report["averaged_posterior"][&name]);
    }
    assert_eq!(report["verdict"]["status"], "unexplained");
    // what is known of steel is not excluded
    let e = &report["averaged_posterior"]["E_GPa"];
    let [low, high] = ["q2.5", "q97.5"].map(|q| e[q].as_f64().unwrap());
    assert!(low < 212.0 && high > 205.0, "E from {low} to {high} GPa");
}

/// What stands at a place of a report.
fn moments<'a>(report: &'a Value, path: &str) -> &'a Value {
    report
        .pointer(path)
        .unwrap_or_else(|| panic!("no {path} in the report"))
}

/// Both tables of the measured strip, and the sentence about the one with a camera.
#[test]
#[ignore = "two loops, 5 minutes; needs ../shared"]
fn the_manual_prints_what_the_measured_strip_gives() {
    let page = read(&root().join("models/README.md"));
    let data = shared("steel-s235/displacements_raw.csv")
        .display()
        .to_string();
    let looped = |file: &str| {
        let out = fresh("printed-steel");
        let path = out.display().to_string();
        succeed(&["loop", file, "--data", &data, "--quiet", "--out", &path]);
        json(&out.join("report.json"))
    };
    let model = root().join("models/steel-s235.json").display().to_string();
    let report = looped(&model);
    // the published calibration lacks the rigid motion
    let mut effects = report["verdict"]["effects"].as_array().unwrap().iter();
    assert!(effects.any(|e| e == "rigid_translation"));
    let last = report["rounds"].as_array().unwrap().len() - 1;
    let rows = table(&page, "| model | E, GPa |");
    assert_eq!(rows.len(), 3);
    for (row, at) in rows.iter().zip([
        "/rounds/0/posterior".to_string(),
        format!("/rounds/{last}/posterior"),
        "/averaged_posterior".into(),
    ]) {
        for (cell, name) in row[1..].iter().zip(["E_GPa", "nu"]) {
            if cell.contains(" +- ") {
                is_printed(&at, cell, moments(&report, &format!("{at}/{name}")));
            }
        }
    }
    let named = ["small", "all", "none"];
    let answers = report["quoted"]["answers"].as_array().unwrap();
    let answer = |name: &str| answers.iter().find(|a| a["name"] == name).unwrap();
    for (row, name) in table(&page, "| explanation of what is left |")
        .iter()
        .zip(named)
    {
        is_printed(name, &row[1], &answer(name)["constants"]["E_GPa"]);
    }
    assert_eq!(report["verdict"]["status"], "unexplained");

    let seen = crate::common::changed("steel-s235.json", |m| {
        m["experiments"][0]["measurement"]["image_correlation"] =
            serde_json::json!({ "subset_mm": 0.8, "camera_distance_mm": 1000 });
    });
    let report = looped(&seen);
    let said = page.split("The result is E = ").nth(1).unwrap();
    is_printed("camera", said, &report["averaged_posterior"]["E_GPa"]);
    let nu = said.split("and nu = ").nth(1).unwrap();
    let nu = nu.split(". ").next().unwrap();
    is_printed("camera", nu, &report["averaged_posterior"]["nu"]);
}

/// What a declared scatter of the plies does to the default test.
#[test]
#[ignore = "three loops, 3 minutes"]
fn the_manual_prints_what_declared_plies_do() {
    let page = read(&root().join("models/README.md"));
    let declared = [
        serde_json::json!({}),
        serde_json::json!({ "balanced_misorientation.angle_deg": 0.2 }),
        serde_json::json!({ "ply_share_1.ply_percent": 2, "ply_share_2.ply_percent": 2 }),
    ];
    for (row, plausible) in table(&page, "| declared | E2, sd in GPa |")
        .iter()
        .zip(declared)
    {
        let file = crate::common::changed("openhole.json", |m| {
            m["experiments"][0]["plausible"] = plausible.clone();
        });
        let out = fresh("printed-plies");
        succeed(&[
            "loop",
            &file,
            "--quiet",
            "--out",
            &out.display().to_string(),
        ]);
        let found = &json(&out.join("report.json"))["averaged_posterior"];
        for (cell, name) in row[1..].iter().zip(["E2_GPa", "nu12", "G12_GPa"]) {
            let sd = found[name]["sd"].as_f64().unwrap();
            match cell.parse::<f64>() {
                Ok(said) => assert!(
                    (said / sd - 1.0).abs() < 0.15 || (said - sd).abs() < rounding(cell),
                    "{plausible}: {name} {said} {sd}"
                ),
                // "near its prior", of .03
                Err(_) => assert!(sd > 0.6 * 0.03, "{plausible}: {name} {sd}"),
            }
        }
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn the_manual_prints_what_the_plate_gives() {
    let page = read(&root().join("models/README.md"));
    let file = root().join("models/plate.json").display().to_string();
    let out = fresh("printed-plate");
    succeed(&[
        "identify",
        &file,
        "--quiet",
        "--out",
        &out.display().to_string(),
    ]);
    let report = json(&out.join("report.json"));
    let section = page.split("## Natural frequencies").nth(1).unwrap();
    for row in table(section, "| | prior | result | simulated |") {
        let name = constant(&row[0]);
        same(&row[1], &priors(&json(Path::new(&file)), &name));
        is_printed(&name, &row[2], &report["posterior"][&name]);
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn the_manual_prints_what_design_says() {
    let page = read(&root().join("models/README.md"));
    let out = fresh("design.json");
    let model = root().join("models/openhole.json").display().to_string();
    succeed(&["design", &model, "--out", &out.display().to_string()]);
    let report = json(&out);
    let candidate = |name: &str| {
        let all = report["candidates"].as_array().unwrap().iter();
        let mut of_kind = all.filter(|c| c["name"].as_str().unwrap().starts_with(name));
        of_kind.next().unwrap()["together_percent"].clone()
    };
    let alone = &report["declared"][0];
    let expected = [
        alone["sd_percent"].clone(),
        alone["sd_percent_with_effects"].clone(),
        candidate("coupon"),
        candidate("plate"),
    ];
    let rows = table(&page, "| experiments | E1 | E2 | nu12 | G12 |");
    assert_eq!(rows.len(), expected.len());
    for (row, expected) in rows.iter().zip(expected) {
        for (cell, name) in row[1..].iter().zip(["E1_GPa", "E2_GPa", "nu12", "G12_GPa"]) {
            let found = expected[name].as_f64().unwrap();
            let off = (cell.parse::<f64>().unwrap() - found).abs();
            assert!(
                off < 0.01 + rounding(cell),
                "{}: {name} {cell} {found}",
                row[0]
            );
        }
    }
}

/// The population of the five specimens that the manual describes.
#[test]
#[ignore = "five loops, 5 minutes"]
fn the_manual_prints_what_five_specimens_give() {
    let page = read(&root().join("runs/README.md"));
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[&str]| {
        let end = plychain_in(folder.path(), words);
        let said = String::from_utf8_lossy(&end.stderr).into_owned();
        assert!(end.status.success(), "{words:?}\n{said}");
    };
    let model = root().join("models/openhole.json");
    std::fs::copy(&model, folder.path().join("openhole.json")).unwrap();
    let rows = table(&page, "| specimen | E1, GPa | E2, GPa | nu12 | G12, GPa |");
    for (row, seed) in rows.iter().zip(["1", "2", "3", "4", "5"]) {
        let name = format!("specimen-{seed}");
        let names = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];
        let sets: Vec<String> = names
            .iter()
            .zip(&row[1..])
            .map(|(name, cell)| format!("{name}={cell}"))
            .collect();
        let mut words = vec!["simulate", "openhole.json", "--grid", "121"];
        words.extend(["--seed", seed, "--out", &name]);
        words.extend(sets.iter().flat_map(|set| ["--set", set.as_str()]));
        if row[0].contains("pixels") {
            words.extend(["--effect", "magnification=0.3"]);
        }
        run(&words);
    }
    let campaign = serde_json::json!({ "schema": "plychain-campaign/1", "name": "coupons", "verb": "loop",
        "models": "openhole.json", "data": "specimen-*" });
    std::fs::write(folder.path().join("coupons.json"), campaign.to_string()).unwrap();
    run(&["campaign", "coupons.json"]);
    run(&["campaign", "population", "runs/coupons"]);
    let report = json(
        &folder
            .path()
            .join("runs/coupons/population/population.json"),
    );
    for name in ["E1_GPa", "E2_GPa"] {
        let found = &report["constants"][name];
        let line = page.lines().find(|l| l.trim().starts_with(name)).unwrap();
        let cells: Vec<&str> = line
            .split("  ")
            .map(str::trim)
            .filter(|c| !c.is_empty())
            .collect();
        is_printed(name, cells[1], &found["mean"]);
        is_printed(name, cells[2], &found["sd"]);
        for (cell, basis) in cells[3..].iter().zip(["b_basis", "a_basis"]) {
            let value = found[basis]["value"].as_f64().unwrap();
            let allowed = 0.15 * (found["mean"]["mean"].as_f64().unwrap() - value);
            let said: f64 = cell.parse().unwrap();
            assert!(
                (said - value).abs() < allowed,
                "{name} {basis} {said} {value}"
            );
        }
    }
}
