//! What is said of a population: `population.json`.

use serde::{Deserialize, Serialize};

use super::density::common;
use super::sampled::Sampled;
use super::specimen::{LEAST_LEFT, Specimen};
use super::unlike::Unlike;
use crate::diagnose::{Row, mcse_quantile, mean, sd, sorted};
use crate::error::{Error, Result};
use crate::files::Keyed;
use crate::numeric::quantile;

/// The schema of `population.json`.
pub const SCHEMA: &str = "plychain-population/1";

/// `population.json`. Constants are in the units of their names.
#[derive(Debug, Serialize, Deserialize)]
pub struct PopulationReport {
    pub schema: String,
    pub name: String,
    pub version: String,
    pub seed: u64,
    /// Relative sd of a scale of all moduli that all specimens share, percent; in the means and percentiles, not in the specimens.
    pub shared_percent: f64,
    pub constants: Keyed<OfConstant>,
    /// By `correlation_` and the two constants.
    pub correlations: Keyed<Estimate>,
    /// By run.
    pub specimens: Keyed<OfSpecimen>,
    /// Runs that are not among the specimens, with the reason.
    pub left_out: Keyed<String>,
    pub converged: bool,
    pub convergence: String,
    pub warnings: Vec<String>,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Estimate {
    pub mean: f64,
    pub sd: f64,
    /// Ends of the 95 % interval.
    pub low: f64,
    pub high: f64,
}

/// A constant over the population.
#[derive(Debug, Serialize, Deserialize)]
pub struct OfConstant {
    /// Prior of the runs, mean and sd.
    #[serde(default)]
    pub prior: [f64; 2],
    /// 1 - sd^2 / prior sd^2 of a specimen's own posterior, the median over specimens: 0 where the data said nothing.
    #[serde(default)]
    pub from_data: f64,
    pub mean: Estimate,
    /// Between specimens.
    pub sd: Estimate,
    pub a_basis: Basis,
    pub b_basis: Basis,
}

/// A tolerance bound: above it lies, with 95 % confidence, the share of the population that its name asks (A 99 %, B 90 %).
#[derive(Debug, Serialize, Deserialize)]
pub struct Basis {
    /// 5 % quantile of the percentile's posterior.
    pub value: f64,
    /// Standard error of the value, as it was sampled.
    pub mcse: f64,
    /// The 1st or 10th percentile of the population.
    pub percentile: Estimate,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct OfSpecimen {
    /// Alone, without its prior: mean and sd by constant.
    pub alone: Keyed<[f64; 2]>,
    /// Given all specimens.
    pub shrunken: Keyed<Estimate>,
    /// Share of its draws that is left in effect when the prior is divided out.
    pub draws_left: f64,
}

impl Estimate {
    fn of_row(row: &Row) -> Self {
        Self {
            mean: row.mean,
            sd: row.sd,
            low: row.low,
            high: row.high,
        }
    }

    fn of_values(values: &[f64]) -> Self {
        let sorted = sorted(values);
        Self {
            mean: mean(values),
            sd: sd(values),
            low: quantile(&sorted, 0.025),
            high: quantile(&sorted, 0.975),
        }
    }
}

/// Fewer specimens are warned of: their bounds rest on the form of the distribution and on few values.
const FEW: usize = 18;

/// Confidence of a bound.
const BELOW: f64 = 0.05;

impl PopulationReport {
    /// # Errors
    /// The program's fault: draws without a constant's columns.
    pub fn new(
        name: &str,
        (seed, shared): (u64, f64),
        sampled: &Sampled,
        specimens: &[Specimen],
    ) -> Result<Self> {
        let of = |constant: &String| {
            let found = of_constant((sampled, specimens), constant)?;
            Ok((constant.clone(), found))
        };
        let correlations = sampled.verdict.rows.iter();
        let correlations = correlations.filter(|r| r.name.starts_with("correlation_"));
        let pairs = specimens.iter().zip(&sampled.shrunken);
        Ok(Self {
            schema: SCHEMA.into(),
            name: name.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            seed,
            shared_percent: 100.0 * shared,
            constants: sampled.constants.iter().map(of).collect::<Result<_>>()?,
            correlations: correlations
                .map(|r| (r.name.clone(), Estimate::of_row(r)))
                .collect(),
            specimens: pairs
                .map(|(s, draws)| (s.name.clone(), of_specimen(s, draws)))
                .collect(),
            left_out: Keyed::new(),
            converged: sampled.verdict.converged,
            convergence: sampled.verdict.line(),
            warnings: warnings(specimens, shared),
        })
    }

