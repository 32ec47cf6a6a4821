//! The full model at a draw: the test solved with its constants, load, thickness and all effects at once, without linearisation.

use nalgebra::DVector;

use super::around::Around;
use crate::effect::{Effect, LOAD_SCALE, amplitude_name};
use crate::error::{Error, Result};
use crate::experiment::series::SeriesState;
use crate::experiment::{State, predict};
use crate::identify::Prepared;
use crate::infer::{Acts, Column, Model, Stepped};
use crate::reduce::THICKNESS;
use crate::trace::account::{About, Account};
use crate::trace::sensitivities::Few;
use crate::trace::series::{averages, of_blocks};

/// A test that can be solved at any draw.
pub(super) struct Full<'a> {
    model: &'a Model,
    prepared: &'a Prepared,
    account: &'a Account,
    around: &'a Around,
    few: Few<'a>,
    /// What it shows where it was linearised, mm.
    here: [DVector<f64>; 2],
}

/// What a column's parameter is of the state.
enum Place {
    Thickness,
    Load,
    /// Parameter of an effect, with its share in each step of a series.
    Amplitude(&'static dyn Effect, usize, Vec<f64>),
    /// Of no state: it enters linearly.
    None,
}

impl<'a> Full<'a> {
    /// Of a test as it was linearised.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn new(
        model: &'a Model,
        prepared: &'a Prepared,
        account: &'a Account,
        around: &'a Around,
    ) -> Result<Self> {
        let blocks = &account.evidence.measured.blocks;
        let mut full = Self {
            model,
            prepared,
            account,
            around,
            few: Few::new(prepared, blocks),
            here: [DVector::zeros(0), DVector::zeros(0)],
        };
        full.here = match &account.about {
            About::Field { state, .. } => full.of_field(state)?,
            About::Series { state, .. } => full.of_series(state)?,
        };
        Ok(full)
    }

    /// Draws at which it is solved at first, and at most: of a series fewer, all of whose steps are solved at each.
    pub fn draws(&self) -> [usize; 2] {
        match &self.account.about {
            About::Field { .. } => [48, 192],
            About::Series { .. } => [12, 12],
        }
    }

    /// By how much block averages differ, mm, from those where the test was linearised: at some constants (border units), with amplitudes
    /// of the linear columns in prior sds from their means.
    ///
    /// # Errors
    /// Those of a finite-element solution: of amplitudes that cannot be, too; displacements that are not finite.
    pub fn change(&self, constants: &[f64], amplitudes: &[f64]) -> Result<[DVector<f64>; 2]> {
        let mut left: Vec<(&Column, f64)> = Vec::new();
        let mut values = Vec::new();
        for ((column, place), a) in self.columns().into_iter().zip(amplitudes) {
            let value = column.mean + column.sd * a;
            match place {
                Place::None => left.push((column, (value - column.at) / column.sd)),
                place => values.push((place, value, column.at)),
            }
        }
        let thinner = thinner(&values);
        let scaled = values.into_iter().map(|(place, value, at)| {
            let value = match place {
                Place::Thickness => at / (1.0 - thinner),
                Place::Load => value / (1.0 - thinner),
                _ => value,
            };
            (place, value, at)
        });
        let mut change = match &self.account.about {
            About::Field { state, .. } => {
                let mut state = state.clone();
                state.constants.copy_from_slice(constants);
                for (place, value, _) in scaled {
                    set(&mut state, &place, value);
                }
                self.of_field(&state)?
            }
            About::Series { state, .. } => {
                let mut state = state.clone();
                state.shared.constants.copy_from_slice(constants);
                for (place, value, at) in scaled {
                    match place {
                        Place::Amplitude(effect, k, weights) => {
                            state = state.raised(effect, k, value - at, &weights);
                        }
                        Place::Load => state
                            .loads
                            .iter_mut()
                            .for_each(|f| *f *= 1.0 + 0.01 * value),
                        place => set(&mut state.shared, &place, value),
                    }
                }
                self.of_series(&state)?
            }
        };
        for (u, here) in change.iter_mut().zip(&self.here) {
            *u -= here;
        }
        for (column, by) in left {
            for (u, values) in change.iter_mut().zip(&column.values) {
                u.axpy(by, values, 1.0);
            }
        }
        if change.iter().any(|u| u.iter().any(|v| !v.is_finite())) {
            // a law of the plies has no answer there
            return Err(Error::input("draw", "displacements that are finite"));
        }
        Ok(change)
    }

