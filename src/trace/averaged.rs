//! The constants' posterior averaged over what may act unseen, and what each unseen effect would do to them.

use std::f64::consts::{SQRT_2, TAU};

use serde::{Deserialize, Serialize};
use statrs::function::erf::erfc;

use nalgebra::{DMatrix, DVector};

use super::blind_spot::{detectable, not_finite, prior_odds};
use super::subsets::{Subset, SubsetPosterior};
use crate::error::Result;
use crate::files::Keyed;
use crate::linearise::{Candidate, Column, Sensitivities};
use crate::noise::NormalEquations;
use crate::numeric::bisect;
use crate::numeric::log_sum_exp;
use crate::parameter::is_modulus;
use crate::posterior::NoisePair;
use crate::posterior::Weighing;
use crate::sample::NormalPart;

/// Sizes of the effects that are not declared, as multiples of their prior sds: which one holds is weighed by
/// the evidence. With every effect at 0.02 of its prior sd, averages over sparse subsets alone covered E2 and nu12 in 72 to 80 % of cases
/// instead of 95 %, this mixture in 98 % (prototype study).
pub const MULTIPLES: [f64; 7] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0];

/// An averaged constant, border units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    pub mean: f64,
    pub sd: f64,
    #[serde(rename = "q2.5")]
    pub low: f64,
    pub median: f64,
    #[serde(rename = "q97.5")]
    pub high: f64,
}

/// A normal component of a mixture.
pub struct AveragedPart {
    pub log_weight: f64,
    pub mean: Vec<f64>,
    pub sd: Vec<f64>,
    /// Constants x constants, row-major.
    pub covariance: Vec<f64>,
}

impl AveragedPart {
    /// The normal distribution that it is.
    pub fn normal(&self) -> NormalPart {
        NormalPart {
            log_weight: self.log_weight,
            mean: self.mean.clone(),
            covariance: self.covariance.clone(),
        }
    }
}

/// The constants' posterior, a mixture of normals over the noise, the effects that act with their full prior sizes, and the size of all
/// others. Parameters whose columns carry no prior of their own are those of the base model. Without the subsets an effect that others can
/// stand in for left constants of series 26 sds off (prototype study).
///
/// # Errors
/// Of the program, for columns that are not finite.
pub fn averaged(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
) -> Result<Keyed<Interval>> {
    let parts = choices(weighing, sensitivities, subsets, PAIRS)?;
    let parts: Vec<AveragedPart> = parts.into_iter().map(|chosen| chosen.part).collect();
    Ok(mixtures(sensitivities, &parts))
}

/// A part of the mixture of [`averaged`] with what it supposes.
pub struct ChosenSubset {
    /// Its posterior weight and the constants.
    pub part: AveragedPart,
    /// Log prior probability of the effects that act.
    pub log_prior: f64,
    /// Candidates that act with their full prior sds, and the size of all others over theirs, but for what is [`unseen`].
    pub own: Subset,
    pub size: f64,
    /// The pair of the noise.
    pub pair: usize,
}

/// What the mixture of [`averaged`] is of; of the likeliest `count` pairs of a subset and a choice of the noise.
///
/// # Errors
/// Those of [`averaged`].
pub fn choices(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
    count: usize,
) -> Result<Vec<ChosenSubset>> {
    let least = weighing
        .noise
        .by_frames()
        .map_or(MULTIPLES[0], |_| LEAST_MULTIPLE);
    let unseen = unseen(weighing, sensitivities, subsets)?;
    let mut all = Vec::new();
    for (own, pair, log_prior) in subsets.likeliest(count) {
        let mut columns = subsets.layout.columns(own);
        columns.extend((0..unseen.len()).filter(|k| unseen[*k]));
        for size in MULTIPLES.into_iter().filter(|m| *m >= least) {
            let sizes = Sizes {
                own: &columns,
                effects: size,
                rival: 0.0,
            };
            let mut part = part_of(weighing, sensitivities, &weighing.pairs[pair], &sizes)?;
            part.log_weight += log_prior;
            all.push(ChosenSubset {
                part,
                log_prior,
                own: own.clone(),
                size,
                pair,
            });
        }
    }
    Ok(all)
}

