//! Choices of the noise of both components, of which evidence is the sum.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::field::Blocks;
use crate::linearise::{Measured, Sensitivities};
use crate::noise::ComponentOfNoise;
use crate::noise::series::{Frames, SeriesNoise};

/// A choice of the noise of both components.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NoisePair {
    /// Indices into the choices of either component; of noise that frames measure, twice the same.
    pub of: [usize; 2],
    /// Log prior probability.
    pub log_prior: f64,
    /// Whether either is a discrepancy.
    pub discrepancy: bool,
}

/// The choices that are worth weighing, with the data and all columns under each. Whether one field has them for each component or the
/// frames of a series have measured them, nobody else knows.
pub trait NoiseChoices: Send + Sync {
    /// All of them, with their log prior probability.
    fn pairs(&self) -> Vec<NoisePair>;

    /// X' C^-1 X of all columns and, last, the data.
    fn gram(&self, pair: &NoisePair) -> DMatrix<f64>;

    /// X' C^-1 X of columns that were not weighed (of u1 and of u2, one row a value), under some pairs.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    fn grams(
        &self,
        blocks: &Blocks,
        columns: [&DMatrix<f64>; 2],
        pairs: &[NoisePair],
    ) -> Result<Vec<DMatrix<f64>>>;

    /// log det C.
    fn log_det(&self, pair: &NoisePair) -> f64;

    /// log det C + y' C^-1 y of the data y.
    fn misfit(&self, pair: &NoisePair) -> f64;

    /// The same with noise of the scale that the near-edge rival leaves.
    fn beyond_rival(&self) -> Arc<dyn NoiseChoices>;

    /// Correlation length of the noise of each component, mm; 0 of white noise.
    fn lengths_mm(&self, pair: &NoisePair) -> [f64; 2];

    /// Variance of every block average of each component, mm^2, correlated noise as if each block stood alone.
    fn variances(&self, pair: &NoisePair, blocks: &Blocks) -> [DVector<f64>; 2];

    /// Each component of what grows with the load in some frames, or of one field as it is, over their blocks.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    fn of_sum(&self, pair: &NoisePair, over: &Frames<'_>) -> Result<[ComponentOfNoise; 2]>;

    /// The choices for the same blocks' columns about another point, where a search there would not find others.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    fn again(
        &self,
        measured: &Measured,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Option<Arc<dyn NoiseChoices>>>;

    /// The noise that frames have measured.
    fn by_frames(&self) -> Option<&SeriesNoise>;
}

/// All columns of one component, the near-edge rival's after the others, and last the data.
pub fn with_data(measured: &Measured, sensitivities: &Sensitivities, c: usize) -> DMatrix<f64> {
    let rival = sensitivities.near_edge.iter().map(|field| &field[c]);
    let data = &measured.residual(sensitivities)[c];
    let columns = sensitivities.columns().map(|k| &k.values[c]);
    let all: Vec<DVector<f64>> = columns.chain(rival).chain([data]).cloned().collect();
    DMatrix::from_columns(&all)
}

/// What correlated noise counts as where it counts as white noise, over its own variance, to leave averages over large areas as uncertain:
/// Matern-3/2 noise of length l is one value in each area of 2 pi l^2.
pub fn alone(blocks: &Blocks, length_mm: f64) -> f64 {
    let area = std::f64::consts::TAU * length_mm * length_mm;
    (area / (blocks.size_mm * blocks.size_mm)).max(1.0)
}

/// The length of noise whose correlated part has a ratio to the white one.
pub fn correlated(length_mm: f64, ratio: f64) -> f64 {
    if ratio > 0.0 { length_mm } else { 0.0 }
}
