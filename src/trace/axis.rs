//! What nobody knows of a single field's places: for a rotation out of the plane where the camera's axis and the specimen's pivot are, for a
//! lens that was not found yet where its centre is.
//!
//! A specimen that turns by a about an axis p away from the hole, before a camera at distance Z whose own axis is c away from the middle of
//! the picture, is seen strained by some a c / Z and a p / Z: 1.25 mrad, 6 and 10 mm at 500 mm make 30 microstrain. Without columns of
//! their own those are called a uniform strain, and at 5 mrad thermal strain too (fields of `tests/dic`); a series has them as well
//! ([`crate::infer::Stepped`]).

use super::sensitivities::{Column, Linearised};
use crate::effect::{EFFECTS, Effect, amplitude_name, displacements_are_imaged, find};
use crate::error::Result;
use crate::experiment::{Direction, Prediction, State, between, beyond_the_axis, sensitivity};
use crate::fem::Anchor;
use crate::infer::{AXIS_MM, LENS, Model, PIVOT_MM, WEAK};

const ROTATION: &str = "out_of_plane_rotation";
const APPROACH: &str = "out_of_plane_translation";
const STRAIN: &str = "uniform_strain";

/// Radians in a milliradian.
const MILLI: f64 = 1e-3;

/// Take the strain that the unknown axes leave into the model of a field whose specimen was found to turn, with the size that they may give
/// it: fitted without it, fields turned by 1.25 mrad were never described by the rotation alone.
pub fn entail_strain(model: &mut Model, effect: &'static dyn Effect, amplitude: &[(f64, f64)]) {
    let Some(strain) = EFFECTS.iter().find(|e| e.name() == STRAIN) else {
        return;
    };
    let declared = model.effects.iter().any(|e| e.name() == STRAIN);
    let distance_mm = model.scene().camera_distance_mm;
    let Some(distance_mm) = distance_mm.filter(|_| effect.name() == ROTATION && !declared) else {
        return;
    };
    let parameters = effect.parameters().len();
    let mrad = amplitude[..parameters]
        .iter()
        .fold(0.0, |m: f64, (a, _)| m.hypot(*a));
    let microstrain = 1e3 * mrad * AXIS_MM.hypot(PIVOT_MM) / distance_mm;
    let experiment = model.experiment_mut();
    experiment.effects.push(STRAIN.into());
    for parameter in strain.parameters() {
        let name = amplitude_name(*strain, parameter);
        experiment.plausible.entry(name).or_insert(microstrain);
    }
    let place = |e: &&'static dyn Effect| EFFECTS.iter().position(|k| k.name() == e.name());
    model.effects.push(*strain);
    model.effects.sort_by_key(place);
}

/// What is said of it.
pub fn words(model: &Model) -> Option<String> {
    let has = |name: &str| model.effects.iter().any(|e| e.name() == name);
    let strain = model
        .experiment()
        .plausible
        .get(&format!("{STRAIN}.exx_microstrain"))?;
    (has(ROTATION) && has(STRAIN) && model.experiment().steps.is_none()).then(|| {
        format!(
            " Beside the rotation a uniform strain of +- {strain:.0} microstrain takes part: about an axis off the hole, or before a camera whose \
             axis is off the middle of the picture, a rotation leaves one, and a single field does not tell where the axes are; a load series does."
        )
    })
}

impl Linearised<'_> {
    /// Columns of the products of a rotation's amplitudes with both unknown places, each for one prior sd; none of other effects.
    ///
    /// # Errors
    /// Those of [`sensitivity`].
    pub(super) fn of_the_axis(
        &self,
        (at, about): (&State, Option<&Anchor>),
        here: &Prediction,
        effect: &'static dyn Effect,
    ) -> Result<Vec<Column>> {
        if effect.name() != ROTATION {
            return Ok(Vec::new());
        }
        let experiment = self.experiment;
        let sight = self.few.sight();
        let amplitude = at.amplitude(effect);
        let size = |k: usize| self.prior_sd(effect, k).max(amplitude[k].abs());
        let mut columns = Vec::new();
        for (k, parameter) in effect.parameters().iter().enumerate() {
            for axis in 0..2 {
                let about = (at, here);
                let field = beyond_the_axis(
                    experiment,
                    about,
                    sight,
                    (effect, k, size(k)),
                    (axis, AXIS_MM),
                );
                let name = format!("{} x axis_{}", amplitude_name(effect, parameter), axis + 1);
                columns.push(self.product(name, &field, 1.0));
            }
        }
        let approach = find("dictionary", APPROACH)?;
        let slope = sensitivity(
            experiment,
            (at, about),
            here,
            sight,
            Direction::Amplitude(approach, 0),
            MILLI,
        )?;
        let rise = MILLI * size(0).hypot(size(1)) * PIVOT_MM;
        columns.push(self.product(format!("{ROTATION}.pivot"), &slope, rise));
        Ok(columns)
    }

    /// Make the columns of the centre of a lens that is as good as none those of its product with the strength, of one prior sd each: without
    /// them the first pass would try a lens in the middle alone, and a specimen that moved by a millimetre under one of 0.1 % whose centre is
    /// 8 mm off was taken for tapered, tilted and damaged. Fringes show no motion through a lens; there it keeps to the middle.
    pub(super) fn of_the_lens_center(
        &self,
        (at, here): (&State, &Prediction),
        effect: &'static dyn Effect,
        columns: &mut [Column],
    ) {
        let strength = self.prior_sd(effect, 0);
        let is_weak = at.amplitude(effect)[0].abs() < WEAK * strength;
        let imaged = displacements_are_imaged(self.experiment.scene());
        if effect.name() != LENS || !is_weak || !imaged {
            return;
        }
        for (k, column) in columns.iter_mut().enumerate().skip(1) {
            let states = [column.sd, -column.sd].map(|by| {
                let mut state = at.clone();
                let mut amplitude = state.amplitude(effect);
                amplitude[0] = strength;
                amplitude[k] += by;
                state.set(effect, amplitude);
                state
            });
            let sight = self.few.sight();
            let field = between(self.experiment, (at, here), sight, states.each_ref(), 2.0);
            column.values = self.few.average(&field);
            column.product = true;
        }
    }

    fn product(&self, name: String, field: &[[f64; 2]], sd: f64) -> Column {
        Column {
            name,
            mean: 0.0,
            sd: 1.0,
            at: 0.0,
            positive: false,
            product: true,
            values: self.few.average(field).map(|values| values * sd),
        }
    }
}
