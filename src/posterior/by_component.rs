//! Choices of the noise of one field, for each component its own.
//!
//! Noise of a component: C = s^2 [diag(nbar / n_b) + rho Matern(l)], s^2 by restricted likelihood on contrasts
//! orthogonal to all columns, the candidates' included, so that an effect's structure does not pass for noise: with the noise taken from
//! the bare fit's residual, loud effects were never named, because they inflate it (prototype study). Short lengths are noise; long
//! ones are a smooth discrepancy, the rival of every named effect.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use serde::{Deserialize, Serialize};

use super::noise_choices::{NoiseChoices, NoisePair, alone, correlated, with_data};
use crate::dense;
use crate::error::{Error, Result};
use crate::field::Blocks;
use crate::linearise::{Measured, Sensitivities};
use crate::noise::covariance::{RATIOS, discrepancy_lengths_mm, noise_lengths_mm, over_grid};
use crate::noise::reml::{Contrasts, orthonormal};
use crate::noise::series::{DISCREPANCY, Frames, SeriesNoise};
use crate::noise::{BlockCovariance, ComponentOfNoise, Hyperparameters, Matern, solve};

/// Ratios rho weighed here: all but that of noise that is correlated alone.
pub const TRACED: &[f64] = RATIOS.split_at(RATIOS.len() - 1).0;

/// Lengths weighed, half of them noise and half discrepancy.
pub const LENGTHS: usize = 6;

/// Choices kept for each component in each class, noise and discrepancy, the likeliest ones; white noise is always kept.
const KEPT: usize = 6;

/// Lengths tried between two of the grid.
const BETWEEN: i32 = 2;

/// Choices for u1 and u2, the likeliest first.
#[derive(Clone, Serialize, Deserialize)]
pub struct ComponentNoise {
    choices: [Vec<NoiseChoice>; 2],
    pairs: Vec<NoisePair>,
    #[serde(skip)]
    factors: Arc<KnownFactors>,
}

/// The data and all columns of one component under one choice of its covariance hyperparameters.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct NoiseChoice {
    /// Length, ratio, scale and restricted likelihood.
    at: Hyperparameters,
    /// log det of the covariance.
    log_det: f64,
    /// X' C^-1 X of all columns and, last, the data.
    gram: DMatrix<f64>,
    /// The scale s^2 of contrasts that are orthogonal to the near-edge rival too, over that of `at`.
    beyond_rival: f64,
    /// The scale s^2 that `gram` has.
    scale2: f64,
    /// Number of values.
    values: usize,
}

/// Factorised covariances of one set of blocks at unit scale, by the bits of length and ratio: both components share them, and rounds that
/// begin with the same choices. No file keeps them.
#[derive(Debug, Default)]
struct KnownFactors(Mutex<Vec<([u64; 2], Arc<BlockCovariance>)>>);

impl KnownFactors {
    fn of(&self, at: &Hyperparameters, blocks: &Blocks) -> Result<Arc<BlockCovariance>> {
        let key = [at.length_mm, at.ratio].map(f64::to_bits);
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().iter().find(|(k, _)| *k == key).map(|k| k.1.clone());
        if let Some(factor) = found {
            return Ok(factor);
        }
        let matern = Matern::new(blocks, at.length_mm);
        let made = Arc::new(BlockCovariance::new(blocks, &matern, at.ratio)?);
        known().push((key, Arc::clone(&made)));
        Ok(made)
    }
}

impl ComponentNoise {
    /// For the sensitivities' columns over blocks; `step` is called for each point of the grid.
    pub fn new(
        measured: &Measured,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let component = |c: usize| ComponentColumns::new(measured, sensitivities, c);
        let components = [component(0)?, component(1)?];
        let blocks = &measured.blocks;
        let lengths = [noise_lengths_mm(blocks), discrepancy_lengths_mm(blocks)].concat();
        let found = over_grid(blocks, &lengths, TRACED, |covariance| {
            step();
            let [first, second] = &components;
            Ok((first.choice(covariance)?, second.choice(covariance)?))
        })?;
        let (first, second): (Vec<_>, Vec<_>) = found.into_iter().unzip();
        let (first, second) = rayon::join(
            || components[0].between(blocks, first),
            || components[1].between(blocks, second),
        );
        let choices = [first?, second?].map(|found| likeliest(found, blocks));
        Ok(Self::of(choices, blocks, Arc::default()))
    }

