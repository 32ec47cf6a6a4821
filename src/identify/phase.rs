//! The phase-shift error of a moire measurement: a ripple of twice the fringe frequency on the displacement itself.
//!
//! Steps of the phase that miss their nominal value add A sin(4 pi f_s F) + B cos(4 pi f_s F) to a measured component,
//! F being that component without the error. The ripple's period, 1/(2 f_s), passes several times within a
//! block, where the elastic field is all but a plane: the error is sought in what a plane a block does not take.
//! The argument is the model plus that plane, free of the pixels' noise; the ripple's own share in
//! the plane is taken out by repetition. What the same regression finds at other multiples of the fringe
//! frequency is the null distribution, so that correlated noise raises no alarm.

use nalgebra::{DMatrix, DVector, Vector2};
use rayon::prelude::*;

use super::tiles::Tiles;
use crate::field::{Blocks, Field};
use crate::noise::NormalEquations;
use crate::quantity::NM_PER_MM;

/// Sine and cosine amplitudes of a ripple.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ripple {
    /// Posterior mean of the sine's amplitude, nm.
    pub sin_nm: f64,
    /// Posterior mean of the cosine's amplitude, nm.
    pub cos_nm: f64,
    /// Posterior sds of the two, nm.
    pub sd_nm: [f64; 2],
    /// Log Bayes factor of amplitudes of their prior sd against none.
    pub log_bayes_factor: f64,
}

/// The phase-shift error of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseError {
    /// The same error in both components, as one camera and one piezo may give it: it speaks louder than either alone.
    pub both: Ripple,
    /// Each component by itself: what is taken out of the field.
    pub component: [Ripple; 2],
    /// What the fringes show without the error and the pixels' noise: model, planes of the blocks, at every point, mm.
    pub smooth: Vec<[f64; 2]>,
    /// Sd of (u1, u2) within the blocks, nm, the ripple aside.
    pub within_nm: [f64; 2],
    /// Variance of the amplitudes at other multiples of the fringe frequency over that of white noise of `within_nm`, for
    /// (u1, u2); at least 1.
    pub inflation: [f64; 2],
}

impl PhaseError {
    /// Mean and sd of the amplitudes, nm: sine and cosine of u1, then of u2.
    pub fn amplitudes_nm(&self) -> [(f64, f64); 4] {
        let [a, b] = &self.component;
        [
            (a.sin_nm, a.sd_nm[0]),
            (a.cos_nm, a.sd_nm[1]),
            (b.sin_nm, b.sd_nm[0]),
            (b.cos_nm, b.sd_nm[1]),
        ]
    }

    /// Log Bayes factor of an error against none: the same in both components, one of its own in either, or in both.
    pub fn log_bayes_factor(&self) -> f64 {
        let [a, b] = self.component.map(|ripple| ripple.log_bayes_factor);
        self.both.log_bayes_factor.max(a).max(b).max(a + b)
    }
}

/// Multiples of the fringe frequency at which there is nothing to find: what the regression finds there is its null distribution.
/// In the prototype study a ripple of 3 nm was recovered as 2.99 nm this way.
const DECOYS: [f64; 20] = [
    1.30, 1.35, 1.40, 1.45, 1.50, 1.55, 1.60, 1.65, 1.70, 1.75, 2.25, 2.30, 2.35, 2.40, 2.45, 2.50,
    2.55, 2.60, 2.65, 2.70,
];
/// Degrees of freedom of the variance that the decoys give: neighbouring decoys overlap, two are as good as one.
const FREEDOM: f64 = 20.0;
/// Repetitions of argument and fit, and the change of the amplitudes that ends them, nm.
const REPETITIONS: usize = 12;
const CONVERGED_NM: f64 = 1e-3;

