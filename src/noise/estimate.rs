//! The noise of the measurement: its covariance on block averages, independent of what the model lacks.

use nalgebra::{DMatrix, DVector};

use super::hyperparameters::{LocalVariance, OneComponent, tables};
use super::normal::solve;
use super::reml::{Contrasts, Hyperparameters, Reml};
use super::white::{Leftover, WhiteNoise, white};
use super::{BlockCovariance, Matern};
use crate::error::{Error, Result};
use crate::field::{Blocks, Field, Reason};
use crate::files::{KeptStages, Stored, stored};
use crate::progress::Progress;
use crate::quantity::NM_PER_MM;

/// Side of the squares on which a quadratic is taken out of the data before the noise is estimated, in longest lengths of noise, at
/// least. Misfit that is smooth on this scale does not pass for noise.
const SQUARE: f64 = 4.0;

/// Relative error that local differences may have beside their sampling error, from curvature that they do not follow.
const LOCAL_BIAS: f64 = 0.005;

/// Blocks, and the short-range noise covariance of each component.
pub struct Noise {
    /// Block averages' geometry, the same for both components.
    pub blocks: Blocks,
    /// Restricted-likelihood estimate of each component.
    pub reml: [Reml; 2],
    /// Covariance of each component's block averages at unit scale, averaged over the hyperparameters.
    pub covariance: [BlockCovariance; 2],
    /// Scale s^2 of each component's covariance, mm^2.
    pub scale2: [f64; 2],
    /// Mean and variance of the logarithm of a point's variance (mm^2) of each component.
    pub log_variance: [(f64, f64); 2],
    /// White sd of a point from local differences, mm.
    pub white_mm: [f64; 2],
    /// Effective number of independent points of both components.
    pub effective_points: f64,
}

/// Columns (u1, u2) at the points, mm.
type ColumnsAtPoints<'a> = &'a [Vec<[f64; 2]>];

/// What is kept of an estimate: all but the blocks.
struct EstimatedParts {
    reml: [Reml; 2],
    covariance: [BlockCovariance; 2],
    scale2: [f64; 2],
    white_mm: [f64; 2],
    log_variance: [(f64, f64); 2],
    effective_points: f64,
}

stored!(EstimatedParts {
    reml,
    covariance,
    scale2,
    white_mm,
    log_variance,
    effective_points
});

