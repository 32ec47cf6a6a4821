//! The data and all columns under every choice of the noise's hyperparameters: normal equations, from which any model's evidence follows.
//!
//! Noise of a component: C = s^2 [diag(nbar / n_b) + rho Matern(l)], s^2 by restricted likelihood on contrasts
//! orthogonal to all columns, the candidates' included, so that an effect's structure does not pass for noise: with the noise taken from
//! the bare fit's residual, loud effects were never named, because they inflate it (prototype study). Short lengths are noise; long
//! ones are a smooth discrepancy, the rival of every named effect.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::sensitivities::{Measured, Sensitivities};
use crate::error::{Error, Result};
use crate::field::Blocks;
use crate::infer::Known;
use crate::noise::covariance::{RATIOS, discrepancy_lengths_mm, noise_lengths_mm, over_grid};
use crate::noise::reml::{Contrasts, orthonormal};
use crate::noise::series::{Frames, SeriesNoise, Setting, settings};
use crate::noise::{BlockCovariance, Hyperparameters, NormalEquations, solve};

/// Prior probability of a smooth discrepancy. With it the prototype study called 38 of 38 smooth random fields outside the
/// dictionary unexplained, and none of 500 fields of noise alone.
pub const DISCREPANCY: f64 = 0.07;

/// Ratios rho weighed here: all but that of noise that is correlated alone.
const TRACED: &[f64] = RATIOS.split_at(RATIOS.len() - 1).0;

/// Lengths weighed, half of them noise and half discrepancy.
const LENGTHS: usize = 6;

/// The data and all columns of one component under one choice of its covariance hyperparameters.
#[derive(Debug, Clone)]
pub struct NoiseChoice {
    /// Length, ratio, scale and restricted likelihood.
    pub at: Hyperparameters,
    /// log det of the covariance.
    pub(super) log_det: f64,
    /// X' C^-1 X of all columns and, last, the data.
    gram: DMatrix<f64>,
    /// The scale s^2 of contrasts that are orthogonal to the near-edge rival too, over that of `at`.
    beyond_rival: f64,
    /// The scale s^2 that `gram` has.
    pub(super) scale2: f64,
}

/// Hyperparameters of both components that are worth weighing together.
pub struct Weighing {
    pub(super) source: Source,
    /// Choices of the noise of both components, with their log prior probability.
    pub pairs: Vec<NoisePair>,
    /// Number of base columns, which come first, before those of the candidates and of the near-edge rival.
    base: usize,
    /// Number of blocks.
    blocks: usize,
    /// What experiments beside the field say of the constants, which are the first columns.
    known: Option<Arc<Known>>,
}

/// What is known under every choice of the noise.
#[derive(Clone)]
pub(super) enum Source {
    /// Choices for u1 and u2.
    Components([Vec<NoiseChoice>; 2]),
    /// Settings of a series, both components together.
    Series(SeriesNoise),
}

/// A choice of the noise of both components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoisePair {
    /// Indices into the choices of either component; into the settings of a series, twice the same.
    pub(super) of: [usize; 2],
    /// Log prior probability.
    pub log_prior: f64,
    /// Whether either is a discrepancy.
    pub discrepancy: bool,
}

/// Normal equations of the candidates and the near-edge rival under one pair, with the base columns eliminated.
#[derive(Clone)]
pub struct Projected {
    /// X' M (data).
    pub z: DVector<f64>,
    /// X' M X.
    pub g: DMatrix<f64>,
    /// Log evidence of the base model, with the pair's log prior.
    pub log_base: f64,
}

/// Choices kept for each component in each class, noise and discrepancy, the likeliest ones; white noise is always kept.
const KEPT: usize = 6;

impl Weighing {
    /// How often [`Weighing::new`] calls its `step`.
    pub fn steps() -> usize {
        1 + (TRACED.len() - 1) * LENGTHS
    }

