//! The verdict: numbers of every parameter, what is not converged in words, and the rule that stops a run.

use std::fmt;

use rayon::prelude::*;

use serde::{Deserialize, Serialize};

use super::FEWEST;
use super::ess::{ess_bulk, ess_tail};
use super::mcse::{mcse_mean, mcse_quantile, mcse_sd};
use super::rhat::rhat;
use super::tau::{tau, tau_error};
use super::transform::{mean, sd, sorted};
use super::transitions::transitions;
use crate::chain::{Draws, ScalarDraws};
use crate::numeric::quantile;
use crate::sample::Stop;

/// Acceptance rate below which a chain counts as stuck.
const STUCK: f64 = 1e-3;

/// When draws are good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    /// R-hat must be below this.
    pub rhat: f64,
    /// Bulk and tail ESS must reach this for each independent ensemble (or chain).
    pub ess: f64,
    /// The run must be this many tau long.
    pub lengths: f64,
    /// tau may change by this fraction over the last twentieth of the run.
    pub tau_change: f64,
}

impl Default for Rule {
    fn default() -> Self {
        Self {
            rhat: 1.01,
            ess: 100.0,
            lengths: 50.0,
            tau_change: 0.01,
        }
    }
}

/// The figures of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name with its unit.
    pub name: String,
    pub mean: f64,
    pub sd: f64,
    /// 2.5 % quantile.
    pub low: f64,
    pub median: f64,
    /// 97.5 % quantile.
    pub high: f64,
    /// Monte Carlo standard error of the mean.
    pub mcse_mean: f64,
    /// Monte Carlo standard error of the sd.
    pub mcse_sd: f64,
    /// Monte Carlo standard errors of the three quantiles.
    pub mcse_quantiles: [f64; 3],
    /// R-hat across independent ensembles.
    pub rhat: f64,
    /// Effective draws for the bulk.
    pub ess_bulk: f64,
    /// Effective draws for the tails.
    pub ess_tail: f64,
    /// Autocorrelation time of a walker, in stored draws.
    pub tau: f64,
    /// Relative change of tau over the last twentieth of the run.
    pub tau_change: f64,
    /// Relative standard error of tau itself.
    pub tau_error: f64,
}

/// What a run's draws are worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Whether the rule is satisfied by every parameter.
    pub converged: bool,
    /// What is not converged, one reason each; empty if converged.
    pub reasons: Vec<String>,
    /// One row a parameter.
    pub rows: Vec<Row>,
    /// Shape of the draws: independent ensembles, chains, draws a chain.
    pub shape: [usize; 3],
}

impl Verdict {
    /// Largest R-hat; NaN if any is.
    pub fn rhat_max(&self) -> f64 {
        worst(self.rows.iter().map(|r| r.rhat), f64::max)
    }

    /// Smallest bulk ESS; NaN if any is.
    pub fn ess_bulk_min(&self) -> f64 {
        worst(self.rows.iter().map(|r| r.ess_bulk), f64::min)
    }

    /// Smallest tail ESS; NaN if any is.
    pub fn ess_tail_min(&self) -> f64 {
        worst(self.rows.iter().map(|r| r.ess_tail), f64::min)
    }

    /// Largest autocorrelation time, in stored draws; NaN if any is.
    pub fn tau_max(&self) -> f64 {
        worst(self.rows.iter().map(|r| r.tau), f64::max)
    }

    pub fn line(&self) -> String {
        let [ensembles, chains, draws] = self.shape;
        let shape = format!("{ensembles} independent ensembles, {chains} chains x {draws} draws");
        if self.converged {
            // what has no figure here was excused: a choice that is always, or hardly ever, made
            let known = |figure: fn(&Row) -> f64, pick: fn(f64, f64) -> f64| {
                let figures = self.rows.iter().map(figure);
                worst(figures.filter(|f| !f.is_nan()), pick)
            };
            format!(
                "converged: R-hat {:.4}, ESS bulk {:.0}, tail {:.0}, tau {:.1} ({shape})",
                known(|r| r.rhat, f64::max),
                known(|r| r.ess_bulk, f64::min),
                known(|r| r.ess_tail, f64::min),
                known(|r| r.tau, f64::max)
            )
        } else {
            format!("NOT converged: {} ({shape})", self.reasons.join("; "))
        }
    }
}

