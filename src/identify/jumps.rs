//! Fringe-order jumps: connected regions of a moire field that are off by whole orders, found in measured minus
//! predicted displacement and corrected before anything is fitted.
//!
//! A jump of whole orders does not show in the *phase* of the difference. The phase is smoothed and unwrapped
//! (`graph`); what the difference has on top of it, in whole orders, is the jump, point by point and however regions
//! lie in each other. A filter of the measurement may have smeared a jump into a ramp, which the unwrapped phase
//! follows; `ramps` finds these from the level of both sides.

mod graph;
mod ramps;
mod trend;

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::field::Field;
use crate::numeric::Forest;
pub use graph::FEWEST;
use graph::Graph;

/// A connected region of one component with the same orders at all points.
#[derive(Debug, Clone, PartialEq)]
pub struct JumpRegion {
    /// 0 for u1, 1 for u2.
    pub component: usize,
    /// Orders that the measurement has too many.
    pub orders: i32,
    pub points: usize,
    /// Mean (s, t) of the points, mm.
    pub centre_mm: [f64; 2],
    /// Smallest (s, t), mm.
    pub low_mm: [f64; 2],
    /// Largest (s, t), mm.
    pub high_mm: [f64; 2],
}

/// The jumps of a field, relative to the largest region of each component. (All of a component by the same orders is a
/// rigid translation and cannot be seen.)
#[derive(Debug, Clone, PartialEq)]
pub struct Jumps {
    /// One fringe order 1/f_s, mm.
    pub order_mm: f64,
    /// Orders too many of u1 and of u2 at each point.
    pub orders: [Vec<i32>; 2],
    /// Regions of other than zero orders, by component, the largest first.
    pub regions: Vec<JumpRegion>,
    /// Points within a smeared jump, in increasing order: they are off by a fraction of an order that no correction by
    /// whole orders takes away, and should be dropped.
    pub smeared: Vec<usize>,
    /// Why nothing is reported, where the field does not allow a search.
    pub refused: Option<String>,
}

/// Share of the neighbour steps above half an order beyond which nothing is reported.
const MOST_STEPS: f64 = 0.1;
/// Share of points with three quarters of their steps above half an order beyond which nothing is reported: the border
/// of a jump has hardly any such points, a field too steep for its points has little else.
const MOST_POINTS: f64 = 0.02;

/// Find the jumps in `field` given the `prediction` (u1, u2) in mm at its points and the fringe order `order_mm` = 1/f_s.
///
/// The prediction may miss a rigid motion, bending (any cubic of the place) and besides any smooth part whose step from
/// point to point is well below half an order (below 0.2 orders: beyond 0.3 in a small part of the field, which is not
/// refused, a false region was seen at the border). Where more than a tenth of the neighbour steps exceed half an order, or at more than 2 % of the points
/// nearly all, nothing is reported and [`Jumps::refused`] says why. Parts of the field without neighbours in
/// common are searched each by itself.
pub fn find(field: &Field, prediction: &[[f64; 2]], order_mm: f64) -> Jumps {
    let n = field.len();
    let mut jumps = Jumps {
        order_mm,
        orders: [vec![0; n], vec![0; n]],
        regions: Vec::new(),
        smeared: Vec::new(),
        refused: None,
    };
    if !(order_mm.is_finite() && order_mm > 0.0) || prediction.len() != n {
        jumps.refused =
            Some("a positive fringe order and a prediction at every point are needed".into());
        return jumps;
    }
    let graph = Graph::new(&field.points);
    let spacing = field.spacing_mm();
    let found: Vec<Result<Levels, String>> = [0, 1]
        .par_iter()
        .map(|&c| {
            let difference: Vec<f64> = field
                .displacement
                .iter()
                .zip(prediction)
                .map(|(u, p)| (u[c] - p[c]) / order_mm)
                .collect();
            let difference = trend::without(&field.points, &difference);
            search(&graph, &field.points, &difference, spacing)
        })
        .collect();
    for (c, result) in found.into_iter().enumerate() {
        match result {
            Ok(component) => {
                jumps
                    .regions
                    .extend(regions(&graph, &field.points, &component.orders, c));
                jumps.orders[c] = component.orders;
                jumps.smeared.extend(component.smeared);
            }
            Err(why) => jumps.refused = Some(format!("u{}: {why}", c + 1)),
        }
    }
    if jumps.refused.is_some() {
        jumps.orders = [vec![0; n], vec![0; n]];
        jumps.regions.clear();
        jumps.smeared.clear();
    }
    jumps.smeared.sort_unstable();
    jumps.smeared.dedup();
    jumps
}

impl Jumps {
    /// Subtract the orders from the measured displacements of the field in which they were found.
    pub fn correct(&self, field: &mut Field) {
        for (i, u) in field.displacement.iter_mut().enumerate() {
            for (u, orders) in u.iter_mut().zip(&self.orders) {
                *u -= f64::from(orders[i]) * self.order_mm;
            }
        }
    }
}

/// Orders of one component at each point, and the points within a smeared jump.
struct Levels {
    orders: Vec<i32>,
    smeared: Vec<usize>,
}