    fn of(choices: [Vec<NoiseChoice>; 2], blocks: &Blocks, factors: Arc<KnownFactors>) -> Self {
        Self {
            pairs: pairs(&choices, blocks),
            choices,
            factors,
        }
    }

    /// The choices of a component for columns about another point than theirs; none if the likeliest is another one now.
    fn moved(
        &self,
        measured: &Measured,
        (sensitivities, c): (&Sensitivities, usize),
        step: &(dyn Fn() + Sync),
    ) -> Result<Option<Vec<NoiseChoice>>> {
        let blocks = &measured.blocks;
        let columns = ComponentColumns::new(measured, sensitivities, c)?;
        let again = |choice: &NoiseChoice| {
            step();
            columns.choice(&*self.factors.of(&choice.at, blocks)?)
        };
        let found: Vec<Result<NoiseChoice>> = self.choices[c].par_iter().map(again).collect();
        let found = found.into_iter().collect::<Result<Vec<_>>>()?;
        let likelihood = |k: &usize| found[*k].at.log_likelihood;
        // of those about the other point the first was the likeliest
        let highest = (0..found.len()).max_by(|a, b| likelihood(a).total_cmp(&likelihood(b)));
        Ok((highest == Some(0)).then(|| likeliest(found, blocks)))
    }

    fn at(&self, pair: &NoisePair) -> [&NoiseChoice; 2] {
        [0, 1].map(|c: usize| &self.choices[c][pair.of[c]])
    }
}

impl NoiseChoices for ComponentNoise {
    fn pairs(&self) -> Vec<NoisePair> {
        self.pairs.clone()
    }

    fn gram(&self, pair: &NoisePair) -> DMatrix<f64> {
        let [first, second] = self.at(pair);
        &first.gram + &second.gram
    }

    fn grams(
        &self,
        blocks: &Blocks,
        columns: [&DMatrix<f64>; 2],
        pairs: &[NoisePair],
    ) -> Result<Vec<DMatrix<f64>>> {
        let mut wanted: Vec<(usize, usize)> = pairs
            .iter()
            .flat_map(|p| [(0, p.of[0]), (1, p.of[1])])
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        let found: Vec<Result<DMatrix<f64>>> = wanted
            .par_iter()
            .map(|&(c, k)| {
                let choice = &self.choices[c][k];
                let white = self.factors.of(&choice.at, blocks)?.whiten(columns[c]);
                Ok(dense::gram(&white) / choice.scale2)
            })
            .collect();
        let found = found.into_iter().collect::<Result<Vec<_>>>()?;
        let gram = |c: usize, k: usize| {
            let at = wanted.iter().position(|w| *w == (c, k));
            &found[at.unwrap_or(0)]
        };
        let both = |p: &NoisePair| gram(0, p.of[0]) + gram(1, p.of[1]);
        Ok(pairs.iter().map(both).collect())
    }

    fn log_det(&self, pair: &NoisePair) -> f64 {
        let [first, second] = self.at(pair);
        first.log_det + second.log_det
    }

    fn misfit(&self, pair: &NoisePair) -> f64 {
        let [first, second] = self.at(pair).map(|choice| {
            let data = choice.gram.nrows() - 1;
            choice.log_det + choice.gram[(data, data)]
        });
        first + second
    }

    fn beyond_rival(&self) -> Arc<dyn NoiseChoices> {
        let rescaled = |choice: &NoiseChoice| NoiseChoice {
            gram: &choice.gram / choice.beyond_rival,
            scale2: choice.scale2 * choice.beyond_rival,
            log_det: choice.log_det + choice.values as f64 * choice.beyond_rival.ln(),
            ..choice.clone()
        };
        let choices = self.choices.each_ref();
        Arc::new(Self {
            choices: choices.map(|choices| choices.iter().map(rescaled).collect()),
            pairs: self.pairs.clone(),
            factors: Arc::clone(&self.factors),
        })
    }

