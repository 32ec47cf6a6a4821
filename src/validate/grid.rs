//! The article's way to the posterior: a grid over the constants. Here it is the check on the chains.

use nalgebra::DMatrix;

use super::quadrature::{GridMoments, Marginalised, Node};
use crate::chain::Draws;
use crate::error::{Error, Result};
use crate::numeric::shares;
use crate::parameter::is_modulus;
use crate::posterior::PosteriorDensity;
use crate::sample::Laplace;

/// Nodes along a side by default, as in the article.
pub const NODES: usize = 17;

/// Automatic bounds reach this many sd from the mean.
pub const REACH_SDS: f64 = 5.0;

/// A grid has at most this many nodes.
const MOST: usize = 4_000_000;

/// A posterior on a grid, noise integrated.
pub struct PosteriorGrid {
    /// Bounds of each constant.
    pub bounds: Vec<[f64; 2]>,
    /// Nodes along each side.
    pub side: usize,
    pub moments: GridMoments,
    /// Coordinates of each side's nodes, and the share of the probability at each.
    pub marginals: Vec<Vec<(f64, f64)>>,
    /// Sentences about a grid that is too coarse or too narrow.
    pub warnings: Vec<String>,
    /// All nodes, points x constants.
    pub thetas: Vec<f64>,
    /// Their integrals over the noise.
    pub nodes: Vec<Node>,
}

/// Check bounds of the constants.
///
/// # Errors
/// Of the input: bounds that are reversed or not finite, or leave no admissible ply between them.
pub fn check_bounds(posterior: &PosteriorDensity, bounds: &[[f64; 2]]) -> Result<()> {
    for (name, [low, high]) in posterior.constant_names().iter().zip(bounds) {
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(Error::input(
                format!("--bounds {name}"),
                "a lower bound below the upper one",
            )
            .found(format!("{low}:{high}")));
        }
        if is_modulus(name) && *low <= 0.0 {
            return Err(Error::input(
                format!("--bounds {name}"),
                "moduli above 0, which an admissible ply has",
            )
            .found(format!("{low}:{high}")));
        }
    }
    let corner = |pick: &dyn Fn(usize) -> usize| -> Vec<f64> {
        bounds.iter().enumerate().map(|(k, b)| b[pick(k)]).collect()
    };
    let middle: Vec<f64> = bounds.iter().map(|b| 0.5 * (b[0] + b[1])).collect();
    let possible = (0..1_usize << bounds.len())
        .map(|c| corner(&|k| c >> k & 1))
        .chain([middle])
        .any(|theta| posterior.is_admissible(&theta));
    if !possible {
        return Err(Error::input(
            "--bounds",
            "bounds with an admissible ply between them (nu12^2 < E1/E2)",
        )
        .found(format!("{bounds:?}")));
    }
    Ok(())
}

/// Bounds of mean +- 5 sd, within the priors' cuts.
pub fn automatic(posterior: &PosteriorDensity, mean: &[f64], sd: &[f64]) -> Vec<[f64; 2]> {
    posterior
        .marginals()
        .iter()
        .zip(mean.iter().zip(sd))
        .zip(posterior.constant_names())
        .map(|((m, (mean, sd)), name)| {
            let [low, high] = m.bounds();
            let floor = if is_modulus(name) {
                1e-3 * mean.abs()
            } else {
                f64::NEG_INFINITY
            };
            [
                (mean - REACH_SDS * sd).max(low).max(floor),
                (mean + REACH_SDS * sd).min(high),
            ]
        })
        .collect()
}

impl PosteriorGrid {
    /// Evaluate at `side` nodes a parameter over `bounds`.
    ///
    /// # Errors
    /// Of the input: too many nodes, fewer than 3 a side, bounds that make no sense, no probability anywhere.
    pub fn new(
        posterior: &PosteriorDensity,
        mode: &Laplace,
        bounds: &[[f64; 2]],
        side: usize,
    ) -> Result<Self> {
        check_bounds(posterior, bounds)?;
        let d = posterior.constants();
        let count = side
            .checked_pow(d as u32)
            .filter(|n| side >= 3 && *n <= MOST);
        let Some(count) = count else {
            return Err(Error::input(
                "--nodes",
                format!("at least 3 nodes a parameter, and at most {MOST} in all"),
            )
            .found(format!("{side} for {d} parameters")));
        };
        let axis = |k: usize, i: usize| {
            let [low, high] = bounds[k];
            low + (high - low) * i as f64 / (side - 1) as f64
        };
        let index = |node: usize, k: usize| node / side.pow((d - 1 - k) as u32) % side;
        let thetas: Vec<f64> = (0..count)
            .flat_map(|node| (0..d).map(move |k| (node, k)))
            .map(|(node, k)| axis(k, index(node, k)))
            .collect();
        let nodes = Marginalised::new(posterior, mode).evaluate(&thetas)?;
        let cell: f64 = (0..d).map(|k| (axis(k, 1) - axis(k, 0)).ln()).sum();
        // the trapezoid rule: nodes on a border count by half
        let log_weight = |node: usize| {
            let borders =
                (0..d).filter(|&k| matches!(index(node, k), i if i == 0 || i + 1 == side));
            cell - borders.count() as f64 * 2_f64.ln()
        };
        let moments = GridMoments::of(posterior, &thetas, &nodes, log_weight);
        if !moments.log_evidence.is_finite() {
            return Err(
                Error::input("--bounds", "bounds that hold some of the posterior")
                    .found(format!("{bounds:?}")),
            );
        }
        let mut marginals: Vec<Vec<(f64, f64)>> = (0..d)
            .map(|k| (0..side).map(|i| (axis(k, i), 0.0)).collect())
            .collect();
        for (node, value) in nodes.iter().enumerate() {
            let p = (value.log + log_weight(node) - moments.log_evidence).exp();
            for (k, marginal) in marginals.iter_mut().enumerate() {
                marginal[index(node, k)].1 += p;
            }
        }
        let mut grid = Self {
            bounds: bounds.to_vec(),
            side,
            moments,
            marginals,
            warnings: Vec::new(),
            thetas,
            nodes,
        };
        grid.judge(posterior);
        Ok(grid)
    }

