//! The numbers of a run, gathered once: `report.json`.

use serde_json::{Map, Value, json};

use crate::diagnose::Row;
use crate::identify::{Identification, Refinement};
use crate::infer::Model;
use crate::reduce::Dimension;
use crate::sample::Stopped;

/// The schema of `report.json`.
pub const SCHEMA: &str = "plychain-report/1";

/// `report.json` of one model's rounds.
pub fn report(model: &Model, rounds: &[Identification], seed: u64) -> Value {
    json!({
        "schema": SCHEMA,
        "model": model.file.name,
        "seed": seed,
        "rounds": rounds.iter().map(|round| round_numbers(model, round)).collect::<Vec<_>>(),
    })
}

/// One round.
pub fn round_numbers(model: &Model, round: &Identification) -> Value {
    let verdict = &round.verdict;
    let rows = &verdict.rows;
    let effects: Vec<_> = model.effects.iter().map(|e| e.name()).collect();
    json!({
        "effects_declared": effects,
        "posterior": rows.iter().map(|row| (row.name.clone(), posterior(row))).collect::<Map<_, _>>(),
        "effect_amplitudes": amplitudes(round),
        "correlation": { "names": rows.iter().map(|r| &r.name).collect::<Vec<_>>(), "matrix": correlation(round) },
        "convergence": {
            "rhat_max": verdict.rhat_max(),
            "ess_bulk_min": verdict.ess_bulk_min(),
            "ess_tail_min": verdict.ess_tail_min(),
            "tau_max": verdict.tau_max(),
            "converged": verdict.converged,
            "text": verdict.line(),
            "warmup_steps": round.draws.info.warmup, "thin": round.draws.info.thin,
            "burn_in": format!(
                "the first {} steps of each ensemble, until a window of them was stationary, are not stored",
                round.draws.info.warmup
            ),
            "stopped": stopped(round.stopped),
            "ensembles": verdict.shape[0], "chains": verdict.shape[1], "draws": verdict.shape[2],
        },
        "residual": residual(round),
        "warnings": round.warnings,
        "noise": noise(round),
        "surrogate": surrogate(round),
    })
}

/// The reduced model's own error, measured by the finite elements at draws of the posterior.
fn surrogate(round: &Identification) -> Value {
    let reduced = &round.inverse.prepared.reduced;
    let error = &round.surrogate;
    json!({
        "max_error_in_posterior_sd": error.max_sd(),
        "error_in_posterior_sd": error.shift_sd.iter().map(|(name, s)| (name.clone(), json!(s))).collect::<Map<_, _>>(),
        "bias_in_posterior_sd": error.shift_sd.iter().zip(&error.bias_sd).map(|((name, _), b)| (name.clone(), json!(b))).collect::<Map<_, _>>(),
        "truth_draws": error.draws,
        "field_error_nm": { "max": error.max_field_nm, "rms": error.rms_field_nm },
        "draws_outside_doe": round.outside_doe,
        "variables": reduced.surface.variables.choice,
        "modes": reduced.modes_per_component(),
        "doe": doe(&reduced.dimensions),
        "press_mm": reduced.surface.quality.iter().map(|q| q.press).collect::<Vec<_>>(),
        "cached": round.inverse.prepared.cached,
        "refinement": round.refinements.iter().map(refinement).collect::<Vec<_>>(),
    })
}

/// One reduced model on the way: the first, then every refinement.
fn refinement(step: &Refinement) -> Value {
    json!({
        "max_error_in_posterior_sd": step.max_error_sd,
        "max_field_error_nm": step.max_field_nm,
        "draws_outside_doe": step.outside_doe,
        "snapshots": step.snapshots,
        "modes": step.modes,
        "doe": doe(&step.dimensions),
    })
}

fn doe(dimensions: &[Dimension]) -> Map<String, Value> {
    let sides = dimensions.iter();
    sides
        .map(|d| (d.name.clone(), json!([d.low, d.high])))
        .collect()
}

fn stopped(why: Stopped) -> &'static str {
    match why {
        Stopped::Enough => "the stopping rule was satisfied",
        Stopped::MaxDraws => "--max-draws was reached",
        Stopped::Interrupted => "--time-limit was reached",
    }
}

fn posterior(row: &Row) -> Value {
    json!({
        "mean": row.mean, "sd": row.sd,
        "q2.5": row.low, "median": row.median, "q97.5": row.high,
        "mcse_mean": row.mcse_mean, "rhat": row.rhat, "ess_bulk": row.ess_bulk, "ess_tail": row.ess_tail,
    })
}

