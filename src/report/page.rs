//! Everything a report shows: `report.json`, the manifest, the truth where it is known, and what the figures are drawn from.
//! A page is gathered from rounds, or read back from a run's folder; both give the same `report.html`.

use std::path::Path;

use serde::Serialize;

use super::document::Report;
use super::figures::{self, FigureData, data};
use super::html;
use super::manifest::{KnownTruth, Manifest};
use super::residual::{ByComponent, ResidualReport};
use crate::error::{Error, Result};
use crate::files;
use crate::identify::Identification;
use crate::trace::{Closed, ToQuote};

#[derive(Debug, Clone)]
pub struct Page {
    pub report: Report,
    pub manifest: Manifest,
    /// `truth.json` of simulated data.
    pub truth: Option<KnownTruth>,
    /// What figures are drawn from beside the report, by round.
    pub figures: Vec<FigureData>,
    /// The same of the posterior to quote, where it was sampled.
    pub quoted: FigureData,
}

/// The mesh of all rounds is one.
fn keep_first_mesh(figures: &mut [FigureData]) {
    for later in figures.iter_mut().skip(1) {
        later.mesh = Vec::new();
    }
}

/// What tables and figures of the posterior to quote are called.
const AVERAGED: &str = "averaged";

/// The folder of figures in a run's folder.
pub const FIGURES: &str = "figures";

impl Page {
    /// A page of rounds, which `report` is of.
    pub fn gather(
        rounds: &[&Identification],
        report: Report,
        manifest: Manifest,
        truth: Option<KnownTruth>,
    ) -> Self {
        let gather = |round: &&Identification| FigureData::gather(round, truth.as_ref());
        let mut figures: Vec<FigureData> = rounds.iter().map(gather).collect();
        keep_first_mesh(&mut figures);
        Self {
            report,
            manifest,
            truth,
            figures,
            quoted: FigureData::default(),
        }
    }

    /// A page of the rounds of a loop, which `report` is of.
    pub fn closed(
        closed: &Closed,
        report: Report,
        manifest: Manifest,
        truth: Option<KnownTruth>,
    ) -> Self {
        let rounds = closed.rounds.iter();
        let summary = report.closing.as_ref().and_then(|c| c.quoted.as_ref());
        let sampled = match &closed.to_quote {
            ToQuote::Sampled(sampled) => Some(sampled),
            ToQuote::ClosedForm(_) => None,
        };
        let quoted = sampled.zip(summary).map(|(sampled, summary)| {
            FigureData::quoted(
                &sampled.draws,
                &summary.leading(figures::AXES),
                truth.as_ref(),
            )
        });
        let mut figures: Vec<FigureData> = rounds
            .map(|r| FigureData::traced(r, truth.as_ref()))
            .collect();
        keep_first_mesh(&mut figures);
        Self {
            quoted: quoted.unwrap_or_default(),
            figures,
            report,
            manifest,
            truth,
        }
    }

    /// The page of a finished run, from the files in its folder.
    ///
    /// # Errors
    /// The input's fault, with the file and the key or line, if one is missing or cannot be read.
    pub fn load(folder: &Path) -> Result<Self> {
        let report = Report::load(folder)?;
        let manifest = Manifest::load(folder)?;
        let truth = KnownTruth::load(folder)?;
        let figures = folder.join(FIGURES);
        if !figures.is_dir() {
            return Err(Error::input(
                figures.display(),
                "the folder of a run's figures",
            ));
        }
        let rounds = 0..report.rounds.len();
        let figures = rounds
            .map(|k| FigureData::read(&figures, &k.to_string()))
            .collect::<Result<_>>()?;
        Ok(Self {
            quoted: FigureData::read(&folder.join(FIGURES), AVERAGED)?,
            report,
            manifest,
            truth,
            figures,
        })
    }

    pub fn constants(&self) -> Vec<&str> {
        let first = self.report.rounds.first();
        first.into_iter().flat_map(|r| r.constants()).collect()
    }

    /// The true value of a parameter, if it is known.
    pub fn true_value(&self, name: &str) -> Option<f64> {
        self.truth.as_ref().and_then(|t| t.of(name))
    }

    /// Mean and sd of a parameter's prior in round `k`.
    pub fn prior(&self, k: usize, name: &str) -> Option<[f64; 2]> {
        let line = self
            .figures
            .get(k)?
            .parameters
            .iter()
            .find(|p| p.parameter == name)?;
        Some([line.prior_mean?, line.prior_sd?])
    }

    /// How far a parameter's posterior mean lies from its prior's in round `k`, prior sds.
    pub fn from_prior(&self, k: usize, name: &str) -> Option<f64> {
        let [mean, sd] = self.prior(k, name)?;
        Some((self.report.rounds.get(k)?.posterior.get(name)?.mean - mean) / sd)
    }

    /// Write figures, their numbers, and `report.html` into a run's folder. With `png` the figures are written as PNG too, where
    /// the feature `png` is built in.
    ///
    /// # Errors
    /// The input's fault if a file cannot be written; the program's if a figure cannot be drawn.
    pub fn write(&self, folder: &Path, png: bool) -> Result<()> {
        let into = folder.join(FIGURES);
        std::fs::create_dir_all(&into)
            .map_err(|e| Error::input(into.display(), "a folder that can be written").found(e))?;
        self.write_tables(&into)?;
        let figures = figures::all(self)?;
        for figure in figures.files() {
            let path = into.join(format!("{}.svg", figure.name));
            files::replace(&path, figure.file())?;
            if png {
                files::replace(&path.with_extension("png"), figures::png(figure)?)?;
            }
        }
        if let Some(truth) = &self.truth {
            files::write_json(&folder.join("truth.json"), truth)?;
        }
        let path = folder.join("report.html");
        files::replace(&path, html::report(self, &figures))
    }

