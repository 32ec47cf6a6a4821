//! Structured mesh of the plate with a hole: an O-grid about the hole blended into a box, and strips from the
//! box to both ends. Eight-node quadrilaterals (Q8), graded towards the hole.

use std::f64::consts::PI;

use super::clamp::Clamp;
use crate::error::{Error, Result};

/// Outline of the plate in coordinates centred on the hole, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// Ends along direction 1: `[low, high]`.
    pub s: [f64; 2],
    /// Edges along direction 2: `[low, high]`.
    pub t: [f64; 2],
    /// Hole radius.
    pub radius: f64,
    /// A clamped end, if there is one.
    pub clamp: Option<Clamp>,
}

impl Outline {
    /// Width at `s` over the nominal width, in the strip that leads to an end (0: s = high, 1: s = low).
    fn widening(&self, end: usize, s: f64) -> f64 {
        let width = self.t[1] - self.t[0];
        self.clamp
            .filter(|clamp| clamp.end == end)
            .map_or(1.0, |clamp| {
                clamp.factor(width, (self.s[1 - end] - s).abs())
            })
    }

    /// Distance of the nearest edge or end from the hole's centre, mm; below 0 if the centre lies outside the plate.
    pub fn clearance(&self) -> f64 {
        [-self.s[0], self.s[1], -self.t[0], self.t[1]]
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Check that the hole stays clear of the edges by at least a twentieth of its radius.
    ///
    /// # Errors
    /// A radius that is not above 0, a dimension that is not finite, or a hole too close to an edge.
    pub fn validate(&self) -> Result<()> {
        let nearest = self.clearance();
        let finite = self.s.iter().chain(&self.t).all(|v| v.is_finite());
        if finite && self.radius > 0.0 && nearest - self.radius >= 0.05 * self.radius {
            return Ok(());
        }
        Err(Error::input(
            "plate outline",
            "a hole that stays clear of the plate's edge",
        )
        .found(format!(
            "radius {} mm, edges at {:?} and {:?} mm from its centre",
            self.radius, self.s, self.t
        ))
        .hint("make the hole smaller, the plate larger, or move the hole inwards"))
    }
}

/// Numbers of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Density {
    /// Along each of the four sides of the box about the hole, on average.
    pub per_side: usize,
    /// From the hole to the box.
    pub radial: usize,
    /// From the box to both ends together.
    pub along: usize,
}

impl Density {
    /// The default mesh, 8,280 elements about a central hole.
    pub const DEFAULT: Density = Density {
        per_side: 36,
        radial: 44,
        along: 54,
    };

    /// The same mesh with every count multiplied by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let scale = |n: usize| ((n as f64 * factor).round() as usize).max(2);
        Self {
            per_side: scale(self.per_side).next_multiple_of(2),
            radial: scale(self.radial),
            along: scale(self.along),
        }
    }
}

/// Nodes and Q8 elements.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// Node coordinates (direction 1, direction 2), mm.
    pub nodes: Vec<[f64; 2]>,
    /// Corners counter-clockwise, then the midside nodes of edges 0-1, 1-2, 2-3, 3-0.
    pub elements: Vec<[u32; 8]>,
    /// Edges on the end s = high and s = low: two corners and the node between, in order of increasing t.
    pub ends: [Vec<[u32; 3]>; 2],
    /// The outline that was meshed.
    pub outline: Outline,
    layout: Layout,
}

/// The numbers of elements that make a mesh's connectivity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Layout {
    /// Along the four sides of the box about the hole.
    sides: [usize; 4],
    /// From the hole to the box.
    radial: usize,
    /// From the box to the end s = high and to the end s = low; none where the box reaches the end.
    strips: [usize; 2],
}

impl Layout {
    fn new(outline: &Outline, density: Density) -> Self {
        let half = 0.5 * (outline.t[1] - outline.t[0]);
        // No strip to an end that would leave only a sliver of it.
        let reach = [outline.s[1], -outline.s[0]]
            .map(|end| if end < SLIVER * half { 0.0 } else { end - half });
        let strips = reach.map(|length| {
            let share = length / (reach[0] + reach[1]).max(f64::MIN_POSITIVE);
            if length > 0.0 {
                (density.along as f64 * share).round().max(2.0) as usize
            } else {
                0
            }
        });
        let corner = box_corners(outline, strips);
        Self {
            sides: side_counts(&corner, density.per_side),
            radial: density.radial,
            strips,
        }
    }
}