/// Estimate the phase-shift error of `field` within `blocks`, its sine and cosine amplitudes in (u1, u2) having the prior sds `prior_sd_nm`.
///
/// `model` is the fitted displacement (u1, u2) in mm at every point, its translation included or not: the blocks' own
/// planes are added to it. The measured displacement in its place would have noise in the argument: 5 nm showed as 13 nm in the
/// prototype study. `order_mm` is the fringe order 1/f_s. Points outside of all blocks are not used. The log Bayes
/// factor of a field without an error is about -10 (Occam); above 4 an error should be accepted.
pub fn find(
    field: &Field,
    blocks: &Blocks,
    model: &[[f64; 2]],
    order_mm: f64,
    prior_sd_nm: [[f64; 2]; 2],
) -> PhaseError {
    let tiles = Tiles::new(field, blocks, order_mm);
    let misfits = [0, 1].map(|c| {
        let value = |i: usize| field.displacement[i][c] - model[i][c];
        let misfit: Vec<f64> = tiles.members.iter().map(|&i| value(i)).collect();
        let model: Vec<f64> = tiles.members.iter().map(|&i| model[i][c]).collect();
        Misfit {
            residual: tiles.without_planes(&misfit),
            misfit,
            model,
        }
    });
    let mut amplitude = [Vector2::zeros(); 2];
    let mut joint = Vector2::zeros();
    for _ in 0..REPETITIONS {
        // with the error of both components, then with their own: each estimate has its own argument
        let next = [0, 1].map(|c| misfits[c].regression(&tiles, amplitude[c]));
        let pair = [0, 1].map(|c| misfits[c].regression(&tiles, joint));
        let solutions = next.map(|n| n.solution());
        let total = Regression {
            gram: &pair[0].gram / pair[0].variance + &pair[1].gram / pair[1].variance,
            right: &pair[0].right / pair[0].variance + &pair[1].right / pair[1].variance,
            variance: 1.0,
        };
        let all = total.solution();
        let change = (0..2)
            .map(|c| (solutions[c] - amplitude[c]).norm())
            .fold((all - joint).norm(), f64::max);
        (amplitude, joint) = (solutions, all);
        if change * NM_PER_MM < CONVERGED_NM {
            break;
        }
    }
    let by_component = [0, 1].map(|c| misfits[c].scaled(&tiles, amplitude[c]));
    let pair = [0, 1].map(|c| misfits[c].scaled(&tiles, joint));
    let information = |n: &Scaled| {
        let variance = n.regression.variance * n.inflation;
        let kept = n.kept(&tiles);
        RippleInformation {
            precision: &n.regression.gram * (kept * kept / variance),
            right: &n.regression.right * (kept / variance),
            lost: 1.0 - kept,
        }
    };
    let [a, b] = pair.each_ref().map(information);
    let weight = [&a, &b].map(|w| w.precision.trace());
    let both = RippleInformation {
        lost: (weight[0] * a.lost + weight[1] * b.lost)
            / (weight[0] + weight[1]).max(f64::MIN_POSITIVE),
        precision: a.precision + b.precision,
        right: a.right + b.right,
    };
    let smooth = [0, 1].map(|c| {
        let argument = misfits[c].argument(&tiles, amplitude[c]);
        tiles.everywhere(field, blocks, &argument, |i| model[i][c])
    });
    PhaseError {
        both: both.ripple(prior_sd_nm[0]),
        component: [0, 1].map(|c| information(&by_component[c]).ripple(prior_sd_nm[c])),
        smooth: (0..field.len())
            .map(|i| [smooth[0][i], smooth[1][i]])
            .collect(),
        within_nm: [0, 1].map(|c| by_component[c].regression.variance.sqrt() * NM_PER_MM),
        inflation: [0, 1].map(|c| by_component[c].inflation),
    }
}

/// What the data say of an amplitude pair a (mm): exp(right' a - a' precision a / 2).
struct RippleInformation {
    precision: DMatrix<f64>,
    right: DVector<f64>,
    /// Share of the amplitude that the noise of the argument took, already put back; it is no better known than itself.
    lost: f64,
}

impl RippleInformation {
    fn ripple(&self, prior_sd_nm: [f64; 2]) -> Ripple {
        let sd = DVector::from_iterator(2, prior_sd_nm.map(|sd| sd / NM_PER_MM));
        let scale = DMatrix::from_diagonal(&sd);
        let scaled = &scale * &self.precision * &scale;
        let fit = NormalEquations::with_unit_prior(scaled, self.right.component_mul(&sd));
        let (mean, covariance, growth) = fit.map_or_else(
            || (DVector::zeros(2), DMatrix::identity(2, 2), 0.0),
            |f| (f.mean(), f.covariance(), f.log_det()),
        );
        let mean = mean.component_mul(&sd);
        // the variance is itself estimated: Student's law instead of the normal one
        let without = NormalEquations::new(self.precision.clone(), self.right.clone())
            .map_or(0.0, |f| f.quadratic());
        let with = (without - self.right.dot(&mean)).max(0.0);
        let evidence =
            0.5 * (FREEDOM + 2.0) * ((1.0 + without / FREEDOM).ln() - (1.0 + with / FREEDOM).ln());
        Ripple {
            sin_nm: mean[0] * NM_PER_MM,
            cos_nm: mean[1] * NM_PER_MM,
            sd_nm: [0, 1].map(|k| {
                let sd = sd[k] * covariance[(k, k)].sqrt();
                sd.hypot(self.lost * mean[k]) * NM_PER_MM
            }),
            log_bayes_factor: evidence - 0.5 * growth,
        }
    }
}

/// Regression of a residual on a ripple's sine and cosine, mm.
struct Regression {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    /// Variance of a point's residual, mm^2.
    variance: f64,
}

impl Regression {
    /// Least-squares amplitudes; none where there are no fringes.
    fn solution(&self) -> Vector2<f64> {
        NormalEquations::new(self.gram.clone(), self.right.clone()).map_or(Vector2::zeros(), |f| {
            let a = f.mean();
            Vector2::new(a[0], a[1])
        })
    }
}

/// A regression with the inflation of its variance.
struct Scaled {
    regression: Regression,
    inflation: f64,
}

