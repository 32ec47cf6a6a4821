//! What the figures of a round are drawn from, gathered from the round into sheets.

use serde_json::Value;

use super::cells::Cells;
use super::sheet::{Sheet, exact, rounded};
use super::tables;
use crate::chain::Draws;
use crate::diagnose::autocorrelation;
use crate::identify::Identification;
use crate::numeric::quantile;
use crate::quantity::{NM_PER_MM, UM_PER_MM};

/// The sheets of a run: those of each round, numbered from 0, as the folder's. `truth` is what `truth.json` beside the data says.
pub fn sheets(rounds: &[&Identification], truth: Option<&Value>) -> Vec<Sheet> {
    let one = |(k, round): (usize, &&Identification)| {
        let draws = &round.draws;
        vec![
            maps(round, k),
            parameters(round, k, truth),
            marginals(draws, k),
            densities(draws, k),
            traces(draws, k),
            ranks(draws, k),
            autocorrelations(draws, k),
            truncation(round, k),
            surfaces(round, k),
        ]
    };
    rounds.iter().enumerate().flat_map(one).collect()
}

/// Cell means of both components: measured and predicted (um), and their difference (nm), in the data's frame.
fn maps(round: &Identification, k: usize) -> Sheet {
    let field = &round.inverse.prepared.observation.field;
    let residual = &round.residual.field;
    let points: Vec<[f64; 2]> = field
        .points
        .iter()
        .map(|&p| field.frame.data_point(p))
        .collect();
    let cells = Cells::new(&points);
    let mut header = vec!["x_mm".to_string(), "y_mm".to_string()];
    let mut columns = Vec::new();
    for (c, component) in ["u1", "u2"].into_iter().enumerate() {
        for (what, unit) in [("measured", "um"), ("predicted", "um"), ("residual", "nm")] {
            header.push(format!("{component}_{what}_{unit}"));
        }
        let of = |i: usize| (field.displacement[i][c], residual[i][c]);
        columns.push((cells.mean(|i| UM_PER_MM * of(i).0), 5));
        columns.push((cells.mean(|i| UM_PER_MM * (of(i).0 - of(i).1)), 5));
        columns.push((cells.mean(|i| NM_PER_MM * of(i).1), 2));
    }
    let rows = (0..cells.len()).map(|cell| {
        let place = [cells.x[cell % cells.x.len()], cells.y[cell / cells.x.len()]];
        let place = place.iter().map(|v| rounded(*v, 5));
        place
            .chain(columns.iter().map(|(v, d)| rounded(v[cell], *d)))
            .collect()
    });
    Sheet {
        name: format!("maps-{k}"),
        rows: rows.collect(),
        header,
    }
}

/// Posterior summary, prior, cut and truth of each sampled parameter.
fn parameters(round: &Identification, k: usize, truth: Option<&Value>) -> Sheet {
    let mut sheet = Sheet::new(
        format!("parameters-{k}"),
        &[
            "parameter",
            "mean",
            "sd",
            "q2.5",
            "median",
            "q97.5",
            "prior_mean",
            "prior_sd",
            "cut_low",
            "cut_high",
            "truth",
        ],
    );
    for (row, i) in round.verdict.rows.iter().zip(0..) {
        let prior = round.inverse.posterior.marginals().get(i);
        let cut = prior.and_then(|p| p.truncate);
        let known = truth.and_then(|t| known(t, &row.name));
        let mut cells = vec![row.name.clone()];
        cells.extend([row.mean, row.sd, row.low, row.median, row.high].map(exact));
        cells.extend(
            [
                prior.map(|p| p.mean),
                prior.map(|p| p.sd),
                cut.map(|c| c[0]),
                cut.map(|c| c[1]),
                known,
            ]
            .map(|v| v.map_or(String::new(), exact)),
        );
        sheet.rows.push(cells);
    }
    sheet
}

/// The true value of a constant or of an effect's amplitude (`effect.parameter`; 0 if the effect did not act), as `truth.json` has it.
pub fn known(truth: &Value, name: &str) -> Option<f64> {
    if let Some((effect, parameter)) = name.split_once('.') {
        let effects = truth.get("effects")?.as_object()?;
        let Some(amplitudes) = effects.get(effect) else {
            return Some(0.0);
        };
        return amplitudes.get(parameter)?.as_f64();
    }
    truth.get("constants")?.get(name)?.as_f64()
}