    /// Weigh the sensitivities' columns over blocks; `step` is called after each of them.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails. Of the input: too few blocks.
    pub fn new(
        measured: &Measured,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let choices = choices(measured, sensitivities, step)?;
        Ok(Self {
            pairs: pairs(&choices, &measured.blocks),
            source: Source::Components(choices),
            base: sensitivities.base.len(),
            blocks: measured.blocks.len(),
            known: sensitivities.known.clone(),
        })
    }

    /// The same of a series, whose values are stacked step by step.
    ///
    /// # Errors
    /// Those of [`settings`].
    pub fn of_series(
        frames: &Frames<'_>,
        measured: &Measured,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let of = |c: usize| with_data(measured, sensitivities, c);
        let noise = settings(frames, [&of(0), &of(1)], step)?;
        let pair = |(k, setting): (usize, &Setting)| NoisePair {
            of: [k, k],
            log_prior: setting.log_prior,
            discrepancy: setting.at.rival.is_some(),
        };
        Ok(Self {
            pairs: noise.settings.iter().enumerate().map(pair).collect(),
            source: Source::Series(noise),
            base: sensitivities.base.len(),
            blocks: measured.blocks.len(),
            known: sensitivities.known.clone(),
        })
    }

    /// The same with noise of the scale that the near-edge rival leaves.
    pub fn beyond_rival(&self) -> Self {
        let rescaled = |choice: &NoiseChoice| NoiseChoice {
            gram: &choice.gram / choice.beyond_rival,
            scale2: choice.scale2 * choice.beyond_rival,
            log_det: choice.log_det + self.blocks as f64 * choice.beyond_rival.ln(),
            ..choice.clone()
        };
        let source = match &self.source {
            Source::Components(choices) => Source::Components(
                choices
                    .each_ref()
                    .map(|choices| choices.iter().map(rescaled).collect()),
            ),
            // measured where nothing that grows with the load can enter it
            Source::Series(noise) => Source::Series(noise.clone()),
        };
        Self {
            source,
            pairs: self.pairs.clone(),
            known: self.known.clone(),
            ..*self
        }
    }

    /// Normal equations of all columns and, last, the data, under a pair; with what other experiments say, as data of their own.
    pub fn gram(&self, pair: &NoisePair) -> DMatrix<f64> {
        let mut gram = self.gram_of_field(pair);
        let Some(known) = &self.known else {
            return gram;
        };
        let data = gram.nrows() - 1;
        let (precision, towards, square) = known.equations();
        let n = known.constants();
        let mut inside = gram.view_mut((0, 0), (n, n));
        inside += precision;
        for k in 0..n {
            gram[(k, data)] += towards[k];
            gram[(data, k)] += towards[k];
        }
        gram[(data, data)] += square;
        gram
    }

    /// The same of the field alone.
    pub fn gram_of_field(&self, pair: &NoisePair) -> DMatrix<f64> {
        match &self.source {
            Source::Components([first, second]) => {
                &first[pair.of[0]].gram + &second[pair.of[1]].gram
            }
            Source::Series(noise) => noise.settings[pair.of[0]].gram.clone(),
        }
    }

    /// Eliminate the base columns, of prior N(0, 1) each, under a pair.
    ///
    /// # Errors
    /// Of the program, for columns that are not finite.
    pub fn project(&self, pair: &NoisePair) -> Result<Projected> {
        let gram = self.gram(pair);
        let (p, all) = (self.base, gram.nrows() - 1);
        let base = NormalEquations::with_unit_prior(
            gram.view((0, 0), (p, p)).into_owned(),
            gram.view((0, all), (p, 1)).column(0).into_owned(),
        )
        .ok_or_else(|| Error::program("trace::weighing", "finite columns of the base model"))?;
        let x = gram.view((0, p), (p, all - p)).into_owned();
        Ok(Projected {
            z: gram.view((p, all), (all - p, 1)).column(0) - x.tr_mul(&base.mean()),
            g: gram.view((p, p), (all - p, all - p)) - x.tr_mul(&base.solve(&x)),
            log_base: self.log_data(pair) + base.log_evidence(),
        })
    }

