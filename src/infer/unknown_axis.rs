//! Columns of a load series for places that nobody knows, as products with an effect's amplitudes: the centre of a lens, the camera's axis, the
//! pivot about which a specimen turns.

use super::stepped::{AXIS_MM, Here, PIVOT_MM, Stack, WEAK, column, quotient};
use super::{Acts, Amplitude, Column};
use crate::effect::{Effect, find};
use crate::error::Result;

impl Here<'_> {
    /// A lens of no strength has no centre: then the columns are those of strength times centre, of one prior sd each. The centre's prior
    /// lies about where it is in the state: taken back to the middle, beside a strength that is taken back to 0, it would subtract their
    /// product twice, which under a specimen's motion is micrometres.
    pub(super) fn of_the_lens_center(&self, effect: &'static dyn Effect, columns: &mut [Column]) {
        let strength = self.stepped.prior_sd(effect, 0);
        for column in columns.iter_mut().skip(1) {
            column.mean = column.at;
        }
        if self.at.shared.amplitude(effect)[0].abs() >= WEAK * strength {
            return;
        }
        let with = |k: usize, by: f64| {
            let mut state = self.at.clone();
            let mut amplitude = state.shared.amplitude(effect);
            amplitude[0] = strength;
            amplitude[k] += by;
            state.shared.set(effect, amplitude);
            state
        };
        for (k, column) in columns.iter_mut().enumerate().skip(1) {
            let moved = [with(k, AXIS_MM), with(k, -AXIS_MM)];
            // a column is in units of its prior sd: of strength times centre
            let slope = self.slope([&moved[0], &moved[1]], 2.0, self.stepped.scene());
            column.values = slope;
            column.product = true;
        }
    }

    /// What a rotation does by its distance from the camera's axis, and from the origin: products with both.
    pub(super) fn of_the_axis(
        &self,
        acts: &Acts,
        amplitudes: &[Amplitude],
        columns: &mut Vec<Column>,
    ) {
        let Ok(approach) = find("dictionary", "out_of_plane_translation") else {
            return;
        };
        let scene = self.stepped.scene();
        for amplitude in amplitudes {
            let sd = self.stepped.prior_sd(acts.effect, amplitude.parameter);
            let turned = self
                .at
                .raised(acts.effect, amplitude.parameter, sd, &amplitude.weights);
            for axis in 0..2 {
                let at = |by: f64| {
                    let mut scene = scene.clone();
                    scene.middle[axis] += by;
                    self.slope([&turned, self.at], 1.0, &scene)
                };
                let slope = quotient([at(AXIS_MM), at(-AXIS_MM)], 2.0);
                let name = format!("{} x axis_{}", amplitude.name, axis + 1);
                columns.push(product(name, slope));
            }
        }
        let milli = 1e-3 * self.stepped.prior_sd(acts.effect, 0);
        for (set, weights) in acts.weights(&self.at.loads).iter().enumerate() {
            let raised = [1.0, -1.0].map(|sign| {
                self.at
                    .raised(approach, 0, sign * milli * PIVOT_MM, weights)
            });
            let slope = self.slope([&raised[0], &raised[1]], 2.0, scene);
            let own = &amplitudes[set * acts.effect.parameters().len()].name;
            let of = own
                .split_once(" in ")
                .map_or(String::new(), |(_, step)| format!(" in {step}"));
            columns.push(product(format!("{}.pivot{of}", acts.effect.name()), slope));
        }
    }

    /// What a specimen that bends out of its plane shows beside its curvature's own field: products of its curvatures with the distances of
    /// the camera's axis from the middle of the window, and how far the window as a whole is lifted towards the camera, which is how the
    /// specimen is held and not a cause of its own.
    ///
    /// # Errors
    /// Those of [`crate::experiment::Mechanics::off_axis`].
    pub(super) fn of_the_bent(
        &self,
        acts: &Acts,
        amplitudes: &[Amplitude],
        columns: &mut Vec<Column>,
    ) -> Result<()> {
        let effect = acts.effect;
        let at = self.at.shared.amplitude(effect);
        for amplitude in amplitudes {
            let k = amplitude.parameter;
            let mut one = vec![0.0; at.len()];
            one[k] = self.stepped.prior_sd(effect, k).max(at[k].abs());
            let (experiment, sight) = (self.stepped.experiment, self.stepped.sight);
            let Some(shares) = experiment.off_axis(effect, &one, sight)? else {
                return Ok(());
            };
            for axis in 0..2 {
                let moved = |share: &f64| {
                    let mut u = [0.0; 2];
                    u[axis] = AXIS_MM * share;
                    u
                };
                let field: Vec<[f64; 2]> = shares.iter().map(moved).collect();
                let name = format!("{} x axis_{}", amplitude.name, axis + 1);
                columns.push(product(name, self.with_the_load(&field)));
            }
        }
        let approach = find("dictionary", "out_of_plane_translation")?;
        let sd = self.stepped.prior_sd(approach, 0);
        let lifted = [sd, -sd].map(|by| self.at.raised(approach, 0, by, &self.at.loads));
        let scene = self.stepped.scene();
        let slope = self.slope([&lifted[0], &lifted[1]], 2.0, scene);
        columns.push(product(format!("{}.lift", effect.name()), slope));
        Ok(())
    }
}

/// A product of one prior sd of each factor.
fn product(name: String, slope: Stack) -> Column {
    let mut own = column(name, [0.0, 1.0], 0.0, slope);
    own.product = true;
    own
}
