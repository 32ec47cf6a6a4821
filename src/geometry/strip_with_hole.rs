//! A strip with a circular hole: an O-grid about the hole blended into a box, and strips from the box to both ends,
//! graded towards the hole.

use std::f64::consts::PI;
use std::sync::Arc;

use super::grading::{at_half, graded, ring_grading};
use super::mesh::{Lattice, Mesh, NONE};
use super::outline::Outline;
use super::{Density, Geometry, HIGH, HOLE, LOW, Morph, SIDES};
use crate::error::{Error, Result};
use crate::laminate::{End, SpecimenSpec};

/// A strip with a circular hole at the origin.
#[derive(Debug, Clone, Copy)]
pub struct StripWithHole {
    pub outline: Outline,
    /// The hole's radius, mm.
    pub radius: f64,
}

/// Elements of the default mesh (8,280 about a central hole): along each of the four sides of the box about the hole on
/// average, from the hole to the box, and from the box to both ends together.
const ELEMENTS: [usize; 3] = [36, 44, 54];

pub fn build(specimen: &SpecimenSpec) -> Option<Arc<dyn Geometry>> {
    let hole = specimen.hole?;
    Some(Arc::new(StripWithHole {
        outline: Outline::about(specimen, hole.center_mm),
        radius: 0.5 * hole.diameter_mm,
    }))
}

impl StripWithHole {
    /// Whether the hole stays clear of the outer edge by at least a twentieth of its radius.
    fn is_clear(&self) -> bool {
        self.outline.clearance() >= 1.05 * self.radius
    }
}

impl Geometry for StripWithHole {
    fn name(&self) -> &'static str {
        "strip_with_hole"
    }

    fn extents(&self) -> [[f64; 2]; 2] {
        [self.outline.s, self.outline.t]
    }

    fn widening(&self) -> f64 {
        self.outline.clamp.map_or(1.0, |clamp| clamp.widening)
    }

    fn distance(&self, edge: &str, point: [f64; 2]) -> Option<f64> {
        match edge {
            HOLE => Some(point[0].hypot(point[1]) - self.radius),
            _ => self.outline.distance(edge, point),
        }
    }

    fn hole_radius(&self) -> Option<f64> {
        Some(self.radius)
    }

    fn validate(&self) -> Result<()> {
        let Outline { s, t, .. } = self.outline;
        if !(self.outline.is_sound() && self.radius > 0.0 && self.is_clear()) {
            return Err(Error::input(
                "plate outline",
                "a hole that stays clear of the plate's edge",
            )
            .found(format!(
                "radius {} mm, edges at {s:?} and {t:?} mm from its centre",
                self.radius
            ))
            .hint("make the hole smaller, the plate larger, or move the hole inwards"));
        }
        Ok(())
    }

    fn has_movable_hole(&self) -> bool {
        true
    }

    fn has_parallel_sides(&self) -> bool {
        true
    }

    fn morphed(&self, morph: &Morph) -> Result<Arc<dyn Geometry>> {
        let [d1, d2] = morph.hole_offset;
        let wide = self.outline.widened(morph.width);
        // Seen from the hole, ends and sides move by the opposite.
        let changed = Self {
            outline: Outline {
                s: wide.s.map(|s| s - d1),
                t: wide.t.map(|t| t - d2),
                ..wide
            },
            radius: self.radius * morph.hole_size,
        };
        changed.validate()?;
        Ok(Arc::new(changed))
    }

    fn counts(&self, density: Density) -> Vec<usize> {
        let [per_side, radial, along] = ELEMENTS.map(|n| density.count(n));
        let strips = strip_counts(&self.outline, along);
        let corner = box_corners(&self.outline, strips);
        let sides = side_counts(&corner, per_side.next_multiple_of(2));
        [&sides[..], &[radial], &strips].concat()
    }

    fn mesh(&self, counts: &[usize]) -> Mesh {
        let at = |k: usize| counts.get(k).copied().unwrap_or(2);
        let layout = MeshLayout {
            sides: [0, 1, 2, 3].map(at),
            radial: at(4),
            strips: [at(5), at(6)],
        };
        layout.mesh(self)
    }
}

/// The numbers of elements that make a mesh's connectivity.
struct MeshLayout {
    /// Along the four sides of the box about the hole.
    sides: [usize; 4],
    /// From the hole to the box.
    radial: usize,
    /// From the box to the high end and to the low end; none where the box reaches the end.
    strips: [usize; 2],
}

/// An end nearer than this many half widths ends the box about the hole.
const SLIVER: f64 = 1.1;

/// The first radial step at the hole over the arc between two rays.
const FIRST_STEP: f64 = 0.4;

/// The first step of a strip from the box over the mean width of its elements.
const STRIP_STEP: f64 = 0.7;

