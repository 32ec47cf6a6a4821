//! The prediction of a test linearised about a state, as block averages.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use serde::{Deserialize, Serialize};

use super::column::{Column, StepStack};
use crate::effect::Effect;
use crate::experiment::series::Law;
use crate::infer::ConstantsLikelihood;

/// An effect that the model lacks, or might.
#[derive(Clone, Serialize, Deserialize)]
pub struct Candidate {
    pub effect: &'static dyn Effect,
    /// How its amplitude goes over the steps of a series, where it is another in each.
    pub law: Option<Law>,
    pub columns: Vec<Column>,
    /// Whether every specimen has some of it, by what the model declares: it acts with its prior sd in all that is averaged.
    pub scatters: bool,
}

/// The prediction linearised about a state.
#[derive(Clone, Serialize, Deserialize)]
pub struct Sensitivities {
    /// Block averages of (u1, u2) at the prior means of all parameters, by this linearisation, mm.
    pub predicted: StepStack,
    /// Elastic constants, the thickness if it is uncertain, the load's scale, declared effects.
    pub base: Vec<Column>,
    /// How many of `base` are elastic constants.
    pub constants: usize,
    /// Effects that are not declared.
    pub candidates: Vec<Candidate>,
    /// Block averages of (u1, u2), mm, of the near-edge rival's fields ([`crate::experiment::Softening::NearEdge`]); none where no
    /// effect is a candidate.
    pub near_edge: Vec<StepStack>,
    /// What experiments beside the field say of the constants.
    pub known: Option<Arc<ConstantsLikelihood>>,
}

impl Sensitivities {
    /// Add what other experiments say to normal equations X'X, X'y of columns that begin with the constants.
    pub fn add_known(&self, gram: &mut DMatrix<f64>, right: &mut DVector<f64>) {
        if let Some(known) = &self.known {
            known.add_to(gram, right);
        }
    }

    /// All columns, those of the model first.
    pub fn columns(&self) -> impl Iterator<Item = &Column> {
        let sought = self.candidates.iter().flat_map(|c| &c.columns);
        self.base.iter().chain(sought)
    }

    /// Whether all that is predicted, and all columns, are numbers.
    pub fn is_finite(&self) -> bool {
        let columns = self.columns().map(|c| &c.values);
        let all = columns.chain(&self.near_edge).chain([&self.predicted]);
        all.flatten().flatten().all(|v| v.is_finite())
    }

    /// Carry the prediction to the prior means of the candidates' parameters.
    pub(super) fn carry_candidates(&mut self) {
        let sought = self.candidates.iter().flat_map(|c| &c.columns);
        move_to_means(&mut self.predicted, sought);
    }

    /// Carry the prediction from where it was linearised to the prior means of all parameters.
    pub(super) fn carry_to_means(&mut self) {
        let sought = self.candidates.iter().flat_map(|c| &c.columns);
        move_to_means(&mut self.predicted, self.base.iter().chain(sought));
    }
}

/// Carry a prediction from where columns were linearised to the prior means of their parameters.
fn move_to_means<'a>(predicted: &mut StepStack, columns: impl Iterator<Item = &'a Column>) {
    for column in columns {
        let shift = (column.mean - column.at) / column.sd;
        for (sum, values) in predicted.iter_mut().zip(&column.values) {
            sum.axpy(shift, values, 1.0);
        }
    }
}
