//! What one specimen says of its constants: its chain without the prior, as a mixture of normal kernels.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use crate::chain::{Draws, StoreReader};
use crate::dense::eigen;
use crate::error::{Error, Result};
use crate::files::Keyed;
use crate::infer::PriorSpec;
use crate::numeric::shares;
use crate::parameter::is_modulus;
use crate::report::json::load;

/// Draws of a chain that are read.
pub const MOST_DRAWS: usize = 1 << 14;

/// Kernels of a specimen.
pub const KERNELS: usize = 1 << SPLITS;
const SPLITS: usize = 6;

/// A specimen's likelihood of its constants, unnormalised: kernels of equal weight and covariance, whose mixture has the mean and the covariance
/// of the weighted draws (shrunken kernels: West 1993, J. R. Stat. Soc. B 55, 409).
#[derive(Debug, Clone)]
pub struct Specimen {
    pub name: String,
    /// Names of the constants, with their units.
    pub constants: Vec<String>,
    /// Means of the kernels.
    pub centres: Vec<DVector<f64>>,
    /// Covariance of every kernel.
    pub kernel: DMatrix<f64>,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Normal priors of the constants, [mean, sd], which its likelihood is without.
    pub priors: Vec<[f64; 2]>,
    /// Share of the draws that is left in effect when the prior is divided out.
    pub left: f64,
}

/// Below this share the likelihood is taken as normal.
pub const LEAST_LEFT: f64 = 0.1;

/// What is read of a model.
#[derive(Deserialize)]
struct WithMaterial {
    material: WithPriors,
}

#[derive(Deserialize)]
struct WithPriors {
    parameters: Keyed<WithPrior>,
}

#[derive(Deserialize)]
struct WithPrior {
    prior: PriorSpec,
}

impl Specimen {
    /// The specimen of a finished run: of a loop the posterior to quote.
    ///
    /// # Errors
    /// The input's fault, with the file: a model or chains that cannot be read, constants that do not vary.
    pub fn of_run(name: &str, folder: &Path) -> Result<Self> {
        let model: WithMaterial = load(folder, "model.json")?;
        let stores = ["averaged/chain.zarr", "chain.zarr"].map(|s| folder.join(s));
        let store = stores.iter().find(|s| s.is_dir()).ok_or_else(|| {
            Error::input(folder.display(), "the chains of a finished run").found("no chain.zarr")
        })?;
        let draws = StoreReader::open(store)?.thinned(MOST_DRAWS)?;
        let of = |(name, p): (&String, &WithPrior)| {
            let PriorSpec::Normal { mean, sd } = p.prior;
            draws.index(name).map(|k| (k, [mean, sd]))
        };
        // in the order of the chain, which is that of the constants
        let mut own: Vec<(usize, [f64; 2])> =
            model.material.parameters.iter().filter_map(of).collect();
        own.sort_by_key(|(k, _)| *k);
        Self::of_draws(name, &draws, &own).map_err(|e| e.within(store.display()))
    }

    /// The specimen without what a scale of all moduli leaves open that is not its own but all specimens': a relative sd of `share`.
    ///
    /// # Errors
    /// The input's fault: a scale that is less certain than this specimen's moduli are.
    pub fn without_scale(mut self, share: f64) -> Result<Self> {
        let scaled = |(name, mean): (&String, &f64)| if is_modulus(name) { *mean } else { 0.0 };
        let along = self.constants.iter().zip(self.mean.iter()).map(scaled);
        let along = DVector::from_iterator(self.mean.len(), along);
        let mut own = self.covariance.clone();
        own.ger(-share * share, &along, &along, 1.0);
        let roots = [&self.covariance, &own].map(|c| c.clone().cholesky());
        let [Some(before), Some(after)] = roots else {
            let wanted = format!(
                "at most what {} itself leaves open of its moduli",
                self.name
            );
            return Err(Error::input("--shared-percent", wanted).found(100.0 * share));
        };
        // kernels and their covariance are moved as the covariance is
        let (before, after) = (before.l(), after.l());
        let moved = |centre: &DVector<f64>| {
            let z = before.solve_lower_triangular(&(centre - &self.mean))?;
            Some(&self.mean + &after * z)
        };
        let centres: Option<Vec<DVector<f64>>> = self.centres.iter().map(moved).collect();
        let height = self.kernel[(0, 0)] / self.covariance[(0, 0)];
        self.centres = centres.ok_or_else(|| Error::program(&self.name, "a root"))?;
        self.kernel = &own * height;
        self.covariance = own;
        Ok(self)
    }

