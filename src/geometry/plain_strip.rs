//! A strip without a hole: a grid of rectangles.

use std::sync::Arc;

use super::grading::even;
use super::mesh::Mesh;
use super::outline::Outline;
use super::{Density, Geometry, HIGH, LOW, Morph, SIDES, not_offered};
use crate::error::{Error, Result};
use crate::laminate::{End, SpecimenSpec};

/// A strip without a hole, with the origin at its centre.
#[derive(Debug, Clone, Copy)]
pub struct PlainStrip {
    pub outline: Outline,
}

/// Elements of the default mesh along and across.
const ELEMENTS: [usize; 2] = [90, 36];

pub fn build(specimen: &SpecimenSpec) -> Option<Arc<dyn Geometry>> {
    let plain = PlainStrip::of(specimen);
    specimen.hole.is_none().then(|| Arc::new(plain) as _)
}

impl PlainStrip {
    /// The strip of a specimen, whatever is drilled into it.
    pub fn of(specimen: &SpecimenSpec) -> Self {
        Self {
            outline: Outline::about(specimen, [0.0; 2]),
        }
    }
}

impl Geometry for PlainStrip {
    fn name(&self) -> &'static str {
        "plain_strip"
    }

    fn extents(&self) -> [[f64; 2]; 2] {
        [self.outline.s, self.outline.t]
    }

    fn widening(&self) -> f64 {
        self.outline.clamp.map_or(1.0, |clamp| clamp.widening)
    }

    fn distance(&self, edge: &str, point: [f64; 2]) -> Option<f64> {
        self.outline.distance(edge, point)
    }

    fn validate(&self) -> Result<()> {
        if self.outline.is_sound() {
            return Ok(());
        }
        Err(
            Error::input("plate outline", "a plate of some length and width")
                .found(format!("{:?}", self.extents())),
        )
    }

    fn has_parallel_sides(&self) -> bool {
        true
    }

    fn morphed(&self, morph: &Morph) -> Result<Arc<dyn Geometry>> {
        let width = morph.width;
        if *morph
            != (Morph {
                width,
                ..Morph::NONE
            })
        {
            return Err(not_offered(self, morph));
        }
        let outline = self.outline.widened(width);
        Ok(Arc::new(Self { outline }))
    }

    fn counts(&self, density: Density) -> Vec<usize> {
        let [along, across] = ELEMENTS.map(|n| density.count(n));
        vec![along, across.next_multiple_of(2)]
    }

    fn mesh(&self, counts: &[usize]) -> Mesh {
        let outline = &self.outline;
        let [along, across] = [0, 1].map(|k| counts.get(k).copied().unwrap_or(2));
        let mut mesh = Mesh {
            extents: self.extents(),
            ..Mesh::default()
        };
        // The grid starts at the end that is not widened.
        let to = match outline.clamp {
            Some(clamp) => clamp.end,
            None => End::High,
        };
        let from = match to {
            End::Low => outline.s[1],
            End::High => outline.s[0],
        };
        let [t0, t1] = outline.t;
        let line: Vec<u32> = even(2 * across)
            .into_iter()
            .map(|x| mesh.add_node([from, t0 + x * (t1 - t0)]))
            .collect();
        let mut lattice = mesh.add_strip(outline, to, &line, &even(along));
        if to == End::Low {
            lattice.reverse();
        }
        let last = lattice.len() - 1;
        let side = |i: usize| lattice.iter().map(move |row| row[i]);
        mesh.name_edges(LOW, &[lattice[0].iter().rev().copied().collect()]);
        mesh.name_edges(HIGH, &[lattice[last].clone()]);
        let sides = [side(0).collect(), side(2 * across).rev().collect()];
        mesh.name_edges(SIDES, &sides);
        mesh
    }
}