    /// Say of specimens that are unlike the others that they are counted, and what the basis values are `without` them, where enough others are
    /// left.
    pub fn say_unlike(&mut self, unlike: &[Unlike], without: Option<&Self>) {
        let names: Vec<&str> = unlike.iter().map(|u| u.specimen.as_str()).collect();
        let options: Vec<String> = names.iter().map(|n| format!("--leave-out {n}")).collect();
        for found in unlike {
            let constant = &found.constant;
            let of = |report: &Self| {
                let c = report.constants.get(constant)?;
                let (b, a) = (c.b_basis.value, c.a_basis.value);
                Some(format!("B {b:.4}, A {a:.4}"))
            };
            let with = of(self).unwrap_or_default();
            let without = without.and_then(of).map_or_else(
                || "too few specimens are left without it to give others".into(),
                |values| format!("without {}: {values}", names.join(", ")),
            );
            self.warnings.push(format!(
                "{}. It is counted in all values. Basis values of {constant} with it: {with}; {without}. If it was damaged or is of another material: {}",
                found.words(),
                options.join(" ")
            ));
        }
    }
}

/// Prior of a constant in the first run, and the median over specimens of what their data added to theirs. A specimen's likelihood has no prior:
/// with it the variances add as precisions.
fn learned(specimens: &[Specimen], constant: &str) -> ([f64; 2], f64) {
    let own = specimens.iter().filter_map(|s| {
        let k = s.constants.iter().position(|c| c == constant)?;
        let prior = s.priors[k];
        let variance = s.covariance[(k, k)];
        Some((prior, prior[1].powi(2) / (prior[1].powi(2) + variance)))
    });
    let own: Vec<([f64; 2], f64)> = own.collect();
    let shares: Vec<f64> = own.iter().map(|o| o.1).collect();
    let prior = own.first().map_or([f64::NAN; 2], |o| o.0);
    (prior, quantile(&sorted(&shares), 0.5))
}

fn of_constant(
    (sampled, specimens): (&Sampled, &[Specimen]),
    constant: &str,
) -> Result<OfConstant> {
    let (prior, from_data) = learned(specimens, constant);
    let missing = || Error::program("population", format!("a column of {constant}"));
    let row = |what: &str| {
        let name = format!("{what}_{constant}");
        let mut rows = sampled.verdict.rows.iter();
        rows.find(|r| r.name == name).ok_or_else(missing)
    };
    let basis = |what: &str| -> Result<Basis> {
        let row = row(what)?;
        let at = sampled.draws.index(&row.name).ok_or_else(missing)?;
        let series = sampled.draws.series(at);
        Ok(Basis {
            value: quantile(&sorted(&series.values), BELOW),
            mcse: mcse_quantile(&series, BELOW),
            percentile: Estimate::of_row(row),
        })
    };
    Ok(OfConstant {
        prior,
        from_data,
        mean: Estimate::of_row(row("mean")?),
        sd: Estimate::of_row(row("sd")?),
        a_basis: basis("percentile_1")?,
        b_basis: basis("percentile_10")?,
    })
}

fn of_specimen(specimen: &Specimen, draws: &[Vec<f64>]) -> OfSpecimen {
    let names = || specimen.constants.iter().cloned().enumerate();
    let alone = |k: usize| [specimen.mean[k], specimen.covariance[(k, k)].sqrt()];
    OfSpecimen {
        alone: names().map(|(k, c)| (c, alone(k))).collect(),
        shrunken: names()
            .map(|(k, c)| (c, Estimate::of_values(&draws[k])))
            .collect(),
        draws_left: specimen.left,
    }
}

fn warnings(specimens: &[Specimen], shared: f64) -> Vec<String> {
    let mut all = Vec::new();
    if specimens.len() < FEW {
        all.push(format!(
            "{} specimens: the basis values rest on the normal form of the distribution. Handbooks ask for {FEW} at least.",
            specimens.len()
        ));
    }
    for s in specimens.iter().filter(|s| s.left < LEAST_LEFT) {
        all.push(format!(
            "{}: without its prior {:.0} % of its draws are left in effect: its data say little of some constant, and are taken as a normal likelihood",
            s.name,
            100.0 * s.left
        ));
    }
    if common(specimens).is_none() {
        all.push("the runs have different priors of the constants: none is given to the means of the population".into());
    }
    if shared == 0.0 {
        all.push(
            "An error that all specimens share (load cell, camera, thickness gauge, batch) does not show between them. It moves the population's mean. --shared-percent counts a scale of all moduli."
                .into(),
        );
    }
    all
}
