//! Fringes miscounted in a region.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_fringes};

pub struct FringeOrderJump;

impl Effect for FringeOrderJump {
    fn entry(&self) -> Entry {
        Entry {
            name: "fringe_order_jump",
            kind: Kind::Recorded,
            parameters: const {
                &[
                    EffectParameter::unbounded("x_orders", 1e3),
                    EffectParameter::unbounded("y_orders", 1e3),
                    EffectParameter::unbounded("x_mm", 1e5),
                    EffectParameter::unbounded("y_mm", 1e5),
                    EffectParameter::unbounded("radius_mm", 1e5),
                ]
            },
            about: "In a region the fringes are miscounted by whole orders, of the displacement along the data's x, along its y, or both. `simulate` makes the region a disc about a point of the data's coordinates. Tracing finds any region.",
            confirm: "Unwrap the phase along another path, or count the fringes across the region's border in the picture. Or follow the fringes up from a smaller load.",
        }
    }

    fn inadmissible(&self, amplitude: &[f64]) -> Option<&'static str> {
        let whole = amplitude[..2].iter().all(|orders| orders.fract() == 0.0);
        if !whole {
            return Some("whole fringe orders");
        }
        (amplitude[4] <= 0.0).then_some("a radius above 0")
    }

    /// Adds orders / f inside the disc, its border included.
    fn recorded(&self, amplitude: &[f64], scene: &Scene, point: [f64; 2], u: [f64; 2]) -> [f64; 2] {
        let Some(frequency) = scene.fringe_frequency_per_mm else {
            return u;
        };
        let [x, y] = scene.frame.data_point(point);
        if (x - amplitude[2]).hypot(y - amplitude[3]) > amplitude[4] {
            return u;
        }
        let [d1, d2] = scene
            .frame
            .vector([amplitude[0] / frequency, amplitude[1] / frequency]);
        [u[0] + d1, u[1] + d2]
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_fringes(scene)
    }
}