/// The worst by `pick` (f64::max or f64::min), and NaN if there is any.
fn worst(values: impl Iterator<Item = f64>, pick: fn(f64, f64) -> f64) -> f64 {
    let both = |a: f64, b: f64| {
        if a.is_nan() || b.is_nan() {
            f64::NAN
        } else {
            pick(a, b)
        }
    };
    values.reduce(both).unwrap_or(f64::NAN)
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.line())
    }
}

/// The figures of every parameter and whether they satisfy the rule.
pub fn diagnose(draws: &Draws, rule: &Rule) -> Verdict {
    let rows: Vec<Row> = (0..draws.dim())
        .into_par_iter()
        .map(|p| row(draws.names()[p].clone(), &draws.series(p)))
        .collect();
    let mut reasons: Vec<String> = rows
        .iter()
        .filter_map(|r| complaint(r, draws, rule))
        .collect();
    reasons.extend(stuck(draws));
    reasons.extend(outside(draws));
    reasons.extend(transitions(draws).into_iter().map(|fault| fault.figure));
    if draws.is_empty() {
        reasons.push("there are no draws".to_string());
    }
    Verdict {
        converged: reasons.is_empty(),
        reasons,
        rows,
        shape: [draws.ensembles(), draws.chains(), draws.draws()],
    }
}

fn row(name: String, series: &ScalarDraws) -> Row {
    let ordered = sorted(&series.values);
    let levels = [0.025, 0.5, 0.975];
    // NaN has no place in an order
    let known = !ordered.iter().any(|x| x.is_nan());
    let at = |p: f64| {
        if known {
            quantile(&ordered, p)
        } else {
            f64::NAN
        }
    };
    let [low, median, high] = levels.map(at);
    let tau = tau(series);
    Row {
        name,
        mean: mean(&series.values),
        // that of equal numbers may be a rounding error
        sd: match &ordered[..] {
            [first, .., last] if first == last => 0.0,
            _ => sd(&series.values),
        },
        low,
        median,
        high,
        mcse_mean: mcse_mean(series),
        mcse_sd: mcse_sd(series),
        mcse_quantiles: levels.map(|p| mcse_quantile(series, p)),
        rhat: rhat(series),
        ess_bulk: ess_bulk(series),
        ess_tail: ess_tail(series),
        tau,
        tau_change: change(series, tau),
        tau_error: tau_error(series, tau),
    }
}

fn change(series: &ScalarDraws, tau_all: f64) -> f64 {
    let before = tau(&series.first(series.draws - series.draws / 20));
    (tau_all - before).abs() / tau_all
}

/// What is wrong with one parameter, in words; comparisons are written so that NaN is wrong.
fn complaint(r: &Row, draws: &Draws, rule: &Rule) -> Option<String> {
    let enough = rule.ess * draws.ensembles() as f64;
    let discrete = is_discrete(draws, &r.name);
    if r.rhat.is_nan() && r.ess_bulk.is_nan() {
        // something that never acted beside others that moved is no fault of the chains
        let moves = |x: &[f64]| draws.points().next().is_some_and(|first| first != x);
        let fixed = discrete && r.sd == 0.0 && draws.points().any(moves);
        let why = match draws.draws() >= FEWEST && r.sd > 0.0 {
            true => {
                "constant in every chain, and different between chains. If it is a setting and no unknown, leave the column out"
            }
            false => "constant, not finite, or too short",
        };
        return (!fixed).then(|| format!("{}: {why}", r.name));
    }
    // a quantile or a distance from the median that all draws of an indicator share has no figure
    let missing = |figure: f64| figure.is_nan() && !discrete;
    let mut wrong = Vec::new();
    if missing(r.rhat) || r.rhat >= rule.rhat {
        wrong.push(format!("R-hat {:.3} (below {} wanted)", r.rhat, rule.rhat));
    }
    for (what, ess) in [("bulk", r.ess_bulk), ("tail", r.ess_tail)] {
        if missing(ess) || ess < enough {
            wrong.push(format!("ESS {what} {ess:.0} ({enough:.0} wanted)"));
        }
    }
    let lengths = draws.draws() as f64 / r.tau;
    if lengths.is_nan() || lengths < rule.lengths {
        wrong.push(format!("length {lengths:.0} tau ({} wanted)", rule.lengths));
    }
    let allowed = rule.tau_change.max(CHANCE * r.tau_error);
    if r.tau_change.is_nan() || r.tau_change > allowed {
        wrong.push(format!(
            "tau still changes by {:.1} % ({:.1} % allowed)",
            100.0 * r.tau_change,
            100.0 * allowed
        ));
    }
    (!wrong.is_empty()).then(|| format!("{}: {}", r.name, wrong.join(", ")))
}

