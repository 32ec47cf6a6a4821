//! The log posterior of the constants with the noise integrated out.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::error::Result;
use crate::numeric::{hermite, relative_weights};
use crate::posterior::PosteriorDensity;
use crate::sample::{Laplace, LogDensity};

/// What is known of a point of the constants once the noise is integrated out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Log of the integral of the density over the noise; -inf outside the support.
    pub log: f64,
    /// Mean of the noise there, nm (0 if it is declared), and of its square.
    pub noise: [f64; 2],
}

/// A posterior with its noise integrated out, by a rule about the mode's noise.
pub struct Marginalised<'a> {
    posterior: &'a PosteriorDensity,
    /// Noise (nm) and log weight of each node; one node without noise if it is declared.
    rule: Vec<(f64, f64)>,
}

/// Nodes over the noise.
const NOISE_NODES: usize = 7;

/// Points evaluated by one thread at a time.
const CHUNK: usize = 256;

impl<'a> Marginalised<'a> {
    /// The rule's place and width are those of the normal approximation in the logarithm of the noise.
    pub fn new(posterior: &'a PosteriorDensity, mode: &Laplace) -> Self {
        let d = posterior.constants();
        let rule = if posterior.dim() == d {
            vec![(0.0, 0.0)]
        } else {
            let centre = mode.mode[d];
            let sd = mode.covariance[d * posterior.dim() + d].sqrt() / centre;
            hermite(NOISE_NODES)
                .into_iter()
                .map(|(z, w)| {
                    let noise = centre * (sd * z).exp();
                    // d noise = noise d ln noise; the rule's own normal density is taken out
                    let log =
                        w.ln() + 0.5 * z * z + (sd * noise).ln() + 0.5 * std::f64::consts::TAU.ln();
                    (noise, log)
                })
                .collect()
        };
        Self { posterior, rule }
    }

    /// The integral at every point of `thetas` (points x constants), in parallel.
    ///
    /// # Errors
    /// Fatal ones of the density.
    pub fn evaluate(&self, thetas: &[f64]) -> Result<Vec<Node>> {
        let d = self.posterior.constants();
        let chunks = thetas.par_chunks(CHUNK * d);
        let nodes: Vec<Vec<Node>> = chunks.map(|c| self.chunk(c)).collect::<Result<_>>()?;
        Ok(nodes.concat())
    }

    fn chunk(&self, thetas: &[f64]) -> Result<Vec<Node>> {
        let (d, dim, k) = (
            self.posterior.constants(),
            self.posterior.dim(),
            self.rule.len(),
        );
        let count = thetas.len() / d;
        // parameter by parameter, as the density takes its points
        let mut points = vec![0.0; count * k * dim];
        for (i, theta) in thetas.chunks_exact(d).enumerate() {
            for (j, (noise, _)) in self.rule.iter().enumerate() {
                let at = i * k + j;
                for (parameter, x) in theta.iter().enumerate() {
                    points[parameter * count * k + at] = *x;
                }
                if dim > d {
                    points[d * count * k + at] = *noise;
                }
            }
        }
        let mut values = vec![0.0; count * k];
        self.posterior.values(&points, &mut values)?;
        Ok(values.chunks_exact(k).map(|v| self.sum(v)).collect())
    }

    fn sum(&self, values: &[f64]) -> Node {
        let terms = || values.iter().zip(&self.rule).map(|(v, (_, log))| v + log);
        let largest = terms().fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY || largest.is_nan() {
            return Node {
                log: f64::NEG_INFINITY,
                noise: [0.0; 2],
            };
        }
        let (mut sum, mut noise) = (0.0, [0.0; 2]);
        for (term, (x, _)) in terms().zip(&self.rule) {
            let weight = (term - largest).exp();
            sum += weight;
            noise[0] += weight * x;
            noise[1] += weight * x * x;
        }
        Node {
            log: largest + sum.ln(),
            noise: noise.map(|n| n / sum),
        }
    }
}

/// Mean, sd and correlation of weighted points.
#[derive(Debug, Clone, PartialEq)]
pub struct GridMoments {
    /// Names of the parameters; the noise last, unless it is declared.
    pub names: Vec<String>,
    pub mean: Vec<f64>,
    pub sd: Vec<f64>,
    /// Correlation of the constants, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Log of the integral of the density.
    pub log_evidence: f64,
}

impl GridMoments {
    /// Moments of points (points x constants) with their integrals over the noise and the log of the weight
    /// of each point.
    pub fn of(
        posterior: &PosteriorDensity,
        thetas: &[f64],
        nodes: &[Node],
        log_weight: impl Fn(usize) -> f64,
    ) -> Self {
        let d = posterior.constants();
        let logs: Vec<f64> = nodes
            .iter()
            .enumerate()
            .map(|(i, n)| n.log + log_weight(i))
            .collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights = relative_weights(&logs);
        let total: f64 = weights.iter().sum();
        let mut mean = DVector::zeros(d);
        let mut noise = [0.0; 2];
        for ((theta, w), node) in thetas.chunks_exact(d).zip(&weights).zip(nodes) {
            mean.axpy(w / total, &DVector::from_column_slice(theta), 1.0);
            (0..2).for_each(|k| noise[k] += w / total * node.noise[k]);
        }
        let mut covariance = DMatrix::zeros(d, d);
        for (theta, w) in thetas.chunks_exact(d).zip(&weights) {
            let r = DVector::from_column_slice(theta) - &mean;
            covariance.ger(w / total, &r, &r, 1.0);
        }
        let mut sd: Vec<f64> = (0..d).map(|k| covariance[(k, k)].sqrt()).collect();
        let correlation = (0..d)
            .map(|i| {
                (0..d)
                    .map(|j| covariance[(i, j)] / (sd[i] * sd[j]))
                    .collect()
            })
            .collect();
        let mut mean = mean.as_slice().to_vec();
        if posterior.dim() > d {
            mean.push(noise[0]);
            sd.push((noise[1] - noise[0] * noise[0]).max(0.0).sqrt());
        }
        Self {
            names: posterior.names().to_vec(),
            mean,
            sd,
            correlation,
            log_evidence: largest + total.ln(),
        }
    }
}
