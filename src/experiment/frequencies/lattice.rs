//! The sum over all one-to-one assignments of modes to peaks, mode by mode.
//!
//! A state is the set of peaks taken so far that later modes can still reach. With links between neighbours only there are few states, and
//! the sum is exact over *all* assignments: modes may cross, nothing is assumed on the order. (The permanent of a banded matrix by transfer
//! matrices; the setting is joint probabilistic data association, Fortmann, Bar-Shalom, Scheffe, IEEE J. Ocean. Eng. 8 (1983) 173.)

use crate::numeric::log_sum_exp;
use nalgebra::DMatrix;

/// A set of peaks, one bit each.
type LatticeSet = u128;

/// Most peaks that a set can hold.
pub const MOST_PEAKS: usize = LatticeSet::BITS as usize;

/// States kept after a mode, the likeliest: enough for ten peaks within reach of one mode without loss.
const MOST_STATES: usize = 1024;

/// What a mode can be: log weights.
#[derive(Debug)]
pub struct Choices {
    /// Of leaving no peak.
    pub missing: f64,
    /// Of being a peak, relative to that peak's being additional: (peak, log weight).
    pub links: Vec<(usize, f64)>,
}

/// The sum and what it consists of.
#[derive(Debug)]
pub struct Sum {
    /// Log of the sum over all assignments.
    pub log_total: f64,
    /// Share of the assignments, by weight, in which a mode is a peak (modes x peaks).
    pub matched: DMatrix<f64>,
    /// The peak of each mode in the likeliest assignment.
    pub best: Vec<Option<usize>>,
}

/// States before a mode: set, log of the summed weights, log of the largest weight, and where that came from (state, peak).
#[derive(Debug, Clone, Copy)]
struct LatticeState {
    set: LatticeSet,
    sum: f64,
    best: f64,
    from: (usize, Option<usize>),
}

/// Sum over the assignments of modes to at most one of `peaks` peaks each, no peak twice.
pub fn sum(modes: &[Choices], peaks: usize) -> Sum {
    let reach = reachable(modes);
    let start = LatticeState {
        set: 0,
        sum: 0.0,
        best: 0.0,
        from: (0, None),
    };
    let mut layers = vec![vec![start]];
    for (j, mode) in modes.iter().enumerate() {
        let before = &layers[j];
        let mut after = Vec::with_capacity(before.len() * (1 + mode.links.len()));
        for (index, state) in before.iter().enumerate() {
            for (peak, set, weight) in steps(mode, state.set, reach[j + 1]) {
                after.push(LatticeState {
                    set,
                    sum: state.sum + weight,
                    best: state.best + weight,
                    from: (index, peak),
                });
            }
        }
        layers.push(merged(after));
    }
    let ends = layers.last().map_or(&[][..], Vec::as_slice);
    let log_total = log_sum_exp(ends.iter().map(|s| s.sum));
    let matched = posterior(modes, peaks, &layers, &reach, log_total);
    let best = likeliest(&layers);
    Sum {
        log_total,
        matched,
        best,
    }
}

/// Log of the sum over all assignments alone, many times as fast: states of less than a part in 10^13 of the likeliest are left out.
pub fn log_total(modes: &[Choices]) -> f64 {
    const LEAST: f64 = 1e-13;
    let reach = reachable(modes);
    let mut log_scale = 0.0;
    let mut states: Vec<(LatticeSet, f64)> = vec![(0, 1.0)];
    let mut after: Vec<(LatticeSet, f64)> = Vec::new();
    let mut weights: Vec<(LatticeSet, f64)> = Vec::new();
    for (j, mode) in modes.iter().enumerate() {
        let links = mode.links.iter();
        weights.clear();
        weights.extend(links.map(|(i, w)| (1 << i, (w - mode.missing).exp())));
        log_scale += mode.missing;
        after.clear();
        for &(set, sum) in &states {
            after.push((set & reach[j + 1], sum));
            let free = weights.iter().filter(|(bit, _)| set & bit == 0);
            after.extend(free.map(|(bit, w)| ((set | bit) & reach[j + 1], sum * w)));
        }
        after.sort_unstable_by_key(|s| s.0);
        states.clear();
        let mut largest = 0.0_f64;
        for &(set, sum) in &after {
            match states.last_mut() {
                Some(last) if last.0 == set => last.1 += sum,
                _ => states.push((set, sum)),
            }
            largest = largest.max(states.last().map_or(0.0, |s| s.1));
        }
        states.retain(|s| s.1 > LEAST * largest);
        states.iter_mut().for_each(|s| s.1 /= largest);
        log_scale += largest.ln();
    }
    log_scale + states.iter().map(|s| s.1).sum::<f64>().ln()
}

