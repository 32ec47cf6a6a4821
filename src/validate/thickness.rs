//! The article's Monte Carlo over the thickness at nodes of the grid, against the analytic marginal.

use std::time::Instant;

use rayon::prelude::*;

use crate::infer::Posterior;
use crate::progress::Progress;
use crate::sample::{Key, Stream};

/// Samples of the thickness at each node, as in the article.
pub const SAMPLES: usize = 4000;

/// Lane of the random streams, which no walker has.
const LANE: u64 = 1 << 62;

/// Both ways at some nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    pub nodes: usize,
    /// Samples of the thickness at each.
    pub samples: usize,
    /// Difference of the log likelihoods (Monte Carlo minus analytic) at each node, and its Monte Carlo standard error.
    pub differences: Vec<(f64, f64)>,
    /// Seconds for one node by each way (Monte Carlo, analytic), on one thread.
    pub seconds: [f64; 2],
}

impl Comparison {
    /// Largest difference in Monte Carlo standard errors.
    pub fn worst(&self) -> f64 {
        self.scaled().fold(0.0, |a, z| a.max(z.abs()))
    }

    /// Root mean square difference in Monte Carlo standard errors.
    pub fn rms(&self) -> f64 {
        (self.scaled().map(|z| z * z).sum::<f64>() / self.nodes.max(1) as f64).sqrt()
    }

    fn scaled(&self) -> impl Iterator<Item = f64> {
        self.differences.iter().map(|(d, e)| d / e)
    }
}

/// Compare at `nodes` random points of the box `bounds`, at noise scale `scale`; none where the thickness is known.
pub fn compare(
    posterior: &Posterior,
    bounds: &[[f64; 2]],
    scale: f64,
    [nodes, samples]: [usize; 2],
    seed: u64,
    progress: &dyn Progress,
) -> Option<Comparison> {
    let likelihood = posterior.likelihood();
    let (mean, sd) = likelihood.thickness();
    if sd <= 0.0 || nodes == 0 {
        return None;
    }
    // a stream for the nodes, then one for each: another seed shares none of them, nor do walkers
    let stream = |of: usize| {
        let ensemble = of as u64;
        Stream::at(Key { seed, ensemble }, LANE, 0)
    };
    let mut rng = stream(0);
    let mut thetas: Vec<Vec<f64>> = Vec::new();
    while thetas.len() < nodes {
        let theta: Vec<f64> = bounds
            .iter()
            .map(|[low, high]| low + (high - low) * rng.uniform())
            .collect();
        // bounds hold admissible plies (checked), but not every point of them is one
        if posterior.is_admissible(&theta) {
            thetas.push(theta);
        }
    }
    progress.begin("Monte Carlo over the thickness", Some(nodes as u64));
    let results: Vec<((f64, f64), f64)> = thetas
        .par_iter()
        .enumerate()
        .map(|(i, theta)| {
            let mut rng = stream(1 + i);
            let began = Instant::now();
            let thicknesses: Vec<f64> = (0..samples).map(|_| mean + sd * rng.normal()).collect();
            let (value, error) = likelihood.sampled_log_likelihood(theta, scale, &thicknesses);
            let seconds = began.elapsed().as_secs_f64();
            progress.step();
            (
                (value - likelihood.log_likelihood(theta, scale), error),
                seconds,
            )
        })
        .collect();
    progress.end();
    let began = Instant::now();
    const REPEAT: usize = 100;
    let mut sum = 0.0;
    for _ in 0..REPEAT {
        sum += thetas
            .iter()
            .map(|t| likelihood.log_likelihood(t, scale))
            .sum::<f64>();
    }
    std::hint::black_box(sum);
    let analytic = began.elapsed().as_secs_f64() / (REPEAT * nodes) as f64;
    Some(Comparison {
        nodes,
        samples,
        seconds: [
            results.iter().map(|r| r.1).sum::<f64>() / nodes as f64,
            analytic,
        ],
        differences: results.into_iter().map(|r| r.0).collect(),
    })
}