/// Mean and sd of the parameters of the base model by the likeliest subset and noise, effects beside it as small as is likeliest, prior sds from
/// their means.
///
/// # Errors
/// Those of [`averaged`].
pub fn likeliest(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
) -> Result<Vec<(f64, f64)>> {
    let parts = choices(weighing, sensitivities, subsets, 1)?.into_iter();
    let best = parts.max_by(|a, b| a.part.log_weight.total_cmp(&b.part.log_weight));
    let Some(best) = best else {
        return Ok(Vec::new());
    };
    let unseen = unseen(weighing, sensitivities, subsets)?;
    let mut own = subsets.layout.columns(&best.own);
    own.extend((0..unseen.len()).filter(|k| unseen[*k]));
    let sizes = Sizes {
        own: &own,
        effects: best.size,
        rival: 0.0,
    };
    let pair = &weighing.pairs[best.pair];
    let (_, fit) = fit_of(weighing, sensitivities, pair, &sizes)?;
    let (mean, covariance) = (fit.mean(), fit.covariance());
    let each = 0..sensitivities.base.len();
    Ok(each.map(|k| (mean[k], covariance[(k, k)].sqrt())).collect())
}

/// Which of the candidates' columns one field would not show at their prior sds: they act with those, whatever the common size of all
/// others is. What can be seen says nothing of them, and pulled them down with it: a strip under uniform strain, 5 K warmer than its
/// reference picture, was quoted with E and nu 3.7 sds off. Products with what is not known of the camera are unseen where their effect is.
/// The steps of a series tell apart what one field cannot. What every specimen has some of by its declared scatter acts so too.
///
/// # Errors
/// Of the program, for columns that are not finite.
pub fn unseen(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
) -> Result<Vec<bool>> {
    let candidates = &sensitivities.candidates;
    if weighing.noise.by_frames().is_some() {
        let each = candidates.iter();
        let is_always = |c: &Candidate| vec![c.scatters; c.columns.len()];
        return Ok(each.flat_map(is_always).collect());
    }
    let projected = weighing.project(&weighing.pairs[subsets.best_pair])?;
    let odds = prior_odds(candidates.len());
    let mut all = Vec::new();
    for candidate in candidates {
        let first = all.len();
        let is_always = candidate.scatters;
        let is_unseen =
            |k: usize| is_always || detectable(projected.g[(first + k, first + k)], odds) > 1.0;
        // the centre of a lens of no strength is no parameter of its own either
        let is_product = |(k, c): (usize, &Column)| c.product || candidate.effect.is_centre(k);
        let columns = candidate.columns.iter().enumerate();
        let mut own = columns.clone().filter(|c| !is_product(*c));
        let altogether = own.all(|(k, _)| is_unseen(k));
        all.extend(columns.map(|c| {
            if is_product(c) {
                altogether
            } else {
                is_unseen(c.0)
            }
        }));
    }
    Ok(all)
}

/// Pairs of a subset and a choice of the noise that are averaged over, at most.
pub const PAIRS: usize = 24;

/// The smallest size of undeclared effects of a series. One size is common to all of them: those that these data cannot show pulled it to
/// 0.003 of their prior sds and left nothing to the others, and constants under ten small effects lay 1.2 to 2.1 sds off (prototype study).
pub const LEAST_MULTIPLE: f64 = 0.03;

/// Sizes of what is not declared, over the prior sds: of some candidates' columns of 1, of all others, and of the near-edge rival.
struct Sizes<'a> {
    own: &'a [usize],
    effects: f64,
    rival: f64,
}