/// An end nearer than this many half widths ends the box about the hole.
const SLIVER: f64 = 1.1;

/// Index of a lattice point that no Q8 element has (the middle of an element).
const NONE: u32 = u32::MAX;

/// The first radial step at the hole over the arc between two rays.
const FIRST_STEP: f64 = 0.4;

/// A structured block's nodes: `id[i][j]` on a lattice of corners and midsides.
type Lattice = Vec<Vec<u32>>;

impl Mesh {
    /// Mesh the outline.
    pub fn new(outline: Outline, density: Density) -> Self {
        Self::build(outline, Layout::new(&outline, density), None)
    }

    /// Another outline with the same connectivity: elements and nodes have the same numbers. With a `ring`, element
    /// edges lie on the circle of that radius (mm) about the hole.
    pub fn remade(&self, outline: Outline, ring: Option<f64>) -> Self {
        Self::build(outline, self.layout, ring)
    }

    fn build(outline: Outline, layout: Layout, ring: Option<f64>) -> Self {
        let mut mesh = Mesh {
            nodes: Vec::new(),
            elements: Vec::new(),
            ends: [Vec::new(), Vec::new()],
            outline,
            layout,
        };
        let corner = box_corners(&outline, layout.strips);
        let counts = layout.sides;
        let rays = ring_rays(&outline, &corner, counts);
        let mut places = mesh.places(&rays);
        if let Some(ring) = ring {
            align(&mut places, &rays, ring);
        }
        let rim = mesh.add_ring(&rays, &places);
        let high: Vec<u32> = rim[..=2 * counts[0]].to_vec();
        let from = 2 * (counts[0] + counts[1]);
        let low: Vec<u32> = rim[from..=from + 2 * counts[2]]
            .iter()
            .rev()
            .copied()
            .collect();
        for (end, edge) in [high, low].into_iter().enumerate() {
            mesh.add_strip(end, &edge, outline.s[1 - end], layout.strips[end]);
        }
        mesh
    }

    /// Degrees of freedom: two a node.
    pub fn unknowns(&self) -> usize {
        2 * self.nodes.len()
    }

    /// Coordinates of an element's eight nodes.
    pub fn corners(&self, element: usize) -> [[f64; 2]; 8] {
        self.elements[element].map(|n| self.nodes[n as usize])
    }

    fn add_node(&mut self, p: [f64; 2]) -> u32 {
        self.nodes.push(p);
        (self.nodes.len() - 1) as u32
    }

    /// Places of the corners along every ray of the O-grid, from 0 at the hole to 1 at the box.
    fn places(&self, rays: &[[[f64; 2]; 2]]) -> Vec<Vec<f64>> {
        let arc = 2.0 * PI * self.outline.radius / (rays.len() / 2) as f64;
        rays.iter()
            .map(|[inner, outer]| {
                let depth = (outer[0] - inner[0]).hypot(outer[1] - inner[1]);
                ring_grading(self.layout.radial, FIRST_STEP * arc / depth)
            })
            .collect()
    }

    /// The O-grid. Returns the nodes on the box, counter-clockwise from the corner (s high, t low).
    fn add_ring(&mut self, rays: &[[[f64; 2]; 2]], places: &[Vec<f64>]) -> Vec<u32> {
        let radial = self.layout.radial;
        let mut lattice: Lattice = Vec::with_capacity(rays.len() + 1);
        for (i, ([inner, outer], grading)) in rays.iter().zip(places).enumerate() {
            let column = (0..=2 * radial)
                .map(|j| {
                    if i % 2 == 1 && j % 2 == 1 {
                        return NONE;
                    }
                    let g = at_half(grading, j);
                    self.add_node([0, 1].map(|k| inner[k] + g * (outer[k] - inner[k])))
                })
                .collect();
            lattice.push(column);
        }
        lattice.push(lattice[0].clone());
        self.add_elements(&lattice);
        lattice.iter().map(|column| column[2 * radial]).collect()
    }