    /// The specimen of a chain, whose columns `own` are constants with normal priors, `[mean, sd]`.
    ///
    /// # Errors
    /// The input's fault: constants that do not vary over the draws.
    pub fn of_draws(name: &str, draws: &Draws, own: &[(usize, [f64; 2])]) -> Result<Self> {
        let constants = own.iter().map(|(k, _)| draws.names()[*k].clone()).collect();
        let pick = |x: &[f64]| DVector::from_iterator(own.len(), own.iter().map(|(k, _)| x[*k]));
        let points: Vec<DVector<f64>> = draws.points().map(pick).collect();
        let log_prior = |x: &[f64]| -> f64 {
            let z = own.iter().map(|(k, [mean, sd])| (x[*k] - mean) / sd);
            z.map(|z| -0.5 * z * z).sum()
        };
        let without_prior: Vec<f64> = draws.points().map(|x| -log_prior(x)).collect();
        let weights = shares(&without_prior);
        let singular = || {
            Error::input(name, "constants that vary over the draws of a chain")
                .found(format!("{} draws", points.len()))
        };
        let left = 1.0 / (weights.iter().map(|w| w * w).sum::<f64>() * points.len() as f64);
        let priors: Vec<[f64; 2]> = own.iter().map(|(_, prior)| *prior).collect();
        let (centres, kernel, mean, covariance) = if left < LEAST_LEFT {
            let (mean, covariance) = divided(&points, &priors).ok_or_else(singular)?;
            (vec![mean.clone()], covariance.clone(), mean, covariance)
        } else {
            let (mean, covariance) = moments(points.iter(), &weights);
            let root = covariance.clone().cholesky().ok_or_else(singular)?.l();
            // the mixture's covariance is (1 - h^2) C of the centres and h^2 C of the kernels
            let d = own.len() as f64;
            let bandwidth = (4.0 / ((d + 2.0) * KERNELS as f64)).powf(1.0 / (d + 4.0));
            let by = (1.0 - bandwidth.powi(2)).sqrt();
            let centres = spread_of(&points, &weights, &mean, &root, by).ok_or_else(singular)?;
            let kernel = &covariance * bandwidth.powi(2);
            (centres, kernel, mean, covariance)
        };
        Ok(Self {
            name: name.into(),
            constants,
            centres,
            kernel,
            mean,
            covariance,
            priors,
            left,
        })
    }
}

/// Mean and covariance of a normal likelihood: the precision of the draws less that of the priors, and in directions of which the data say next
/// to nothing a hundredth of the priors'.
fn divided(points: &[DVector<f64>], priors: &[[f64; 2]]) -> Option<(DVector<f64>, DMatrix<f64>)> {
    const LEAST: f64 = 0.01;
    let d = priors.len();
    // in sds of the priors from their means
    let scaled: Vec<DVector<f64>> = points
        .iter()
        .map(|x| DVector::from_fn(d, |k, _| (x[k] - priors[k][0]) / priors[k][1]))
        .collect();
    let even = vec![1.0 / points.len() as f64; points.len()];
    let (mean, covariance) = moments(scaled.iter(), &even);
    let precision = covariance.cholesky()?.inverse();
    let (own, axes) = eigen(&(&precision - DMatrix::identity(d, d))).ok()?;
    let own = own.map(|p| p.max(LEAST));
    // what the data say of each direction: precision times mean, of which the priors', about zero, have no part
    let along = axes.tr_mul(&(precision * mean)).component_div(&own);
    let scale = DMatrix::from_fn(d, d, |i, j| if i == j { priors[i][1] } else { 0.0 });
    let turned = &scale * axes;
    let middle = DVector::from_fn(d, |k, _| priors[k][0]);
    let spread = DMatrix::from_diagonal(&own.map(|p| 1.0 / p));
    Some((
        middle + &turned * along,
        &turned * spread * turned.transpose(),
    ))
}

pub fn moments<'a>(
    points: impl Iterator<Item = &'a DVector<f64>> + Clone,
    weights: &[f64],
) -> (DVector<f64>, DMatrix<f64>) {
    let d = points.clone().next().map_or(0, DVector::len);
    let mut mean = DVector::zeros(d);
    for (x, w) in points.clone().zip(weights) {
        mean.axpy(*w, x, 1.0);
    }
    let mut covariance = DMatrix::zeros(d, d);
    for (x, w) in points.zip(weights) {
        let off = x - &mean;
        covariance.ger(*w, &off, &off, 1.0);
    }
    (mean, covariance)
}

/// [`KERNELS`] of the points, one of each part of equal weight, moved so that their mean is `mean` and their covariance `by`^2 `root` `root`^T.
fn spread_of(
    points: &[DVector<f64>],
    weights: &[f64],
    mean: &DVector<f64>,
    root: &DMatrix<f64>,
    by: f64,
) -> Option<Vec<DVector<f64>>> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let mut taken = Vec::with_capacity(KERNELS);
    part(points, weights, &mut order, SPLITS, &mut taken);
    let taken: Vec<&DVector<f64>> = taken.into_iter().map(|k| &points[k]).collect();
    let even = vec![1.0 / taken.len() as f64; taken.len()];
    let (middle, covariance) = moments(taken.iter().copied(), &even);
    let own = covariance.cholesky()?.l();
    let moved = |x: &&DVector<f64>| {
        let z = own.solve_lower_triangular(&(*x - &middle))?;
        Some(mean + root * z * by)
    };
    taken.iter().map(moved).collect()
}

/// Split points into halves of equal weight, along one constant after the other, and take the middle one of each part by its place in the chain,
/// which has nothing to do with where it lies.
fn part(
    points: &[DVector<f64>],
    weights: &[f64],
    order: &mut [usize],
    splits: usize,
    taken: &mut Vec<usize>,
) {
    if splits == 0 || order.len() < 2 {
        order.sort_unstable();
        taken.extend(order.get(order.len() / 2));
        return;
    }
    let axis = splits % points[order[0]].len();
    order.sort_by(|a, b| points[*a][axis].total_cmp(&points[*b][axis]));
    let half = 0.5 * order.iter().map(|k| weights[*k]).sum::<f64>();
    let mut below = 0.0;
    let lower = order.iter().take_while(|k| {
        below += weights[**k];
        below < half
    });
    let middle = lower.count().clamp(1, order.len() - 1);
    let (low, high) = order.split_at_mut(middle);
    part(points, weights, low, splits - 1, taken);
    part(points, weights, high, splits - 1, taken);
}
