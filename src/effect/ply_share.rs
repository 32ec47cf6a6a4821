//! Plies of one direction are thicker than the others.

use std::f64::consts::PI;

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_own_plies};
use crate::fem::Setup;

/// Plies of the `0`-th different angle to the loading axis, whatever its sign, counted from 0.
pub struct PlyShare(pub usize);

const NAMES: [&str; 2] = ["ply_share_1", "ply_share_2"];

/// Plies whose angles differ by less, rad, are meant to have one: their own errors lie beside this one.
const ALIKE: f64 = 0.07;

/// The group of each ply: plies of opposite angles are of one.
fn groups(angles: &[f64]) -> Vec<usize> {
    let mut known: Vec<f64> = Vec::new();
    let group = |angle: &f64| {
        let turned = angle.rem_euclid(PI);
        let off = turned.min(PI - turned);
        let found = known.iter().position(|k| (k - off).abs() < ALIKE);
        found.unwrap_or_else(|| {
            known.push(off);
            known.len() - 1
        })
    };
    angles.iter().map(group).collect()
}

impl Effect for PlyShare {
    fn entry(&self) -> Entry {
        Entry {
            name: NAMES[self.0],
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("ply_percent", 2.0, 50.0)] },
            about: "The plies of the first or second different angle to the loading axis (+45 and -45 count as one) are thicker, and all others thinner. The laminate's thickness stays. The amplitude is that of a single ply's thickness; of the mean of n plies it is less by the root of n. The field hardly shows it, and the constants change. It is weighed only if plausible declares its sd.",
            confirm: "Measure the thickness of the plies of each direction on a polished cut. Without that, quote the constants with the shares' sd.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let groups = groups(&setup.angles);
        let own = groups.iter().filter(|g| **g == self.0).count() as f64;
        let others = groups.len() as f64 - own;
        if own == 0.0 || others == 0.0 {
            return;
        }
        // the means of both groups differ by the scatter of a ply times this
        let apart = (1.0 / own + 1.0 / others).sqrt();
        let more = 0.01 * amplitude[0] * apart / (1.0 + own / others);
        setup.thicker.resize(groups.len(), 0.0);
        for (by, group) in setup.thicker.iter_mut().zip(&groups) {
            *by += if *group == self.0 {
                more
            } else {
                -more * own / others
            };
        }
    }

    fn is_manufacturing(&self) -> bool {
        true
    }

    fn needs_declared_scatter(&self) -> bool {
        true
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        if let Some(obstacle) = unless_own_plies(scene) {
            return Some(obstacle);
        }
        // the last group's share is what the others leave
        let count = groups(&scene.setup.angles).into_iter().max().unwrap_or(0);
        (count <= self.0).then_some("the layup has fewer different angles to the loading axis")
    }
}