    /// A strip of elements from the box's side `edge` (t increasing) to the end at s = `far`.
    fn add_strip(&mut self, end: usize, edge: &[u32], far: f64, count: usize) {
        let near = self.nodes[edge[0] as usize][0];
        let reach = far - near;
        let step = (self.outline.t[1] - self.outline.t[0]) / (edge.len() / 2) as f64;
        let center = 0.5 * (self.outline.t[0] + self.outline.t[1]);
        let mut lattice: Lattice = vec![edge.to_vec()];
        if count > 0 {
            let grading = graded(count, (0.7 * step / reach.abs()).min(1.0));
            for j in 1..=2 * count {
                let s = near + reach * at_half(&grading, j);
                let widening = self.outline.widening(end, s);
                let row = (0..edge.len()).map(|i| {
                    if i % 2 == 1 && j % 2 == 1 {
                        return NONE;
                    }
                    let t = self.nodes[edge[i] as usize][1];
                    self.add_node([s, center + widening * (t - center)])
                });
                let row = row.collect();
                lattice.push(row);
            }
            self.add_elements(&lattice);
        }
        let last = &lattice[lattice.len() - 1];
        self.ends[end] = (0..last.len() - 1)
            .step_by(2)
            .map(|i| [last[i], last[i + 1], last[i + 2]])
            .collect();
    }

    /// The elements of a lattice of nodes `id[i][j]`, turned counter-clockwise.
    fn add_elements(&mut self, id: &Lattice) {
        for i in (0..id.len() - 1).step_by(2) {
            for j in (0..id[0].len() - 1).step_by(2) {
                let at = |di: usize, dj: usize| id[i + di][j + dj];
                let [a, b, c, d] = [at(0, 0), at(2, 0), at(2, 2), at(0, 2)];
                let [ab, bc, cd, da] = [at(1, 0), at(2, 1), at(1, 2), at(0, 1)];
                self.elements.push(if self.turns_left(a, b, c) {
                    [a, b, c, d, ab, bc, cd, da]
                } else {
                    [a, d, c, b, da, cd, bc, ab]
                });
            }
        }
    }

    fn turns_left(&self, a: u32, b: u32, c: u32) -> bool {
        let [a, b, c] = [a, b, c].map(|n| self.nodes[n as usize]);
        (b[0] - a[0]) * (c[1] - b[1]) > (b[1] - a[1]) * (c[0] - b[0])
    }
}

/// Corners of the box about the hole, counter-clockwise from (s high, t low). Along direction 1 it is as long as the
/// plate is wide, but never past an end, and it reaches an end without a strip.
fn box_corners(outline: &Outline, strips: [usize; 2]) -> [[f64; 2]; 4] {
    let half = 0.5 * (outline.t[1] - outline.t[0]);
    let side = |end: usize| {
        let far = outline.s[1 - end];
        if strips[end] == 0 {
            far
        } else {
            half.min(far.abs() / SLIVER).copysign(far)
        }
    };
    let [high, low] = [side(0), side(1)];
    let [t0, t1] = outline.t;
    [[high, t0], [high, t1], [low, t1], [low, t0]]
}

/// Move the corners along the rays so that those of one index lie on a circle about the hole; the others keep their
/// proportions on both sides of it.
fn align(places: &mut [Vec<f64>], rays: &[[[f64; 2]; 2]], radius: f64) {
    let crossing: Vec<f64> = rays.iter().map(|ray| cross_circle(ray, radius)).collect();
    let index = |(places, &at): (&Vec<f64>, &f64)| places.partition_point(|&g| g < at) as f64;
    let sum: f64 = places.iter().zip(&crossing).map(index).sum();
    let last = places.first().map_or(0, Vec::len).saturating_sub(2);
    let middle = ((sum / rays.len() as f64 - 0.5).round() as usize).clamp(1, last.max(1));
    for (places, at) in places.iter_mut().zip(crossing) {
        let from = places[middle];
        for g in places.iter_mut() {
            *g = if *g <= from {
                *g * at / from
            } else {
                at + (*g - from) * (1.0 - at) / (1.0 - from)
            };
        }
    }
}

/// Where a ray that starts inside a circle about the origin crosses it, as a fraction of its length.
fn cross_circle([inner, outer]: &[[f64; 2]; 2], radius: f64) -> f64 {
    let d = [outer[0] - inner[0], outer[1] - inner[1]];
    let (a, b) = (d[0] * d[0] + d[1] * d[1], inner[0] * d[0] + inner[1] * d[1]);
    let c = inner[0] * inner[0] + inner[1] * inner[1] - radius * radius;
    -c / (b + (b * b - a * c).sqrt())
}

