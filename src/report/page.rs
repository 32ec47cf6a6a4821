//! Everything a report shows: the numbers of `report.json`, the manifest, the truth where it is known, and the figures'
//! sheets. A page is gathered from rounds, or read back from a run's folder; both give the same `report.html`.

use std::path::Path;

use serde_json::Value;

use super::figures;
use super::gather::{known, sheets};
use super::html;
use super::sheet::{Sheet, exact};
use crate::error::{Error, Result};
use crate::files;
use crate::identify::Identification;

/// What a report shows.
#[derive(Debug, Clone)]
pub struct Page {
    /// `report.json`.
    pub report: Value,
    /// `run.json`.
    pub manifest: Value,
    /// `truth.json` of simulated data.
    pub truth: Option<Value>,
    /// What figures are drawn from.
    pub sheets: Vec<Sheet>,
}

/// The folder of figures in a run's folder.
pub const FIGURES: &str = "figures";

impl Page {
    /// A page of rounds. `report` is what `report.json` says of them, `manifest` what `run.json` says, `truth` what
    /// `truth.json` beside the data says, if they are simulated.
    pub fn gather(
        rounds: &[&Identification],
        report: Value,
        manifest: Value,
        truth: Option<Value>,
    ) -> Self {
        let sheets = sheets(rounds, truth.as_ref());
        Self::complete(report, manifest, truth, sheets)
    }

    /// The page of a finished run, from the files in its folder.
    ///
    /// # Errors
    /// The input's fault, with the file, if one is missing or cannot be read.
    pub fn load(folder: &Path) -> Result<Self> {
        let json = |name: &str| -> Result<Value> {
            let path = folder.join(name);
            let text = std::fs::read_to_string(&path).map_err(|e| {
                Error::input(path.display(), "a file of a finished run")
                    .found(e)
                    .hint("give the folder of a run, for example runs/openhole")
            })?;
            serde_json::from_str(&text)
                .map_err(|e| Error::input(path.display(), "valid JSON").found(e))
        };
        let report = json("report.json")?;
        let schema = report.get("schema").and_then(Value::as_str);
        if schema != Some(super::numbers::SCHEMA) {
            return Err(Error::input(
                folder.join("report.json").display(),
                format!("\"schema\": \"{}\"", super::numbers::SCHEMA),
            )
            .found(schema.unwrap_or("no schema")));
        }
        let truth = folder
            .join("truth.json")
            .is_file()
            .then(|| json("truth.json"));
        let figures = folder.join(FIGURES);
        let mut paths: Vec<_> = std::fs::read_dir(&figures)
            .map_err(|e| Error::input(figures.display(), "the folder of a run's figures").found(e))?
            .filter_map(|entry| entry.ok().map(|e| e.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "csv"))
            .collect();
        paths.sort();
        let sheets = paths
            .iter()
            .map(|path| Sheet::read(path))
            .collect::<Result<Vec<_>>>()?;
        let manifest = json("run.json")?;
        Ok(Self::complete(report, manifest, truth.transpose()?, sheets))
    }

    /// Add the sheets that say no more than the report's numbers.
    fn complete(
        report: Value,
        manifest: Value,
        truth: Option<Value>,
        mut sheets: Vec<Sheet>,
    ) -> Self {
        let derived = |s: &Sheet| {
            ["intervals", "blind-spots"].contains(&s.name.as_str())
                || s.name.starts_with("candidates-")
                || s.name.starts_with("variogram-")
                || s.name.starts_with("breakdown-")
        };
        sheets.retain(|s| !derived(s));
        let mut page = Self {
            report,
            manifest,
            truth,
            sheets,
        };
        let mut more = vec![page.intervals(), page.blind_spots()];
        for k in 0..page.rounds().len() {
            more.extend([page.candidates(k), page.variogram(k), page.breakdown(k)]);
        }
        page.sheets
            .extend(more.into_iter().filter(|s| !s.rows.is_empty()));
        page
    }

    /// The sheet called `name`.
    pub fn sheet(&self, name: &str) -> Option<&Sheet> {
        self.sheets.iter().find(|s| s.name == name)
    }

