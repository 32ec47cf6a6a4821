//! An answer posed: its linear columns, its choices, and the data's normal equations under them.

use nalgebra::{DMatrix, DVector};

use super::Supposing;
use super::choices::{AnswerChoices, likeliest, with_rival};
use crate::error::Result;
use crate::files::Keyed;
use crate::infer::{Marginal, Model};
use crate::posterior::{
    ConstantsPrior, Density, Equations, Expansion, Space, Whose, shown, stacked,
};
use crate::sample::{LogDensity, NormalPart};
use crate::trace::averaged::{Interval, MULTIPLES, unseen};
use crate::trace::noise_choices::NoisePair;
use crate::trace::traced::Traced;
use crate::trace::weighing::Weighing;

/// An answer ready to be sampled, with what its draws need to be completed.
pub(super) struct PosedAnswer<'a> {
    pub answer: Density,
    pub traced: &'a Traced,
    pub expanded: &'a Expansion,
    /// Which of the linear columns the answer has.
    pub kept: Vec<usize>,
    pub pairs: Vec<NoisePair>,
    pub supposing: Supposing,
    /// Columns of [`stacked`], (u1, u2).
    pub columns: [DMatrix<f64>; 2],
    /// The constants by each of its parts in closed form: the first proposal.
    pub closed: Vec<NormalPart>,
    /// Choices of the noise, where they are not the account's.
    wide: Option<Weighing>,
}

/// Posterior sds of the constants in prior sds, within these: the steps beside which slopes are taken, and so many times as far the surface
/// of the mean reaches, within others.
const STEP: [f64; 2] = [0.03, 0.5];
const REACH: f64 = 8.0;
const BOX: [f64; 2] = [0.5, 3.0];

/// How far constants are raised for slopes, and how far the surface reaches, border units; over the whole prior where answers are asked for
/// that are wider than the `averaged` one.
pub(super) fn reaches(
    model: &Model,
    averaged: &Keyed<Interval>,
    is_wider: bool,
) -> (Vec<f64>, Vec<f64>) {
    let names = model.constants().iter().zip(model.marginals());
    let of = |(name, m): (&&str, Marginal)| {
        let sd = averaged.get(*name).map_or(m.sd, |i| i.sd) / m.sd;
        let reach = if is_wider { BOX[1] } else { REACH * sd };
        let step = m.sd * sd.clamp(STEP[0], STEP[1]);
        (step, m.sd * reach.clamp(BOX[0], BOX[1]))
    };
    names.map(of).unzip()
}

impl<'a> PosedAnswer<'a> {
    /// The answer of an account under a supposition.
    ///
    /// # Errors
    /// Of the program: columns that are not finite.
    pub fn new(
        model: &Model,
        traced: &'a Traced,
        expanded: &'a Expansion,
        supposing: Supposing,
    ) -> Result<Self> {
        let evidence = &traced.evidence;
        let wide = (supposing != Supposing::Small).then(|| evidence.weighing.beyond_rival());
        let weighing = wide.as_ref().unwrap_or(&evidence.weighing);
        let here = &expanded.here;
        let unseen = unseen(
            &evidence.weighing,
            &evidence.sensitivities,
            &evidence.subsets,
        )?;
        let (kept, whose) = kept(traced, expanded, supposing, &unseen);
        let AnswerChoices {
            pairs,
            parts,
            closed,
        } = match supposing {
            Supposing::Small => likeliest(evidence, weighing)?,
            _ => with_rival(evidence, weighing, supposing)?,
        };
        let largest = |w: &Whose| match w {
            Whose::Candidate(_) if supposing == Supposing::Small => MULTIPLES[MULTIPLES.len() - 1],
            _ => 1.0,
        };
        let largest = DVector::from_iterator(whose.len(), whose.iter().map(largest));
        let measured = &evidence.measured;
        // of the columns as they are here: at another point other combinations are not seen
        let own = [0, 1].map(|c| shown(here, &kept, c));
        let mut gram = DMatrix::zeros(kept.len(), kept.len());
        for of_pair in weighing
            .noise
            .grams(&measured.blocks, [&own[0], &own[1]], &pairs)?
        {
            gram += of_pair;
        }
        let space = Space::new(whose, largest, &gram);
        let columns = [0, 1].map(|c| stacked(here, expanded, measured, &space, &kept, c));
        let grams = weighing
            .noise
            .grams(&measured.blocks, [&columns[0], &columns[1]], &pairs)?;
        let directions = space.directions();
        let noise = grams
            .iter()
            .map(|g| Equations::new(g, directions, here.constants))
            .collect();
        let prior = ConstantsPrior {
            material: model.material(),
            marginals: model.marginals(),
            known: model.known.clone(),
        };
        let answer = Density::new(prior, expanded.surface.clone(), space, noise, parts);
        Ok(Self {
            answer,
            traced,
            expanded,
            kept,
            pairs,
            supposing,
            columns,
            closed,
            wide,
        })
    }

    /// What weighs the residual.
    pub fn weighing(&self) -> &Weighing {
        let own = &self.traced.evidence.weighing;
        self.wide.as_ref().unwrap_or(own)
    }

    /// A point to start from and the sd to start with: the closed form's, or the prior's where that is no material.
    pub fn start(&self, averaged: &Keyed<Interval>) -> (Vec<f64>, Vec<f64>) {
        let columns = &self.expanded.here.base[..self.answer.constants()];
        let of = |name: &str| averaged.get(name).map(|i| (i.mean, i.sd));
        let moments = columns
            .iter()
            .map(|c| of(&c.name).unwrap_or((c.mean, c.sd)));
        let (mean, sd): (Vec<f64>, Vec<f64>) = moments.unzip();
        if self.answer.log_density(&mean).is_ok() {
            return (mean, sd);
        }
        columns.iter().map(|c| (c.mean, c.sd)).unzip()
    }
}

/// Linear columns of an answer, and whose they are; of the candidates' columns those that are `unseen`.
fn kept(
    traced: &Traced,
    expanded: &Expansion,
    supposing: Supposing,
    unseen: &[bool],
) -> (Vec<usize>, Vec<Whose>) {
    let here = &expanded.here;
    let base = here.base.len() - here.constants;
    let mut all: Vec<(usize, Whose)> = (0..base).map(|k| (k, Whose::Always)).collect();
    let mut next = base;
    for (candidate, c) in here.candidates.iter().enumerate() {
        for column in &c.columns {
            match supposing {
                // where the specimen stands is nobody's account
                Supposing::None if column.is_rigid() => all.push((next, Whose::Always)),
                Supposing::None => {}
                Supposing::Small if unseen.get(next - base) == Some(&true) => {
                    all.push((next, Whose::Always));
                }
                _ => all.push((next, Whose::Candidate(candidate))),
            }
            next += 1;
        }
    }
    if supposing != Supposing::Small {
        let rival = traced.evidence.sensitivities.near_edge.len();
        all.extend((next..next + rival).map(|k| (k, Whose::Rival)));
    }
    all.into_iter().unzip()
}
