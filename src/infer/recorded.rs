//! Declared effects of the recording: estimated within blocks, at pixel level, and taken out of the measured field.
//!
//! A ripple at twice the fringe frequency averages to nothing over a block, so that block averages know nothing of it;
//! and differences of neighbouring pixels would take it for noise. It is therefore estimated from what is left within
//! blocks, before the noise is.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::model::Model;
use super::observation::Observation;
use crate::effect::{Effect, Kind, Scene, amplitude_name, recorded_column};
use crate::error::{Error, Result};
use crate::experiment::Experiment;
use crate::field::{Blocks, Field};
use crate::noise::{NormalEquations, residual_of_fit, solve};
use crate::reduce::ReducedModel;

/// The second pass has the first one's ripple out of the argument.
const PASSES: usize = 2;

/// Points that determine a plane over a block with some to spare; a smaller block has its mean.
const FEWEST_FOR_PLANE: usize = 8;

/// One amplitude of a declared effect of the recording, in its border unit.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedAmplitude {
    /// `effect.parameter`.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation, for white noise within the blocks.
    pub sd: f64,
}

impl Observation {
    /// Estimate the model's declared effects of the recording and subtract them from the measured field.
    ///
    /// # Errors
    /// Columns that depend on each other.
    pub fn take_out_recorded(
        &mut self,
        reduced: &ReducedModel,
        experiment: &dyn Experiment,
        model: &Model,
    ) -> Result<()> {
        let effects: Vec<_> = model
            .effects
            .iter()
            // miscounted orders are corrected by regions, elsewhere
            .filter(|e| e.kind() == Kind::Recorded && e.name() != "fringe_order_jump")
            .copied()
            .collect();
        if effects.is_empty() {
            return Ok(());
        }
        let modes = reduced.columns(experiment, &self.sight);
        let tiles = Tiles::new(&self.field);
        let scene = experiment.scene();
        let measured = self.field.displacement.clone();
        for _ in 0..PASSES {
            let smooth = smooth_field(&self.field, &modes, &tiles);
            let columns = recorded_columns(&effects, scene, &self.field.points, &smooth);
            let prior_sd: Vec<Option<f64>> = effects
                .iter()
                .flat_map(|e| (0..e.parameters().len()).map(|k| model.prior_sd(*e, k)))
                .collect();
            let (mean, sd) = regress(&tiles, &measured, &smooth, &columns, &prior_sd)?;
            self.field.displacement = measured.clone();
            for (column, a) in columns.iter().zip(&mean) {
                for (u, c) in self.field.displacement.iter_mut().zip(column) {
                    u[0] -= a * c[0];
                    u[1] -= a * c[1];
                }
            }
            let names = effects.iter().flat_map(|e| {
                let parameters = e.parameters().iter();
                parameters.map(|p| amplitude_name(*e, p))
            });
            self.recorded = names
                .zip(mean.iter().zip(&sd))
                .map(|(name, (&mean, &sd))| RecordedAmplitude { name, mean, sd })
                .collect();
        }
        Ok(())
    }
}