/// Bins of a marginal.
const BINS: usize = 60;

/// Bins of a joint density along each side.
const JOINT_BINS: usize = 32;

/// The middle 99.8 % of a parameter, a little widened.
fn reach(draws: &Draws, k: usize) -> [f64; 2] {
    let mut values: Vec<f64> = draws.points().map(|x| x[k]).collect();
    values.sort_by(f64::total_cmp);
    if values.is_empty() {
        return [0.0, 1.0];
    }
    let (low, high) = (quantile(&values, 0.001), quantile(&values, 0.999));
    let room = 0.05 * (high - low).max(1e-12 * high.abs().max(1e-300));
    [low - room, high + room]
}

/// The bin of a value, if it is in the range.
fn bin(value: f64, [low, high]: [f64; 2], bins: usize) -> Option<usize> {
    let at = (value - low) / (high - low);
    (0.0..1.0)
        .contains(&at)
        .then(|| ((at * bins as f64) as usize).min(bins - 1))
}

fn centre([low, high]: [f64; 2], bins: usize, k: usize) -> f64 {
    low + (high - low) * (k as f64 + 0.5) / bins as f64
}

fn marginals(draws: &Draws, k: usize) -> Sheet {
    let mut sheet = Sheet::new(format!("marginals-{k}"), &["parameter", "value", "density"]);
    for (p, name) in draws.names().iter().enumerate() {
        let range = reach(draws, p);
        let mut counts = [0.0; BINS];
        for x in draws.points() {
            if let Some(b) = bin(x[p], range, BINS) {
                counts[b] += 1.0;
            }
        }
        let whole = draws.len() as f64 * (range[1] - range[0]) / BINS as f64;
        for (b, count) in counts.iter().enumerate() {
            sheet.rows.push(vec![
                name.clone(),
                format!("{:.7e}", centre(range, BINS, b)),
                format!("{:.4e}", count / whole),
            ]);
        }
    }
    sheet
}

/// Joint densities of each pair, relative to the largest; cells below a thousandth are left out.
fn densities(draws: &Draws, k: usize) -> Sheet {
    let mut sheet = Sheet::new(
        format!("corner-{k}"),
        &["first", "second", "x", "y", "relative_density"],
    );
    let ranges: Vec<[f64; 2]> = (0..draws.dim()).map(|p| reach(draws, p)).collect();
    for j in 1..draws.dim() {
        for i in 0..j {
            let mut counts = vec![0.0_f64; JOINT_BINS * JOINT_BINS];
            for x in draws.points() {
                let cell = bin(x[i], ranges[i], JOINT_BINS).zip(bin(x[j], ranges[j], JOINT_BINS));
                if let Some((a, b)) = cell {
                    counts[b * JOINT_BINS + a] += 1.0;
                }
            }
            let largest = counts.iter().fold(1.0_f64, |m, c| m.max(*c));
            for (cell, count) in counts.iter().enumerate() {
                if count / largest >= 1e-3 {
                    sheet.rows.push(vec![
                        draws.names()[i].clone(),
                        draws.names()[j].clone(),
                        format!("{:.7e}", centre(ranges[i], JOINT_BINS, cell % JOINT_BINS)),
                        format!("{:.7e}", centre(ranges[j], JOINT_BINS, cell / JOINT_BINS)),
                        rounded(count / largest, 4),
                    ]);
                }
            }
        }
    }
    sheet
}

/// Draws of a trace, at most.
const TRACE: usize = 240;

/// The first chain of each ensemble, thinned.
fn traces(draws: &Draws, k: usize) -> Sheet {
    let mut sheet = Sheet::new(
        format!("trace-{k}"),
        &["parameter", "ensemble", "draw", "value"],
    );
    let stride = draws.draws().div_ceil(TRACE).max(1);
    for (p, name) in draws.names().iter().enumerate() {
        let series = draws.series(p);
        for (e, chains) in series.groups().iter().enumerate() {
            for draw in (0..draws.draws()).step_by(stride) {
                sheet.rows.push(vec![
                    name.clone(),
                    (e + 1).to_string(),
                    draw.to_string(),
                    format!("{:.6e}", series.chain(chains[0])[draw]),
                ]);
            }
        }
    }
    sheet
}

