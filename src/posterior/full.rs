//! The full model at a draw: the test solved with its constants, load, thickness and all effects at once, without linearisation.

use nalgebra::DVector;

use super::point::LinearisationPoint;

use crate::effect::{Effect, amplitude_name, force_scale};
use crate::error::{Error, Result};
use crate::experiment::series::SeriesState;
use crate::infer::EffectUnderLaw;
use crate::linearise::{Column, Forward, Sensitivities, StepStack};
use crate::reduce::THICKNESS;

/// A test that can be solved at any draw, on one mesh.
pub struct Full<'a> {
    pub forward: &'a Forward<'a>,
    pub point: &'a LinearisationPoint,
    /// The test linearised about the point on this mesh.
    pub here: &'a Sensitivities,
}

/// A draw as the full model takes it.
pub struct DrawnState<'a> {
    pub state: SeriesState,
    /// Columns that enter linearly all the same, and how far from where the test was linearised, prior sds.
    pub left: Vec<(&'a Column, f64)>,
}

/// What a column's parameter is of the state.
enum ColumnPlace {
    Thickness,
    Load,
    /// Parameter of an effect, with its share in each step of a series.
    Amplitude(&'static dyn Effect, usize, Vec<f64>),
    /// Of no state: it enters linearly.
    None,
}

impl<'a> Full<'a> {
    /// The state of some constants (border units) and of amplitudes of the linear columns in prior sds from their means.
    pub fn drawn(&self, constants: &[f64], amplitudes: &[f64]) -> DrawnState<'a> {
        let mut left: Vec<(&Column, f64)> = Vec::new();
        let mut values = Vec::new();
        for ((column, place), a) in self.columns().into_iter().zip(amplitudes) {
            let value = column.mean + column.sd * a;
            match place {
                ColumnPlace::None => left.push((column, (value - column.at) / column.sd)),
                place => values.push((place, value, column.at)),
            }
        }
        let thinner = thinner(&values);
        let mut state = self.point.state.clone();
        state.shared.constants.copy_from_slice(constants);
        for (place, value, at) in values {
            match place {
                ColumnPlace::Thickness => state.shared.thickness_mm = at / (1.0 - thinner),
                ColumnPlace::Load => {
                    let percent = value / (1.0 - thinner);
                    state.shared.set(force_scale(), vec![percent]);
                }
                ColumnPlace::Amplitude(effect, k, weights) => {
                    state = state.raised(effect, k, value - at, &weights);
                }
                ColumnPlace::None => {}
            }
        }
        DrawnState { state, left }
    }

    /// What is shown where the test was linearised, mm.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn origin(&self) -> Result<StepStack> {
        self.forward.shown(&self.point.state)
    }

    /// By how much block averages differ at a draw from the `origin`'s, mm.
    ///
    /// # Errors
    /// Those of a finite-element solution: of amplitudes that cannot be, too; displacements that are not finite.
    pub fn change(&self, drawn: &DrawnState<'_>, origin: &StepStack) -> Result<StepStack> {
        let mut change = self.forward.shown(&drawn.state)?;
        for (u, here) in change.iter_mut().zip(origin) {
            *u -= here;
        }
        for (column, by) in &drawn.left {
            for (u, values) in change.iter_mut().zip(&column.values) {
                u.axpy(*by, values, 1.0);
            }
        }
        let is_finite = |u: &DVector<f64>| u.iter().all(|v| v.is_finite());
        if !change.iter().all(is_finite) {
            // a law of the plies has no answer there
            return Err(Error::input("draw", "displacements that are finite"));
        }
        Ok(change)
    }

    /// The linear columns in their order, with what they are.
    fn columns(&self) -> Vec<(&'a Column, ColumnPlace)> {
        let here = self.here;
        let LinearisationPoint {
            declared, sought, ..
        } = self.point;
        let base = here.base[here.constants..].iter().map(|column| {
            let load = &force_scale().parameters()[0];
            let place = match column.name.as_str() {
                THICKNESS => ColumnPlace::Thickness,
                name if name == amplitude_name(force_scale(), load) => ColumnPlace::Load,
                name => self.amplitude(declared, name),
            };
            (column, place)
        });
        let own = here.candidates.iter().zip(sought);
        let own = own.flat_map(|(candidate, effect)| {
            let place = |c: &Column| self.amplitude(std::slice::from_ref(effect), &c.name);
            let columns = candidate.columns.iter();
            columns.map(|c| (c, place(c))).collect::<Vec<_>>()
        });
        let all = base.chain(own);
        // a product is no amplitude of its own
        all.map(|(column, place)| match column.product {
            true => (column, ColumnPlace::None),
            false => (column, place),
        })
        .collect()
    }

    /// The amplitude of one of some effects that has a name.
    fn amplitude(&self, effects: &[EffectUnderLaw], name: &str) -> ColumnPlace {
        let (loads, names) = (&self.point.state.loads, self.forward.observing.names());
        let found = effects.iter().find_map(|effect| {
            let mut amplitudes = effect.amplitudes(loads, names).into_iter();
            let found = amplitudes.find(|a| a.name == name)?;
            Some(ColumnPlace::Amplitude(
                effect.effect,
                found.parameter,
                found.weights,
            ))
        });
        found.unwrap_or(ColumnPlace::None)
    }
}

/// How much thicker the specimen is drawn, over the thickness about which it was linearised. Drawn is the scale of the response: what a
/// thickness t and a load l make of it is (1 + l) t0 / t, exactly linear in t0 / t and in l t0 / t, whose priors differ from those of t and
/// l by a hundredth of an sd. Taken for those of t and l themselves, draws are misfits by 1e-5 of the field, which points by the hundred
/// thousand see, and which says nothing of the constants.
fn thinner(values: &[(ColumnPlace, f64, f64)]) -> f64 {
    let of = |(place, value, at): &(ColumnPlace, f64, f64)| match place {
        ColumnPlace::Thickness => Some((value - at) / at),
        _ => None,
    };
    values.iter().find_map(of).unwrap_or(0.0)
}