/// Amplitudes of all declared effects: closed-form ones, and mechanical ones, which are sampled.
fn amplitudes(round: &Identification) -> Map<String, Value> {
    let closed = round
        .effect_amplitudes
        .iter()
        .map(|(name, mean, sd)| (name.clone(), json!({ "mean": mean, "sd": sd })));
    let sampled = round
        .verdict
        .rows
        .iter()
        .filter(|row| row.name.contains('.'))
        .map(|row| (row.name.clone(), json!({ "mean": row.mean, "sd": row.sd })));
    closed.chain(sampled).collect()
}

fn residual(round: &Identification) -> Value {
    let r = &round.residual;
    let both = |v: [f64; 2]| json!({ "u1": v[0], "u2": v[1] });
    json!({
        "rms_nm": { "u1": r.rms_nm[0], "u2": r.rms_nm[1], "all": r.rms_all_nm() },
        "noise_nm": both(r.noise_nm),
        "chi2_reduced": r.chi2_reduced,
        "structured_fraction": r.structured_fraction,
        "p_spatial": round.structure.p_spatial,
        "morans_i": both(round.structure.moran),
        "variogram": round.structure.variogram.iter().map(|(d, g)| json!({ "distance_mm": d, "u1_nm2": g[0], "u2_nm2": g[1] })).collect::<Vec<_>>(),
        "rings": round.structure.rings.iter().map(|(r, v)| json!({ "to_radius_mm": r, "u1_nm": v[0], "u2_nm": v[1] })).collect::<Vec<_>>(),
        "quadrants_nm": round.structure.quadrants.iter().map(|v| both(*v)).collect::<Vec<_>>(),
        "patterns": patterns(round),
        "n": r.points,
        "n_eff": r.effective_points,
    })
}

/// What stationary noise does not do, in the data's directions.
fn patterns(round: &Identification) -> Value {
    let frame = &round.inverse.prepared.observation.field.frame;
    let name = |component: usize| ["u1", "u2"][component];
    json!({
        "breakout": round.patterns.exceedance.map(|b| json!({
            "component": name(b.component), "blocks": b.blocks, "of": b.of, "expected": b.expected, "p": b.p,
            "place_in_data_mm": frame.data_point(b.place_mm), "sds": b.sds,
        })),
        "wave": round.patterns.wave.map(|w| json!({
            "component": name(w.component), "length_mm": w.length_mm, "length_range_mm": w.length_range_mm, "direction_in_data": frame.vector(w.direction),
            "amplitude_nm": w.amplitude_nm, "place_in_data_mm": frame.data_point(w.place_mm), "share": w.share, "p": w.p,
        })),
    })
}

fn noise(round: &Identification) -> Value {
    let component = |c: usize| {
        let reml = &round.inverse.noise.reml[c];
        json!({
            "white_nm": round.inverse.noise.white_mm[c] * crate::quantity::NM_PER_MM,
            "block_white_nm": reml.white_sd() * crate::quantity::NM_PER_MM,
            "correlated_nm": reml.correlated_sd() * crate::quantity::NM_PER_MM,
            "length_mm": reml.best.length_mm,
        })
    };
    let rejected = round.inverse.prepared.observation.field.rejected;
    json!({
        "u1": component(0), "u2": component(1),
        "block_mm": round.inverse.noise.blocks.size_mm, "blocks": round.inverse.noise.blocks.len(),
        "points_dropped": {
            "missing": rejected.missing, "outside_window": rejected.outside_window,
            "outliers": rejected.outliers, "outside_plate": rejected.outside_plate,
        },
    })
}

/// Correlation matrix of the draws.
pub fn correlation(round: &Identification) -> Vec<Vec<f64>> {
    let draws = &round.draws;
    let d = draws.dim();
    let n = draws.len() as f64;
    let means: Vec<f64> = round.verdict.rows.iter().map(|r| r.mean).collect();
    let mut sums = vec![vec![0.0; d]; d];
    for x in draws.points() {
        for i in 0..d {
            for j in 0..d {
                sums[i][j] += (x[i] - means[i]) * (x[j] - means[j]) / n;
            }
        }
    }
    (0..d)
        .map(|i| {
            (0..d)
                .map(|j| sums[i][j] / (sums[i][i] * sums[j][j]).sqrt())
                .collect()
        })
        .collect()
}