    /// The report's rounds.
    pub fn rounds(&self) -> &[Value] {
        self.report
            .get("rounds")
            .and_then(Value::as_array)
            .map_or(&[], Vec::as_slice)
    }

    /// The elastic constants: sampled parameters that are no effect's amplitude, and not the noise.
    pub fn constants(&self) -> Vec<String> {
        let first = self.rounds().first().and_then(|r| r.get("posterior"));
        first
            .and_then(Value::as_object)
            .into_iter()
            .flatten()
            .map(|(name, _)| name.clone())
            .filter(|name| !name.contains('.') && name != crate::infer::NOISE)
            .collect()
    }

    /// The true value of a parameter, if it is known.
    pub fn true_value(&self, name: &str) -> Option<f64> {
        self.truth.as_ref().and_then(|t| known(t, name))
    }

    /// Write figures, their numbers, and `report.html` into a run's folder. With `png` the figures are written as PNG too.
    ///
    /// # Errors
    /// The input's fault if a file cannot be written; the program's if a figure cannot be drawn.
    pub fn write(&self, folder: &Path, png: bool) -> Result<()> {
        let into = folder.join(FIGURES);
        std::fs::create_dir_all(&into)
            .map_err(|e| Error::input(into.display(), "a folder that can be written").found(e))?;
        for sheet in &self.sheets {
            sheet.write(&into)?;
        }
        let figures = figures::all(self)?;
        for figure in figures.files() {
            let path = into.join(format!("{}.svg", figure.name));
            files::replace(&path, figure.file())?;
            if png {
                let path = path.with_extension("png");
                files::replace(&path, figures::png(figure)?)?;
            }
        }
        if let Some(truth) = &self.truth {
            let path = folder.join("truth.json");
            files::replace(&path, format!("{truth:#}\n"))?;
        }
        let path = folder.join("report.html");
        files::replace(&path, html::report(self, &figures))
    }

    /// Constants with 95 % intervals: prior, each round's posterior, averaged posterior.
    fn intervals(&self) -> Sheet {
        let mut sheet = Sheet::new(
            "intervals",
            &["parameter", "what", "mean", "low", "high", "truth"],
        );
        let priors = self.sheet("parameters-0");
        for name in self.constants() {
            let truth = self.true_value(&name).map_or(String::new(), exact);
            let mut add = |what: String, values: [f64; 3]| {
                let mut row = vec![name.clone(), what];
                row.extend(values.map(exact));
                row.push(truth.clone());
                sheet.rows.push(row);
            };
            if let Some(prior) = priors.map(|s| s.only("parameter", &name)) {
                let (mean, sd) = (prior.numbers("prior_mean"), prior.numbers("prior_sd"));
                if let (Some(m), Some(s)) = (mean.first(), sd.first()) {
                    add("prior".into(), [*m, m - 1.96 * s, m + 1.96 * s]);
                }
            }
            for (k, round) in self.rounds().iter().enumerate() {
                if let Some(values) = three(&round["posterior"][&name]) {
                    add(format!("round {k}"), values);
                }
            }
            if let Some(values) = three(&self.report["averaged_posterior"][&name]) {
                add("averaged".into(), values);
            }
        }
        sheet
    }

    fn blind_spots(&self) -> Sheet {
        let constants = self.constants();
        let mut header = vec!["effect", "plausible", "unit", "would_be_seen"];
        let shifts: Vec<String> = constants
            .iter()
            .map(|c| format!("{c}_shift_percent"))
            .collect();
        header.extend(shifts.iter().map(String::as_str));
        let mut sheet = Sheet::new("blind-spots", &header);
        for spot in self.report["blind_spots"].as_array().into_iter().flatten() {
            let mut row = vec![
                effect_name(spot),
                spot["plausible"].as_f64().map_or(String::new(), exact),
                words(&spot["unit"]),
                yes(&spot["would_be_seen"]).into(),
            ];
            row.extend(constants.iter().map(|c| {
                let shift = spot["shift_in_percent"][c].as_f64();
                shift.map_or(String::new(), exact)
            }));
            sheet.rows.push(row);
        }
        sheet
    }

