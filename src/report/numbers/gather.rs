//! [`FigureData`] gathered from a finished identification.

use super::cells::FieldCells;
use super::data::{
    FigureData, JointBin, MapCell, MarginalBin, MeshPoint, ParameterLine, RankBin, StepCell,
    StiffnessCell, TracePoint,
};
use super::mesh::lines;
use crate::chain::Draws;
use crate::diagnose::{Row, Rule, diagnose};
use crate::field::blocks::origin;
use crate::identify::Identification;
use crate::infer::Marginal;
use crate::numeric::quantile;
use crate::quantity::{NM_PER_MM, UM_PER_MM};
use crate::report::manifest::KnownTruth;
use crate::trace::{Round, StepMaps, StiffnessAt};

impl FigureData {
    /// The tables of a round. `truth` is known of simulated data.
    pub fn gather(round: &Identification, truth: &KnownTruth) -> Self {
        let draws = &round.draws;
        let ranges: Vec<[f64; 2]> = (0..draws.dim()).map(|p| reach(draws, p)).collect();
        Self {
            maps: maps(round),
            steps: Vec::new(),
            stiffness: Vec::new(),
            mesh: imported(round),
            parameters: parameters(round, truth),
            marginals: marginals(draws, &ranges),
            corner: densities(draws, &ranges),
            trace: traces(draws),
            rank: ranks(draws),
        }
    }

    /// The tables of a round of a loop.
    pub fn traced(round: &Round, truth: &KnownTruth) -> Self {
        Self {
            steps: steps(round),
            stiffness: stiffness(round),
            ..Self::gather(&round.identification, truth)
        }
    }

    /// The tables of some variables of the quoted draws.
    pub fn quoted(draws: &Draws, names: &[String], truth: &KnownTruth) -> Self {
        let columns: Vec<usize> = names.iter().filter_map(|n| draws.index(n)).collect();
        let values = draws.points().flat_map(|x| columns.iter().map(|&c| x[c]));
        let names = columns.iter().map(|&c| draws.names()[c].clone()).collect();
        let some = Draws::new(
            names,
            draws.ensemble().to_vec(),
            values.collect(),
            draws.lp().to_vec(),
        );
        let Ok(draws) = some else {
            return Self::default();
        };
        let ranges: Vec<[f64; 2]> = (0..draws.dim()).map(|p| reach(&draws, p)).collect();
        Self {
            parameters: diagnose(&draws, &Rule::default())
                .rows
                .iter()
                .map(|row| parameter(row, None, truth))
                .collect(),
            marginals: marginals(&draws, &ranges),
            corner: densities(&draws, &ranges),
            ..Self::default()
        }
    }
}

/// The mesh of another program with the measured points; nothing of a shape that the program meshes itself.
fn imported(round: &Identification) -> Vec<MeshPoint> {
    let prepared = &round.inverse.prepared;
    let geometry = &prepared.problem.experiment.scene().setup.geometry;
    if geometry.name() != "imported" {
        return Vec::new();
    }
    let field = &prepared.observation.field;
    let points: Vec<[f64; 2]> = field
        .points
        .iter()
        .map(|&p| field.frame.data_point(p))
        .collect();
    lines(&geometry.mesh(&[]), &field.frame, &points)
}

/// What is left of each step of a series, block by block, in the data's frame.
fn steps(round: &Round) -> Vec<StepCell> {
    let observation = &round.identification.inverse.prepared.observation;
    let maps = round.tracing.series.as_ref().and_then(|s| s.maps.as_ref());
    let (Some(steps), Some(maps)) = (&observation.steps, maps) else {
        return Vec::new();
    };
    let places = middles(round, maps);
    let pairs = steps.names.iter().zip(&maps.left_nm);
    let of = |(name, left): (&String, &[Vec<f64>; 2])| {
        let cell = |(b, at): (usize, &[f64; 2])| StepCell {
            step: name.clone(),
            x_mm: at[0],
            y_mm: at[1],
            u1_residual_nm: rounded(left[0][b], 2),
            u2_residual_nm: rounded(left[1][b], 2),
        };
        places.iter().enumerate().map(cell).collect::<Vec<_>>()
    };
    pairs.flat_map(of).collect()
}

/// The stiffness that would make what grows with the load, block by block, in the data's frame.
fn stiffness(round: &Round) -> Vec<StiffnessCell> {
    let series = round.tracing.series.as_ref();
    let both = series.and_then(|s| s.stiffness.as_ref().zip(s.maps.as_ref()));
    let Some((found, maps)) = both else {
        return Vec::new();
    };
    let cell = |(at, place): ([f64; 2], &StiffnessAt)| StiffnessCell {
        x_mm: at[0],
        y_mm: at[1],
        change_percent: significant(100.0 * place.change, 4),
        sd_percent: significant(100.0 * place.sd, 4),
    };
    let places = middles(round, maps).into_iter();
    places.zip(&found.map).map(cell).collect()
}

/// The middles of the blocks' tiles in the data's frame, which are those of their points only where all are there.
fn middles(round: &Round, maps: &StepMaps) -> Vec<[f64; 2]> {
    let field = &round.identification.inverse.prepared.observation.field;
    let (origin, size) = (origin(&field.points, maps.size_mm), maps.size_mm);
    let middle = |p: &[f64; 2]| {
        let tile = [0, 1].map(|k| ((p[k] - origin[k]) / size).floor());
        let at = [0, 1].map(|k| origin[k] + (tile[k] + 0.5) * size);
        let at = field.frame.data_point(at);
        at.map(|v| rounded(v, 5))
    };
    maps.places.iter().map(middle).collect()
}

