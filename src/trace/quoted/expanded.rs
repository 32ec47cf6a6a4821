//! The slopes of what was traced as they change with the constants.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::identify::Prepared;
use crate::infer::Model;
use crate::linearise::Sensitivities;
use crate::trace::traced::{Traced, forward};

/// The test linearised about a point and, for every constant, about the point with that constant raised by some prior sds; with all
/// effects there too. Their fields are small, but an amplitude of what can be told from none of the load's scale (the sensitivity of both
/// components) is as good as one of the load, and follows the constants as the load does.
pub struct TestExpansion {
    pub here: Sensitivities,
    pub raised: Vec<Sensitivities>,
    /// How far, prior sds.
    pub by: Vec<f64>,
}

impl TestExpansion {
    /// Linearise about the traced point and beside it; `by` has a step for each constant, prior sds.
    ///
    /// # Errors
    /// Those of finite-element solutions.
    pub fn new(traced: &Traced, model: &Model, prepared: &Prepared, by: Vec<f64>) -> Result<Self> {
        let forward = forward(model, prepared, &traced.evidence.measured, &|| ());
        let point = &traced.point;
        let linearised = |constant: Option<usize>| {
            let mut state = point.state.clone();
            if let Some(k) = constant {
                state.shared.constants[k] += by[k] * model.marginals()[k].sd;
            }
            forward.sensitivities(&state, &point.declared, &point.sought)
        };
        let raised: Vec<Option<usize>> = (0..by.len()).map(Some).collect();
        let points = [vec![None], raised].concat();
        let all: Result<Vec<Sensitivities>> = points.into_par_iter().map(linearised).collect();
        let mut all = all?.into_iter();
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
