//! The data and all columns under every setting of the noise: normal equations, from which any model's evidence follows.
//!
//! Noise of a component: C = s^2 [diag(nbar / n_b) + rho Matern(l)], s^2 by restricted likelihood on contrasts
//! orthogonal to all columns, the candidates' included, so that an effect's structure does not pass for noise. Lengths up to 1.5 mm are
//! noise; longer ones are a smooth discrepancy, the rival of every named effect.

use nalgebra::{DMatrix, DVector};

use super::sensitivities::Sensitivities;
use crate::error::{Error, Result};
use crate::field::Blocks;
use crate::noise::covariance::{DISCREPANCY_LENGTHS_MM, NOISE_LENGTHS_MM, over_grid};
use crate::noise::reml::Contrasts;

/// Prior probability of a smooth discrepancy.
pub const DISCREPANCY: f64 = 0.07;

/// Ratios rho of the correlated to the white variance of a block.
const RATIOS: [f64; 10] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0];

/// One setting of one component's noise.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Correlation length, mm.
    pub length_mm: f64,
    /// Ratio rho of the correlated to the white variance of a block.
    pub ratio: f64,
    /// s^2 of the restricted likelihood, mm^2.
    pub scale2: f64,
    /// Restricted log likelihood.
    pub log_likelihood: f64,
    /// log det of the covariance.
    log_det: f64,
    /// X' C^-1 X of all columns and, last, the data.
    gram: DMatrix<f64>,
}

impl Setting {
    /// Whether it is a discrepancy of the model rather than noise.
    pub fn is_discrepancy(&self) -> bool {
        self.ratio > 0.0 && self.length_mm >= DISCREPANCY_LENGTHS_MM[0]
    }
}

/// Settings of both components that are worth weighing together.
pub struct Weighing {
    /// Settings of u1 and u2.
    pub settings: [Vec<Setting>; 2],
    /// Pairs of settings, with their log prior probability.
    pub pairs: Vec<Pair>,
    /// Number of base columns.
    base: usize,
}

/// A setting of each component.
#[derive(Debug, Clone, Copy)]
pub struct Pair {
    /// Indices into the settings.
    pub of: [usize; 2],
    /// Log prior probability.
    pub log_prior: f64,
    /// Whether either is a discrepancy.
    pub discrepancy: bool,
}

/// Candidates' normal equations under one pair, with the base columns eliminated.
pub struct Projected {
    /// X' M (data).
    pub z: DVector<f64>,
    /// X' M X.
    pub g: DMatrix<f64>,
    /// Log evidence of the base model, with the pair's log prior.
    pub log_base: f64,
}

/// Settings kept for each component in each class.
const KEPT: usize = 6;

impl Weighing {
    /// How often [`Weighing::new`] calls its `step`.
    pub fn steps() -> usize {
        2 * RATIOS.len() * (NOISE_LENGTHS_MM.len() + DISCREPANCY_LENGTHS_MM.len())
    }

    /// Weigh the sensitivities' columns over blocks; `step` is called after each setting.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails. Of the input: too few blocks.
    pub fn new(
        blocks: &Blocks,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let component = |c: usize| settings(blocks, sensitivities, c, step);
        let settings = [component(0)?, component(1)?];
        let pairs = pairs(&settings);
        Ok(Self {
            settings,
            pairs,
            base: sensitivities.base.len(),
        })
    }

    /// Normal equations of all columns and, last, the data, under a pair.
    pub fn gram(&self, pair: &Pair) -> DMatrix<f64> {
        &self.settings[0][pair.of[0]].gram + &self.settings[1][pair.of[1]].gram
    }

