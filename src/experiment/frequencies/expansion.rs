//! Logarithms of frequencies to second order about a plate: what a million draws can afford.

use nalgebra::{DMatrix, DVector};

use super::assignment::PredictedFrequency;
use super::plate::{PlateParameter, VibratingPlate};
use super::ritz::{Ritz, VibrationMode};
use crate::error::{Error, Result};

/// ln f of some modes about a plate, each followed by family and rank, so that those of different families may cross.
#[derive(Debug, Clone)]
pub struct Expansion {
    /// Values of the parameters about which it is, and steps that are 1.
    at: Vec<f64>,
    steps: Vec<f64>,
    modes: Vec<Expanded>,
}

#[derive(Debug, Clone)]
struct Expanded {
    odd: Option<bool>,
    ln_hz: f64,
    slope: Vec<f64>,
    /// Half the second derivatives on the diagonal, whole ones below it, row by row.
    curvature: Vec<f64>,
}

impl Expansion {
    /// Of the `count` lowest modes of a plate, by differences of their exact slopes over a step of each parameter to either side.
    ///
    /// # Errors
    /// Those of [`Ritz::modes`]; of the program if a mode is not found beside the plate.
    pub fn new(
        ritz: &Ritz,
        plate: &VibratingPlate,
        count: usize,
        to: &[(PlateParameter, f64)],
    ) -> Result<Self> {
        /// Modes beyond those that are followed: one of these may lie lower beside the plate.
        const BEYOND: usize = 8;
        let parameters: Vec<PlateParameter> = to.iter().map(|(p, _)| *p).collect();
        let slopes = |mode: &VibrationMode, plate: &VibratingPlate| -> Vec<f64> {
            let slopes = ritz.sensitivities_hz(mode, plate, &parameters);
            let scaled = slopes.iter().zip(to);
            scaled
                .map(|(s, (_, step))| s * step / mode.frequency_hz())
                .collect()
        };
        let here = ritz.modes(&plate.coefficients(), count)?;
        let n = to.len();
        let mut curvature = vec![DMatrix::zeros(n, n); here.len()];
        for (k, (parameter, step)) in to.iter().enumerate() {
            for sign in [-1.0, 1.0] {
                let moved = plate
                    .clone()
                    .with(*parameter, plate.get(*parameter) + sign * step);
                let there = ritz.modes(&moved.coefficients(), count + BEYOND)?;
                for (mode, curvature) in here.iter().zip(&mut curvature) {
                    let same = there.iter().find(|m| m.is(mode)).ok_or_else(|| {
                        Error::program("natural frequencies", "a mode that stays among the lowest")
                    })?;
                    let change = 0.5 * sign * DVector::from_vec(slopes(same, &moved));
                    let mut row = curvature.row_mut(k);
                    row += change.transpose();
                }
            }
        }
        let expanded = |(mode, curvature): (&VibrationMode, DMatrix<f64>)| {
            let whole = 0.5 * (&curvature + curvature.transpose());
            let below = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
            let half = |(i, j): (usize, usize)| whole[(i, j)] * if i == j { 0.5 } else { 1.0 };
            Expanded {
                odd: mode.odd,
                ln_hz: mode.frequency_hz().ln(),
                slope: slopes(mode, plate),
                curvature: below.map(half).collect(),
            }
        };
        Ok(Self {
            at: parameters.iter().map(|p| plate.get(*p)).collect(),
            steps: to.iter().map(|(_, step)| *step).collect(),
            modes: here.iter().zip(curvature).map(expanded).collect(),
        })
    }

    /// The modes of a plate with other values of the parameters.
    pub fn predicted(&self, values: &[f64]) -> Vec<PredictedFrequency> {
        let each = values.iter().zip(&self.at).zip(&self.steps);
        let d: Vec<f64> = each.map(|((x, at), step)| (x - at) / step).collect();
        let products: Vec<f64> = (0..d.len())
            .flat_map(|i| (0..=i).map(move |j| (i, j)))
            .map(|(i, j)| d[i] * d[j])
            .collect();
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let modes = self.modes.iter();
        modes
            .map(|m| PredictedFrequency {
                frequency_hz: (m.ln_hz + dot(&m.slope, &d) + dot(&m.curvature, &products)).exp(),
                odd: m.odd,
            })
            .collect()
    }
}