/// By how many of its standard errors tau may change over the last twentieth of a run by chance: the change has an sd of the square root of
/// 1 / 0.95 - 1 of them, 0.23. Five of those are allowed, so that none of many parameters goes beyond by chance.
const CHANCE: f64 = 1.15;

/// Whether a variable takes a few values only, as what is chosen does.
fn is_discrete(draws: &Draws, name: &str) -> bool {
    let Some(k) = draws.index(name) else {
        return false;
    };
    let mut values: Vec<f64> = Vec::new();
    for x in draws.points() {
        if !values.contains(&x[k]) {
            values.push(x[k]);
        }
        if values.len() > FEW {
            return false;
        }
    }
    true
}

/// Values of a variable that is chosen, at most.
const FEW: usize = 12;

fn stuck(draws: &Draws) -> Option<String> {
    let rates = &draws.info.acceptance;
    let count = rates.iter().filter(|r| **r < STUCK).count();
    (count > 0).then(|| format!("{count} of {} chains hardly ever moved", rates.len()))
}

/// Draws of log density -inf are none of the posterior; NaN says that the density is not known.
fn outside(draws: &Draws) -> Option<String> {
    let outside = |lp: &&f64| **lp == f64::NEG_INFINITY;
    let count = draws.lp().iter().filter(outside).count();
    (count > 0).then(|| {
        format!("{count} draws have the log density -inf, so that they are none of this density")
    })
}

/// Fewest tau of a warm-up window that counts as stationary, and the R-hat it must have.
const SETTLED: (f64, f64) = (20.0, 1.05);

impl Stop for Rule {
    fn settled(&self, window: &Draws) -> Option<usize> {
        let calm = |p: usize| {
            let series = window.series(p);
            let tau = tau(&series);
            (window.draws() as f64 >= SETTLED.0 * tau && rhat(&series) < SETTLED.1).then_some(tau)
        };
        let taus: Option<Vec<f64>> = (0..window.dim()).into_par_iter().map(calm).collect();
        taus.map(|taus| thinning(&taus))
    }

    fn fallback(&self, window: &Draws) -> usize {
        let taus = (0..window.dim()).into_par_iter();
        thinning(&taus.map(|p| tau(&window.series(p))).collect::<Vec<f64>>())
    }

    fn enough(&self, draws: &Draws) -> bool {
        let wanted = self.ess * draws.ensembles() as f64;
        // The cheap figures first: most checks fail on the length. Written so that NaN is not enough.
        let good = |p: usize| {
            let series = draws.series(p);
            let tau = tau(&series);
            draws.draws() as f64 / tau >= self.lengths
                && change(&series, tau) <= self.tau_change
                && rhat(&series) < self.rhat
                && ess_bulk(&series) >= wanted
                && ess_tail(&series) >= wanted
        };
        (0..draws.dim()).into_par_iter().all(good)
    }
}

/// Half of the shortest autocorrelation time: hardly any information is lost, and stored draws stay few.
fn thinning(taus: &[f64]) -> usize {
    let shortest = taus.iter().copied().fold(f64::INFINITY, f64::min);
    if shortest.is_finite() {
        ((shortest / 2.0).floor() as usize).max(1)
    } else {
        1
    }
}
