//! Jumps that a filter has smeared over some points: bands steeper than the field, with whole orders between their
//! two sides.

use std::collections::{BTreeMap, VecDeque};

use rayon::prelude::*;

use super::FEWEST;
use super::graph::{Graph, Offsets};
use crate::numeric::median;

/// A slope beyond this makes a point steep, orders a spacing: half that of one order over five points.
const STEEP: f64 = 0.1;
/// A band is bridged from points at most this many neighbours inside it from either side.
const REACH: u8 = 4;
/// Steps across a band between two sides, at least.
const CONTACTS: usize = 5;
/// The median step across a band lies within this of a whole number of orders, and most of the steps do: a jump is the
/// same all along its border.
const WHOLE: f64 = 0.3;
const MOST: f64 = 0.7;
/// A point of a ramp this far from both levels is smeared, orders.
const SMEARED: f64 = 0.15;

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
    let flat: Vec<bool> = (0..points.len())
        .into_par_iter()
        .map(|i| {
            let [s, t] = slope(graph, points, smooth, i);
            s.hypot(t) * spacing_mm <= STEEP
        })
        .collect();
    let sides = RampSides::new(graph, &flat);
    let mut contacts: BTreeMap<(u32, u32), Vec<f64>> = BTreeMap::new();
    for (a, b) in sides.contacts(graph) {
        let pair = (sides.side[a], sides.side[b]);
        contacts
            .entry(pair)
            .or_default()
            .push(smooth[b] - smooth[a]);
    }
    let found = levels(points.len(), &sides, &mut contacts);
    if found.values().all(|k| *k == 0) {
        return Vec::new();
    }
    let orders_of = |side: u32| found.get(&side).copied().unwrap_or(0);
    let mut beside: BTreeMap<u32, Vec<i32>> = BTreeMap::new();
    for &(a, b) in contacts.keys() {
        beside
            .entry(a)
            .or_default()
            .push(orders_of(b) - orders_of(a));
        beside
            .entry(b)
            .or_default()
            .push(orders_of(a) - orders_of(b));
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
            let above = level[i] - smooth[origin];
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
        orders[i] += orders_of(side) + added;
    }
    smeared
}

/// Whole orders of every side relative to the largest one, from the median steps of the `contacts`.
fn levels(
    n: usize,
    sides: &RampSides,
    contacts: &mut BTreeMap<(u32, u32), Vec<f64>>,
) -> BTreeMap<u32, i32> {
    let mut steps: Vec<(usize, u32, u32, i32)> = Vec::new();
    for (&(a, b), values) in contacts.iter_mut() {
        let whole = median(values).round();
        let agree = values
            .iter()
            .filter(|v| (**v - whole).abs() < WHOLE)
            .count();
        if values.len() >= CONTACTS && agree as f64 >= MOST * values.len() as f64 {
            steps.push((agree, a, b, whole as i32));
        }
    }
    steps.sort_by_key(|step| std::cmp::Reverse(step.0));
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
struct RampSides {
    /// The set of each point, as one of its points.
    side: Vec<u32>,
    /// The flat point from which a point was reached; none is `u32::MAX`.
    from: Vec<u32>,
    size: BTreeMap<u32, usize>,
}

impl RampSides {
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