impl MeshLayout {
    fn mesh(&self, plate: &StripWithHole) -> Mesh {
        let outline = &plate.outline;
        let mut mesh = Mesh {
            extents: plate.extents(),
            ..Mesh::default()
        };
        let corner = box_corners(outline, self.strips);
        let rays = ring_rays(plate.radius, &corner, self.sides);
        let places = self.places(plate.radius, &rays);
        let ring = self.add_ring(&mut mesh, &rays, &places);
        let rim = |from: usize, count: usize| -> Vec<u32> {
            let nodes = ring[2 * from..=2 * (from + count)].iter();
            nodes.map(|ray| ray[2 * self.radial]).collect()
        };
        let [a, b, c, d] = self.sides;
        let [right, top, mut left, bottom] =
            [rim(0, a), rim(a, b), rim(a + b, c), rim(a + b + c, d)];
        left.reverse();
        let high = self.add_strip(&mut mesh, outline, End::High, &right);
        let low = self.add_strip(&mut mesh, outline, End::Low, &left);
        name_edges(&mut mesh, [&low, &high], &bottom, &top);
        mesh.name_edges(HOLE, &[ring.iter().rev().map(|ray| ray[0]).collect()]);
        mesh
    }

    /// Places of the corners along every ray of the O-grid, from 0 at the hole to 1 at the box.
    fn places(&self, radius: f64, rays: &[[[f64; 2]; 2]]) -> Vec<Vec<f64>> {
        let arc = 2.0 * PI * radius / (rays.len() / 2) as f64;
        rays.iter()
            .map(|[inner, outer]| {
                let depth = (outer[0] - inner[0]).hypot(outer[1] - inner[1]);
                ring_grading(self.radial, FIRST_STEP * arc / depth)
            })
            .collect()
    }

    /// The O-grid, counter-clockwise from the corner (s high, t low): the nodes along every ray from the hole.
    fn add_ring(&self, mesh: &mut Mesh, rays: &[[[f64; 2]; 2]], places: &[Vec<f64>]) -> Lattice {
        let mut lattice: Lattice = Vec::with_capacity(rays.len() + 1);
        for (i, ([inner, outer], grading)) in rays.iter().zip(places).enumerate() {
            let column = (0..=2 * self.radial)
                .map(|j| {
                    if i % 2 == 1 && j % 2 == 1 {
                        return NONE;
                    }
                    let g = at_half(grading, j);
                    mesh.add_node([0, 1].map(|k| inner[k] + g * (outer[k] - inner[k])))
                })
                .collect();
            lattice.push(column);
        }
        lattice.push(lattice[0].clone());
        mesh.add_elements(&lattice);
        lattice
    }

    /// The strip from a side of the box (t increasing) to an end.
    fn add_strip(&self, mesh: &mut Mesh, outline: &Outline, end: End, side: &[u32]) -> Lattice {
        let count = self.strips[usize::from(end == End::Low)];
        let reach = (outline.end(end) - mesh.nodes[side[0] as usize][0]).abs();
        let step = outline.width() / (side.len() / 2) as f64;
        let places = match count {
            0 => vec![0.0],
            _ => graded(count, (STRIP_STEP * step / reach).min(1.0)),
        };
        mesh.add_strip(outline, end, side, &places)
    }
}

/// Name ends and sides, from the strips' lattices (low, high; away from the box, t increasing) and the box's own sides.
fn name_edges(mesh: &mut Mesh, [low, high]: [&Lattice; 2], bottom: &[u32], top: &[u32]) {
    let (first, last) = (&low[low.len() - 1], &high[high.len() - 1]);
    mesh.name_edges(LOW, &[first.iter().rev().copied().collect()]);
    mesh.name_edges(HIGH, std::slice::from_ref(last));
    let column = |lattice: &Lattice, i: usize| -> Vec<u32> {
        lattice.iter().skip(1).map(|row| row[i]).collect()
    };
    let back = |mut nodes: Vec<u32>| {
        nodes.reverse();
        nodes
    };
    let below = [back(column(low, 0)), bottom.to_vec(), column(high, 0)];
    let (i, j) = (first.len() - 1, last.len() - 1);
    let above = [back(column(high, j)), top.to_vec(), column(low, i)];
    mesh.name_edges(SIDES, &[below.concat(), above.concat()]);
}

/// Elements from the box to both ends: no strip to an end that would leave only a sliver of it.
fn strip_counts(outline: &Outline, along: usize) -> [usize; 2] {
    let half = 0.5 * outline.width();
    let reach =
        [outline.s[1], -outline.s[0]].map(|end| if end < SLIVER * half { 0.0 } else { end - half });
    reach.map(|length| {
        let share = length / (reach[0] + reach[1]).max(f64::MIN_POSITIVE);
        if length > 0.0 {
            (along as f64 * share).round().max(2.0) as usize
        } else {
            0
        }
    })
}

/// Corners of the box about the hole, counter-clockwise from (s high, t low). Along direction 1 it is as long as the
/// plate is wide, but never past an end, and it reaches an end without a strip.
fn box_corners(outline: &Outline, strips: [usize; 2]) -> [[f64; 2]; 4] {
    let half = 0.5 * outline.width();
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
fn ring_rays(radius: f64, corner: &[[f64; 2]; 4], counts: [usize; 4]) -> Vec<[[f64; 2]; 2]> {
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
    let on_hole = |angle: f64| [radius * angle.cos(), radius * angle.sin()];
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