    fn of_field(&self, state: &State) -> Result<[DVector<f64>; 2]> {
        let experiment = &*self.prepared.problem.experiment;
        let predicted = predict(experiment, state, self.few.sight())?;
        Ok(self.few.average(&predicted.field))
    }

    fn of_series(&self, state: &SeriesState) -> Result<[DVector<f64>; 2]> {
        let blocks = &self.account.evidence.measured.blocks;
        let steps = self.prepared.observation.steps.as_ref();
        let steps = steps.ok_or_else(|| Error::program("trace::quoted", "a series"))?;
        let average = |u: &[[f64; 2]]| averages(blocks, u);
        let stepped = Stepped {
            average: &average,
            ..of_blocks(self.model, self.prepared, steps, blocks)
        };
        stepped.shown(state)
    }

    /// The linear columns in their order, with what they are.
    fn columns(&self) -> Vec<(&Column, Place)> {
        let here = &self.around.here;
        let (declared, sought, loads, names) = match &self.account.about {
            About::Field { sought, .. } => (
                self.model.effects.iter().map(|e| field(*e)).collect(),
                sought.iter().map(|e| field(*e)).collect(),
                Vec::new(),
                Vec::new(),
            ),
            About::Series {
                state,
                declared,
                sought,
            } => {
                let steps = self.prepared.observation.steps.as_ref();
                let names = steps.map_or_else(Vec::new, |s| s.names.clone());
                (declared.clone(), sought.clone(), state.loads.clone(), names)
            }
        };
        let of = |acts: &[Acts], name: &str| {
            acts.iter()
                .find_map(|acts| amplitude(acts, name, &loads, &names))
        };
        let base = here.base[here.constants..].iter().map(|column| {
            let load = &LOAD_SCALE.parameters()[0];
            let place = match column.name.as_str() {
                THICKNESS => Place::Thickness,
                name if name == amplitude_name(LOAD_SCALE, load) => Place::Load,
                name => of(&declared, name).unwrap_or(Place::None),
            };
            (column, place)
        });
        let of = |acts: &Acts, name: &str| amplitude(acts, name, &loads, &names);
        let own = here.candidates.iter().zip(&sought);
        let own = own.flat_map(|(candidate, acts)| {
            let place = move |c: &Column| of(acts, &c.name).unwrap_or(Place::None);
            candidate.columns.iter().map(move |c| (c, place(c)))
        });
        let all = base.chain(own);
        // a product is no amplitude of its own
        all.map(|(column, place)| match column.product {
            true => (column, Place::None),
            false => (column, place),
        })
        .collect()
    }
}

/// How much thicker the specimen is drawn, over the thickness about which it was linearised. Drawn is the scale of the response: what a
/// thickness t and a load l make of it is (1 + l) t0 / t, exactly linear in t0 / t and in l t0 / t, whose priors differ from those of t and
/// l by a hundredth of an sd. Taken for those of t and l themselves, draws are misfits by 1e-5 of the field, which points by the hundred
/// thousand see, and which says nothing of the constants.
fn thinner(values: &[(Place, f64, f64)]) -> f64 {
    let of = |(place, value, at): &(Place, f64, f64)| match place {
        Place::Thickness => Some((value - at) / at),
        _ => None,
    };
    values.iter().find_map(of).unwrap_or(0.0)
}

fn field(effect: &'static dyn Effect) -> Acts {
    Acts { effect, law: None }
}

/// The amplitude of an effect that has a name.
fn amplitude(acts: &Acts, name: &str, loads: &[f64], steps: &[String]) -> Option<Place> {
    if loads.is_empty() {
        let mut parameters = acts.effect.parameters().iter();
        let k = parameters.position(|p| amplitude_name(acts.effect, p) == name)?;
        return Some(Place::Amplitude(acts.effect, k, Vec::new()));
    }
    let found = acts.amplitudes(loads, steps).into_iter();
    let found = found.into_iter().find(|a| a.name == name)?;
    Some(Place::Amplitude(
        acts.effect,
        found.parameter,
        found.weights,
    ))
}

fn set(state: &mut State, place: &Place, value: f64) {
    let mut of = |effect: &'static dyn Effect, k: usize| {
        let mut amplitude = state.amplitude(effect);
        amplitude[k] = value;
        state.set(effect, amplitude);
    };
    match place {
        Place::Thickness => state.thickness_mm = value,
        Place::Load => of(LOAD_SCALE, 0),
        Place::Amplitude(effect, k, _) => of(*effect, *k),
        Place::None => {}
    }
}
