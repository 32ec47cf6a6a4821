//! How far two experiments on one material disagree.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::prior::Marginal;

/// Mean and covariance of the constants, border units.
#[derive(Debug, Clone)]
pub struct Moments {
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

impl Moments {
    /// Of points, of each the first `count` values.
    pub fn of<'a>(points: impl Iterator<Item = &'a [f64]>, count: usize) -> Self {
        let points: Vec<&[f64]> = points.collect();
        let n = points.len() as f64;
        let mut mean = DVector::zeros(count);
        for x in &points {
            mean += DVector::from_column_slice(&x[..count]);
        }
        mean /= n;
        let mut covariance = DMatrix::zeros(count, count);
        for x in points {
            let d = DVector::from_column_slice(&x[..count]) - &mean;
            covariance.ger(1.0 / n, &d, &d, 1.0);
        }
        Self { mean, covariance }
    }

    /// In prior sds from the prior means.
    fn scaled(&self, priors: &[Marginal]) -> Self {
        let n = priors.len();
        Self {
            mean: DVector::from_fn(n, |k, _| (self.mean[k] - priors[k].mean) / priors[k].sd),
            covariance: DMatrix::from_fn(n, n, |i, j| {
                self.covariance[(i, j)] / (priors[i].sd * priors[j].sd)
            }),
        }
    }
}

/// Two posteriors of the same constants, from different data and one prior, held against each other as normal densities.
#[derive(Debug, Serialize, Deserialize)]
pub struct Tension {
    /// For each constant the difference of the posterior means, and its sd if both saw one material, border units.
    pub difference: Vec<[f64; 2]>,
    /// Square of the whole difference in those sds, the number of directions of which either says something, and the probability of as
    /// much by chance.
    pub chi2: f64,
    pub directions: usize,
    pub p: f64,
    /// Log Bayes factor for one material against one for each, of the same prior: log of the integral of p(c|first) p(c|second) / p(c).
    pub log_bayes_factor: f64,
    /// What would be wrong if all of it came from the first experiment as a whole.
    pub factor: ExperimentFactor,
}

/// All moduli by one experiment too large by one factor: its force, a thickness, a width, or another batch of the material.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct ExperimentFactor {
    pub percent: f64,
    /// Sds of that from none.
    pub z: f64,
    /// Log Bayes factor for such an error, of 5 % (one sd), against none.
    pub log_bayes_factor: f64,
}

/// Probability of a disagreement by chance below which it is called one, and the log Bayes factor of an error of an experiment above which
/// it is. A contradiction along one direction is diluted by those in which neither can be wrong (measured on eight pairs with an error of 4
/// to 9 % and two without).
const APART: f64 = 0.01;
const WHOLE: f64 = 2.0;

/// Sd of an error of an experiment as a whole, percent.
const ERROR_PERCENT: f64 = 5.0;

impl ExperimentFactor {
    /// Of the difference of two posterior means, `along` the eigenvectors of its covariance, whose eigenvalues are `values`; only the directions
    /// `said` count. `u` is what one percent in all moduli does to the first mean, along the same directions: of means that shrink towards the
    /// prior u = (I - S) x, with the first posterior's covariance S and the change x of the constants. All in prior sds. The difference is
    /// then normal about `percent` u, and the Bayes factor that of two normal densities.
    fn new(along: &DVector<f64>, values: &DVector<f64>, said: &[usize], u: &DVector<f64>) -> Self {
        let sum = |a: &DVector<f64>| said.iter().map(|&k| u[k] * a[k] / values[k]).sum::<f64>();
        let information = sum(u);
        if information <= 0.0 {
            return Self {
                percent: 0.0,
                z: 0.0,
                log_bayes_factor: 0.0,
            };
        }
        let percent = sum(along) / information;
        let z = percent * information.sqrt();
        let [prior, own] = [ERROR_PERCENT * ERROR_PERCENT, 1.0 / information];
        Self {
            percent,
            z,
            log_bayes_factor: 0.5 * z * z * prior / (prior + own) - 0.5 * (1.0 + prior / own).ln(),
        }
    }
}

/// Variances of the difference, prior variances, below which neither experiment says anything.
const SILENT: f64 = 1e-3;

impl Tension {
    /// Whether the experiments contradict each other.
    pub fn contradicts(&self) -> bool {
        self.p < APART || self.factor.log_bayes_factor > WHOLE
    }

    /// Of two posteriors under a common prior, of constants of which some are `moduli`; none where one is singular.
    pub fn between(
        first: &Moments,
        second: &Moments,
        priors: &[Marginal],
        moduli: &[bool],
    ) -> Option<Self> {
        let n = priors.len();
        let [a, b] = [first, second].map(|m| m.scaled(priors));
        let (sa, sb) = (&a.covariance, &b.covariance);
        // of means that shrink towards one prior: cov(a - b) = Sa + Sb - Sa Sb - Sb Sa
        let spread = sa + sb - sa * sb - sb * sa;
        let off = &a.mean - &b.mean;
        let eigen = SymmetricEigen::new(spread.clone());
        let along = eigen.eigenvectors.tr_mul(&off);
        let said: Vec<usize> = (0..n).filter(|&k| eigen.eigenvalues[k] > SILENT).collect();
        let chi2 = said
            .iter()
            .map(|&k| along[k] * along[k] / eigen.eigenvalues[k])
            .sum();
        let percent = DVector::from_fn(n, |k, _| match moduli.get(k) {
            Some(true) => 0.01 * priors[k].mean / priors[k].sd,
            _ => 0.0,
        });
        let u = eigen.eigenvectors.tr_mul(&(&percent - sa * &percent));
        let factor = ExperimentFactor::new(&along, &eigen.eigenvalues, &said, &u);
        let p = match said.len() {
            0 => 1.0,
            directions => ChiSquared::new(directions as f64).ok()?.sf(chi2),
        };
        let (pa, pb) = (sa.clone().cholesky()?, sb.clone().cholesky()?);
        let log_det = |m: &DMatrix<f64>| -> Option<f64> {
            Some(2.0 * m.clone().cholesky()?.l().diagonal().map(f64::ln).sum())
        };
        let both = pa.inverse() + pb.inverse() - DMatrix::identity(n, n);
        let (ea, eb) = (pa.solve(&a.mean), pb.solve(&b.mean));
        let eta = &ea + &eb;
        let square =
            a.mean.dot(&ea) + b.mean.dot(&eb) - eta.dot(&both.clone().cholesky()?.solve(&eta));
        let log_bayes_factor =
            -0.5 * (log_det(sa)? + log_det(sb)? + log_det(&both)?) - 0.5 * square;
        let difference = (0..n).map(|k| {
            let sd = spread[(k, k)].max(0.0).sqrt() * priors[k].sd;
            [first.mean[k] - second.mean[k], sd]
        });
        Some(Self {
            difference: difference.collect(),
            chi2,
            directions: said.len(),
            p,
            log_bayes_factor,
            factor,
        })
    }
}
