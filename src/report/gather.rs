//! A [`Report`] gathered from finished identifications.

use super::document::{Closing, Report, SCHEMA};
use super::json::{Keyed, finite};
use super::learned::learned;
use super::quoted::quoted;
use super::residual::{NoiseComponent, NoiseReport, ResidualReport, RmsReport};
use super::round::{Convergence, Correlation, MeanAndSd, PosteriorSummary, RoundReport};
use super::steps::{HeldOutReport, LinearityReport, StepReport};
use super::traced::{map, tracing};
use super::verdict::{BeforeAfter, Shifted};
use super::words::widening;
use crate::identify::Identification;
use crate::infer::Model;
use crate::parameter::Parameter;
use crate::quantity::NM_PER_MM;
use crate::sample::Stopped;
use crate::trace::{Closed, HeldOutStep, NOT_LINEAR, Round};

pub fn identified(model: &Model, rounds: &[Identification], seed: u64) -> Report {
    report(
        model,
        seed,
        rounds.iter().map(|r| round(model, r)).collect(),
    )
}

/// The report of a loop.
pub fn closed(closed: &Closed, seed: u64) -> Report {
    let rounds: Vec<RoundReport> = closed.rounds.iter().map(traced).collect();
    let [first, last] = [&closed.rounds[0], &closed.rounds[closed.rounds.len() - 1]];
    let blind_spots = last.tracing.blind_spots.clone();
    let averaged = closed.quoted();
    let note = rounds
        .last()
        .and_then(|r| widening((&r.alone(), &averaged), r.tracing.as_ref()?, &blind_spots));
    let closing = Closing {
        averaged_posterior: averaged,
        quoted: quoted(closed),
        averaged_note: note,
        blind_spots,
        before_after: before_after(first, last),
        verdict: closed.conclusion.clone(),
    };
    let mut report = Report {
        closing: Some(closing),
        ..report(&last.model, seed, rounds)
    };
    report.learned = learned(&last.model, &report.both());
    report
}

fn report(model: &Model, seed: u64, rounds: Vec<RoundReport>) -> Report {
    let alone = rounds.last().map(RoundReport::alone).unwrap_or_default();
    Report {
        schema: SCHEMA.into(),
        model: model.file.name.clone(),
        seed,
        rounds,
        together: None,
        told: model.file.to_json().unwrap_or_default(),
        learned: learned(model, &alone),
        closing: None,
    }
}

fn traced(step: &Round) -> RoundReport {
    let mut round = round(&step.model, &step.identification);
    round.residual.holdout_rms_nm = finite(step.tracing.holdout_rms_nm);
    round.tracing = Some(tracing(&step.tracing));
    round.steps = steps(step);
    let linearity = step.tracing.series.as_ref().and_then(|s| s.linearity);
    round.linearity = linearity.map(|test| LinearityReport {
        ratio: test.ratio,
        freedom: test.freedom,
        p: test.p,
        linear: test.p >= NOT_LINEAR,
    });
    round
}

/// The steps of a series, and what is left of them.
fn steps(round: &Round) -> Vec<StepReport> {
    let Some(steps) = &round.identification.inverse.prepared.observation.steps else {
        return Vec::new();
    };
    let left = round.tracing.steps().iter().enumerate();
    left.map(|(k, left)| StepReport {
        name: steps.names[k].clone(),
        load: steps.loads[k],
        force_known: steps.known[k],
        rms_nm: left.bare_nm.into(),
        explained_rms_nm: left.explained_nm.into(),
        noise_scale: left.noise_scale,
        held_out: left.predicted.map(held_out),
    })
    .collect()
}

fn held_out(step: HeldOutStep) -> HeldOutReport {
    HeldOutReport {
        rms_nm: step.bare_nm.into(),
        explained_rms_nm: step.explained_nm.into(),
        z: step.z,
    }
}

fn round(model: &Model, round: &Identification) -> RoundReport {
    let rows = &round.verdict.rows;
    RoundReport {
        effects_declared: map(&model.effects, |e| e.name().into()),
        posterior: rows.iter().map(|row| summary(model, row)).collect(),
        effect_amplitudes: amplitudes(round),
        correlation: Correlation {
            names: map(rows, |r| r.name.clone()),
            matrix: correlation(round),
        },
        convergence: convergence(round),
        residual: residual(round),
        doubts: round.doubts.clone(),
        warnings: round.all_warnings(),
        noise: noise(round),
        full_model: round.importance.clone(),
        steps: Vec::new(),
        linearity: None,
        tracing: None,
    }
}

fn summary(model: &Model, row: &crate::diagnose::Row) -> (String, PosteriorSummary) {
    let summary = PosteriorSummary {
        mean: row.mean,
        sd: row.sd,
        low: row.low,
        median: row.median,
        high: row.high,
        mcse_mean: row.mcse_mean,
        rhat: row.rhat,
        ess_bulk: row.ess_bulk,
        ess_tail: row.ess_tail,
        published: MeanAndSd::published(&model.file.material, &row.name),
    };
    (row.name.clone(), summary)
}