    fn judge(&mut self, posterior: &PosteriorDensity) {
        let d = self.bounds.len();
        let spacing: Vec<f64> = self
            .bounds
            .iter()
            .map(|[low, high]| (high - low) / (self.side - 1) as f64)
            .collect();
        let names = posterior.constant_names();
        for k in 0..d {
            let sd = self.moments.sd[k];
            // A grid that misses the posterior puts everything on one node: its own sd is no measure then.
            if spacing[k] > sd {
                self.warnings.push(format!(
                    "the grid is too coarse for {}: spacing {:.3} sd",
                    names[k],
                    spacing[k] / sd
                ));
            }
            let [low, high] = posterior.marginals()[k].bounds();
            let edges = [
                (0, low, self.bounds[k][0]),
                (self.side - 1, high, self.bounds[k][1]),
            ];
            for (i, cut, bound) in edges {
                let mass = self.marginals[k][i].1;
                if mass > BORDER_MASS && cut != bound {
                    self.warnings.push(format!(
                        "the grid is too narrow for {}: {:.1} % of the probability lies on its border {bound}",
                        names[k], 100.0 * mass
                    ));
                }
            }
        }
        let error = self.lattice_error(&spacing);
        if error > COARSE {
            self.warnings.push(format!(
                "the grid is too coarse for the correlation of the constants: its sums may be {:.1} % off", 100.0 * error
            ));
        }
    }

    /// Relative error of a sum over the lattice of a normal density of this covariance (Poisson summation), from the
    /// nearest frequencies.
    fn lattice_error(&self, spacing: &[f64]) -> f64 {
        let d = spacing.len();
        let scaled = DMatrix::from_fn(d, d, |i, j| {
            let m = &self.moments;
            m.correlation[i][j] * m.sd[i] * m.sd[j] / (spacing[i] * spacing[j])
        });
        let count = 3_usize.pow(d as u32);
        (1..count)
            .map(|c| {
                let digits = nalgebra::DVector::from_fn(d, |k, _| {
                    [0.0, 1.0, -1.0][c / 3_usize.pow(k as u32) % 3]
                });
                let q = digits.dot(&(&scaled * &digits));
                (-2.0 * std::f64::consts::PI.powi(2) * q).exp()
            })
            .sum()
    }

    /// Draws of the nodes by their probability, in `chains` chains of `draws` draws, for programs that read chains. The
    /// noise of a draw is the node's mean; draws are in an even order of probability, so that the seed does not matter.
    ///
    /// # Errors
    /// The program's, if shapes disagree.
    pub fn draws(&self, chains: usize, draws: usize) -> Result<Draws> {
        let d = self.bounds.len();
        let total = chains * draws;
        let logs: Vec<f64> = self.nodes.iter().map(|n| n.log).collect();
        let mut chosen = Vec::with_capacity(total);
        let mut reached = 0.0;
        for (i, share) in shares(&logs).into_iter().enumerate() {
            reached += share * total as f64;
            while (chosen.len() as f64) + 0.5 < reached && chosen.len() < total {
                chosen.push(i);
            }
        }
        let last = chosen.last().copied().unwrap_or(0);
        chosen.resize(total, last);
        // a stride prime to the total scatters neighbours over the chains
        let stride = (total as f64 * 0.618_034) as usize | 1;
        let stride = (stride..)
            .step_by(2)
            .find(|s| gcd(*s, total) == 1)
            .unwrap_or(1);
        let names = self.moments.names.clone();
        let noisy = names.len() > d;
        let (mut values, mut lp) = (Vec::new(), Vec::new());
        for k in 0..total {
            let i = chosen[k * stride % total];
            values.extend_from_slice(&self.thetas[i * d..(i + 1) * d]);
            values.extend(noisy.then_some(self.nodes[i].noise[0]));
            lp.push(self.nodes[i].log);
        }
        Draws::new(names, (0..chains).collect(), values, lp)
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Probability on one border that makes a grid too narrow.
const BORDER_MASS: f64 = 1e-3;

/// Relative error of the grid's sums that makes it too coarse.
const COARSE: f64 = 0.01;