impl Noise {
    /// Estimate from contrasts orthogonal to the model's columns and to local quadratics (restricted maximum
    /// likelihood over correlation lengths up to [`Blocks::noise_length_mm`]). `modes` are those of u1, then of u2, and `effects` the columns of
    /// declared effects, both in mm at the points.
    ///
    /// # Errors
    /// Too few points to tell noise from the columns.
    pub fn estimate(
        field: &Field,
        modes: &[Vec<[f64; 2]>],
        effects: &[Vec<[f64; 2]>],
    ) -> Result<Self> {
        let blocks = Blocks::new(field, Blocks::size_for(field), |_| true);
        let fitted = modes.len() + effects.len();
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
        // Local fits follow the residual of a global one more easily than the field about the hole.
        let left = Field {
            displacement: residual_of_fit(field, modes),
            ..field.clone()
        };
        let seen = white(&left);
        let coarser = coarser(&left, &blocks);
        let strides: Vec<(&Field, f64)> = std::iter::once((&left, 1.0))
            .chain(coarser.iter().map(|(field, stride)| (field, *stride)))
            .collect();
        let differences: Vec<(WhiteNoise, Leftover<'_>, f64)> = strides
            .into_iter()
            .map(|(field, stride)| (white(field), Leftover::new(field), stride))
            .collect();
        let contrasts = |c: usize| {
            let explained = component(modes.iter().chain(effects), c, &blocks);
            let mut all = DMatrix::zeros(blocks.len(), explained.ncols() + smooth.ncols());
            all.columns_mut(0, explained.ncols()).copy_from(&explained);
            all.columns_mut(explained.ncols(), smooth.ncols())
                .copy_from(&smooth);
            Contrasts::new(&blocks, blocks.average(&field.component(c)), &all)
        };
        let contrasts = [contrasts(0)?, contrasts(1)?];
        let [first, second] = tables(&blocks, [&contrasts[0], &contrasts[1]])?;
        let estimate = |c: usize, reml: Reml| -> Result<OneComponent> {
            let locals = differences
                .iter()
                .map(|(seen, leftover, stride)| LocalVariance {
                    variance: seen.sd_mm[c].powi(2),
                    // what is far out among points is in the averages of blocks
                    error: (2.0 * seen.relative_error)
                        .hypot(LOCAL_BIAS * stride * stride)
                        .hypot(seen.tails[c]),
                    leftover,
                });
            let locals: Vec<LocalVariance<'_>> = locals.collect();
            OneComponent::new(&blocks, &contrasts[c], reml, &locals)
        };
        let (a, b) = (estimate(0, first)?, estimate(1, second)?);
        let effective_points = a.covariance.effective_points() + b.covariance.effective_points();
        Ok(Self {
            white_mm: seen.sd_mm,
            log_variance: [a.log_variance, b.log_variance],
            scale2: [a.scale2, b.scale2],
            reml: [a.reml, b.reml],
            covariance: [a.covariance, b.covariance],
            effective_points,
            blocks,
        })
    }

    /// The same as a stage of a run that is kept, but for the blocks, which are made anew.
    ///
    /// # Errors
    /// Those of [`Noise::estimate`]; a folder that cannot be written.
    pub fn estimate_kept(
        field: &Field,
        (modes, effects): (ColumnsAtPoints<'_>, ColumnsAtPoints<'_>),
        kept: &KeptStages,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut of = Vec::new();
        (field.points.clone(), field.displacement.clone()).put(&mut of);
        (modes.to_vec(), effects.to_vec()).put(&mut of);
        let estimate = || {
            let found = Self::estimate(field, modes, effects)?;
            Ok(EstimatedParts {
                reml: found.reml,
                covariance: found.covariance,
                scale2: found.scale2,
                white_mm: found.white_mm,
                log_variance: found.log_variance,
                effective_points: found.effective_points,
            })
        };
        let found = kept.stage("noise", &of, estimate, progress)?;
        Ok(Self {
            blocks: Blocks::new(field, Blocks::size_for(field), |_| true),
            reml: found.reml,
            covariance: found.covariance,
            scale2: found.scale2,
            log_variance: found.log_variance,
            white_mm: found.white_mm,
            effective_points: found.effective_points,
        })
    }

    /// The same noise with a smooth discrepancy of the model in place of the correlated part, where a component has one.
    ///
    /// # Errors
    /// Of the program, if a covariance is not positive definite.
    pub fn with(mut self, discrepancy: &[Option<Hyperparameters>; 2]) -> Result<Self> {
        for (c, found) in discrepancy.iter().enumerate() {
            let Some(d) = found else { continue };
            let matern = Matern::new(&self.blocks, d.length_mm);
            self.covariance[c] = BlockCovariance::new(&self.blocks, &matern, d.ratio)?;
            self.scale2[c] = d.scale2;
        }
        let effective = |c: usize| self.covariance[c].effective_points();
        self.effective_points = effective(0) + effective(1);
        Ok(self)
    }

    /// Sd of a point's noise in nm, white and correlated parts together.
    pub fn point_sd_nm(&self, c: usize) -> f64 {
        (0.5 * self.log_variance[c].0).exp() * NM_PER_MM
    }

    /// Root mean square of the point sd over both components, nm: the noise parameter of the posterior at scale 1.
    pub fn reference_nm(&self) -> f64 {
        (0.5 * (self.point_sd_nm(0).powi(2) + self.point_sd_nm(1).powi(2))).sqrt()
    }

    /// Degrees of freedom nu with which the noise's scale is known: the number of independent values of a known
    /// covariance from which its logarithm would have the same variance, 1 / (2 nu).
    pub fn freedom(&self) -> f64 {
        let variance = [0, 1].map(|c| self.log_variance[c].0.exp());
        let total = variance[0] + variance[1];
        let relative: f64 = (0..2)
            .map(|c| (variance[c] / total).powi(2) * self.log_variance[c].1)
            .sum();
        2.0 / relative
    }

    /// Whitened block averages of one component of some columns, at the estimated scale.
    pub fn whiten(&self, columns: &DMatrix<f64>, c: usize) -> DMatrix<f64> {
        self.covariance[c].whiten(columns) / self.scale2[c].sqrt()
    }

    /// The inverse of [`Noise::whiten`].
    pub fn colour(&self, columns: &DMatrix<f64>, c: usize) -> DMatrix<f64> {
        self.covariance[c].colour(columns) * self.scale2[c].sqrt()
    }
}

/// Thinned fields with their stride, 2, 4, .. spacings, up to half a block: differences over more than the correlation length see all of the
/// noise, those of neighbours only what is white in it.
fn coarser(field: &Field, blocks: &Blocks) -> Vec<(Field, f64)> {
    let spacing = field.spacing_mm();
    let mut thinned = Vec::new();
    let mut stride = 2.0;
    while stride * spacing <= 0.5 * blocks.size_mm {
        let kept = crate::field::blocks::one_a_tile(&field.points, stride * spacing);
        let mut field = field.clone();
        field.retain(Reason::OutsideWindow, |i| kept[i]);
        if field.len() < FEWEST_THINNED {
            break;
        }
        thinned.push((field, stride));
        stride *= 2.0;
    }
    thinned
}

/// Points that a thinned field must have for its differences to say anything.
const FEWEST_THINNED: usize = 200;

/// Contrasts needed beside the fitted columns.
const FEWEST_CONTRASTS: usize = 20;

/// Local polynomials of the highest degree that leaves most contrasts to the noise.
pub(super) fn smooth_columns(blocks: &Blocks, fitted: usize) -> DMatrix<f64> {
    let side = (SQUARE * blocks.noise_length_mm).max(6.0 * blocks.size_mm);
    [2, 1]
        .map(|degree| blocks.local_polynomials(side, degree))
        .into_iter()
        .find(|columns| 2 * (columns.ncols() + fitted) < blocks.len())
        .unwrap_or_else(|| DMatrix::zeros(blocks.len(), 0))
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

/// Residual (mm) of each component's least-squares fit on its own modes and {1, s, t}; `modes` are those of u1, then of u2.
pub fn residual_of_fit(field: &Field, modes: &[Vec<[f64; 2]>]) -> Vec<[f64; 2]> {
    let mut residual = field.displacement.clone();
    let half = modes.len() / 2;
    for c in 0..2 {
        let basis = |i: usize| {
            let p = field.points[i];
            let own = modes[c * half..(c + 1) * half].iter().map(move |m| m[i][c]);
            own.chain([1.0, p[0], p[1]])
        };
        let p = half + 3;
        let mut gram = DMatrix::<f64>::zeros(p, p);
        let mut right = DVector::<f64>::zeros(p);
        for i in 0..field.len() {
            let row = DVector::from_iterator(p, basis(i));
            right.axpy(field.displacement[i][c], &row, 1.0);
            gram.ger(1.0, &row, &row, 1.0);
        }
        let fit = solve(&gram, &right);
        for (i, r) in residual.iter_mut().enumerate() {
            r[c] -= basis(i).zip(fit.iter()).map(|(b, f)| b * f).sum::<f64>();
        }
    }
    residual
}
