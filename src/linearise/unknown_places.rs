//! Columns for places that nobody knows, as products with an effect's amplitudes: the centre of a lens that was not found yet, the camera's
//! axis, the pivot about which a specimen turns.
//!
//! A specimen that turns by a about an axis p away from the hole, before a camera at distance Z whose own axis is c away from the middle of
//! the picture, is seen strained by some a c / Z and a p / Z: 1.25 mrad, 6 and 10 mm at 500 mm make 30 microstrain. Without columns of
//! their own those are called a uniform strain, and at 5 mrad thermal strain too (fields of `tests/dic`).

use super::column::Column;
use super::linearisation::Linearisation;
use super::observing::quotient;
use crate::effect::{Companions, Effect, displacements_are_imaged};
use crate::error::Result;
use crate::infer::{Amplitude, EffectUnderLaw};
use crate::parameter::Parameter;

/// A lens' centre has no column of its own while its strength is below this many prior sds.
const WEAK: f64 = 0.1;

/// Prior sd of the camera's axis and of the lens' centre about the middle of the picture, mm: 3 mm is too little where they lie 11 mm off,
/// and 6 found them (prototype study).
pub const AXIS_MM: f64 = 6.0;

/// Prior sd of the distance between the origin and the axis about which a specimen turns, mm.
pub const PIVOT_MM: f64 = 10.0;

/// The same of a rotation that was found, over [`PIVOT_MM`]: a translation by its law is taken for a part of it then (prototype study: with
/// 30 mm nothing is lost up to 0.1 mm of it).
const FOUND_PIVOT: f64 = 3.0;

/// Radians in a milliradian.
const MILLI: f64 = 1e-3;

