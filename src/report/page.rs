//! Everything a report shows: `report.json`, the manifest, the truth where it is known, and what the figures are drawn from.
//! A page is gathered from rounds, or read back from a run's folder; both give the same `report.html`.

use std::path::Path;

use super::document::Report;
use super::manifest::{KnownTruth, Manifest};
use super::numbers::{FigureData, IntervalLine};
use crate::error::{Error, Result};
use crate::identify::Identification;
use crate::section::{Digits, TableCell};
use crate::trace::{Closed, ToQuote};

#[derive(Debug)]
pub struct Page {
    pub report: Report,
    pub manifest: Manifest,
    /// `truth.json` of simulated data.
    pub truth: KnownTruth,
    /// What figures are drawn from beside the report, by round.
    pub figures: Vec<FigureData>,
    /// The same of the posterior to quote, where it was sampled.
    pub quoted: FigureData,
}

/// What the figures of rounds are drawn from: the mesh of all rounds is one, which the first keeps.
fn of_rounds(rounds: impl Iterator<Item = FigureData>) -> Vec<FigureData> {
    let mut figures: Vec<FigureData> = rounds.map(FigureData::rounded).collect();
    for later in figures.iter_mut().skip(1) {
        later.mesh = Vec::new();
    }
    figures
}

/// Parameters in a corner plot, at most: more cannot be read.
pub const AXES: usize = 10;

/// What tables and figures of the posterior to quote are called.
pub(super) const AVERAGED: &str = "averaged";

/// The folder of figures in a run's folder.
pub const FIGURES: &str = "figures";

impl Page {
    /// A page of rounds, which `report` is of.
    pub fn gather(
        rounds: &[Identification],
        report: Report,
        manifest: Manifest,
        truth: KnownTruth,
    ) -> Self {
        let figures = rounds.iter().map(|r| FigureData::gather(r, &truth));
        Self {
            figures: of_rounds(figures),
            quoted: FigureData::default(),
            report,
            manifest,
            truth,
        }
    }

    /// A page of the rounds of a loop, which `report` is of.
    pub fn closed(closed: &Closed, report: Report, manifest: Manifest, truth: KnownTruth) -> Self {
        let figures = closed.rounds.iter().map(|r| FigureData::traced(r, &truth));
        let summary = report.closing.as_ref().and_then(|c| c.quoted.as_ref());
        let sampled = match &closed.to_quote {
            ToQuote::Sampled(sampled) => Some(sampled),
            ToQuote::ClosedForm(_) => None,
        };
        let quoted = sampled.zip(summary).map(|(sampled, summary)| {
            FigureData::quoted(&sampled.draws, &summary.leading(AXES), &truth).rounded()
        });
        Self {
            figures: of_rounds(figures),
            quoted: quoted.unwrap_or_default(),
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

    /// The result for a constant, mean, sd and the ends of the 95 % interval: averaged over what may act unseen, of a run that did not look for
    /// causes the model's own.
    pub fn to_quote(&self, name: &str) -> Option<[f64; 4]> {
        if let Some(i) = self.report.averaged(name) {
            return Some([i.mean, i.sd, i.low, i.high]);
        }
        let p = self.report.last()?.posterior.get(name)?;
        Some([p.mean, p.sd, p.low, p.high])
    }

    /// The true value of a parameter, if it is known.
    pub fn true_value(&self, name: &str) -> Option<f64> {
        self.truth.of(name)
    }

    pub fn truth_cell(&self, name: &str) -> TableCell {
        let truth = self.true_value(name);
        truth.map_or(TableCell::Blank, |t| TableCell::number(t, Digits::Whole))
    }

    /// Mean and sd of a parameter's prior in round `k`.
    pub fn prior(&self, k: usize, name: &str) -> Option<[f64; 2]> {
        let line = self
            .figures
            .get(k)?
            .parameters
            .iter()
            .find(|p| p.parameter == name)?;
        Some([line.prior_mean, line.prior_sd]).filter(|[mean, _]| mean.is_finite())
    }

    /// How far a parameter's posterior mean lies from its prior's in round `k`, prior sds.
    pub fn from_prior(&self, k: usize, name: &str) -> Option<f64> {
        let [mean, sd] = self.prior(k, name)?;
        Some((self.report.rounds.get(k)?.posterior.get(name)?.mean - mean) / sd)
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
                    truth: self.true_value(name).unwrap_or(f64::NAN),
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
}