/// Amplitudes of all declared effects: closed-form ones, and mechanical ones, which are sampled.
fn amplitudes(round: &Identification) -> Keyed<MeanAndSd> {
    let closed = round.effect_amplitudes.iter();
    let sampled = round
        .verdict
        .rows
        .iter()
        .filter(|r| Parameter::read(&r.name).is_amplitude());
    closed
        .map(|(name, mean, sd)| (name.clone(), (*mean, *sd).into()))
        .chain(sampled.map(|r| (r.name.clone(), (r.mean, r.sd).into())))
        .collect()
}

fn correlation(round: &Identification) -> Vec<Vec<Option<f64>>> {
    let d = round.draws.dim();
    let n = round.draws.len() as f64;
    let means = map(&round.verdict.rows, |r| r.mean);
    let mut sums = vec![vec![0.0; d]; d];
    for x in round.draws.points() {
        for i in 0..d {
            for j in 0..d {
                sums[i][j] += (x[i] - means[i]) * (x[j] - means[j]) / n;
            }
        }
    }
    let of = |i: usize, j: usize| finite(sums[i][j] / (sums[i][i] * sums[j][j]).sqrt());
    (0..d).map(|i| (0..d).map(|j| of(i, j)).collect()).collect()
}

fn convergence(round: &Identification) -> Convergence {
    let verdict = &round.verdict;
    let [ensembles, chains, draws] = verdict.shape;
    let warmup_steps = round.draws.info.warmup;
    let stopped = match round.stopped {
        Stopped::Enough => "the stopping rule was satisfied",
        Stopped::MaxDraws => "--max-draws was reached",
        Stopped::Interrupted => "--time-limit was reached",
    };
    Convergence {
        rhat_max: verdict.rhat_max(),
        ess_bulk_min: verdict.ess_bulk_min(),
        ess_tail_min: verdict.ess_tail_min(),
        tau_max: verdict.tau_max(),
        converged: verdict.converged,
        text: verdict.line(),
        warmup_steps,
        thin: round.draws.info.thin,
        burn_in: format!(
            "the first {warmup_steps} steps of each ensemble, until a window of them was stationary, are not stored"
        ),
        stopped: stopped.into(),
        ensembles,
        chains,
        draws,
    }
}

fn residual(round: &Identification) -> ResidualReport {
    let r = &round.residual;
    ResidualReport {
        rms_nm: RmsReport {
            u1: r.rms_nm[0],
            u2: r.rms_nm[1],
            all: r.rms_all_nm(),
        },
        noise_nm: r.noise_nm.into(),
        chi2_reduced: r.chi2_reduced,
        structured_fraction: r.structured_fraction,
        patterns: round.patterns.clone(),
        n: r.points,
        n_eff: r.effective_points,
        holdout_rms_nm: None,
    }
}

fn noise(round: &Identification) -> NoiseReport {
    let noise = &round.inverse.noise;
    let component = |c: usize| NoiseComponent {
        white_nm: noise.white_mm[c] * NM_PER_MM,
        block_white_nm: noise.white_sd(c) * NM_PER_MM,
        correlated_nm: noise.correlated_sd(c) * NM_PER_MM,
        length_mm: noise.at[c].length_mm,
    };
    NoiseReport {
        u1: component(0),
        u2: component(1),
        block_mm: noise.blocks.size_mm,
        blocks: noise.blocks.len(),
        points_dropped: round.inverse.prepared.observation.field.rejected,
    }
}

fn before_after(first: &Round, last: &Round) -> BeforeAfter {
    let both = |f: &dyn Fn(&Round) -> f64| [first, last].map(|s| finite(f(s)));
    let [before, after] = [first, last].map(|s| s.identification.verdict.rows.iter());
    let constants = before.filter_map(|before| {
        let name = &before.name;
        let after = after.clone().find(|r| r.name == *name)?;
        let shifted = Shifted {
            mean: [before.mean, after.mean],
            sd: [before.sd, after.sd],
            shift_in_sd: (after.mean - before.mean) / before.sd,
            from_prior_in_prior_sd: [(first, before.mean), (last, after.mean)]
                .map(|(round, mean)| from_prior(round, name, mean)),
        };
        Some((name.clone(), shifted))
    });
    BeforeAfter {
        residual_rms_nm: both(&|s| s.identification.residual.rms_all_nm()),
        residual_rms_u1_nm: both(&|s| s.identification.residual.rms_nm[0]),
        residual_rms_u2_nm: both(&|s| s.identification.residual.rms_nm[1]),
        chi2_reduced: both(&|s| s.identification.residual.chi2_reduced),
        holdout_rms_nm: both(&|s| s.tracing.holdout_rms_nm),
        posterior: constants.collect(),
    }
}

/// How far a constant's posterior mean lies from its prior's, prior sds.
fn from_prior(step: &Round, name: &str, mean: f64) -> Option<f64> {
    let k = step.model.constants().iter().position(|n| *n == name)?;
    let prior = step.model.marginals()[k];
    finite((mean - prior.mean) / prior.sd)
}