    /// Log evidence of a model without a column, with the pair's log prior, up to a constant (what other experiments say is one).
    pub fn log_data(&self, pair: &NoisePair) -> f64 {
        let log = |log_det: f64, gram: &DMatrix<f64>| {
            log_det + gram[(gram.nrows() - 1, gram.nrows() - 1)]
        };
        let both = match &self.source {
            Source::Components(choices) => {
                let of = |c: usize| {
                    let choice = &choices[c][pair.of[c]];
                    log(choice.log_det, &choice.gram)
                };
                of(0) + of(1)
            }
            Source::Series(noise) => {
                let setting = &noise.settings[pair.of[0]];
                log(setting.log_det, &setting.gram)
            }
        };
        pair.log_prior - 0.5 * both
    }

    /// Correlation length of the noise of each component in a pair, mm; 0 of white noise.
    pub fn lengths_mm(&self, pair: &NoisePair) -> [f64; 2] {
        let of = |length: f64, ratio: f64| if ratio > 0.0 { length } else { 0.0 };
        match &self.source {
            Source::Components(choices) => [0, 1].map(|c: usize| {
                let at = &choices[c][pair.of[c]].at;
                of(at.length_mm, at.ratio)
            }),
            Source::Series(series) => {
                let spatial = &series.noise.spatial;
                spatial.each_ref().map(|n| of(n.length_mm, n.ratio))
            }
        }
    }

    /// Hyperparameters of each component in a pair, where they are those of a discrepancy of a single field.
    pub fn structure(&self, pair: &NoisePair, blocks: &Blocks) -> [Option<Hyperparameters>; 2] {
        match &self.source {
            Source::Components(choices) => [0, 1].map(|c: usize| {
                let at = choices[c][pair.of[c]].at;
                at.is_discrepancy(blocks).then_some(at)
            }),
            Source::Series(_) => [None, None],
        }
    }

    /// Variance of every block average of each component in a pair, mm^2. Correlated noise counts as white noise that leaves averages
    /// over large areas as uncertain: Matern-3/2 noise of length l is one value in each area of 2 pi l^2.
    pub fn variances(&self, pair: &NoisePair, blocks: &Blocks) -> [DVector<f64>; 2] {
        let mean = blocks.mean_count();
        let together = |length_mm: f64| {
            let area = std::f64::consts::TAU * length_mm * length_mm;
            (area / (blocks.size_mm * blocks.size_mm)).max(1.0)
        };
        match &self.source {
            Source::Components(choices) => [0, 1].map(|c: usize| {
                let s = &choices[c][pair.of[c]].at;
                let counts = blocks.worth.iter();
                let of = |&n: &f64| s.scale2 * (mean / n + s.ratio * together(s.length_mm));
                DVector::from_iterator(blocks.len(), counts.map(of))
            }),
            Source::Series(series) => [0, 1].map(|c: usize| {
                let noise = &series.noise;
                let s = &noise.spatial[c];
                let reference = series.settings[pair.of[0]].at.reference;
                let all = s.covariance.variances();
                let white: Vec<f64> = all.iter().map(|v| (v - s.ratio).max(0.0)).collect();
                let of = |(d, w): (&f64, f64)| {
                    (d + reference) * s.scale2 * (w + s.ratio * together(s.length_mm))
                };
                let frames = noise.scales.iter();
                let all: Vec<f64> = frames
                    .flat_map(|d| white.iter().map(move |w| of((d, *w))))
                    .collect();
                DVector::from_vec(all)
            }),
        }
    }

    /// The noise of a series.
    pub fn series(&self) -> Option<&SeriesNoise> {
        match &self.source {
            Source::Components(_) => None,
            Source::Series(noise) => Some(noise),
        }
    }
}