    /// Eliminate the base columns, of prior N(0, 1) each, under a pair.
    ///
    /// # Errors
    /// Of the program, for columns that are not finite.
    pub fn project(&self, pair: &Pair) -> Result<Projected> {
        let gram = self.gram(pair);
        let (p, all) = (self.base, gram.nrows() - 1);
        let mut bb = gram.view((0, 0), (p, p)).into_owned();
        for k in 0..p {
            bb[(k, k)] += 1.0;
        }
        let factor = bb
            .cholesky()
            .ok_or_else(|| Error::program("trace::weighing", "finite columns of the base model"))?;
        let b = gram.view((0, all), (p, 1)).column(0).into_owned();
        let x = gram.view((0, p), (p, all - p)).into_owned();
        let solved = factor.solve(&b);
        let quad = gram[(all, all)] - b.dot(&solved);
        let log_det_base: f64 = 2.0
            * factor
                .l_dirty()
                .diagonal()
                .iter()
                .map(|d| d.ln())
                .sum::<f64>();
        let log_det: f64 = [0, 1]
            .map(|c| self.settings[c][pair.of[c]].log_det)
            .iter()
            .sum();
        Ok(Projected {
            z: gram.view((p, all), (all - p, 1)).column(0) - x.tr_mul(&solved),
            g: gram.view((p, p), (all - p, all - p)) - x.tr_mul(&factor.solve(&x)),
            log_base: pair.log_prior - 0.5 * (log_det + log_det_base + quad),
        })
    }
}

fn settings(
    blocks: &Blocks,
    sensitivities: &Sensitivities,
    c: usize,
    step: &(dyn Fn() + Sync),
) -> Result<Vec<Setting>> {
    let columns: Vec<DVector<f64>> = sensitivities
        .base
        .iter()
        .chain(sensitivities.candidates.iter().flat_map(|k| &k.columns))
        .map(|column| column.values[c].clone())
        .collect();
    let y = &sensitivities.rest[c];
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
    let contrasts = Contrasts::new(blocks, y.clone(), &all)?;
    let mut with_data = all.clone().insert_column(all.ncols(), 0.0);
    with_data.set_column(all.ncols(), y);
    let lengths: Vec<f64> = NOISE_LENGTHS_MM
        .iter()
        .chain(&DISCREPANCY_LENGTHS_MM)
        .copied()
        .collect();
    let mut settings = over_grid(blocks, &lengths, &RATIOS, |covariance| {
        step();
        // without correlation every length is the same
        if covariance.ratio == 0.0 && covariance.length_mm != lengths[0] {
            return Ok(None);
        }
        let reml = contrasts.at(covariance)?;
        let white = covariance.whiten(&with_data);
        Ok(Some(Setting {
            length_mm: covariance.length_mm,
            ratio: covariance.ratio,
            scale2: reml.scale2,
            log_likelihood: reml.log_likelihood,
            log_det: covariance.log_det() + blocks.len() as f64 * reml.scale2.ln(),
            gram: white.tr_mul(&white) / reml.scale2,
        }))
    })?
    .into_iter()
    .flatten()
    .collect::<Vec<_>>();
    settings.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
    let mut kept = [0, 0];
    settings.retain(|s| {
        let class = usize::from(s.is_discrepancy());
        kept[class] += 1;
        kept[class] <= KEPT || s.ratio == 0.0
    });
    Ok(settings)
}

/// Within the noise, half the probability is on white noise; all correlated settings are alike.
fn log_prior(s: &Setting) -> f64 {
    let correlated = (RATIOS.len() - 1) as f64;
    if s.is_discrepancy() {
        -(correlated * DISCREPANCY_LENGTHS_MM.len() as f64).ln()
    } else if s.ratio > 0.0 {
        -(2.0 * correlated * NOISE_LENGTHS_MM.len() as f64).ln()
    } else {
        -std::f64::consts::LN_2
    }
}

/// All pairs: a discrepancy in u1, in u2 or in both shares [`DISCREPANCY`] equally.
fn pairs(settings: &[Vec<Setting>; 2]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (i, first) in settings[0].iter().enumerate() {
        for (j, second) in settings[1].iter().enumerate() {
            let discrepancy = first.is_discrepancy() || second.is_discrepancy();
            let class = if discrepancy {
                DISCREPANCY / 3.0
            } else {
                1.0 - DISCREPANCY
            };
            pairs.push(Pair {
                of: [i, j],
                log_prior: class.ln() + log_prior(first) + log_prior(second),
                discrepancy,
            });
        }
    }
    pairs
}
