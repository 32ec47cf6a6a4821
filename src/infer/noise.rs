//! The noise of the measurement: its covariance on block averages, independent of what the model lacks.

use nalgebra::{DMatrix, DVector};

use super::observation::{Columns, Observation};
use crate::error::{Error, Result};
use crate::field::covariance::{NOISE_LENGTHS_MM, RATIOS};
use crate::field::reml::{Reml, Setting, reml};
use crate::field::{BlockCovariance, Blocks, noise};
use crate::quantity::NM_PER_MM;

/// Side of the squares on which a quadratic is taken out of the data before the noise is estimated, mm at least.
/// Misfit that is smooth on this scale does not pass for noise.
const SQUARE_MM: f64 = 6.0;

/// Blocks, and the short-range noise covariance of each component.
pub struct Noise {
    /// Block averages' geometry, the same for both components.
    pub blocks: Blocks,
    /// Restricted-likelihood estimate of each component.
    pub reml: [Reml; 2],
    /// Covariance of each component's block averages at unit scale.
    pub covariance: [BlockCovariance; 2],
    /// White sd of a point from local differences, mm.
    pub white_mm: [f64; 2],
    /// Effective number of independent points of both components.
    pub effective_points: f64,
}

impl Noise {
    /// Estimate from contrasts orthogonal to the model's columns and to local quadratics (restricted maximum
    /// likelihood over correlation lengths up to 1.5 mm).
    pub fn estimate(observation: &Observation, columns: &Columns) -> Result<Self> {
        let field = &observation.field;
        let blocks = Blocks::new(field, Blocks::size_for(field), |_| true);
        let fitted = columns.modes.len() + columns.effects.len();
        if blocks.len() < fitted + FEWEST_CONTRASTS {
            let place = field
                .files
                .first()
                .map_or_else(|| "measurement".into(), |f| f.display().to_string());
            return Err(Error::input(place, format!("points that fill at least {} blocks of {:.2} mm", fitted + FEWEST_CONTRASTS, blocks.size_mm))
                .found(format!("{} points in {} blocks", field.len(), blocks.len()))
                .hint("the noise cannot be told from the model's own fields with so few points: enlarge the window or measure more densely"));
        }
        let smooth = smooth_columns(&blocks, fitted);
        let white_mm = noise::white(field).sd_mm;
        let estimate = |c: usize| -> Result<(Reml, BlockCovariance)> {
            let explained = component(columns.modes.iter().chain(&columns.effects), c, &blocks);
            let mut all = DMatrix::zeros(blocks.len(), explained.ncols() + smooth.ncols());
            all.columns_mut(0, explained.ncols()).copy_from(&explained);
            all.columns_mut(explained.ncols(), smooth.ncols())
                .copy_from(&smooth);
            let y = blocks.average(&field.component(c));
            let mut estimate = reml(&blocks, &y, &all, &NOISE_LENGTHS_MM, &RATIOS)?;
            estimate.best = with_white(&estimate, white_mm[c]);
            let covariance = estimate.covariance(&blocks)?;
            Ok((estimate, covariance))
        };
        let ((reml1, cov1), (reml2, cov2)) = (estimate(0)?, estimate(1)?);
        let effective_points = cov1.effective_points() + cov2.effective_points();
        Ok(Self {
            white_mm,
            reml: [reml1, reml2],
            covariance: [cov1, cov2],
            effective_points,
            blocks,
        })
    }

    /// Sd of a point's noise in nm, white and correlated parts together: the white part from local differences,
    /// which know it best, unless the blocks show more.
    pub fn point_sd_nm(&self, c: usize) -> f64 {
        self.white_mm[c].hypot(self.reml[c].correlated_sd()) * NM_PER_MM
    }

    /// Root mean square of the block covariance's point sd over both components, nm: the noise scale that the
    /// posterior samples is given in this unit.
    pub fn reference_nm(&self) -> f64 {
        let variance = |c: usize| self.reml[c].best.scale2 * self.covariance[c].point_variance();
        (0.5 * (variance(0) + variance(1))).sqrt() * NM_PER_MM
    }