/// As many decimals as a figure shows.
fn rounded(value: f64, decimals: usize) -> f64 {
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

/// So many significant digits.
fn significant(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

/// Cell means of both components in the data's frame.
fn maps(round: &Identification) -> Vec<MapCell> {
    let field = &round.inverse.prepared.observation.field;
    let residual = &round.residual.field;
    let points = field.points.iter().map(|&p| field.frame.data_point(p));
    let cells = FieldCells::new(&points.collect::<Vec<_>>());
    let means = [0, 1].map(|c| {
        let of = |i: usize| (field.displacement[i][c], residual[i][c]);
        [
            cells.mean(|i| UM_PER_MM * of(i).0),
            cells.mean(|i| UM_PER_MM * (of(i).0 - of(i).1)),
            cells.mean(|i| NM_PER_MM * of(i).1),
        ]
    });
    let place = |v: f64| rounded(v, 5);
    let cell = |k: usize| {
        let [u1, u2] = [0, 1].map(|c| [0, 1, 2].map(|w| rounded(means[c][w][k], [5, 5, 2][w])));
        MapCell {
            x_mm: place(cells.x[k % cells.x.len()]),
            y_mm: place(cells.y[k / cells.x.len()]),
            u1_measured_um: u1[0],
            u1_predicted_um: u1[1],
            u1_residual_nm: u1[2],
            u2_measured_um: u2[0],
            u2_predicted_um: u2[1],
            u2_residual_nm: u2[2],
        }
    };
    (0..cells.count()).map(cell).collect()
}

fn parameters(round: &Identification, truth: &KnownTruth) -> Vec<ParameterLine> {
    let priors = round.inverse.posed.density.marginals();
    let rows = round.verdict.rows.iter().enumerate();
    rows.map(|(i, row)| parameter(row, priors.get(i), truth))
        .collect()
}

fn parameter(row: &Row, prior: Option<&Marginal>, truth: &KnownTruth) -> ParameterLine {
    let missing = [f64::NAN; 2];
    let [prior_mean, prior_sd] = prior.map_or(missing, |p| [p.mean, p.sd]);
    let [cut_low, cut_high] = prior.and_then(|p| p.truncate).unwrap_or(missing);
    ParameterLine {
        parameter: row.name.clone(),
        mean: row.mean,
        sd: row.sd,
        low: row.low,
        median: row.median,
        high: row.high,
        prior_mean,
        prior_sd,
        cut_low,
        cut_high,
        truth: truth.of(&row.name).unwrap_or(f64::NAN),
    }
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
    significant(low + (high - low) * (k as f64 + 0.5) / bins as f64, 8)
}

fn marginals(draws: &Draws, ranges: &[[f64; 2]]) -> Vec<MarginalBin> {
    let mut rows = Vec::new();
    for (p, (name, &range)) in draws.names().iter().zip(ranges).enumerate() {
        let mut counts = [0.0; BINS];
        for x in draws.points() {
            if let Some(b) = bin(x[p], range, BINS) {
                counts[b] += 1.0;
            }
        }
        let whole = draws.len() as f64 * (range[1] - range[0]) / BINS as f64;
        rows.extend(counts.iter().enumerate().map(|(b, count)| MarginalBin {
            parameter: name.clone(),
            value: centre(range, BINS, b),
            density: significant(count / whole, 5),
        }));
    }
    rows
}

/// Relative densities below a thousandth are left out.
const NEXT_TO_NONE: f64 = 1e-3;

fn densities(draws: &Draws, ranges: &[[f64; 2]]) -> Vec<JointBin> {
    let mut rows = Vec::new();
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
            let relative = counts.iter().map(|c| c / largest).enumerate();
            rows.extend(
                relative
                    .filter(|(_, d)| *d >= NEXT_TO_NONE)
                    .map(|(cell, d)| JointBin {
                        first: draws.names()[i].clone(),
                        second: draws.names()[j].clone(),
                        x: centre(ranges[i], JOINT_BINS, cell % JOINT_BINS),
                        y: centre(ranges[j], JOINT_BINS, cell / JOINT_BINS),
                        relative_density: rounded(d, 4),
                    }),
            );
        }
    }
    rows
}

/// Draws of a trace, at most.
const TRACE: usize = 240;

fn traces(draws: &Draws) -> Vec<TracePoint> {
    let mut rows = Vec::new();
    let stride = draws.draws().div_ceil(TRACE).max(1);
    for (p, name) in draws.names().iter().enumerate() {
        let series = draws.series(p);
        for (e, chains) in series.groups().iter().enumerate() {
            let chain = series.chain(chains[0]);
            rows.extend((0..draws.draws()).step_by(stride).map(|draw| TracePoint {
                parameter: name.clone(),
                ensemble: e + 1,
                draw,
                value: significant(chain[draw], 7),
            }));
        }
    }
    rows
}

/// Bins of a rank plot.
const RANKS: usize = 20;

fn ranks(draws: &Draws) -> Vec<RankBin> {
    let mut rows = Vec::new();
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
            rows.extend(counts.iter().enumerate().map(|(b, count)| RankBin {
                parameter: name.clone(),
                ensemble: e + 1,
                bin: b + 1,
                relative_count: rounded(count / expected, 4),
            }));
        }
    }
    rows
}