/// The constants where all undeclared effects act with `effects` times their prior sds, and the near-edge rival with stresses of
/// `rival` times the nominal one. Rigid motion is left free where no effect acts.
///
/// # Errors
/// Of the program, for columns that are not finite.
pub fn part(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    pair: &NoisePair,
    [effects, rival]: [f64; 2],
) -> Result<AveragedPart> {
    let sizes = Sizes {
        own: &[],
        effects,
        rival,
    };
    part_of(weighing, sensitivities, pair, &sizes)
}

/// The constants where the candidates' columns `own` act with their prior sds, and all others with a size that the evidence weighs.
///
/// # Errors
/// Of the program, for columns that are not finite.
pub fn supposing(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    pair: &NoisePair,
    own: &[usize],
) -> Result<Keyed<Interval>> {
    let sizes = MULTIPLES.into_iter().filter(|m| *m >= LEAST_MULTIPLE);
    let part = |effects: f64| {
        let sizes = Sizes {
            own,
            effects,
            rival: 0.0,
        };
        part_of(weighing, sensitivities, pair, &sizes)
    };
    let parts: Vec<AveragedPart> = sizes.map(part).collect::<Result<_>>()?;
    Ok(mixtures(sensitivities, &parts))
}

/// Half-width of a normal distribution's 95 % interval, sds.
pub const NORMAL_95: f64 = 1.959_964;

/// The interval of a normal distribution.
pub fn normal((mean, sd): (f64, f64)) -> Interval {
    Interval {
        mean,
        sd,
        low: mean - NORMAL_95 * sd,
        median: mean,
        high: mean + NORMAL_95 * sd,
    }
}

fn part_of(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    pair: &NoisePair,
    sizes: &Sizes<'_>,
) -> Result<AveragedPart> {
    let (_, fit) = fit_of(weighing, sensitivities, pair, sizes)?;
    let columns = &sensitivities.base[..sensitivities.constants];
    let (solved, covariance) = (fit.mean(), fit.covariance());
    let of = |k: usize| (solved[k], covariance[(k, k)].sqrt());
    let moments = columns.iter().enumerate();
    let moments = moments.map(|(k, c)| (c.mean + c.sd * of(k).0, c.sd * of(k).1));
    let (mean, sd) = moments.unzip();
    let own = || columns.iter().enumerate();
    let pairs = own().flat_map(|i| own().map(move |j| (i, j)));
    let covariance = pairs.map(|((i, a), (j, b))| a.sd * b.sd * covariance[(i, j)]);
    Ok(AveragedPart {
        log_weight: weighing.log_data(pair) + fit.log_evidence(),
        mean,
        sd,
        covariance: covariance.collect(),
    })
}

/// Mean and covariance of the rival's amplitudes, of the sizes of [`part`].
///
/// # Errors
/// Of the program, for columns that are not finite.
pub fn rival_of(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    pair: &NoisePair,
    [effects, rival]: [f64; 2],
) -> Result<(DVector<f64>, DMatrix<f64>)> {
    let sizes = Sizes {
        own: &[],
        effects,
        rival,
    };
    let (scaled, fit) = fit_of(weighing, sensitivities, pair, &sizes)?;
    let count = sensitivities.near_edge.len();
    let first = scaled.len() - count;
    Ok((
        fit.mean().rows(first, count) * rival,
        fit.covariance()
            .view((first, first), (count, count))
            .into_owned()
            * (rival * rival),
    ))
}

/// The columns of some sizes, each with its scale, and their fit; the constants' come first and the rival's last.
fn fit_of(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    pair: &NoisePair,
    &Sizes {
        own,
        effects,
        rival,
    }: &Sizes<'_>,
) -> Result<(Vec<(usize, f64)>, NormalEquations)> {
    let gram = weighing.gram(pair);
    let data = gram.nrows() - 1;
    let base = sensitivities.base.len();
    let first_rival = data - sensitivities.near_edge.len();
    let candidates: Vec<&Column> = sensitivities
        .candidates
        .iter()
        .flat_map(|c| &c.columns)
        .collect();
    let scaled: Vec<(usize, f64)> = (0..data)
        .map(|k| match k {
            k if k < base || own.contains(&(k - base)) => (k, 1.0),
            // where the specimen stands is nobody's account
            k if effects == 0.0 && k < first_rival && candidates[k - base].is_rigid() => (k, 1.0),
            k if k < first_rival => (k, effects),
            k => (k, rival),
        })
        .filter(|(_, scale)| *scale > 0.0)
        .collect();
    let right = |k: usize| gram[(k, data)];
    let fit = NormalEquations::of_columns(&gram, right, &scaled).ok_or_else(not_finite)?;
    Ok((scaled, fit))
}