    /// Contrasts of both components from which the noise's scale is known.
    pub fn contrasts(&self) -> usize {
        self.reml.iter().map(|r| r.contrasts).sum()
    }

    /// Whitened block averages of one component of some columns, at the estimated scale.
    pub fn whiten(&self, columns: &DMatrix<f64>, c: usize) -> DMatrix<f64> {
        self.covariance[c].whiten(columns) / self.reml[c].best.scale2.sqrt()
    }

    /// The inverse of [`Noise::whiten`].
    pub fn colour(&self, columns: &DMatrix<f64>, c: usize) -> DMatrix<f64> {
        self.covariance[c].colour(columns) * self.reml[c].best.scale2.sqrt()
    }
}

/// Contrasts needed beside the fitted columns.
const FEWEST_CONTRASTS: usize = 20;

/// Local polynomials of the highest degree that leaves most contrasts to the noise.
fn smooth_columns(blocks: &Blocks, fitted: usize) -> DMatrix<f64> {
    let side = SQUARE_MM.max(6.0 * blocks.size_mm);
    [2, 1]
        .map(|degree| blocks.local_polynomials(side, degree))
        .into_iter()
        .find(|columns| 2 * (columns.ncols() + fitted) < blocks.len())
        .unwrap_or_else(|| DMatrix::zeros(blocks.len(), 0))
}

/// Relative sd of the white variance of a block average, given the white noise of points: the local differences
/// see a little of a short correlation too.
const WHITE_VARIANCE_SD: f64 = 0.1;

/// The most likely setting given also the white noise of points, which the block averages by themselves hardly tell
/// from noise that is correlated over less than a block: the restricted likelihood times a lognormal for s^2
/// about white^2 / nbar, at the s^2 that is best for each setting.
fn with_white(estimate: &Reml, white_mm: f64) -> Setting {
    let nu = estimate.contrasts as f64;
    let expected = (white_mm * white_mm / estimate.mean_count).ln();
    let refined = |setting: &Setting| {
        let profile = setting.scale2.ln();
        let mut x = profile;
        for _ in 0..50 {
            let ratio = (profile - x).exp();
            let slope = -0.5 * nu * (1.0 - ratio) - (x - expected) / WHITE_VARIANCE_SD.powi(2);
            let curvature = 0.5 * nu * ratio + WHITE_VARIANCE_SD.powi(-2);
            x += (slope / curvature).clamp(-1.0, 1.0);
        }
        let lost = 0.5 * nu * (x - profile + (profile - x).exp() - 1.0);
        let penalty = 0.5 * ((x - expected) / WHITE_VARIANCE_SD).powi(2);
        Setting {
            scale2: x.exp(),
            log_likelihood: setting.log_likelihood - lost - penalty,
            ..*setting
        }
    };
    // Half the prior probability on white noise, half shared by the correlated settings: a correlation is
    // found where the data ask for it.
    let correlated = estimate
        .table
        .iter()
        .filter(|s| s.ratio > 0.0)
        .count()
        .max(1) as f64;
    let weighed =
        |s: &Setting| s.log_likelihood - if s.ratio > 0.0 { correlated.ln() } else { 0.0 };
    let best = |a: Setting, b: Setting| {
        if weighed(&b) > weighed(&a) { b } else { a }
    };
    estimate
        .table
        .iter()
        .map(refined)
        .reduce(best)
        .unwrap_or(estimate.best)
}

/// Block averages of one component of columns: blocks x columns.
pub fn component<'a>(
    columns: impl Iterator<Item = &'a Vec<[f64; 2]>>,
    c: usize,
    blocks: &Blocks,
) -> DMatrix<f64> {
    let averages: Vec<DVector<f64>> = columns
        .map(|column| {
            let values: Vec<f64> = column.iter().map(|u| u[c]).collect();
            blocks.average(&values)
        })
        .collect();
    if averages.is_empty() {
        return DMatrix::zeros(blocks.len(), 0);
    }
    DMatrix::from_columns(&averages)
}
