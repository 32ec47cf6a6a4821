//! The report and its figures: they say what report.json says, can be made again from a run's folder, and need nothing
//! but themselves.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use plychain::report::{FieldCells, Page, Palette};
use serde_json::{Value, json};

use crate::common::{coarse, copy, fresh, json, plychain, read, root, succeed};

/// A run of the sample measurement, made once.
pub fn run() -> &'static Path {
    static RUN: OnceLock<PathBuf> = OnceLock::new();
    RUN.get_or_init(|| {
        let out = fresh("reported");
        let path = out.display().to_string();
        let openhole = coarse();
        succeed(&["identify", &openhole, "--quiet", "--out", &path]);
        out
    })
}

/// A table of a figure's numbers as a plotting script reads it: columns under their names.
struct Sheet(serde_json::Map<String, Value>);

impl Sheet {
    fn column(&self, name: &str) -> &Vec<Value> {
        self.0[name].as_array().expect(name)
    }

    fn texts(&self, name: &str) -> Vec<&str> {
        let column = self.column(name).iter();
        column.map(|v| v.as_str().expect(name)).collect()
    }

    fn numbers(&self, name: &str) -> Vec<f64> {
        let column = self.column(name).iter();
        column.map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
    }

    fn only(&self, name: &str, value: &Value) -> Self {
        let kept = |column: &Value| {
            let pairs = column.as_array().unwrap().iter().zip(self.column(name));
            pairs
                .filter(|(_, v)| *v == value)
                .map(|(c, _)| c.clone())
                .collect::<Value>()
        };
        Self(
            self.0
                .iter()
                .map(|(k, column)| (k.clone(), kept(column)))
                .collect(),
        )
    }

    fn distinct(&self, name: &str) -> Vec<Value> {
        let mut values = self.column(name).clone();
        values.dedup();
        values
    }
}

/// A table in the JSON of a figure of round 0; without a name, of a figure that is one table.
fn sheet(folder: &Path, figure: &str, table: &str) -> Sheet {
    let numbers = json(&folder.join("figures").join(format!("{figure}.json")));
    let table = match table {
        "" => &numbers,
        table => &numbers[table],
    };
    Sheet(table.as_object().unwrap().clone())
}

/// A copy of the run whose report went through `change`.
pub fn changed(change: impl Fn(&mut Value)) -> PathBuf {
    let copy = fresh("copy");
    let figures = copy.join("figures");
    std::fs::create_dir_all(&figures).unwrap();
    for entry in std::fs::read_dir(run().join("figures")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "json") {
            std::fs::copy(&path, figures.join(path.file_name().unwrap())).unwrap();
        }
    }
    for name in ["run.json", "truth.json"] {
        std::fs::copy(run().join(name), copy.join(name)).unwrap();
    }
    let mut report = json(&run().join("report.json"));
    change(&mut report);
    std::fs::write(copy.join("report.json"), report.to_string()).unwrap();
    copy
}

#[test]
fn figures_numbers_are_those_of_the_report() {
    let report = json(&run().join("report.json"));
    let round = &report["rounds"][0];
    let parameters = sheet(run(), "corner-0", "parameters");
    let names = parameters.texts("parameter");
    assert_eq!(names.len(), round["posterior"].as_object().unwrap().len());
    for column in ["mean", "sd", "q2.5", "median", "q97.5"] {
        for (name, value) in names.iter().zip(parameters.numbers(column)) {
            let said = round["posterior"][*name][column].as_f64().unwrap();
            // figures' numbers have seven digits
            let near = (value - said).abs() <= 1e-6 * said.abs();
            assert!(near, "{name} {column}: {value} {said}");
        }
    }
    let intervals = sheet(run(), "intervals", "").only("what", &json!("round 0"));
    for (name, low) in intervals
        .texts("parameter")
        .iter()
        .zip(intervals.numbers("low"))
    {
        assert_eq!(round["posterior"][*name]["q2.5"].as_f64(), Some(low));
    }
    let truth = json(&root().join("models/openhole/truth.json"));
    let known = sheet(run(), "intervals", "")
        .only("parameter", &json!("nu12"))
        .numbers("truth");
    assert_eq!(Some(known[0]), truth["constants"]["nu12"].as_f64());
    // the sample has one point a cell, so that cells keep the root mean square
    let maps = sheet(run(), "maps-0", "maps");
    for c in ["u1", "u2"] {
        let of = |what: &str| maps.numbers(&format!("{c}_{what}"));
        let residual: Vec<f64> = of("residual_nm")
            .into_iter()
            .filter(|v| v.is_finite())
            .collect();
        let rms = (residual.iter().map(|v| v * v).sum::<f64>() / residual.len() as f64).sqrt();
        let said = round["residual"]["rms_nm"][c].as_f64().unwrap();
        assert!(
            (rms / said - 1.0).abs() < 1e-4,
            "{c}: {rms} on the map, {said} in the report"
        );
        assert_eq!(Some(residual.len() as u64), round["residual"]["n"].as_u64());
        let (m, p) = (of("measured_um"), of("predicted_um"));
        for ((m, p), r) in m
            .iter()
            .zip(&p)
            .zip(of("residual_nm"))
            .filter(|(_, r)| r.is_finite())
        {
            assert!(
                (1e3 * (m - p) - r).abs() < 0.02,
                "{m} - {p} um is not {r} nm"
            );
        }
    }
}

