//! The slopes of an account as they change with the constants.

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::experiment::State;
use crate::experiment::series::SeriesState;
use crate::identify::Prepared;
use crate::infer::{Model, Stepped};
use crate::trace::account::{About, Account};
use crate::trace::ridge::of_series;
use crate::trace::sensitivities::{Few, Linearised, Sensitivities};
use crate::trace::series::{averages, of_blocks};

/// The test linearised about a point and, for every constant, about the point with that constant raised by some prior sds; with all
/// effects there too. Their fields are small, but an amplitude of what can be told from none of the load's scale (the sensitivity of both
/// components) is as good as one of the load, and follows the constants as the load does.
pub struct Around {
    pub here: Sensitivities,
    pub raised: Vec<Sensitivities>,
    /// How far, prior sds.
    pub by: Vec<f64>,
}

impl Around {
    /// Linearise about the account's point and beside it; `by` has a step for each constant, prior sds.
    ///
    /// # Errors
    /// Those of finite-element solutions.
    pub fn new(
        account: &Account,
        model: &Model,
        prepared: &Prepared,
        by: Vec<f64>,
    ) -> Result<Self> {
        let measured = Arc::clone(&account.evidence.measured);
        let sds: Vec<f64> = model.marginals().iter().map(|m| m.sd).collect();
        let moved = |state: &State, k: Option<usize>| {
            let mut state = state.clone();
            if let Some(k) = k {
                state.constants[k] += by[k] * sds[k];
            }
            state
        };
        let places: Vec<Option<usize>> = std::iter::once(None)
            .chain((0..by.len()).map(Some))
            .collect();
        let all: Vec<Result<Sensitivities>> = match &account.about {
            About::Field {
                state,
                sought,
                size_mm,
            } => {
                let linearised = Linearised {
                    model,
                    experiment: &*prepared.problem.experiment,
                    size_mm: *size_mm,
                    few: Few::new(prepared, &measured.blocks),
                    step: &|| (),
                };
                let at = |k: Option<usize>| linearised.sensitivities(&moved(state, k), sought);
                places.into_iter().map(at).collect()
            }
            About::Series {
                state,
                declared,
                sought,
            } => {
                let average = |u: &[[f64; 2]]| averages(&measured.blocks, u);
                let steps = prepared.observation.steps.as_ref();
                let steps = steps.ok_or_else(|| Error::program("trace::quoted", "a series"))?;
                let stepped = Stepped {
                    average: &average,
                    ..of_blocks(model, prepared, steps, &measured.blocks)
                };
                let at = |k: Option<usize>| {
                    let shared = moved(&state.shared, k);
                    let state = SeriesState {
                        shared,
                        ..state.clone()
                    };
                    of_series(&stepped, &state, declared, sought)
                };
                places.into_par_iter().map(at).collect()
            }
        };
        let mut all = all.into_iter().collect::<Result<Vec<_>>>()?.into_iter();
        let here = all
            .next()
            .ok_or_else(|| Error::program("trace::quoted", "a linearisation"))?;
        Ok(Self {
            here,
            raised: all.collect(),
            by,
        })
    }
}