/// The jumps in one component's `difference`, in orders.
fn search(
    graph: &Graph,
    points: &[[f64; 2]],
    difference: &[f64],
    spacing_mm: f64,
) -> Result<Levels, String> {
    check_steps(graph, difference)?;
    let phase = graph.smoothed_phase(difference);
    let (smooth, part) = graph.unwrap(&phase);
    let mut orders: Vec<i32> = difference
        .iter()
        .zip(&smooth)
        .map(|(d, g)| (d - g).round() as i32)
        .collect();
    consolidate(graph, &part, &mut orders);
    // the phase without its outliers and relative to what was just found
    let level: Vec<f64> = difference
        .iter()
        .zip(&orders)
        .map(|(d, k)| d - f64::from(*k))
        .collect();
    let smeared = ramps::find(graph, points, &smooth, &level, spacing_mm, &mut orders);
    consolidate(graph, &part, &mut orders);
    Ok(Levels { orders, smeared })
}

/// Refuse a field too steep or too noisy for its points.
fn check_steps(graph: &Graph, difference: &[f64]) -> Result<(), String> {
    let (mut steps, mut large, mut lost) = (0_usize, 0_usize, 0_usize);
    for (i, d) in difference.iter().enumerate() {
        let near = graph.neighbours(i);
        let above = near
            .iter()
            .filter(|&&j| (difference[j as usize] - d).abs() > 0.5)
            .count();
        steps += near.len();
        large += above;
        lost += usize::from(4 * above >= 3 * near.len() && above > 0);
    }
    let share = large as f64 / steps.max(1) as f64;
    let points = lost as f64 / difference.len().max(1) as f64;
    if share <= MOST_STEPS && points <= MOST_POINTS {
        return Ok(());
    }
    Err(format!(
        "{:.1} % of the steps between neighbouring points exceed half a fringe order (at {:.1} % of the points nearly all): \
         the residual is too steep or too noisy for the spacing of the points to tell a jump from a slope",
        100.0 * share,
        100.0 * points
    ))
}

/// Connected sets of equal orders: the set of each point (as one of its points) and the sets' sizes.
fn sets(graph: &Graph, orders: &[i32]) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = Forest::new(orders.len());
    for i in 0..orders.len() {
        for &j in graph.neighbours(i) {
            if orders[i] == orders[j as usize] {
                offsets.join(i as u32, j, 0);
            }
        }
    }
    let set: Vec<u32> = (0..orders.len())
        .map(|i| offsets.root(i as u32).0)
        .collect();
    let mut size = vec![0; orders.len()];
    set.iter().for_each(|&s| size[s as usize] += 1);
    (set, size)
}

/// Make orders relative to the largest set of their part of the field, and give sets of fewer than [`FEWEST`] points
/// the orders that most of their neighbours have.
fn consolidate(graph: &Graph, part: &[u32], orders: &mut [i32]) {
    let (set, size) = sets(graph, orders);
    let mut reference: BTreeMap<u32, (u32, i32)> = BTreeMap::new();
    for i in 0..orders.len() {
        let own = (size[set[i] as usize], orders[i]);
        let best = reference.entry(part[i]).or_insert(own);
        if own.0 > best.0 {
            *best = own;
        }
    }
    for (k, p) in orders.iter_mut().zip(part) {
        *k -= reference.get(p).map_or(0, |r| r.1);
    }
    let mut small: Vec<bool> = set
        .iter()
        .map(|&s| (size[s as usize] as usize) < FEWEST)
        .collect();
    while small.contains(&true) {
        let mut votes: BTreeMap<u32, BTreeMap<i32, usize>> = BTreeMap::new();
        for i in 0..orders.len() {
            for &j in graph.neighbours(i) {
                let j = j as usize;
                // a neighbour is one either way round
                for (from, to) in [(i, j), (j, i)] {
                    if small[from] && !small[to] {
                        *votes
                            .entry(set[from])
                            .or_default()
                            .entry(orders[to])
                            .or_default() += 1;
                    }
                }
            }
        }
        if votes.is_empty() {
            break;
        }
        for i in (0..orders.len()).filter(|&i| small[i]).collect::<Vec<_>>() {
            let winner = votes
                .get(&set[i])
                .and_then(|v| v.iter().max_by_key(|(k, n)| (**n, -k.abs())));
            if let Some((k, _)) = winner {
                orders[i] = *k;
                small[i] = false;
            }
        }
    }
    // a part of the field with nothing else
    for (k, small) in orders.iter_mut().zip(&small) {
        if *small {
            *k = 0;
        }
    }
}

/// The regions of other than zero orders of one component.
fn regions(
    graph: &Graph,
    points: &[[f64; 2]],
    orders: &[i32],
    component: usize,
) -> Vec<JumpRegion> {
    let (set, _) = sets(graph, orders);
    let mut found: BTreeMap<u32, JumpRegion> = BTreeMap::new();
    for (i, p) in points.iter().enumerate().filter(|(i, _)| orders[*i] != 0) {
        let region = found.entry(set[i]).or_insert(JumpRegion {
            component,
            orders: orders[i],
            points: 0,
            centre_mm: [0.0; 2],
            low_mm: *p,
            high_mm: *p,
        });
        region.points += 1;
        for (k, &x) in p.iter().enumerate() {
            region.centre_mm[k] += x;
            region.low_mm[k] = region.low_mm[k].min(x);
            region.high_mm[k] = region.high_mm[k].max(x);
        }
    }
    let mut found: Vec<JumpRegion> = found.into_values().collect();
    for region in &mut found {
        let count = region.points as f64;
        region.centre_mm = region.centre_mm.map(|sum| sum / count);
    }
    found.sort_by_key(|region| std::cmp::Reverse(region.points));
    found
}