#[test]
fn densities_integrate_to_one_and_ranks_to_their_number() {
    let marginals = sheet(run(), "corner-0", "marginals");
    for name in marginals.distinct("parameter") {
        let of = marginals.only("parameter", &name);
        let (x, d) = (of.numbers("value"), of.numbers("density"));
        let mass = (x[1] - x[0]) * d.iter().sum::<f64>();
        assert!((0.99..1.0005).contains(&mass), "{name}: {mass}");
    }
    let ranks = sheet(run(), "rank-0", "rank");
    for name in ranks.distinct("parameter") {
        let sum: f64 = ranks
            .only("parameter", &name)
            .numbers("relative_count")
            .iter()
            .sum();
        assert!(
            (sum / 80.0 - 1.0).abs() < 1e-4,
            "{name}: four ensembles in twenty bins sum to {sum}"
        );
    }
}

#[test]
fn a_report_is_made_again_from_its_folder_to_the_same_bytes() {
    // a folder of its own: others read the run's at the same time
    let folder = fresh("made-again");
    copy(run(), &folder);
    let names = [
        "report.html",
        "figures/corner-0.svg",
        "figures/maps-0-u1.svg",
    ];
    let read = |name: &&str| std::fs::read(folder.join(name)).unwrap();
    let before: Vec<Vec<u8>> = names.iter().map(read).collect();
    let path = folder.display().to_string();
    succeed(&["report", &path]);
    for (name, before) in names.iter().zip(before) {
        assert!(
            std::fs::read(folder.join(name)).unwrap() == before,
            "{name} differs"
        );
    }
}

#[test]
fn the_page_is_complete_in_itself() {
    let html = read(&run().join("report.html"));
    assert!(html.len() < 5 << 20, "{} bytes", html.len());
    let outside: Vec<&str> = html
        .match_indices("http")
        .map(|(at, _)| &html[at..(at + 60).min(html.len())])
        .filter(|s| !s.starts_with("http://www.w3.org/2000/svg") && !s.starts_with("http-equiv"))
        .collect();
    assert!(outside.is_empty(), "{outside:?}");
    for part in [
        "<h1>",
        "id=\"before-and-after\"",
        "id=\"maps\"",
        "id=\"posterior\"",
        "id=\"convergence\"",
        "id=\"provenance\"",
        "prefers-color-scheme",
        "@media print",
    ] {
        assert!(html.contains(part), "{part} is missing");
    }
    let drawings = html.matches("<svg").count();
    assert!(drawings >= 11, "{drawings} drawings");
    assert_eq!(html.matches("role=\"img\" aria-label=").count(), drawings);
    let manifest = json(&run().join("run.json"));
    for hash in manifest["inputs_sha256"].as_object().unwrap().values() {
        assert!(html.contains(hash.as_str().unwrap()));
    }
}