impl Linearisation<'_> {
    /// Add what is not known of places to the columns of an effect's amplitudes.
    pub(super) fn add_unknown_places(
        &self,
        effect: &EffectUnderLaw,
        columns: &mut Vec<Column>,
    ) -> Result<()> {
        match effect.effect.companions() {
            Companions::Centre => self.center_a_lens(effect.effect, columns),
            Companions::AxisAndPivot { lift } => {
                columns.extend(self.beyond_the_axis(effect, lift)?);
            }
            Companions::AxisAndLift { lift } => columns.extend(self.beside_bending(effect, lift)?),
            Companions::None => {}
        }
        Ok(())
    }

    /// A lens of no strength has no centre: then the columns are those of strength times centre, of one prior sd each. Without them the
    /// first pass would try a lens in the middle alone, and a specimen that moved by a millimetre under one of 0.1 % whose centre is 8 mm off
    /// was taken for tapered, tilted and damaged. Fringes show no motion through a lens; there it keeps to the middle.
    fn center_a_lens(&self, effect: &'static dyn Effect, columns: &mut [Column]) {
        let strength = columns[0].sd;
        let is_weak = self.at.shared.amplitude(effect)[0].abs() < WEAK * strength;
        if !is_weak || !displacements_are_imaged(self.scene()) {
            return;
        }
        for (k, column) in columns.iter_mut().enumerate().skip(1) {
            let [high, low] = [column.sd, -column.sd].map(|by| {
                let mut state = self.at.clone();
                let mut amplitude = state.shared.amplitude(effect);
                amplitude[0] = strength;
                amplitude[k] += by;
                state.shared.set(effect, amplitude);
                state
            });
            // in units of the prior sd of strength times centre
            column.values = self.pictured([&high, &low], 2.0, self.scene());
            column.product = true;
        }
    }

    /// What a rotation does by its distance from the camera's axis, and from the origin: products with both, each for one prior sd.
    fn beyond_the_axis(
        &self,
        effect: &EffectUnderLaw,
        lift: &'static dyn Effect,
    ) -> Result<Vec<Column>> {
        let amplitudes = self.amplitudes_of(effect);
        let size = |a: &Amplitude| {
            let found = self.at.amplitude(effect.effect, &a.weights)[a.parameter];
            self.forward.prior_sd(effect, a.parameter).max(found.abs())
        };
        let mut columns = Vec::new();
        for amplitude in &amplitudes {
            let Amplitude {
                name,
                parameter,
                weights,
            } = amplitude;
            let by = size(amplitude);
            let turned = self.at.raised(effect.effect, *parameter, by, weights);
            for axis in 0..2 {
                let beyond = |by: f64| {
                    let mut scene = self.scene().clone();
                    scene.middle[axis] += by;
                    self.pictured([&turned, self.at], 1.0, &scene)
                };
                let slope = quotient([beyond(AXIS_MM), beyond(-AXIS_MM)], 2.0);
                let name = format!("{name} x axis_{}", axis + 1);
                columns.push(Column::product(name, slope));
            }
        }
        let mut declared = self.forward.model.effects.iter();
        let is_declared = declared.any(|e| e.name() == effect.effect.name());
        for set in amplitudes.chunks(effect.effect.parameters().len()) {
            let angle = set.iter().map(size).fold(0.0, f64::hypot);
            let [high, low] = [1.0, -1.0].map(|sign| {
                let rise = sign * MILLI * angle * PIVOT_MM;
                self.at.raised(lift, 0, rise, &set[0].weights)
            });
            let slope = self.pictured([&high, &low], 2.0, self.scene());
            let pivot = Parameter {
                own: "pivot".into(),
                ..Parameter::read(&set[0].name)
            };
            // of one unit whether it was found or not: what one round says of it is the next one's prior
            let sd = if is_declared { FOUND_PIVOT } else { 1.0 };
            columns.push(Column {
                product: true,
                ..Column::new(pivot.name(), [0.0, sd], 0.0, slope)
            });
        }
        if is_declared {
            for set in amplitudes.chunks(effect.effect.parameters().len()) {
                columns.extend(self.with_the_specimen(effect, lift, set));
            }
        }
        Ok(columns)
    }

    /// What a rotation does where its axis moves in the plane with the specimen, in place of standing still: every step then lacks the rise of
    /// its own motion in the plane, 6 microstrain for 1 mm and 3 mrad at 500 mm. With the axis in the wrong one of the two a tilt of the camera
    /// was found that was not there (series of `tests/dic`).
    fn with_the_specimen(
        &self,
        effect: &EffectUnderLaw,
        lift: &'static dyn Effect,
        set: &[Amplitude],
    ) -> Option<Column> {
        let first = set.first()?;
        let found = self.at.amplitude(effect.effect, &first.weights);
        let rises = self.at.rigid.iter().zip(&first.weights).map(|(motion, w)| {
            let turn: Vec<f64> = found.iter().map(|a| w * a).collect();
            effect.effect.motion(&turn, self.scene(), motion.shift)[2]
        });
        let rises: Vec<f64> = rises.collect();
        if rises.is_empty() {
            return None;
        }
        let lifted = self.at.raised(lift, 0, -1.0, &rises);
        let slope = self.pictured([&lifted, self.at], 1.0, self.scene());
        let carried = Parameter {
            own: "carried".into(),
            ..Parameter::read(&first.name)
        };
        Some(Column::product(carried.name(), slope))
    }

    /// What a specimen that bends out of its plane shows in a series beside its curvature's own field: products of its curvatures with the
    /// distances of the camera's axis from the middle of the window, and how far the window as a whole is lifted towards the camera, which is
    /// how the specimen is held and not a cause of its own.
    fn beside_bending(
        &self,
        effect: &EffectUnderLaw,
        lift: &'static dyn Effect,
    ) -> Result<Vec<Column>> {
        let observing = &self.forward.observing;
        let mut columns = Vec::new();
        if !observing.of_each_step() {
            return Ok(columns);
        }
        let at = self.at.shared.amplitude(effect.effect);
        for amplitude in self.amplitudes_of(effect) {
            let k = amplitude.parameter;
            let mut one = vec![0.0; at.len()];
            one[k] = self.forward.prior_sd(effect, k).max(at[k].abs());
            let (experiment, sight) = (observing.experiment(), observing.sight());
            let Some(shares) = experiment.off_axis(effect.effect, &one, sight)? else {
                return Ok(columns);
            };
            for axis in 0..2 {
                let moved = |share: &f64| {
                    let mut u = [0.0; 2];
                    u[axis] = AXIS_MM * share;
                    u
                };
                let field: Vec<[f64; 2]> = shares.iter().map(moved).collect();
                let name = format!("{} x axis_{}", amplitude.name, axis + 1);
                let slope = self.observed.with_the_load(&field);
                columns.push(Column::product(name, slope));
            }
        }
        let sd = observing.prior_sd(self.forward.model, lift, 0);
        let [high, low] = [sd, -sd].map(|by| self.at.raised(lift, 0, by, &self.at.loads));
        let slope = self.pictured([&high, &low], 2.0, self.scene());
        let name = Parameter::amplitude(effect.effect.name(), "lift").name();
        columns.push(Column::product(name, slope));
        Ok(columns)
    }
}