    fn lengths_mm(&self, pair: &NoisePair) -> [f64; 2] {
        let both = self.at(pair);
        both.map(|choice| correlated(choice.at.length_mm, choice.at.ratio))
    }

    fn variances(&self, pair: &NoisePair, blocks: &Blocks) -> [DVector<f64>; 2] {
        let mean = blocks.mean_count();
        self.at(pair).map(|choice| {
            let s = &choice.at;
            let variance = |&n: &f64| s.scale2 * (mean / n + s.ratio * alone(blocks, s.length_mm));
            DVector::from_iterator(blocks.len(), blocks.worth.iter().map(variance))
        })
    }

    fn of_sum(&self, pair: &NoisePair, over: &Frames<'_>) -> Result<[ComponentOfNoise; 2]> {
        let of = |c: &NoiseChoice| -> Result<ComponentOfNoise> {
            let scale2 = c.scale2;
            let matern = Matern::new(over.blocks, c.at.length_mm);
            let covariance = BlockCovariance::new(over.blocks, &matern, c.at.ratio)?;
            Ok((Hyperparameters { scale2, ..c.at }, Arc::new(covariance)))
        };
        let [first, second] = self.at(pair);
        Ok([of(first)?, of(second)?])
    }

    fn again(
        &self,
        measured: &Measured,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Option<Arc<dyn NoiseChoices>>> {
        let blocks = &measured.blocks;
        let mut all = self.choices.iter().flatten();
        if measured.frames().is_some() || all.any(|c| c.values != blocks.len()) {
            return Ok(None);
        }
        let component = |c: usize| self.moved(measured, (sensitivities, c), step);
        let (first, second) = rayon::join(|| component(0), || component(1));
        let found = first?.zip(second?);
        Ok(found.map(|(first, second)| -> Arc<dyn NoiseChoices> {
            Arc::new(Self::of([first, second], blocks, Arc::clone(&self.factors)))
        }))
    }

    fn by_frames(&self) -> Option<&SeriesNoise> {
        None
    }
}

/// The choices worth keeping, the likeliest first.
fn likeliest(mut found: Vec<NoiseChoice>, blocks: &Blocks) -> Vec<NoiseChoice> {
    found.sort_by(|a, b| b.at.log_likelihood.total_cmp(&a.at.log_likelihood));
    let mut kept = [0, 0];
    found.retain(|w| {
        let class = usize::from(w.at.is_discrepancy(blocks));
        kept[class] += 1;
        kept[class] <= KEPT || w.at.ratio == 0.0
    });
    found
}

/// What is weighed of one component.
struct ComponentColumns {
    contrasts: Contrasts,
    /// All columns, the near-edge rival's after the others, and last the data.
    with_data: DMatrix<f64>,
    /// Blocks beyond the rank of those columns.
    freedom: usize,
}

impl ComponentColumns {
    fn new(measured: &Measured, sensitivities: &Sensitivities, c: usize) -> Result<Self> {
        let blocks = &measured.blocks;
        let with_data = with_data(measured, sensitivities, c);
        let last = with_data.ncols() - 1;
        let columns = last - sensitivities.near_edge.len();
        if blocks.len() < columns + 20 {
            return Err(Error::input(
                "measurement",
                "enough points to tell the effects from noise",
            )
            .found(format!("{} blocks for {columns} columns", blocks.len()))
            .hint("restrict the dictionary with \"candidates\", or measure more densely"));
        }
        let rank = orthonormal(&with_data.columns(0, last).into_owned()).ncols();
        let own = with_data.columns(0, columns).into_owned();
        Ok(Self {
            contrasts: Contrasts::new(blocks, with_data.column(last).into_owned(), &own)?,
            freedom: blocks.len().saturating_sub(rank).max(1),
            with_data,
        })
    }