/// A loop's report, as `plychain loop` writes it.
pub fn looped(report: &mut Value) {
    let first = report["rounds"][0].clone();
    let mut second = first.clone();
    second["effects_declared"] = json!(["rigid_translation", "load_misalignment"]);
    second["candidates"] = json!([]);
    let rounds = report["rounds"].as_array_mut().unwrap();
    rounds[0]["candidates"] = json!([
        { "effect": "load_misalignment", "inclusion_probability": 0.987, "log_bayes_factor": 812.0,
          "amplitude": [{ "parameter": "angle_deg", "mean": 0.801, "sd": 0.004 }], "explained_fraction": 0.97,
          "detectable": 0.01, "aliases": [{ "effect": "camera_rotation", "cosine": 0.991 }] },
        { "effect": "magnification", "inclusion_probability": 0.02, "log_bayes_factor": null,
          "amplitude": [], "explained_fraction": 0.29, "detectable": null, "aliases": [] },
        { "effect": "hole_size", "inclusion_probability": 0.001, "log_bayes_factor": -4.0,
          "amplitude": [], "explained_fraction": 0.25, "detectable": 0.08, "aliases": [] },
    ]);
    rounds[0]["accepted"] = json!(["load_misalignment"]);
    rounds[0]["warnings"] = json!(["<script>alert(1)</script> & so on"]);
    rounds.push(second);
    rounds[1]["warnings"] = json!(["<script>alert(1)</script> & so on"]);
    report["averaged_posterior"] = json!({ "nu12": { "mean": 0.331, "sd": 0.012, "q2.5": 0.307, "median": 0.331, "q97.5": 0.355 } });
    report["blind_spots"] = json!([
        { "effect": "magnification", "parameter": "percent", "plausible": 0.3, "unit": "percent",
          "shift_in_percent": { "nu12": 23.4, "E1_GPa": -0.2 }, "detectable": null, "would_be_seen": false },
        { "effect": "hole_size", "parameter": "diameter_percent", "plausible": 2.0, "unit": "percent",
          "shift_in_percent": { "nu12": -12.3, "E1_GPa": -341.5 }, "detectable": 0.08, "would_be_seen": true },
    ]);
    report["verdict"] = json!({
        "status": "closed", "effects": ["load_misalignment"], "text": "The residual is consistent with load_misalignment (0.801 +- 0.004 deg).",
        "confirm": [{ "added": true, "tests": [
            { "effect": "load_misalignment", "test": "Measure the offset between the grips." },
            { "effect": "ply_misorientation", "test": "Section the laminate." },
        ] }],
    });
    report["averaged_note"] = json!("The averaged sd is larger than that of the model alone.");
    report["before_after"] = json!({
        "residual_rms_nm": [110.5, 10.1], "residual_rms_u1_nm": [111.5, 10.0], "residual_rms_u2_nm": [109.6, 10.2],
        "chi2_reduced": [58.6, 1.0], "holdout_rms_nm": [82.3, null],
        "posterior": { "nu12": { "mean": [0.34, 0.33], "sd": [0.02, 0.01], "shift_in_sd": -0.5, "from_prior_in_prior_sd": [0.1, null] } },
    });
}

/// Half of what would be found is 0.23 degrees; they move nu12 by 13 %, which is four of its sds, and by 2 % where 0.08 would be found.
#[test]
fn what_would_not_show_and_leaves_an_interval_is_said_first() {
    let first_screen = |detectable: f64| {
        let folder = changed(|report| {
            looped(report);
            report["blind_spots"][1] = json!(
                { "effect": "balanced_misorientation", "parameter": "angle_deg", "plausible": 1.0, "unit": "deg",
                  "shift_in_percent": { "nu12": -57.0 }, "detectable": detectable, "would_be_seen": true });
        });
        succeed(&["report", &folder.display().to_string()]);
        let html = read(&folder.join("report.html"));
        html.split_once("</header>").unwrap().0.to_string()
    };
    let said = "balanced_misorientation of 0.23 deg would not show, and it moves nu12 by 13.1 %. The intervals do not reach so far.";
    assert!(first_screen(0.46).contains(said));
    assert!(!first_screen(0.08).contains("would not show"));
}

#[test]
fn a_loop_shows_its_verdict_ranking_and_blind_spots() {
    let folder = changed(looped);
    succeed(&["report", &folder.display().to_string()]);
    let html = read(&folder.join("report.html"));
    for text in [
        "<strong>Explained by: load_misalignment. </strong>The residual is consistent with load_misalignment (0.801 \u{b1} 0.004 deg).",
        "<strong>load_misalignment</strong>: Measure the offset between the grips.",
        "<strong>ply_misorientation</strong>: Section the laminate.",
        "The averaged sd is larger than that of the model alone.",
        "round 1, with load_misalignment",
        "camera_rotation (0.991)",
        "0.801",
        "magnification.percent",
        "&gt; +20",
        "&lt; \u{2212}20",
        "\u{2212}12.3",
        "Beyond 20 % only their sign is known",
        "never",
        "0.331 \u{b1} 0.012",
        "&lt;script&gt;alert(1)&lt;/script&gt; &amp; so on",
    ] {
        assert!(html.contains(text), "{text} is missing");
    }
    assert!(!html.contains("<script>alert"));
    // what an improbable effect would explain alone is not shown
    let has_cell = |text: &str| html.contains(&format!("<td>{text}</td>"));
    assert!(has_cell("97 %") && !has_cell("29 %") && !has_cell("25 %"));
    // a shift that is only known to be large keeps its number in the figures' numbers
    let spots = sheet(&folder, "blind-spots", "");
    assert_eq!(spots.numbers("nu12_shift_percent"), [23.4, -12.3]);
    assert_eq!(*spots.column("would_be_seen"), [false, true]);
    assert!(!html.contains("341.5"));
    assert_eq!(
        *sheet(&folder, "candidates-0", "").column("accepted"),
        [true, false, false]
    );
    assert_eq!(
        sheet(&folder, "intervals", "")
            .only("what", &json!("averaged"))
            .numbers("low"),
        [0.307]
    );
}

