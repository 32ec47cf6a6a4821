//! Jumps that a filter has smeared over some points: bands steeper than the field, with whole orders between their
//! two sides.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{SMatrix, SVector};

use super::FEWEST;
use super::graph::{Graph, Offsets};

/// A slope beyond the field's own makes a point steep, orders a spacing: half that of one order over five points.
const STEEP: f64 = 0.1;
/// A band is bridged from points at most this many neighbours inside it from either side.
const REACH: u8 = 6;
/// Steps across a band between two sides, at least.
const CONTACTS: usize = 5;
/// The median step across a band lies within this of a whole number of orders.
const WHOLE: f64 = 0.25;
/// A point of a ramp this far from both levels is smeared, orders.
const SMEARED: f64 = 0.15;

type Cubic = SVector<f64, 10>;

/// Add to `orders` what smeared jumps have in the unwrapped and smoothed phase `smooth` (orders). `level` is the
/// difference itself without the jumps found so far. Returns the points within ramps.
pub(super) fn find(
    graph: &Graph,
    points: &[[f64; 2]],
    smooth: &[f64],
    level: &[f64],
    spacing_mm: f64,
    orders: &mut [i32],
) -> Vec<usize> {
    let slopes: Vec<[f64; 2]> = (0..points.len())
        .map(|i| slope(graph, points, smooth, i))
        .collect();
    let trend = Trend::new(points, &slopes);
    let flat: Vec<bool> = slopes
        .iter()
        .zip(points)
        .map(|(g, p)| {
            let own = trend.at(*p);
            (g[0] - own[0]).hypot(g[1] - own[1]) * spacing_mm <= STEEP
        })
        .collect();
    let sides = Sides::new(graph, &flat);
    // how far a value lies above another, but for the field's own slope between them
    let step = |from: usize, value: f64, to: usize| {
        let [p, q] = [points[from], points[to]];
        let own = trend.at([0, 1].map(|k| 0.5 * (p[k] + q[k])));
        value - smooth[from] - own[0] * (q[0] - p[0]) - own[1] * (q[1] - p[1])
    };
    let mut contacts: BTreeMap<(u32, u32), Vec<f64>> = BTreeMap::new();
    for (a, b) in sides.contacts(graph) {
        let pair = (sides.side[a], sides.side[b]);
        contacts
            .entry(pair)
            .or_default()
            .push(step(a, smooth[b], b));
    }
    let found = levels(points.len(), &sides, &mut contacts);
    if found.values().all(|k| *k == 0) {
        return Vec::new();
    }
    let own = |side: u32| found.get(&side).copied().unwrap_or(0);
    let mut beside: BTreeMap<u32, Vec<i32>> = BTreeMap::new();
    for &(a, b) in contacts.keys() {
        beside.entry(a).or_default().push(own(b) - own(a));
        beside.entry(b).or_default().push(own(a) - own(b));
    }
    let mut smeared = Vec::new();
    for i in 0..points.len() {
        let Some(origin) = sides.origin(i) else {
            continue;
        };
        let side = sides.side[i];
        let mut added = 0;
        if !flat[i] {
            // a point in the band goes to the nearer level of the two sides
            let above = step(origin, level[i], i);
            let other = beside.get(&side).into_iter().flatten().copied();
            let distance = |k: i32| (above - f64::from(k)).abs();
            let all: Vec<i32> = other.filter(|k| *k != 0).collect();
            added = all.iter().copied().fold(0, |best, k| {
                if distance(k) < distance(best) {
                    k
                } else {
                    best
                }
            });
            if !all.is_empty() && distance(added) > SMEARED {
                smeared.push(i);
            }
        }
        orders[i] += own(side) + added;
    }
    smeared
}

/// Whole orders of every side relative to the largest one, from the median steps of the `contacts`.
fn levels(
    n: usize,
    sides: &Sides,
    contacts: &mut BTreeMap<(u32, u32), Vec<f64>>,
) -> BTreeMap<u32, i32> {
    let mut steps: Vec<(usize, u32, u32, i32)> = Vec::new();
    for (&(a, b), values) in contacts.iter_mut() {
        values.sort_unstable_by(f64::total_cmp);
        let median = values[values.len() / 2];
        if values.len() >= CONTACTS && (median - median.round()).abs() < WHOLE {
            steps.push((values.len(), a, b, median.round() as i32));
        }
    }
    steps.sort_by(|p, q| q.0.cmp(&p.0));
    let mut offsets = Offsets::new(n);
    for (_, a, b, orders) in steps {
        offsets.join(a, b, orders);
    }
    let largest = sides.size.iter().max_by_key(|(side, n)| (**n, **side));
    let Some((&largest, _)) = largest else {
        return BTreeMap::new();
    };
    let (root, reference) = offsets.root(largest);
    sides
        .size
        .keys()
        .filter_map(|&side| {
            let (own, above) = offsets.root(side);
            (own == root).then_some((side, above - reference))
        })
        .collect()
}

/// Connected sets of flat points, and the steep points nearest to each.
struct Sides {
    /// The set of each point, as one of its points.
    side: Vec<u32>,
    /// The flat point from which a point was reached; none is `u32::MAX`.
    from: Vec<u32>,
    size: BTreeMap<u32, usize>,
}

