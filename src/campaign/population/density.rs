//! The density of a population's means, sds and correlations, given what every specimen says of its own constants.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::specimen::Specimen;
use crate::sample::{DensityError, LogDensity};

/// Exponent of the correlations' prior, det(R)^(eta - 1) (Lewandowski, Kurowicka & Joe 2009).
const ETA: f64 = 4.0;

/// Constants of specimens are normal: N(mean, S R S), S the sds between specimens, R their correlations. Sampled are the means, the logarithms of
/// the sds, and atanh of the canonical partial correlations.
///
/// Priors: of the means what the runs' models know of the material, if all know the same, which every specimen's likelihood is without (else
/// flat); an sd 1/(sd + w), w what a specimen leaves open of the constant. Where that is nothing it is 1/sd, by which the bounds
/// of a normal population's percentiles are those of classical tolerance factors (Geisser & Cornfield 1963 for one constant); where it is more
/// than the sd, it is flat, so that a spread of nothing is possible. No sd is larger than its constant.
pub struct Population<'a> {
    names: Vec<String>,
    specimens: &'a [Specimen],
    /// w of each constant.
    open: Vec<f64>,
    /// Of the means, [mean, sd]; none where the runs' differ.
    priors: Option<&'a [[f64; 2]]>,
}

/// A population.
pub struct NormalPopulation {
    pub mean: DVector<f64>,
    pub sds: Vec<f64>,
    /// Lower root of the correlations.
    pub root: DMatrix<f64>,
}

impl<'a> Population<'a> {
    pub fn new(specimens: &'a [Specimen]) -> Self {
        let constants = specimens.first().map_or(&[][..], |s| &s.constants);
        let n = constants.len();
        let mut names: Vec<String> = constants.iter().map(|c| format!("mean_{c}")).collect();
        names.extend(constants.iter().map(|c| format!("ln_sd_{c}")));
        for i in 1..n {
            for j in 0..i {
                names.push(format!("partial_{}_{}", constants[j], constants[i]));
            }
        }
        let open = |k: usize| {
            let mut own: Vec<f64> = specimens
                .iter()
                .map(|s| s.covariance[(k, k)].sqrt())
                .collect();
            crate::numeric::median(&mut own)
        };
        Self {
            names,
            specimens,
            priors: common(specimens),
            open: (0..n).map(open).collect(),
        }
    }

    pub fn constants(&self) -> usize {
        self.open.len()
    }

    /// A point to start from and the sd to start with.
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let count = self.specimens.len() as f64;
        let (mut centre, mut sds) = (Vec::new(), Vec::new());
        let mut widths = Vec::new();
        for (k, open) in self.open.iter().enumerate() {
            let own = || self.specimens.iter().map(|s| s.mean[k]);
            let mean = own().sum::<f64>() / count;
            let variance = own().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
            let between = (variance - open * open)
                .max(0.1 * variance)
                .max(1e-12 * mean * mean);
            centre.push(mean);
            sds.push((variance / count).sqrt().max(1e-9 * mean.abs()));
            widths.push(0.5 * between.ln());
        }
        let n = self.constants();
        centre.extend(widths);
        sds.extend(vec![(0.5 / (count - 1.0)).sqrt(); n]);
        centre.extend(vec![0.0; n * (n - 1) / 2]);
        sds.extend(vec![0.2; n * (n - 1) / 2]);
        (centre, sds)
    }

    /// The population of a point, and the log density of its priors there.
    pub fn place(&self, x: &[f64]) -> (NormalPopulation, f64) {
        let n = self.constants();
        let sds: Vec<f64> = x[n..2 * n].iter().map(|v| v.exp()).collect();
        let mut log_prior: f64 = sds
            .iter()
            .zip(&self.open)
            .map(|(s, w)| s.ln() - (s + w).ln())
            .sum();
        let mut root = DMatrix::identity(n, n);
        let mut at = x[2 * n..].iter();
        for i in 1..n {
            let mut rest = 1.0_f64;
            for (j, z) in at.by_ref().take(i).enumerate() {
                let partial = z.tanh();
                let square = 1.0 / z.cosh().powi(2);
                root[(i, j)] = partial * rest.sqrt();
                rest *= square;
                // Beta density of a partial correlation, with the derivative of tanh
                log_prior += (ETA + 0.5 * (n - 2 - j) as f64) * square.ln();
            }
            root[(i, i)] = rest.sqrt();
        }
        let mean = DVector::from_column_slice(&x[..n]);
        let known = self.priors.unwrap_or_default().iter().zip(&mean);
        log_prior += known
            .map(|([m, s], x)| -0.5 * ((x - m) / s).powi(2))
            .sum::<f64>();
        (NormalPopulation { mean, sds, root }, log_prior)
    }
}

/// The priors of all specimens, if they are the same.
pub fn common(specimens: &[Specimen]) -> Option<&[[f64; 2]]> {
    let first = &specimens.first()?.priors;
    let same = specimens.iter().all(|s| s.priors == *first);
    same.then_some(first)
}

impl NormalPopulation {
    /// Covariance between specimens.
    pub fn covariance(&self) -> DMatrix<f64> {
        let mut lower = self.root.clone();
        for (mut row, sd) in lower.row_iter_mut().zip(&self.sds) {
            row *= *sd;
        }
        &lower * lower.transpose()
    }

    /// Covariance of a kernel's mean over the population, as its root; none where it is not positive definite.
    pub fn around(&self, specimen: &Specimen) -> Option<Cholesky<f64, Dyn>> {
        (self.covariance() + &specimen.kernel).cholesky()
    }

    /// Log densities of a specimen's kernels, and of their mixture.
    pub fn of_kernels(&self, specimen: &Specimen, around: &Cholesky<f64, Dyn>) -> (Vec<f64>, f64) {
        let lower = around.l_dirty();
        let n = self.mean.len();
        let log_det: f64 = (0..n).map(|k| lower[(k, k)].ln()).sum();
        let mut z = vec![0.0; n];
        let one = |centre: &DVector<f64>| {
            let mut square = 0.0;
            for i in 0..n {
                let known: f64 = (0..i).map(|j| lower[(i, j)] * z[j]).sum();
                z[i] = (centre[i] - self.mean[i] - known) / lower[(i, i)];
                square += z[i] * z[i];
            }
            -0.5 * square - log_det
        };
        let each: Vec<f64> = specimen.centres.iter().map(one).collect();
        let most = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = each.iter().map(|v| (v - most).exp()).sum();
        let all = most + (sum / each.len() as f64).ln();
        (each, all)
    }
}

impl LogDensity for Population<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        let (place, log_prior) = self.place(x);
        let mut constants = place.sds.iter().zip(place.mean.iter());
        if constants.any(|(sd, mean)| *sd > mean.abs()) {
            return Err(DensityError::Outside);
        }
        let one = |s: &Specimen| Some(place.of_kernels(s, &place.around(s)?).1);
        let likelihood: Option<f64> = self.specimens.iter().map(one).sum();
        // sds that overflow or vanish in f64 are outside the support
        likelihood
            .map(|l| l + log_prior)
            .filter(|l| l.is_finite())
            .ok_or(DensityError::Outside)
    }
}