/// A constant far from its prior is flagged where it stands, and only there.
#[test]
fn what_contradicts_its_prior_is_flagged_in_the_table() {
    assert!(!read(&run().join("report.html")).contains("contradicts the prior"));
    let folder = changed(|report| {
        // the prior of nu12 is 0.34 +- 0.03
        report["rounds"][0]["posterior"]["nu12"]["mean"] = 0.61.into();
    });
    succeed(&["report", &folder.display().to_string()]);
    let html = read(&folder.join("report.html"));
    assert!(html.contains("contradicts the prior by +9.0 sd"));
    assert_eq!(html.matches("contradicts the prior").count(), 1);
}

#[test]
fn runs_are_compared_side_by_side() {
    let other = changed(looped);
    let out = fresh("side-by-side.html");
    let paths = [run(), &other, &out].map(|p| p.display().to_string());
    succeed(&["report", &paths[0], &paths[1], "--out", &paths[2]]);
    let html = read(&out);
    for text in [
        "reported",
        "copy",
        "explained by: load_misalignment",
        "0.331 \u{b1} 0.012 [0.307, 0.355]",
        "rigid_translation, load_misalignment",
    ] {
        assert!(html.contains(text), "{text} is missing");
    }
    let refused = plychain(&["report", "nowhere"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("nowhere"));
}

#[test]
fn large_fields_are_shown_in_few_cells_with_the_same_mean() {
    let points: Vec<[f64; 2]> = (0..700 * 700)
        .map(|k| [0.035 * f64::from(k % 700), 0.035 * f64::from(k / 700)])
        .collect();
    let noise = |i: usize| ((i * 7919 + 13) % 1009) as f64 / 1009.0 - 0.5;
    let cells = FieldCells::new(&points);
    assert!(cells.count() <= 33_000, "{} cells", cells.count());
    let mean = cells.mean(noise);
    let mut count = vec![0.0; cells.count()];
    cells.of_point.iter().for_each(|&c| count[c] += 1.0);
    assert!(count.iter().all(|c| *c > 0.0), "cells without points");
    let total: f64 = mean.iter().zip(&count).map(|(m, c)| m * c).sum();
    let direct: f64 = (0..points.len()).map(noise).sum();
    assert!((total - direct).abs() < 1e-6 * points.len() as f64);
    // twelve maps a round: six rounds of incompressible maps stay below 5 MB
    let image = Palette::Difference
        .image(&mean, cells.x.len(), [-0.5, 0.5])
        .unwrap();
    assert!(36 * image.len() < 5 << 20, "{} bytes a map", image.len());
}

#[test]
fn scattered_points_fill_their_cells() {
    // the golden ratio's sequence is even, and lies on no lattice
    let points: Vec<[f64; 2]> = (0..5000)
        .map(|k| f64::from(k) + 0.5)
        .map(|k| {
            [
                80.0 * (k * 0.618_033_988_749_895).fract(),
                20.0 * k / 5000.0,
            ]
        })
        .collect();
    let cells = FieldCells::new(&points);
    let mut seen = vec![false; cells.count()];
    cells.of_point.iter().for_each(|&c| seen[c] = true);
    let empty = seen.iter().filter(|s| !**s).count();
    assert!(cells.count() > 1000, "{} cells", cells.count());
    assert!(
        50 * empty < cells.count(),
        "{empty} of {} cells are empty",
        cells.count()
    );
    let x = cells.mean(|i| points[i][0]);
    let width = cells.x[1] - cells.x[0];
    for (k, x) in x.iter().enumerate().filter(|(_, x)| x.is_finite()) {
        assert!((x - cells.x[k % cells.x.len()]).abs() <= 0.51 * width);
    }
}

#[test]
fn a_page_without_figures_is_refused_with_its_place() {
    let folder = fresh("no-figures");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::copy(run().join("report.json"), folder.join("report.json")).unwrap();
    let error = Page::load(&folder).unwrap_err().to_string();
    assert!(
        error.contains("figures") && error.contains("expected"),
        "{error}"
    );
}

/// What nobody changed since `init` wrote it is named; a shipped model has its own values.
#[test]
fn values_of_the_template_are_named() {
    let text = std::fs::read_to_string(root().join("models/openhole.json")).unwrap();
    let mut model: Value = serde_json::from_str(&text).unwrap();
    assert!(plychain::infer::unchanged(&model).is_empty());
    assert!(plychain::report::told::not_changed(&model).is_none());
    model["name"] = "coupon".into();
    let left = plychain::infer::unchanged(&model);
    for key in [
        "load.force_N",
        "specimen.layup_deg",
        "specimen.thickness_mm.mean",
        "prior of E1_GPa",
    ] {
        assert!(left.iter().any(|l| l == key), "{key} of {left:?}");
    }
    model["experiments"][0]["load"]["force_N"] = json!(701);
    let prior = &mut model["material"]["parameters"]["E1_GPa"]["prior"]["normal"]["mean"];
    *prior = json!(140);
    let left = plychain::infer::unchanged(&model).join(", ");
    assert!(
        !left.contains("force_N") && !left.contains("E1_GPa"),
        "{left}"
    );
    assert!(left.contains("prior of E2_GPa"), "{left}");
}

/// What a person reads first fits on a screen of a terminal: verdict, constants with priors, effects with tests, what to check, where the report is.
#[test]
#[ignore = "slow: run by .ci/run"]
fn the_terminal_has_a_screen_and_the_rest_on_request() {
    let folder = changed(looped);
    let page = Page::load(&folder).unwrap();
    let text = plychain::section::terminal(&[plychain::report::run::brief(&page)]);
    println!("{text}");
    let lines = text.lines().filter(|l| !l.is_empty()).count();
    assert!(lines <= 14, "{lines} lines:\n{text}");
    for part in [
        "VERDICT: explained by: load_misalignment",
        "nu12",
        "0.331 +- 0.012",
        "prior",
        "from the data",
        "Measure the offset between the grips.",
        "BEFORE YOU USE",
    ] {
        assert!(text.contains(part), "{part} is missing:\n{text}");
    }

    let output = |extra: &[&str]| {
        let (openhole, out) = (coarse(), fresh("said").display().to_string());
        let all = [&["identify", &openhole, "--out", &out][..], extra].concat();
        let end = plychain(&all);
        assert!(end.status.success());
        let report = json(&Path::new(&out).join("report.json"));
        let html = read(&Path::new(&out).join("report.html"));
        let (first, _) = html.split_once("</header>").unwrap();
        assert!(first.contains("class=\"map\""), "a map on the first screen");
        let [said, errors] = [end.stdout, end.stderr].map(|t| String::from_utf8(t).unwrap());
        (said, errors, report)
    };
    let (said, errors, _) = output(&[]);
    let lines = said.lines().filter(|l| !l.is_empty()).count();
    assert!(
        lines <= 14 && said.contains("VERDICT") && said.contains("report.html"),
        "{said}"
    );
    // no line of progress goes to a file
    assert!(
        errors.lines().all(|l| l.starts_with("warning: ")),
        "{errors}"
    );
    let (all, stages, _) = output(&["--verbose"]);
    assert!(all.contains("correlation of the draws") && all.lines().count() > 3 * lines);
    assert!(
        stages.contains("looking for mistakes in the input"),
        "{stages}"
    );
    let (one, errors, report) = output(&["--json", "--quiet"]);
    assert_eq!(errors, "");
    assert_eq!(serde_json::from_str::<Value>(&one).unwrap(), report);
}

/// The first screen of the page has the verdict, the constants with their priors and what went in; all else is folded below it.
#[test]
fn the_page_begins_with_what_one_asks_first() {
    let folder = changed(|report| {
        looped(report);
        report["told"]["run"] = json!({ "note": "B-17, operator K, 3 November" });
        report["rounds"][0]["candidates"][2]["inclusion_probability"] = 1e-5.into();
    });
    succeed(&["report", &folder.display().to_string()]);
    let html = read(&folder.join("report.html"));
    let (first, rest) = html.split_once("</header>").unwrap();
    for part in [
        "B-17, operator K, 3 November",
        "Explained by: load_misalignment.",
        "0.331 \u{b1} 0.012",
        "0.340 \u{b1} 0.030",
        "700 N",
        "45, -45, 0, 0, -45, 45",
        "Measure the offset between the grips.",
    ] {
        assert!(
            first.contains(part),
            "{part} is missing on the first screen"
        );
    }
    assert!(!first.contains("<details"));
    assert!(rest.matches("<details").count() >= 8 && !rest.contains("<section"));
    assert!(
        rest.contains("Probability 0.000: hole_size"),
        "one line for what is excluded"
    );
}