    fn write_tables(&self, into: &Path) -> Result<()> {
        for (k, tables) in self.figures.iter().enumerate() {
            tables.write(into, &k.to_string())?;
        }
        self.quoted.write(into, AVERAGED)?;
        data::write(into, "intervals", &self.intervals())?;
        data::write(into, "blind-spots", &self.blind_spots())?;
        for (k, round) in self.report.rounds.iter().enumerate() {
            let residual = &round.residual;
            data::write(into, &format!("variogram-{k}"), &residual.variogram)?;
            data::write(into, &format!("breakdown-{k}"), &places(residual))?;
            let candidates = round.tracing.iter().flat_map(|t| {
                t.candidates.iter().map(|c| CandidateLine {
                    effect: &c.effect,
                    inclusion_probability: c.inclusion_probability,
                    log_bayes_factor: c.log_bayes_factor,
                    explained_fraction: c.explained_fraction,
                    detectable: c.detectable,
                    accepted: yes(t.accepted.contains(&c.effect)),
                })
            });
            data::write(
                into,
                &format!("candidates-{k}"),
                &candidates.collect::<Vec<_>>(),
            )?;
        }
        Ok(())
    }

    /// Constants with 95 % intervals: prior, each round's posterior, averaged posterior.
    pub fn intervals(&self) -> Vec<IntervalLine> {
        let mut lines = Vec::new();
        for name in self.constants() {
            let mut add = |what: &str, [mean, low, high]: [f64; 3]| {
                lines.push(IntervalLine {
                    parameter: name.into(),
                    what: what.into(),
                    mean,
                    low,
                    high,
                    truth: self.true_value(name),
                });
            };
            if let Some([m, s]) = self.prior(0, name) {
                add("prior", [m, m - 1.96 * s, m + 1.96 * s]);
            }
            for (k, round) in self.report.rounds.iter().enumerate() {
                if let Some(p) = round.posterior.get(name) {
                    add(&format!("round {k}"), [p.mean, p.low, p.high]);
                }
            }
            if let Some(a) = self.report.averaged(name) {
                add("averaged", [a.mean, a.low, a.high]);
            }
        }
        lines
    }

    /// Header and rows.
    fn blind_spots(&self) -> Vec<Vec<String>> {
        let spots = self.report.blind_spots().iter();
        let constants = self.constants();
        let header = ["effect", "plausible", "unit", "would_be_seen"].map(String::from);
        let shifts = constants.iter().map(|c| format!("{c}_shift_percent"));
        let mut rows = vec![header.into_iter().chain(shifts).collect()];
        rows.extend(spots.map(|spot| {
            let shifts = constants.iter().map(|c| spot.shift(c));
            [
                spot.name(),
                format!("{:?}", spot.plausible),
                spot.unit.clone(),
            ]
            .into_iter()
            .chain([yes(spot.would_be_seen).into()])
            .chain(shifts.map(|s| s.map_or(String::new(), |s| format!("{s:?}"))))
            .collect()
        }));
        rows.truncate(if rows.len() > 1 { usize::MAX } else { 0 });
        rows
    }
}

fn yes(answer: bool) -> &'static str {
    if answer { "yes" } else { "no" }
}

/// A 95 % interval of a constant, border units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IntervalLine {
    pub parameter: String,
    /// Whose interval it is.
    pub what: String,
    pub mean: f64,
    pub low: f64,
    pub high: f64,
    /// The true value, where it is known.
    pub truth: Option<f64>,
}

#[derive(Serialize)]
struct CandidateLine<'a> {
    effect: &'a str,
    inclusion_probability: f64,
    log_bayes_factor: Option<f64>,
    explained_fraction: Option<f64>,
    detectable: Option<f64>,
    accepted: &'static str,
}

/// RMS of the block averages of a residual somewhere.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlaceRms {
    pub place: String,
    pub u1_nm: f64,
    pub u2_nm: f64,
}

/// Quadrants about the hole by the signs of direction 1, along the load, and direction 2, in the order of `quadrants_nm`.
const QUADRANTS: [&str; 4] = [
    "+1, +2 quadrant",
    "\u{2212}1, +2 quadrant",
    "\u{2212}1, \u{2212}2 quadrant",
    "+1, \u{2212}2 quadrant",
];

/// A residual in rings about the hole and in quadrants.
pub fn places(residual: &ResidualReport) -> Vec<PlaceRms> {
    let mut inner = None;
    let rings = residual.rings.iter().map(|ring| {
        let outer = ring.to_radius_mm;
        let place = match inner.replace(outer) {
            None => format!("up to {outer:.1} mm"),
            Some(inner) => format!("{inner:.1} to {outer:.1} mm"),
        };
        (place, ByComponent::from([ring.u1_nm, ring.u2_nm]))
    });
    let mut places: Vec<_> = rings.collect();
    let quadrants = QUADRANTS.iter().zip(&residual.quadrants_nm);
    places.extend(quadrants.map(|(name, q)| ((*name).to_string(), *q)));
    let line = |(place, ByComponent { u1, u2 })| PlaceRms {
        place,
        u1_nm: u1,
        u2_nm: u2,
    };
    places.into_iter().map(line).collect()
}
