//! How far what a round says of the constants by the field alone disagrees with what other experiments say, and what spans a contradiction.

use super::averaged::normal;
use super::evidence::Evidence;
use super::round::Round;
use super::subsets::SubsetPosterior;
use super::suspect::ConditionalAnswer;
use crate::error::Result;
use crate::infer::{Marginal, Moments, Tension};
use crate::linearise::Column;
use crate::noise::NormalEquations;
use crate::parameter::is_modulus;

/// Size of the effects that were not found but may act, prior sds.
const UNSEEN: f64 = 0.1;

/// The tension between the field, with the effects that were found and a little of all others, and the experiments beside it.
pub fn tension(round: &Round) -> Option<Tension> {
    let evidence = &round.traced.evidence;
    let acting = evidence.subsets.layout.columns(evidence.subsets.best());
    between(evidence, &acting, UNSEEN)
}

fn between(evidence: &Evidence, acting: &[usize], unseen: f64) -> Option<Tension> {
    let known = evidence.sensitivities.known.as_ref()?;
    let constants = &evidence.sensitivities.base[..evidence.sensitivities.constants];
    let prior = |c: &Column| Marginal {
        mean: c.mean,
        sd: c.sd,
        truncate: None,
    };
    let priors: Vec<Marginal> = constants.iter().map(prior).collect();
    let moduli: Vec<bool> = constants.iter().map(|c| is_modulus(&c.name)).collect();
    let field = of_field(evidence, acting, unseen)?;
    Tension::between(&field, &known.moments()?, &priors, &moduli)
}

/// The constants by the field of a round alone and by the other experiments alone, where they contradict each other.
pub(super) fn both_alone(round: &Round) -> Vec<ConditionalAnswer> {
    if !tension(round).is_some_and(|t| t.contradicts()) {
        return Vec::new();
    }
    let known = round.model.known.as_ref().and_then(|known| known.moments());
    let each = [
        ("the field", field_alone(round)),
        ("the other experiments", known),
    ];
    let names = round.model.constants();
    let answer = |(whose, moments): (&str, Option<Moments>)| {
        let moments = moments?;
        let one = |(k, name): (usize, &&str)| {
            let sd = moments.covariance[(k, k)].sqrt();
            ((*name).to_string(), normal((moments.mean[k], sd)))
        };
        Some(ConditionalAnswer {
            supposing: format!("{whose} alone"),
            constants: names.iter().enumerate().map(one).collect(),
        })
    };
    each.into_iter().filter_map(answer).collect()
}

/// A contradiction between the field as it is declared and the experiments beside it, and what the field alone says of effects.
pub(super) struct Contradiction {
    tension: Tension,
    alone: SubsetPosterior,
}

impl Contradiction {
    /// # Errors
    /// Of the program, for columns that are not finite.
    pub fn of(evidence: &Evidence) -> Result<Option<Self>> {
        let tension = between(evidence, &[], 0.0).filter(Tension::contradicts);
        let of = |tension| {
            let candidates = &evidence.sensitivities.candidates;
            let alone = SubsetPosterior::new(&evidence.weighing.alone(), candidates)?;
            Ok(Self { tension, alone })
        };
        tension.map(of).transpose()
    }

    /// Why an effect of the best subset does not stand: an error of an experiment explains as much as the field alone has for it.
    pub fn objection(&self, evidence: &Evidence, leader: &str) -> Option<String> {
        let candidates = &evidence.sensitivities.candidates;
        let best = evidence.subsets.best();
        let others = best.iter().copied();
        let others = others.filter(|&k| candidates[k].effect.name() != leader);
        let with = self.alone.log_evidence(best);
        let support = with - self.alone.log_evidence(&others.collect::<Vec<_>>());
        let factor = &self.tension.factor;
        (support <= factor.log_bayes_factor.max(0.0)).then(|| {
            format!(
                "the field alone does not call for it, and an error of {:+.1} % in all moduli by the field, or of the other experiments, explains the contradiction as well",
                factor.percent
            )
        })
    }
}

/// Mean and covariance of the constants by the field of a round alone under its likeliest noise, with the effects that were found and a
/// little of all others.
pub fn field_alone(round: &Round) -> Option<Moments> {
    let evidence = &round.traced.evidence;
    let acting = evidence.subsets.layout.columns(evidence.subsets.best());
    of_field(evidence, &acting, UNSEEN)
}

/// The same with the columns that are `acting` and `unseen` of the prior sds of all others.
fn of_field(evidence: &Evidence, acting: &[usize], unseen: f64) -> Option<Moments> {
    let Evidence {
        sensitivities,
        weighing,
        subsets,
        ..
    } = evidence;
    let gram = weighing.noise.gram(&weighing.pairs[subsets.best_pair]);
    let data = gram.nrows() - 1;
    let base = sensitivities.base.len();
    let size = |k: usize| match k.checked_sub(base) {
        Some(k) if !acting.contains(&k) => unseen,
        _ => 1.0,
    };
    let scaled: Vec<(usize, f64)> = (0..sensitivities.columns().count())
        .map(|k| (k, size(k)))
        .collect();
    let fit = NormalEquations::of_columns(&gram, |k| gram[(k, data)], &scaled)?;
    let n = sensitivities.constants;
    let columns = &sensitivities.base[..n];
    let (mean, covariance) = (fit.mean(), fit.covariance());
    Some(Moments {
        mean: nalgebra::DVector::from_fn(n, |k, _| columns[k].mean + columns[k].sd * mean[k]),
        covariance: nalgebra::DMatrix::from_fn(n, n, |i, j| {
            columns[i].sd * columns[j].sd * covariance[(i, j)]
        }),
    })
}
