//! How a camera reports a specimen: the points that are really seen, and the displacements reported for them.
//!
//! In image correlation what is reported is the exact difference of two places in the picture, M(P(X + u, z)) - M(X), at the material
//! point X that is reported as M(X): P is the perspective of motion out of the plane, M the static map of the picture that the
//! optical effects make, and u the *whole* displacement, rigid motion included: a lens times a millimetre of translation is
//! micrometres. Fringes count lines on the specimen: of them only the places are distorted.

use super::optics::displacements_are_imaged;
use super::{Acting, Kind, Scene};
use crate::field::rigid::RigidMotion;

/// The optical effects among those that act, in the order of the dictionary, in which they follow each other.
pub struct Seen<'a> {
    effects: Vec<&'a Acting>,
    scene: &'a Scene,
    motion: RigidMotion,
}

impl<'a> Seen<'a> {
    /// Pick the optical effects.
    pub fn new(acting: &'a [Acting], scene: &'a Scene) -> Self {
        let optical = |a: &&Acting| a.effect.kind() == Kind::Optical;
        Self {
            effects: acting.iter().filter(optical).collect(),
            scene,
            motion: RigidMotion::NONE,
        }
    }

    /// The same of a specimen that moves in the plane beside what the load does to it.
    #[must_use]
    pub fn moved(self, motion: RigidMotion) -> Self {
        Self { motion, ..self }
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

    /// What is reported, at a point, for the displacement `u` that the load causes at [`Seen::true_point`] of it, mm.
    pub fn report(&self, reported: [f64; 2], u: [f64; 2]) -> [f64; 2] {
        let u = if displacements_are_imaged(self.scene) {
            self.imaged(reported, u)
        } else {
            u
        };
        self.components(reported, u)
    }

    /// The same in the specimen's own axes, without its motion in the plane.
    pub fn report_at_rest(&self, reported: [f64; 2], u: [f64; 2]) -> [f64; 2] {
        let u = self.report(reported, u);
        if displacements_are_imaged(self.scene) {
            self.motion.released(reported, u)
        } else {
            u
        }
    }

    /// The difference of the places in the picture.
    fn imaged(&self, reported: [f64; 2], u: [f64; 2]) -> [f64; 2] {
        let before = self.true_point(reported);
        // the specimen is strained in its own axes, and moves as it is then
        let own = self.motion.own_at(before);
        let strained = [0, 1].map(|k| before[k] + u[k] + own[k]);
        let rigid = self.motion.turned(strained);
        let plane = [0, 1].map(|k| strained[k] + rigid[k]);
        let after = self.projected(plane);
        let place = self.place(after, [0, 1].map(|k| reported[k] + after[k] - before[k]));
        [0, 1].map(|k| place[k] - reported[k])
    }

    /// Where a point at `place` in the plane is seen that moves out of it from there, about axes that stand still: by a pinhole at the
    /// camera's distance, over the middle of the picture.
    fn projected(&self, place: [f64; 2]) -> [f64; 2] {
        let mut moved = [0.0; 3];
        for a in &self.effects {
            let by = a.effect.motion(&a.amplitude, self.scene, place);
            moved = [0, 1, 2].map(|k| moved[k] + by[k]);
        }
        let place = [place[0] + moved[0], place[1] + moved[1]];
        let Some(distance) = self.scene.camera_distance_mm.filter(|_| moved[2] != 0.0) else {
            return place;
        };
        let scale = distance / (distance - moved[2]);
        let middle = self.scene.middle;
        [0, 1].map(|k| middle[k] + (place[k] - middle[k]) * scale)
    }

    /// Where the picture reports a point of the specimen's plane: the inverse of [`Seen::true_point`], from a `guess`.
    fn place(&self, point: [f64; 2], guess: [f64; 2]) -> [f64; 2] {
        let mut place = guess;
        let slopes = [0, 1].map(|k| {
            let at = |by: f64| {
                let mut p = guess;
                p[k] += by;
                self.true_point(p)
            };
            let (high, low) = (at(DIFFERENCE_MM), at(-DIFFERENCE_MM));
            [0, 1].map(|i| (high[i] - low[i]) / (2.0 * DIFFERENCE_MM))
        });
        let det = slopes[0][0] * slopes[1][1] - slopes[1][0] * slopes[0][1];
        for _ in 0..MOST_STEPS {
            let reached = self.true_point(place);
            let miss = [point[0] - reached[0], point[1] - reached[1]];
            let step = [
                (slopes[1][1] * miss[0] - slopes[1][0] * miss[1]) / det,
                (slopes[0][0] * miss[1] - slopes[0][1] * miss[0]) / det,
            ];
            place = [place[0] + step[0], place[1] + step[1]];
            if step[0].abs() + step[1].abs() < CLOSE_MM {
                break;
            }
        }
        place
    }

    /// What the instrument makes of a displacement beside the map of the picture.
    fn components(&self, reported: [f64; 2], u: [f64; 2]) -> [f64; 2] {
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

/// Step of the differences that give the slopes of the picture's map, mm.
const DIFFERENCE_MM: f64 = 1e-2;

/// Steps to the place of a point, at most, and how near is near enough, mm: far below a nanometre.
const MOST_STEPS: usize = 20;
const CLOSE_MM: f64 = 1e-12;