/// Elements along the four sides of the box: 4 `per_side` in all, shared by the angles under which the hole sees
/// them, so that the elements about the hole are about equally wide wherever the hole lies.
fn side_counts(corner: &[[f64; 2]; 4], per_side: usize) -> [usize; 4] {
    [0, 1, 2, 3].map(|side| {
        let share = 4.0 * sweep(corner, side) / (2.0 * PI);
        ((per_side as f64 * share / 2.0).round() as usize).max(1) * 2
    })
}

/// Angle under which the origin sees a side of the box.
fn sweep(corner: &[[f64; 2]; 4], side: usize) -> f64 {
    let [a, b] = [corner[side], corner[(side + 1) % 4]];
    (b[1].atan2(b[0]) - a[1].atan2(a[0])).rem_euclid(2.0 * PI)
}

/// Rays of the O-grid, counter-clockwise from the corner (s high, t low): the point on the hole and the point
/// on the box, for corners (even) and midsides (odd) in turn. A midside's point on the box is the middle of its
/// neighbours, so that the strips' edges stay straight and evenly divided; on the hole it lies on the circle.
fn ring_rays(outline: &Outline, corner: &[[f64; 2]; 4], counts: [usize; 4]) -> Vec<[[f64; 2]; 2]> {
    let mut angles = Vec::new();
    let mut outer = Vec::new();
    for (side, count) in counts.into_iter().enumerate() {
        let [a, b] = [corner[side], corner[(side + 1) % 4]];
        let from = a[1].atan2(a[0]);
        for k in 0..count {
            let angle = from + sweep(corner, side) * k as f64 / count as f64;
            let (sin, cos) = angle.sin_cos();
            // The point of the side a-b on the ray: a + f (b - a) with its cross product with the ray zero.
            let f = (a[0] * sin - a[1] * cos) / ((a[0] - b[0]) * sin - (a[1] - b[1]) * cos);
            angles.push(angle);
            // Half-way to even steps along the side: a ray that meets it at a slant would make long elements.
            let f = f + 0.5 * (k as f64 / count as f64 - f);
            outer.push([0, 1].map(|k| a[k] + f * (b[k] - a[k])));
        }
    }
    let n = angles.len();
    let on_hole = |angle: f64| [outline.radius * angle.cos(), outline.radius * angle.sin()];
    let mut rays = Vec::with_capacity(2 * n);
    for k in 0..n {
        let next = (k + 1) % n;
        let sweep = (angles[next] - angles[k]).rem_euclid(2.0 * PI);
        rays.push([on_hole(angles[k]), outer[k]]);
        rays.push([
            on_hole(angles[k] + 0.5 * sweep),
            [0, 1].map(|c| 0.5 * (outer[k][c] + outer[next][c])),
        ]);
    }
    rays
}

/// `n + 1` places from 0 to 1, x -> s x + (1 - s) x^2.5, whose first step is about `first`; even where that is
/// coarser. Steps grow more slowly far out than in a geometric progression, where the box's corners need them.
fn ring_grading(n: usize, first: f64) -> Vec<f64> {
    let slope = (first * n as f64).min(1.0);
    (0..=n)
        .map(|k| k as f64 / n as f64)
        .map(|x| slope * x + (1.0 - slope) * x.powf(2.5))
        .collect()
}

/// `n + 1` places from 0 to 1 in geometric progression whose first step is `first`; even where that is coarser.
fn graded(n: usize, first: f64) -> Vec<f64> {
    if first * n as f64 >= 1.0 {
        return (0..=n).map(|k| k as f64 / n as f64).collect();
    }
    let total = |q: f64| first * (q.powi(n as i32) - 1.0) / (q - 1.0);
    let [mut low, mut high] = [1.0 + 1e-12, 2.0];
    while total(high) < 1.0 {
        high *= 2.0;
    }
    for _ in 0..200 {
        let q = 0.5 * (low + high);
        if total(q) < 1.0 {
            low = q;
        } else {
            high = q;
        }
    }
    let mut places: Vec<f64> = (0..=n)
        .map(|k| first * (low.powi(k as i32) - 1.0) / (low - 1.0))
        .collect();
    places[n] = 1.0;
    places
}

/// Place `j` on a lattice of corners (even) and midsides (odd).
fn at_half(places: &[f64], j: usize) -> f64 {
    0.5 * (places[j / 2] + places[j.div_ceil(2)])
}