    fn variogram(&self, k: usize) -> Sheet {
        let keys = ["distance_mm", "u1_nm2", "u2_nm2"];
        let mut sheet = Sheet::new(format!("variogram-{k}"), &keys);
        let lags = self.rounds()[k]["residual"]["variogram"].as_array();
        for lag in lags.into_iter().flatten() {
            let cell = |key: &str| lag[key].as_f64().map_or(String::new(), exact);
            sheet.rows.push(keys.map(cell).to_vec());
        }
        sheet
    }

    /// RMS of the residual's block averages in rings about the hole and in quadrants.
    fn breakdown(&self, k: usize) -> Sheet {
        let mut sheet = Sheet::new(format!("breakdown-{k}"), &["place", "u1_nm", "u2_nm"]);
        let residual = &self.rounds()[k]["residual"];
        let mut add = |place: String, values: [&Value; 2]| {
            let cells = values.map(|v| v.as_f64().map_or(String::new(), exact));
            sheet.rows.push([vec![place], cells.to_vec()].concat());
        };
        let mut inner = None;
        for ring in residual["rings"].as_array().into_iter().flatten() {
            let outer = ring["to_radius_mm"].as_f64().unwrap_or(f64::NAN);
            let place = match inner {
                None => format!("up to {outer:.1} mm"),
                Some(inner) => format!("{inner:.1} to {outer:.1} mm"),
            };
            add(place, [&ring["u1_nm"], &ring["u2_nm"]]);
            inner = Some(outer);
        }
        let quadrants = residual["quadrants_nm"].as_array().into_iter().flatten();
        for (signs, quadrant) in QUADRANTS.iter().zip(quadrants) {
            add((*signs).into(), [&quadrant["u1"], &quadrant["u2"]]);
        }
        sheet
    }

    fn candidates(&self, k: usize) -> Sheet {
        let mut sheet = Sheet::new(
            format!("candidates-{k}"),
            &[
                "effect",
                "inclusion_probability",
                "log_bayes_factor",
                "explained_fraction",
                "detectable",
                "accepted",
            ],
        );
        let round = &self.rounds()[k];
        let accepted = round["accepted"].as_array();
        for found in round["candidates"].as_array().into_iter().flatten() {
            let number = |key: &str| found[key].as_f64().map_or(String::new(), exact);
            let taken = accepted.is_some_and(|a| a.contains(&found["effect"]));
            sheet.rows.push(vec![
                words(&found["effect"]),
                number("inclusion_probability"),
                number("log_bayes_factor"),
                number("explained_fraction"),
                number("detectable"),
                if taken { "yes" } else { "no" }.into(),
            ]);
        }
        sheet
    }
}

/// Quadrants about the hole by the signs of direction 1, along the load, and direction 2, in the order of `quadrants_nm`.
const QUADRANTS: [&str; 4] = [
    "+1, +2 quadrant",
    "\u{2212}1, +2 quadrant",
    "\u{2212}1, \u{2212}2 quadrant",
    "+1, \u{2212}2 quadrant",
];

/// Mean and 95 % interval of a posterior's entry.
fn three(entry: &Value) -> Option<[f64; 3]> {
    let number = |key: &str| entry.get(key).and_then(Value::as_f64);
    Some([number("mean")?, number("q2.5")?, number("q97.5")?])
}

/// A text of the report, without quotes; empty if it is none.
pub fn words(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_string()
}

/// The effect of a blind spot, with its parameter where it is given and does not stand in the name.
pub fn effect_name(spot: &Value) -> String {
    let effect = words(&spot["effect"]);
    match spot["parameter"].as_str() {
        Some(p) if p.starts_with(&effect) => p.to_string(),
        Some(p) => format!("{effect}.{p}"),
        None => effect,
    }
}

fn yes(value: &Value) -> &'static str {
    if value.as_bool() == Some(true) {
        "yes"
    } else {
        "no"
    }
}