/// Bins of a rank plot.
const RANKS: usize = 20;

/// Ranks of each ensemble's draws among all draws (Vehtari et al. 2021): the share of an ensemble's draws in each of twenty bins, 1
/// where it is as expected.
fn ranks(draws: &Draws, k: usize) -> Sheet {
    let mut sheet = Sheet::new(
        format!("rank-{k}"),
        &["parameter", "ensemble", "bin", "relative_count"],
    );
    for (p, name) in draws.names().iter().enumerate() {
        let series = draws.series(p);
        let mut order: Vec<usize> = (0..series.values.len()).collect();
        order.sort_by(|&a, &b| series.values[a].total_cmp(&series.values[b]));
        let groups = series.groups();
        let mut group_of = vec![0; series.chains()];
        for (e, chains) in groups.iter().enumerate() {
            chains.iter().for_each(|&c| group_of[c] = e);
        }
        let mut counts = vec![[0.0; RANKS]; groups.len()];
        for (rank, &i) in order.iter().enumerate() {
            counts[group_of[i / series.draws.max(1)]][rank * RANKS / order.len()] += 1.0;
        }
        for (e, (counts, chains)) in counts.iter().zip(&groups).enumerate() {
            let expected = (chains.len() * series.draws) as f64 / RANKS as f64;
            for (b, count) in counts.iter().enumerate() {
                sheet.rows.push(vec![
                    name.clone(),
                    (e + 1).to_string(),
                    (b + 1).to_string(),
                    rounded(count / expected, 4),
                ]);
            }
        }
    }
    sheet
}

/// Lags of an autocorrelation, at most.
const LAGS: usize = 100;

fn autocorrelations(draws: &Draws, k: usize) -> Sheet {
    let mut sheet = Sheet::new(
        format!("autocorrelation-{k}"),
        &["parameter", "lag", "autocorrelation"],
    );
    for (p, name) in draws.names().iter().enumerate() {
        for (lag, rho) in autocorrelation(&draws.series(p), LAGS).iter().enumerate() {
            let row = vec![name.clone(), lag.to_string(), rounded(*rho, 5)];
            sheet.rows.push(row);
        }
    }
    sheet
}

/// Truncation error and leave-one-out error for each number of modes.
fn truncation(round: &Identification, k: usize) -> Sheet {
    let numbers = tables::numbers(&round.inverse.prepared.reduced);
    let mut sheet = Sheet::new(
        format!("truncation-{k}"),
        &["modes", "component", "eps", "cv_rms_mm", "cv_rms_percent"],
    );
    for component in ["U", "V"] {
        let column = |key: &str| numbers[key][component].as_array().cloned();
        let eps = column("table_3_truncation_error_K_1_up").unwrap_or_default();
        let mm = column("table_8_cv_rms_mm_K_1_up").unwrap_or_default();
        let percent = column("table_8_cv_rms_percent_K_1_up").unwrap_or_default();
        for (n, eps) in eps.iter().enumerate() {
            let cell = |v: Option<&Value>| v.and_then(Value::as_f64).map_or(String::new(), exact);
            sheet.rows.push(vec![
                (n + 1).to_string(),
                component.into(),
                cell(Some(eps)),
                cell(mm.get(n)),
                cell(percent.get(n)),
            ]);
        }
    }
    sheet
}

/// Error tables of the response surfaces.
fn surfaces(round: &Identification, k: usize) -> Sheet {
    let numbers = tables::numbers(&round.inverse.prepared.reduced);
    let measures = ["mean_mm", "sd_mm", "r2", "rms_mm", "press_mm"];
    let header: Vec<&str> = std::iter::once("coefficient").chain(measures).collect();
    let mut sheet = Sheet::new(format!("surfaces-{k}"), &header);
    for (name, row) in numbers["surface_kept"]["coefficients"]
        .as_object()
        .into_iter()
        .flatten()
    {
        let cell = |m: &&str| row[*m].as_f64().map_or(String::new(), exact);
        sheet.rows.push(
            std::iter::once(name.clone())
                .chain(measures.iter().map(cell))
                .collect(),
        );
    }
    sheet
}