/// Peaks that mode j and later ones can be, for every j and behind the last.
fn reachable(modes: &[Choices]) -> Vec<LatticeSet> {
    let mut reach = vec![0; modes.len() + 1];
    for (j, mode) in modes.iter().enumerate().rev() {
        let own = mode.links.iter().fold(0, |set, (i, _)| set | (1 << i));
        reach[j] = reach[j + 1] | own;
    }
    reach
}

/// What a mode can do from a set: the peak it takes, the set it leaves for later modes, the log weight.
fn steps(
    mode: &Choices,
    set: LatticeSet,
    later: LatticeSet,
) -> impl Iterator<Item = (Option<usize>, LatticeSet, f64)> + '_ {
    let free = mode.links.iter().filter(move |(i, _)| set & (1 << i) == 0);
    let taken = free.map(move |&(i, weight)| (Some(i), (set | (1 << i)) & later, weight));
    std::iter::once((None, set & later, mode.missing)).chain(taken)
}

/// One state a set, ordered by set; beyond [`MOST_STATES`] the likeliest.
fn merged(mut states: Vec<LatticeState>) -> Vec<LatticeState> {
    states.sort_by_key(|s| s.set);
    let mut unique: Vec<LatticeState> = Vec::with_capacity(states.len());
    for group in states.chunk_by(|a, b| a.set == b.set) {
        // the first of equals, so that ties do not depend on rounding elsewhere
        let best = group[1..].iter().fold(
            group[0],
            |best, s| {
                if s.best > best.best { *s } else { best }
            },
        );
        unique.push(LatticeState {
            sum: log_sum_exp(group.iter().map(|s| s.sum)),
            ..best
        });
    }
    if unique.len() > MOST_STATES {
        unique.sort_by(|a, b| b.sum.total_cmp(&a.sum).then(a.set.cmp(&b.set)));
        unique.truncate(MOST_STATES);
        unique.sort_by_key(|s| s.set);
    }
    unique
}

/// Share of the assignments in which a mode is a peak, by what follows from every state.
fn posterior(
    modes: &[Choices],
    peaks: usize,
    layers: &[Vec<LatticeState>],
    reach: &[LatticeSet],
    log_total: f64,
) -> DMatrix<f64> {
    let mut matched = DMatrix::zeros(modes.len(), peaks);
    let mut behind = vec![0.0; layers.last().map_or(0, Vec::len)];
    for (j, mode) in modes.iter().enumerate().rev() {
        let after = &layers[j + 1];
        let mut here = Vec::with_capacity(layers[j].len());
        for state in &layers[j] {
            let mut terms = Vec::with_capacity(1 + mode.links.len());
            for (peak, set, weight) in steps(mode, state.set, reach[j + 1]) {
                let Ok(next) = after.binary_search_by_key(&set, |s| s.set) else {
                    continue;
                };
                let term = weight + behind[next];
                terms.push(term);
                if let Some(i) = peak {
                    matched[(j, i)] += (state.sum + term - log_total).exp();
                }
            }
            here.push(log_sum_exp(terms.into_iter()));
        }
        behind = here;
    }
    matched
}

/// The likeliest assignment, traced back.
fn likeliest(layers: &[Vec<LatticeState>]) -> Vec<Option<usize>> {
    let mut best = vec![None; layers.len() - 1];
    let ends = layers.last().map_or(&[][..], Vec::as_slice);
    let mut at = 0;
    for (index, state) in ends.iter().enumerate() {
        if state.best > ends[at].best {
            at = index;
        }
    }
    for j in (0..best.len()).rev() {
        let (before, peak) = layers[j + 1][at].from;
        best[j] = peak;
        at = before;
    }
    best
}