impl Scaled {
    /// Share of a ripple's amplitude that shows in spite of the noise in the argument, which the planes let through:
    /// exp(-v / 2) of a phase of variance v.
    fn kept(&self, tiles: &Tiles) -> f64 {
        let share = tiles.terms as f64 / tiles.members.len().max(1) as f64;
        let per_mm = 2.0 * std::f64::consts::TAU / tiles.order_mm;
        (-0.5 * per_mm * per_mm * share * self.regression.variance * self.inflation)
            .exp()
            .max(0.5)
    }
}

/// One component of the field, one value a member of the tiles, mm.
struct Misfit {
    model: Vec<f64>,
    /// Measured minus model.
    misfit: Vec<f64>,
    /// The misfit without the blocks' planes.
    residual: Vec<f64>,
}

impl Misfit {
    /// Argument of the fringes, rad a unit multiple, given the error's `amplitude` (mm).
    fn argument(&self, tiles: &Tiles, amplitude: Vector2<f64>) -> Vec<f64> {
        let per_mm = std::f64::consts::TAU / tiles.order_mm;
        let add = |planes: Vec<f64>| -> Vec<f64> {
            self.model
                .iter()
                .zip(planes)
                .map(|(m, p)| per_mm * (m + p))
                .collect()
        };
        let measured = add(tiles.planes(&self.misfit));
        if amplitude == Vector2::zeros() {
            return measured;
        }
        // the planes hold a part of the ripple; a few sweeps make argument and ripple agree
        const SWEEPS: usize = 3;
        let mut argument = measured.clone();
        for _ in 0..SWEEPS {
            let error: Vec<f64> = argument
                .iter()
                .map(|a| (2.0 * a).sin_cos())
                .map(|(sin, cos)| amplitude[0] * sin + amplitude[1] * cos)
                .collect();
            argument = measured
                .iter()
                .zip(tiles.planes(&error))
                .map(|(m, p)| m - per_mm * p)
                .collect();
        }
        argument
    }

    fn regression(&self, tiles: &Tiles, amplitude: Vector2<f64>) -> Regression {
        let argument = self.argument(tiles, amplitude);
        self.regression_on(tiles, &waves(tiles, &argument, 2.0))
    }

    fn regression_on(&self, tiles: &Tiles, [sin, cos]: &[Vec<f64>; 2]) -> Regression {
        let (gram, right) = self.products(&[sin, cos]);
        let mut regression = Regression {
            gram,
            right,
            variance: 0.0,
        };
        let solution = regression.solution();
        let explained = regression.right[0] * solution[0] + regression.right[1] * solution[1];
        let left = dot(&self.residual, &self.residual) - explained;
        let freedom = (self.residual.len() as f64 - tiles.terms as f64 - 2.0).max(1.0);
        // exact data have no scale: rounding is no ripple
        let exact = 1e-6 * tiles.order_mm;
        regression.variance = (left / freedom).max(exact * exact);
        regression
    }

    /// Scalar products of columns with each other and with the residual.
    fn products(&self, columns: &[&Vec<f64>]) -> (DMatrix<f64>, DVector<f64>) {
        let n = columns.len();
        let gram = DMatrix::from_fn(n, n, |a, b| dot(columns[a], columns[b]));
        let right = DVector::from_fn(n, |a, _| dot(columns[a], &self.residual));
        (gram, right)
    }

    /// The regression at `amplitude`, and how much larger the decoys are than white noise makes them.
    fn scaled(&self, tiles: &Tiles, amplitude: Vector2<f64>) -> Scaled {
        let argument = self.argument(tiles, amplitude);
        let own = waves(tiles, &argument, 2.0);
        let regression = self.regression_on(tiles, &own);
        let squares: Vec<Option<f64>> = DECOYS
            .par_iter()
            .map(|&multiple| {
                let decoy = waves(tiles, &argument, multiple);
                self.decoy_square(&own, &decoy)
                    .map(|square| square / (2.0 * regression.variance))
            })
            .collect();
        let valid: Vec<f64> = squares.into_iter().flatten().collect();
        let mean = valid.iter().sum::<f64>() / valid.len().max(1) as f64;
        Scaled {
            regression,
            inflation: mean.max(1.0),
        }
    }

    /// The sum of squares that a decoy explains beyond the ripple itself, mm^2.
    fn decoy_square(&self, own: &[Vec<f64>; 2], decoy: &[Vec<f64>; 2]) -> Option<f64> {
        let explained = |columns: &[&Vec<f64>]| {
            let (gram, right) = self.products(columns);
            NormalEquations::new(gram, right).map(|f| f.quadratic())
        };
        let all = explained(&[&own[0], &own[1], &decoy[0], &decoy[1]])?;
        let square = all - explained(&[&own[0], &own[1]])?;
        square.is_finite().then_some(square.max(0.0))
    }
}

/// Sine and cosine of a multiple of the argument, without what a plane a block takes.
fn waves(tiles: &Tiles, argument: &[f64], multiple: f64) -> [Vec<f64>; 2] {
    let (sin, cos): (Vec<f64>, Vec<f64>) =
        argument.iter().map(|a| (multiple * a).sin_cos()).unzip();
    [tiles.without_planes(&sin), tiles.without_planes(&cos)]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