    /// The choices with one more: the likeliest correlated noise has its length between those of the grid. What is seen of Matern-3/2 noise
    /// at short distances is s^2 / l^3 (Zhang 2004), so that a length of the grid, 40 % off, would leave the sd 70 % off.
    fn between(&self, blocks: &Blocks, mut choices: Vec<NoiseChoice>) -> Result<Vec<NoiseChoice>> {
        let noise = choices.iter().filter(|c| !c.at.is_discrepancy(blocks));
        let best = noise.max_by(|a, b| a.at.log_likelihood.total_cmp(&b.at.log_likelihood));
        let Some(at) = best.map(|c| c.at).filter(|at| at.ratio > 0.0) else {
            return Ok(choices);
        };
        let covariance = |ln_length: f64| {
            let matern = Matern::new(blocks, ln_length.exp());
            BlockCovariance::new(blocks, &matern, at.ratio)
        };
        let grid = noise_lengths_mm(blocks);
        let step = (grid[1] / grid[0]).ln() / BETWEEN as f64;
        // the gap to a discrepancy stays
        let longest = grid[grid.len() - 1].ln();
        let places: Vec<f64> = (-BETWEEN..=BETWEEN)
            .map(|k| (at.length_mm.ln() + step * k as f64).min(longest))
            .collect();
        let likelihoods: Vec<Result<f64>> = places
            .par_iter()
            .map(|&l| Ok(self.contrasts.at(&covariance(l)?)?.log_likelihood))
            .collect();
        let likelihoods = likelihoods.into_iter().collect::<Result<Vec<f64>>>()?;
        choices.push(self.choice(&covariance(highest(&places, &likelihoods))?)?);
        Ok(choices)
    }

    fn choice(&self, covariance: &BlockCovariance) -> Result<NoiseChoice> {
        let last = self.with_data.ncols() - 1;
        let at = self.contrasts.at(covariance)?;
        let white = covariance.whiten(&self.with_data);
        let gram = white.tr_mul(&white) / at.scale2;
        let explained = gram.view((0, last), (last, 1)).column(0).into_owned();
        let fit = solve(&gram.view((0, 0), (last, last)).into_owned(), &explained);
        let left = (gram[(last, last)] - fit.dot(&explained)).max(f64::MIN_POSITIVE);
        let values = self.with_data.nrows();
        Ok(NoiseChoice {
            at,
            log_det: covariance.log_det() + values as f64 * at.scale2.ln(),
            gram,
            beyond_rival: left / self.freedom as f64,
            scale2: at.scale2,
            values,
        })
    }
}

/// Where the parabola through the highest of `values` and its neighbours has its top; at an end, the end.
fn highest(places: &[f64], values: &[f64]) -> f64 {
    let highest = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b]));
    let k = highest.unwrap_or(0);
    if k == 0 || k + 1 >= values.len() || places[k + 1] <= places[k] {
        return places[k];
    }
    let [below, above] = [places[k] - places[k - 1], places[k + 1] - places[k]];
    let [before, after] = [values[k] - values[k - 1], values[k] - values[k + 1]];
    let bend = before * above + after * below;
    match bend > 0.0 {
        true => places[k] + 0.5 * (before * above * above - after * below * below) / bend,
        false => places[k],
    }
}

/// Within the noise, half the probability is on white noise; all correlated noise of the grid is as probable.
fn log_prior(at: &Hyperparameters, blocks: &Blocks) -> f64 {
    let correlated = ((TRACED.len() - 1) * LENGTHS / 2) as f64;
    if at.is_discrepancy(blocks) {
        -correlated.ln()
    } else if at.ratio > 0.0 {
        -(2.0 * correlated).ln()
    } else {
        -std::f64::consts::LN_2
    }
}

/// All pairs: a discrepancy in u1, in u2 or in both shares [`DISCREPANCY`] equally.
fn pairs(choices: &[Vec<NoiseChoice>; 2], blocks: &Blocks) -> Vec<NoisePair> {
    let mut pairs = Vec::new();
    for (i, first) in choices[0].iter().enumerate() {
        for (j, second) in choices[1].iter().enumerate() {
            let discrepancy = first.at.is_discrepancy(blocks) || second.at.is_discrepancy(blocks);
            let class = if discrepancy {
                DISCREPANCY / 3.0
            } else {
                1.0 - DISCREPANCY
            };
            pairs.push(NoisePair {
                of: [i, j],
                log_prior: class.ln()
                    + log_prior(&first.at, blocks)
                    + log_prior(&second.at, blocks),
                discrepancy,
            });
        }
    }
    pairs
}
