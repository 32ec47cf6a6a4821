//! The data and all columns under every choice of the noise's hyperparameters: normal equations, from which any model's evidence follows.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::by_component::{ComponentNoise, LENGTHS, TRACED};
use super::noise_choices::{NoiseChoices, NoisePair, with_data};
use crate::error::{Error, Result};
use crate::infer::ConstantsLikelihood;
use crate::linearise::{Measured, Sensitivities, StepStack};
use crate::noise::NormalEquations;
use crate::noise::series::{settings, steps};

/// Hyperparameters of both components that are worth weighing together.
#[derive(Clone)]
pub struct Weighing {
    pub noise: Arc<dyn NoiseChoices>,
    /// Choices of the noise of both components, with their log prior probability.
    pub pairs: Vec<NoisePair>,
    /// Number of base columns, which come first, before those of the candidates and of the near-edge rival.
    base: usize,
    /// What experiments beside the field say of the constants, which are the first columns.
    known: Option<Arc<ConstantsLikelihood>>,
}

/// The choices for the sensitivities' columns over blocks; `step` is called [`Weighing::steps`] times.
///
/// # Errors
/// Of the program: a factorisation that fails. Of the input: too few blocks.
fn choices(
    measured: &Measured,
    sensitivities: &Sensitivities,
    step: &(dyn Fn() + Sync),
) -> Result<Arc<dyn NoiseChoices>> {
    let Some(frames) = measured.frames() else {
        return Ok(Arc::new(ComponentNoise::new(
            measured,
            sensitivities,
            step,
        )?));
    };
    let [first, second] = [0, 1].map(|c| with_data(measured, sensitivities, c));
    Ok(Arc::new(settings(&frames, [&first, &second], step)?))
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

impl Weighing {
    /// How often [`Weighing::new`] calls its `step`.
    pub fn steps(measured: &Measured) -> usize {
        let grid = 1 + (TRACED.len() - 1) * LENGTHS;
        measured.frames().map_or(grid, |frames| steps(&frames))
    }

    /// Weigh the sensitivities' columns over blocks; `step` is called on the way.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails. Of the input: too few blocks.
    pub fn new(
        measured: &Measured,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let noise = choices(measured, sensitivities, step)?;
        Ok(Self::by(noise, sensitivities))
    }

    /// Norms of some errors of the block averages, mm, by the noise of a pair.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn norms(
        &self,
        measured: &Measured,
        pair: &NoisePair,
        errors: &[StepStack],
    ) -> Result<Vec<f64>> {
        let columns = [0, 1].map(|c| {
            let own: Vec<DVector<f64>> = errors.iter().map(|e| e[c].clone()).collect();
            DMatrix::from_columns(&own)
        });
        let both = [&columns[0], &columns[1]];
        let grams = self.noise.grams(&measured.blocks, both, &[*pair])?;
        let square = |k: usize| grams.iter().map(|g| g[(k, k)]).sum::<f64>();
        Ok((0..errors.len()).map(|k| square(k).sqrt()).collect())
    }

    /// By choices that are known for the sensitivities' columns.
    pub fn by(noise: Arc<dyn NoiseChoices>, sensitivities: &Sensitivities) -> Self {
        Self {
            pairs: noise.pairs(),
            noise,
            base: sensitivities.base.len(),
            known: sensitivities.known.clone(),
        }
    }

    /// The same without what other experiments say.
    #[must_use]
    pub fn alone(&self) -> Self {
        Self {
            known: None,
            ..self.clone()
        }
    }

    /// The same with noise of the scale that the near-edge rival leaves.
    pub fn beyond_rival(&self) -> Self {
        Self {
            noise: self.noise.beyond_rival(),
            pairs: self.pairs.clone(),
            known: self.known.clone(),
            base: self.base,
        }
    }

    /// Normal equations of all columns and, last, the data, under a pair; with what other experiments say, as data of their own.
    pub fn gram(&self, pair: &NoisePair) -> DMatrix<f64> {
        let mut gram = self.noise.gram(pair);
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
        pair.log_prior - 0.5 * self.noise.misfit(pair)
    }

    /// Log prior of a pair with the normalisation of its noise: the log density of data that columns explain entirely.
    pub fn log_norm(&self, pair: &NoisePair) -> f64 {
        pair.log_prior - 0.5 * self.noise.log_det(pair)
    }
}
