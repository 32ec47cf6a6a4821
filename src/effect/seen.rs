//! What optical effects make of a field: the points that are really seen, and the displacements reported for them.

use super::{Acting, Kind, Scene};

/// The optical effects among those that act, in the order of the dictionary, in which they follow each other.
pub struct Seen<'a> {
    effects: Vec<&'a Acting>,
    scene: &'a Scene,
}

impl<'a> Seen<'a> {
    /// Pick the optical effects.
    pub fn new(acting: &'a [Acting], scene: &'a Scene) -> Self {
        let optical = |a: &&Acting| a.effect.kind() == Kind::Optical;
        Self {
            effects: acting.iter().filter(optical).collect(),
            scene,
        }
    }

    /// Whether no optical effect acts.
    pub fn is_plain(&self) -> bool {
        self.effects.is_empty()
    }

    /// The point of the specimen that is reported as `reported`.
    pub fn true_point(&self, reported: [f64; 2]) -> [f64; 2] {
        self.effects.iter().rev().fold(reported, |p, a| {
            a.effect.true_point(&a.amplitude, self.scene, p)
        })
    }

    /// What is reported for the displacement `u` of the specimen at [`Seen::true_point`] of `reported`.
    pub fn components(&self, reported: [f64; 2], u: [f64; 2]) -> [f64; 2] {
        // The last effect reports at `reported`, the one before it at the point which the last one takes for true.
        let mut places = Vec::with_capacity(self.effects.len());
        let mut p = reported;
        for a in self.effects.iter().rev() {
            places.push(p);
            p = a.effect.true_point(&a.amplitude, self.scene, p);
        }
        let steps = self.effects.iter().zip(places.iter().rev());
        steps.fold(u, |u, (a, p)| {
            a.effect.components(&a.amplitude, self.scene, *p, u)
        })
    }
}
