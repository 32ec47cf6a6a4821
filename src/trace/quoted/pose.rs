//! An answer posed: its linear columns and its choices.

use std::sync::Arc;

use nalgebra::DVector;

use super::Scenario;
use super::choices::{AnswerChoices, likeliest, with_rival};
use crate::error::Result;
use crate::files::Keyed;
use crate::infer::Model;
use crate::posterior::{Composition, LinearRole, Posed, TestExpansion, Weighing};
use crate::sample::{LogDensity, NormalPart};
use crate::trace::averaged::{Interval, MULTIPLES, unseen};
use crate::trace::traced::LinearisedEvidence;

/// An answer ready to be sampled, with what its draws need to be completed.
pub(super) struct PosedAnswer<'a> {
    pub posed: Posed,
    pub traced: &'a LinearisedEvidence,
    pub supposing: Scenario,
    /// The constants by each of its parts in closed form: the first proposal.
    pub closed: Vec<NormalPart>,
}

impl<'a> PosedAnswer<'a> {
    /// The answer of an account under a supposition.
    ///
    /// # Errors
    /// Of the program: columns that are not finite.
    pub fn new(
        model: &Model,
        traced: &'a LinearisedEvidence,
        expanded: Arc<TestExpansion>,
        supposing: Scenario,
    ) -> Result<Self> {
        let evidence = &traced.evidence;
        let wide = (supposing != Scenario::Small).then(|| evidence.weighing.beyond_rival());
        let weighing: &Weighing = wide.as_ref().unwrap_or(&evidence.weighing);
        let unseen = unseen(
            &evidence.weighing,
            &evidence.sensitivities,
            &evidence.subsets,
        )?;
        let (kept, whose) = kept(traced, &expanded, supposing, &unseen);
        let AnswerChoices {
            pairs,
            parts,
            closed,
        } = match supposing {
            Scenario::Small => likeliest(evidence, weighing)?,
            _ => with_rival(evidence, weighing, supposing)?,
        };
        let largest = |w: &LinearRole| match w {
            LinearRole::Candidate(_) if supposing == Scenario::Small => {
                MULTIPLES[MULTIPLES.len() - 1]
            }
            _ => 1.0,
        };
        let account = Composition {
            largest: DVector::from_iterator(whose.len(), whose.iter().map(largest)),
            kept,
            whose,
            pairs,
            parts,
        };
        let test = (expanded, Arc::clone(&evidence.measured));
        Ok(Self {
            posed: Posed::new(model, test, Arc::clone(&weighing.noise), account)?,
            traced,
            supposing,
            closed,
        })
    }

    /// A point to start from and the sd to start with: the closed form's, or the prior's where that is no material.
    pub fn start(&self, averaged: &Keyed<Interval>) -> (Vec<f64>, Vec<f64>) {
        let Posed {
            density, expanded, ..
        } = &self.posed;
        let columns = &expanded.here.base[..density.constants()];
        let of = |name: &str| averaged.get(name).map(|i| (i.mean, i.sd));
        let moments = columns
            .iter()
            .map(|c| of(&c.name).unwrap_or((c.mean, c.sd)));
        let (mean, sd): (Vec<f64>, Vec<f64>) = moments.unzip();
        if density.log_density(&mean).is_ok() {
            return (mean, sd);
        }
        columns.iter().map(|c| (c.mean, c.sd)).unzip()
    }
}

/// Linear columns of an answer, and whose they are; of the candidates' columns those that are `unseen`.
fn kept(
    traced: &LinearisedEvidence,
    expanded: &TestExpansion,
    supposing: Scenario,
    unseen: &[bool],
) -> (Vec<usize>, Vec<LinearRole>) {
    let here = &expanded.here;
    let base = here.base.len() - here.constants;
    let mut all: Vec<(usize, LinearRole)> = (0..base).map(|k| (k, LinearRole::Always)).collect();
    let mut next = base;
    for (candidate, c) in here.candidates.iter().enumerate() {
        for column in &c.columns {
            match supposing {
                // where the specimen stands is nobody's account
                Scenario::None if column.is_rigid() => all.push((next, LinearRole::Always)),
                Scenario::None => {}
                Scenario::Small if unseen.get(next - base) == Some(&true) => {
                    all.push((next, LinearRole::Always));
                }
                _ => all.push((next, LinearRole::Candidate(candidate))),
            }
            next += 1;
        }
    }
    if supposing != Scenario::Small {
        let rival = traced.evidence.sensitivities.near_edge.len();
        all.extend((next..next + rival).map(|k| (k, LinearRole::Rival)));
    }
    all.into_iter().unzip()
}
