//! A rectangle with parallel sides, which may widen by circular fillets towards a clamped end.

use super::grading::at_half;
use super::mesh::{Lattice, Mesh, NONE};
use super::{HIGH, LOW, SIDES};
use crate::laminate::{ClampSpec, End, SpecimenSpec};

/// Outer edge of a strip, in coordinates whose origin is the geometry's.
#[derive(Debug, Clone, Copy)]
pub struct Outline {
    /// Ends along direction 1: `[low, high]`, mm.
    pub s: [f64; 2],
    /// Sides along direction 2 of the parallel part: `[low, high]`, mm.
    pub t: [f64; 2],
    pub clamp: Option<Clamp>,
}

/// The shape of a clamped end.
#[derive(Debug, Clone, Copy)]
pub struct Clamp {
    pub end: End,
    /// Width of the plate at the clamp over its width elsewhere, at least 1.
    pub widening: f64,
    /// Radius of the fillets, mm; they touch the parallel part tangentially.
    pub fillet_radius: f64,
}

impl Outline {
    /// Of a specimen, with the origin at a place relative to the plate's centre.
    pub fn about(specimen: &SpecimenSpec, [c1, c2]: [f64; 2]) -> Self {
        let (l, w) = (0.5 * specimen.length_mm, 0.5 * specimen.width_mm);
        let clamp = |clamp: ClampSpec| Clamp {
            end: clamp.end,
            widening: clamp.width_mm.unwrap_or(specimen.width_mm) / specimen.width_mm,
            fillet_radius: clamp.fillet_radius_mm.unwrap_or(0.0),
        };
        Self {
            s: [-l - c1, l - c1],
            t: [-w - c2, w - c2],
            clamp: specimen.clamp.map(clamp),
        }
    }

    /// Width of the parallel part, mm.
    pub fn width(&self) -> f64 {
        self.t[1] - self.t[0]
    }

    /// The same with another width, by a factor.
    #[must_use]
    pub fn widened(&self, factor: f64) -> Self {
        let middle = 0.5 * (self.t[0] + self.t[1]);
        Self {
            t: self.t.map(|t| middle + factor * (t - middle)),
            ..*self
        }
    }

    /// Where an end lies along direction 1.
    pub fn end(&self, end: End) -> f64 {
        match end {
            End::Low => self.s[0],
            End::High => self.s[1],
        }
    }

    /// Distance of the nearest edge or end from the origin, mm; below 0 if the origin lies outside.
    pub fn clearance(&self) -> f64 {
        [-self.s[0], self.s[1], -self.t[0], self.t[1]]
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Whether all dimensions are finite and lengths and widths above 0.
    pub fn is_sound(&self) -> bool {
        let sound = |[low, high]: [f64; 2]| low.is_finite() && high.is_finite() && low < high;
        sound(self.s) && sound(self.t)
    }

    /// How far from the clamp the fillets reach, mm.
    fn fillet_length(&self, clamp: &Clamp) -> f64 {
        let rise = 0.5 * self.width() * (clamp.widening - 1.0);
        let drop = (clamp.fillet_radius - rise).max(0.0);
        (clamp.fillet_radius.powi(2) - drop.powi(2)).max(0.0).sqrt()
    }

    /// Width at `s` over that of the parallel part.
    fn widening_at(&self, s: f64) -> f64 {
        let Some(clamp) = self.clamp else {
            return 1.0;
        };
        let along = self.fillet_length(&clamp) - (self.end(clamp.end) - s).abs();
        if along <= 0.0 || clamp.fillet_radius == 0.0 {
            return 1.0;
        }
        let r = clamp.fillet_radius;
        let rise = r - (r * r - along * along).max(0.0).sqrt();
        1.0 + 2.0 * rise / self.width()
    }

    /// Distance from one of the named edges of the outline, mm, negative beyond it; `None` for another name.
    pub fn distance(&self, edge: &str, [s, t]: [f64; 2]) -> Option<f64> {
        let from_axis = (t - 0.5 * (self.t[0] + self.t[1])).abs();
        let end = |end: End, inwards: f64| {
            let place = self.end(end);
            let half = 0.5 * self.width() * self.widening_at(place);
            inwards.signum() * inwards.hypot((from_axis - half).max(0.0))
        };
        match edge {
            LOW => Some(end(End::Low, s - self.s[0])),
            HIGH => Some(end(End::High, self.s[1] - s)),
            SIDES => Some(self.distance_to_sides(s, from_axis)),
            _ => None,
        }
    }

    /// Distance from the sides at a distance from the axis between them: each is a line and the arc of a fillet.
    fn distance_to_sides(&self, s: f64, from_axis: f64) -> f64 {
        let half = 0.5 * self.width();
        let mut line = self.s;
        let mut nearest = f64::INFINITY;
        if let Some(clamp) = self.clamp {
            let (length, r) = (self.fillet_length(&clamp), clamp.fillet_radius);
            let inwards = if clamp.end == End::Low { 1.0 } else { -1.0 };
            let tangent = self.end(clamp.end) + inwards * length;
            line[usize::from(clamp.end == End::High)] = tangent;
            // From the fillet's centre: towards the clamp, and towards the axis.
            let (along, across) = (inwards * (tangent - s), half + r - from_axis);
            let last = (length, (r * r - length * length).max(0.0).sqrt());
            nearest = if along >= 0.0 && along * last.1 <= across * last.0 {
                (along.hypot(across) - r).abs()
            } else {
                (along - last.0).hypot(across - last.1)
            };
        }
        let beyond = (line[0] - s).max(s - line[1]).max(0.0);
        nearest = nearest.min(beyond.hypot(from_axis - half));
        nearest.copysign(half * self.widening_at(s) - from_axis)
    }
}

impl Mesh {
    /// A strip of elements from a line of nodes across the plate (t increasing) to an end; `places` from 0 at the line to
    /// 1 at the end. Returns its nodes, `lattice[j]` a line across.
    pub(super) fn add_strip(
        &mut self,
        outline: &Outline,
        end: End,
        line: &[u32],
        places: &[f64],
    ) -> Lattice {
        let near = self.nodes[line[0] as usize][0];
        let reach = outline.end(end) - near;
        let center = 0.5 * (outline.t[0] + outline.t[1]);
        let mut lattice: Lattice = vec![line.to_vec()];
        for j in 1..2 * places.len() - 1 {
            let s = near + reach * at_half(places, j);
            let widening = outline.widening_at(s);
            let row = (0..line.len()).map(|i| {
                if i % 2 == 1 && j % 2 == 1 {
                    return NONE;
                }
                let t = self.nodes[line[i] as usize][1];
                self.add_node([s, center + widening * (t - center)])
            });
            let row = row.collect();
            lattice.push(row);
        }
        if places.len() > 1 {
            self.add_elements(&lattice);
        }
        lattice
    }
}