/// The likeliest choices of both components, the best first.
fn choices(
    measured: &Measured,
    sensitivities: &Sensitivities,
    step: &(dyn Fn() + Sync),
) -> Result<[Vec<NoiseChoice>; 2]> {
    let of = |c: usize| Weighed::new(measured, sensitivities, c);
    let components = [of(0)?, of(1)?];
    let blocks = &measured.blocks;
    let lengths = [noise_lengths_mm(blocks), discrepancy_lengths_mm(blocks)].concat();
    let found = over_grid(blocks, &lengths, TRACED, |covariance| {
        step();
        let [first, second] = &components;
        Ok((first.choice(covariance)?, second.choice(covariance)?))
    })?;
    let (first, second): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    Ok([first, second].map(|mut found| {
        found.sort_by(|a, b| b.at.log_likelihood.total_cmp(&a.at.log_likelihood));
        let mut kept = [0, 0];
        found.retain(|w| {
            let class = usize::from(w.at.is_discrepancy(blocks));
            kept[class] += 1;
            kept[class] <= KEPT || w.at.ratio == 0.0
        });
        found
    }))
}

/// All columns of one component, the near-edge rival's after the others, and last the data.
fn with_data(measured: &Measured, sensitivities: &Sensitivities, c: usize) -> DMatrix<f64> {
    let sought = sensitivities.candidates.iter().flat_map(|k| &k.columns);
    let own = sensitivities
        .base
        .iter()
        .chain(sought)
        .map(|k| &k.values[c]);
    let rival = sensitivities.near_edge.iter().map(|field| &field[c]);
    let data = &measured.residual(sensitivities)[c];
    let all: Vec<DVector<f64>> = own.chain(rival).chain([data]).cloned().collect();
    DMatrix::from_columns(&all)
}

/// What is weighed of one component.
struct Weighed<'a> {
    contrasts: Contrasts<'a>,
    /// All columns, the near-edge rival's after the others, and last the data.
    with_data: DMatrix<f64>,
    /// Blocks beyond the rank of those columns.
    freedom: usize,
}

impl<'a> Weighed<'a> {
    fn new(measured: &'a Measured, sensitivities: &Sensitivities, c: usize) -> Result<Self> {
        let columns: Vec<DVector<f64>> = sensitivities
            .base
            .iter()
            .chain(sensitivities.candidates.iter().flat_map(|k| &k.columns))
            .map(|column| column.values[c].clone())
            .collect();
        let blocks = &measured.blocks;
        let y = &measured.residual(sensitivities)[c];
        let all = DMatrix::from_columns(&columns);
        if blocks.len() < all.ncols() + 20 {
            return Err(Error::input(
                "measurement",
                "enough points to tell the effects from noise",
            )
            .found(format!(
                "{} blocks for {} columns",
                blocks.len(),
                all.ncols()
            ))
            .hint("restrict the dictionary with \"candidates\", or measure more densely"));
        }
        let rival = sensitivities.near_edge.iter().map(|u| u[c].clone());
        let columns: Vec<DVector<f64>> = columns
            .into_iter()
            .chain(rival)
            .chain([y.clone()])
            .collect();
        let with_data = DMatrix::from_columns(&columns);
        let rank = orthonormal(&with_data.columns(0, columns.len() - 1).into_owned()).ncols();
        Ok(Self {
            contrasts: Contrasts::new(blocks, y.clone(), &all)?,
            with_data,
            freedom: blocks.len().saturating_sub(rank).max(1),
        })
    }

    fn choice(&self, covariance: &BlockCovariance) -> Result<NoiseChoice> {
        let last = self.with_data.ncols() - 1;
        let at = self.contrasts.at(covariance)?;
        let white = covariance.whiten(&self.with_data);
        let gram = white.tr_mul(&white) / at.scale2;
        let explained = gram.view((0, last), (last, 1)).column(0).into_owned();
        let fit = solve(&gram.view((0, 0), (last, last)).into_owned(), &explained);
        let left = (gram[(last, last)] - fit.dot(&explained)).max(f64::MIN_POSITIVE);
        let blocks = self.with_data.nrows() as f64;
        Ok(NoiseChoice {
            at,
            log_det: covariance.log_det() + blocks * at.scale2.ln(),
            gram,
            beyond_rival: left / self.freedom as f64,
            scale2: at.scale2,
        })
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