impl Sides {
    fn new(graph: &Graph, flat: &[bool]) -> Self {
        let n = flat.len();
        let mut offsets = Offsets::new(n);
        for i in (0..n).filter(|&i| flat[i]) {
            for &j in graph.neighbours(i) {
                if flat[j as usize] {
                    offsets.join(i as u32, j, 0);
                }
            }
        }
        let mut side: Vec<u32> = (0..n).map(|i| offsets.root(i as u32).0).collect();
        let mut size: BTreeMap<u32, usize> = BTreeMap::new();
        for i in (0..n).filter(|&i| flat[i]) {
            *size.entry(side[i]).or_default() += 1;
        }
        size.retain(|_, n| *n >= FEWEST);
        let mut from = vec![u32::MAX; n];
        let mut queue: VecDeque<(usize, u8)> = VecDeque::new();
        for i in (0..n).filter(|&i| flat[i] && size.contains_key(&side[i])) {
            from[i] = i as u32;
            queue.push_back((i, 0));
        }
        while let Some((i, depth)) = queue.pop_front() {
            if depth == REACH {
                continue;
            }
            for &j in graph.neighbours(i) {
                let j = j as usize;
                if from[j] == u32::MAX {
                    from[j] = from[i];
                    side[j] = side[i];
                    queue.push_back((j, depth + 1));
                }
            }
        }
        Self { side, from, size }
    }

    fn origin(&self, i: usize) -> Option<usize> {
        (self.from[i] != u32::MAX).then_some(self.from[i] as usize)
    }

    /// Pairs of flat points on different sides whose reaches meet, the smaller side first.
    fn contacts(&self, graph: &Graph) -> Vec<(usize, usize)> {
        let mut found = Vec::new();
        for i in 0..self.side.len() {
            for &j in graph.neighbours(i) {
                let j = j as usize;
                let (Some(a), Some(b)) = (self.origin(i), self.origin(j)) else {
                    continue;
                };
                if self.side[i] != self.side[j] {
                    let ordered = self.side[i] < self.side[j];
                    found.push(if ordered { (a, b) } else { (b, a) });
                }
            }
        }
        found
    }
}

/// Least-squares slope (1/mm) of `values` about point `i`.
fn slope(graph: &Graph, points: &[[f64; 2]], values: &[f64], i: usize) -> [f64; 2] {
    let (mut ss, mut st, mut tt, mut sv, mut tv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &j in graph.neighbours(i) {
        let j = j as usize;
        let [s, t] = [0, 1].map(|k| points[j][k] - points[i][k]);
        let v = values[j] - values[i];
        ss += s * s;
        st += s * t;
        tt += t * t;
        sv += s * v;
        tv += t * v;
    }
    let determinant = ss * tt - st * st;
    if determinant <= 1e-9 * ss * tt {
        return [0.0; 2];
    }
    [
        (tt * sv - st * tv) / determinant,
        (ss * tv - st * sv) / determinant,
    ]
}

/// The field's own slope: a cubic of the place for each component, by least absolute deviations.
struct Trend {
    centre: [f64; 2],
    half: f64,
    coefficients: [Cubic; 2],
}

impl Trend {
    fn new(points: &[[f64; 2]], slopes: &[[f64; 2]]) -> Self {
        const MOST: usize = 20_000;
        const SWEEPS: usize = 8;
        let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for p in points {
            for k in 0..2 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        let half = (0..2)
            .map(|k| 0.5 * (high[k] - low[k]))
            .fold(f64::MIN_POSITIVE, f64::max);
        let mut trend = Self {
            centre: [0, 1].map(|k| 0.5 * (low[k] + high[k])),
            half,
            coefficients: [Cubic::zeros(); 2],
        };
        // an odd stride wanders through the columns of most grids
        let used: Vec<usize> = (0..points.len())
            .step_by((points.len() / MOST) | 1)
            .collect();
        for c in 0..2 {
            let mut weights = vec![1.0; used.len()];
            for _ in 0..SWEEPS {
                let mut gram = SMatrix::<f64, 10, 10>::zeros();
                let mut right = Cubic::zeros();
                for (&i, w) in used.iter().zip(&weights) {
                    let row = trend.row(points[i]);
                    gram.ger(*w, &row, &row, 1.0);
                    right.axpy(w * slopes[i][c], &row, 1.0);
                }
                let ridge = 1e-9 * gram.trace();
                (0..10).for_each(|k| gram[(k, k)] += ridge);
                let Some(factor) = gram.cholesky() else { break };
                trend.coefficients[c] = factor.solve(&right);
                let mut deviations: Vec<f64> = used
                    .iter()
                    .map(|&i| {
                        (slopes[i][c] - trend.row(points[i]).dot(&trend.coefficients[c])).abs()
                    })
                    .collect();
                let sum: f64 = deviations.iter().sum();
                let floor = (1e-3 * sum / used.len() as f64).max(f64::MIN_POSITIVE);
                deviations
                    .iter_mut()
                    .for_each(|d| *d = floor / d.max(floor));
                weights = deviations;
            }
        }
        trend
    }

    fn row(&self, p: [f64; 2]) -> Cubic {
        let [s, t] = [0, 1].map(|k| (p[k] - self.centre[k]) / self.half);
        Cubic::from([
            1.0,
            s,
            t,
            s * s,
            s * t,
            t * t,
            s * s * s,
            s * s * t,
            s * t * t,
            t * t * t,
        ])
    }

    fn at(&self, p: [f64; 2]) -> [f64; 2] {
        let row = self.row(p);
        [0, 1].map(|c| row.dot(&self.coefficients[c]))
    }
}