/// Columns of recorded effects at the points, one a parameter, for one border unit each: `smooth` is the displacement
/// that the instrument saw, mm, without its noise.
pub fn recorded_columns(
    effects: &[&'static dyn Effect],
    scene: &Scene,
    points: &[[f64; 2]],
    smooth: &[[f64; 2]],
) -> Vec<Vec<[f64; 2]>> {
    effects
        .iter()
        .flat_map(|e| {
            (0..e.parameters().len()).map(|k| recorded_column(*e, k, scene, points, smooth))
        })
        .collect()
}

/// The measured displacement without what varies within a block: the least-squares fit of `modes` and any affine
/// displacement, and a plane a block through what that leaves. In mm, translation included.
pub fn smooth_field(field: &Field, modes: &[Vec<[f64; 2]>], tiles: &Tiles) -> Vec<[f64; 2]> {
    let residual = residual_of_fit(field, modes);
    let planes = [0, 1].map(|c| {
        let left: Vec<f64> = residual.iter().map(|r| r[c]).collect();
        tiles.planes(&left)
    });
    (0..field.len())
        .map(|i| [0, 1].map(|c| field.displacement[i][c] - residual[i][c] + planes[c][i]))
        .collect()
}

/// Blocks with a plane fitted over each.
pub struct Tiles {
    /// Points of each block.
    members: Vec<Vec<usize>>,
    /// Block of each point; the nearest one for a point that is in none.
    of_point: Vec<usize>,
    /// 1 and the offsets from the block's centre in units of its side, of each point.
    basis: Vec<Vector3<f64>>,
    /// Inverse Gram matrix of each block's members.
    inverse: Vec<Matrix3<f64>>,
}

impl Tiles {
    /// Blocks of the size that the noise is estimated on.
    pub fn new(field: &Field) -> Self {
        let blocks = Blocks::new(field, Blocks::size_for(field), |_| true);
        let offset = |p: [f64; 2], b: usize| {
            let c = blocks.centroid[b];
            [0, 1].map(|k| (p[k] - c[k]) / blocks.size_mm)
        };
        let nearest = |p: [f64; 2]| {
            let distance = |&b: &usize| {
                let [s, t] = offset(p, b);
                s * s + t * t
            };
            (0..blocks.len())
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .unwrap_or(0)
        };
        let mut members = vec![Vec::new(); blocks.len()];
        let (mut of_point, mut basis) = (Vec::new(), Vec::new());
        for (i, (&p, block)) in field.points.iter().zip(&blocks.of_point).enumerate() {
            let b = block.map_or_else(|| nearest(p), |b| b as usize);
            if block.is_some() {
                members[b].push(i);
            }
            let [s, t] = offset(p, b);
            of_point.push(b);
            // Beyond its block a plane is not to be trusted: the mean then.
            basis.push(if block.is_some() {
                Vector3::new(1.0, s, t)
            } else {
                Vector3::x()
            });
        }
        let inverse = members
            .iter()
            .map(|m: &Vec<usize>| {
                let gram: Matrix3<f64> = m.iter().map(|&i| basis[i] * basis[i].transpose()).sum();
                let mean = Matrix3::from_diagonal(&Vector3::new(1.0 / m.len() as f64, 0.0, 0.0));
                if m.len() < FEWEST_FOR_PLANE {
                    return mean;
                }
                gram.cholesky().map_or(mean, |g| g.inverse())
            })
            .collect();
        Self {
            members,
            of_point,
            basis,
            inverse,
        }
    }

    /// The least-squares plane over each block, at the points.
    fn planes(&self, values: &[f64]) -> Vec<f64> {
        let fits: Vec<Vector3<f64>> = self
            .members
            .iter()
            .zip(&self.inverse)
            .map(|(m, inverse)| {
                let right: Vector3<f64> = m.iter().map(|&i| self.basis[i] * values[i]).sum();
                inverse * right
            })
            .collect();
        self.of_point
            .iter()
            .zip(&self.basis)
            .map(|(&b, x)| fits[b].dot(x))
            .collect()
    }

    /// What the planes leave of component `c`, at the members of blocks.
    fn within(&self, values: impl Fn(usize) -> f64) -> DVector<f64> {
        let values: Vec<f64> = (0..self.of_point.len()).map(values).collect();
        let planes = self.planes(&values);
        let all = self.members.iter().flatten();
        DVector::from_iterator(self.count(), all.map(|&i| values[i] - planes[i]))
    }

    /// Points in blocks.
    fn count(&self) -> usize {
        self.members.iter().map(Vec::len).sum()
    }

    /// Degrees of freedom that the planes leave of [`Tiles::count`].
    fn freedom(&self) -> f64 {
        (self.count() as f64 - 3.0 * self.members.len() as f64).max(1.0)
    }
}

/// Amplitudes of columns, mean and sd, from what varies within blocks, with their normal priors. Each component has the
/// weight of its own variance.
fn regress(
    tiles: &Tiles,
    measured: &[[f64; 2]],
    smooth: &[[f64; 2]],
    columns: &[Vec<[f64; 2]>],
    plausible: &[Option<f64>],
) -> Result<(Vec<f64>, Vec<f64>)> {
    let q = columns.len();
    let prior = plausible
        .iter()
        .map(|sd| sd.map_or(0.0, |sd| 1.0 / (sd * sd)));
    let mut precision = DMatrix::from_diagonal(&DVector::from_iterator(q, prior));
    let mut right = DVector::zeros(q);
    for c in 0..2 {
        let y = tiles.within(|i| measured[i][c] - smooth[i][c]);
        let x: Vec<DVector<f64>> = columns
            .iter()
            .map(|column| tiles.within(|i| column[i][c]))
            .collect();
        let x = DMatrix::from_columns(&x);
        let gram = x.tr_mul(&x);
        let product = x.tr_mul(&y);
        let fit = solve(&gram, &product);
        let left = (y.norm_squared() - fit.dot(&product)).max(f64::MIN_POSITIVE);
        let weight = tiles.freedom() / left;
        precision += gram * weight;
        right += product * weight;
    }
    let fit = NormalEquations::new(precision, right)
        .ok_or_else(|| Error::input("effects", "effects of the recording that differ"))?;
    let (mean, covariance) = (fit.mean(), fit.covariance());
    let sd = (0..q).map(|k| covariance[(k, k)].sqrt()).collect();
    Ok((mean.as_slice().to_vec(), sd))
}