/// The constants' mixtures of weighted parts.
pub fn mixtures(sensitivities: &Sensitivities, parts: &[AveragedPart]) -> Keyed<Interval> {
    let total = log_sum_exp(parts.iter().map(|p| p.log_weight));
    let columns = sensitivities.base.iter().take(sensitivities.constants);
    let mixed = |(k, c): (usize, &Column)| {
        let modulus = is_modulus(&c.name);
        (c.name.clone(), mixture(parts, total, k, modulus))
    };
    columns.enumerate().map(mixed).collect()
}

/// A normal distribution above zero: its share of all, mean and sd.
pub fn above_zero(mean: f64, sd: f64) -> (f64, f64, f64) {
    let a = mean / sd;
    let share = 0.5 * erfc(-a / SQRT_2);
    let hazard = (-0.5 * a * a).exp() / (TAU.sqrt() * share);
    let variance = sd * sd * (1.0 - a * hazard - hazard * hazard);
    (share, mean + sd * hazard, variance.max(0.0).sqrt())
}

/// Parts of which less than this lies above zero do not count.
const LEAST_SHARE: f64 = 1e-12;

/// The mixture of one constant; of a modulus, what lies above zero of it.
pub fn mixture(parts: &[AveragedPart], total: f64, k: usize, modulus: bool) -> Interval {
    let share = |p: &AveragedPart| above_zero(p.mean[k], p.sd[k]).0;
    let positive: Vec<&AveragedPart> = parts.iter().filter(|p| share(p) > LEAST_SHARE).collect();
    let cut = modulus && !positive.is_empty();
    let kept: Vec<&AveragedPart> = if cut {
        positive
    } else {
        parts.iter().collect()
    };
    let log_weight = |p: &AveragedPart| p.log_weight + if cut { share(p).ln() } else { 0.0 };
    // most of the probability may lie where a modulus cannot be
    let total = if cut {
        log_sum_exp(kept.iter().map(|p| log_weight(p)))
    } else {
        total
    };
    let weighed = || {
        kept.iter().map(|p| {
            let (mean, sd) = match above_zero(p.mean[k], p.sd[k]) {
                (_, mean, sd) if cut => (mean, sd),
                _ => (p.mean[k], p.sd[k]),
            };
            ((log_weight(p) - total).exp(), mean, sd)
        })
    };
    let mean: f64 = weighed().map(|(w, m, _)| w * m).sum();
    let variance: f64 = weighed()
        .map(|(w, m, s)| w * (s * s + (m - mean).powi(2)))
        .sum();
    let sd = variance.sqrt();
    let below = |x: f64| -> f64 {
        let one = |p: &&AveragedPart| {
            let normal = |x: f64| 0.5 * erfc((p.mean[k] - x) / (p.sd[k] * SQRT_2));
            let within = if cut {
                (normal(x) - normal(0.0)).max(0.0) / share(p)
            } else {
                normal(x)
            };
            (log_weight(p) - total).exp() * within
        };
        kept.iter().map(one).sum()
    };
    let lowest = if cut { 0.0 } else { mean - 40.0 * sd };
    let quantile = |q: f64| bisect(lowest, mean + 40.0 * sd, |x| below(x) < q);
    Interval {
        mean,
        sd,
        low: quantile(0.025),
        median: quantile(0.5),
        high: quantile(0.975),
    }
}
