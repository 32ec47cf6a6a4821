//! The article's Monte Carlo over the thickness at nodes of the grid, against the analytic marginal.

use std::time::Instant;

use rayon::prelude::*;

use crate::linearise::Column;
use crate::posterior::{GivenChoice, Posed, linear};
use crate::progress::Progress;
use crate::reduce::THICKNESS;
use crate::sample::{Key, LogDensity, Stream};

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

/// The thickness as a column of a density: its place among those that take part, its mean and its sd, mm.
fn thickness(posed: &Posed) -> Option<(usize, f64, f64)> {
    let all = linear(&posed.expanded.here);
    let is_thickness = |k: &&usize| all.get(**k).is_some_and(|c| c.name == THICKNESS);
    let place = posed.kept.iter().position(|k| is_thickness(&k))?;
    let Column { mean, sd, .. } = all[posed.kept[place]];
    Some((place, *mean, *sd))
}

/// The log likelihood of a point as a function of one amplitude, up to a constant: b t - g t^2 / 2.
#[derive(Clone, Copy)]
struct InAmplitude {
    slope: f64,
    precision: f64,
}

impl InAmplitude {
    /// At a point of a density, of the column at a place.
    fn at(posed: &Posed, x: &[f64], place: usize) -> Self {
        let (mean, covariance) =
            GivenChoice::at(&posed.density, x, posed.density.choice(0)).moments(&[place]);
        let variance = covariance[(0, 0)];
        Self {
            slope: mean[0] / variance,
            precision: 1.0 / variance - 1.0,
        }
    }

    /// Its logarithm with the amplitude integrated out over a normal distribution.
    fn integrated(&self, mean: f64, variance: f64) -> f64 {
        let whole = 1.0 + self.precision * variance;
        let square = (self.slope * variance + mean).powi(2) / whole - mean * mean;
        0.5 * (square / variance - whole.ln())
    }

    /// The same by the article's way, mean and variance of the response from samples of the thickness, and its standard error, by a jackknife
    /// over a hundred groups of samples. `responses` are amplitudes for which the linear column has the exact response.
    fn sampled(&self, responses: &[f64]) -> (f64, f64) {
        const GROUPS: usize = 100;
        let mut sums = [[0.0; 3]; GROUPS];
        for (k, t) in responses.iter().enumerate() {
            let sum = &mut sums[k % GROUPS];
            *sum = [sum[0] + 1.0, sum[1] + t, sum[2] + t * t];
        }
        let add = |a: [f64; 3], b: &[f64; 3], sign: f64| [0, 1, 2].map(|k| a[k] + sign * b[k]);
        let total = sums.iter().fold([0.0; 3], |a, b| add(a, b, 1.0));
        let value = |[n, sum, square]: [f64; 3]| {
            let mean = sum / n;
            self.integrated(mean, square / n - mean * mean)
        };
        let without: Vec<f64> = sums.iter().map(|s| value(add(total, s, -1.0))).collect();
        let groups = GROUPS as f64;
        let mean = without.iter().sum::<f64>() / groups;
        let square: f64 = without.iter().map(|v| (v - mean).powi(2)).sum();
        (value(total), ((groups - 1.0) / groups * square).sqrt())
    }
}

/// Compare at `nodes` random points of the box `bounds`, at a noise of a point, nm, where it is a parameter; none where the thickness is known.
pub fn compare(
    posed: &Posed,
    bounds: &[[f64; 2]],
    noise: Option<f64>,
    [nodes, samples]: [usize; 2],
    seed: u64,
    progress: &dyn Progress,
) -> Option<Comparison> {
    let (place, mean, sd) = thickness(posed)?;
    if nodes == 0 {
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
        if posed.density.is_admissible(&theta) {
            thetas.push(theta.into_iter().chain(noise).collect());
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
            let response = |h: &f64| (1.0 - mean / h) * mean / sd;
            let responses: Vec<f64> = thicknesses.iter().map(response).collect();
            let own = InAmplitude::at(posed, theta, place);
            let (value, error) = own.sampled(&responses);
            let seconds = began.elapsed().as_secs_f64();
            progress.step();
            ((value - own.integrated(0.0, 1.0), error), seconds)
        })
        .collect();
    progress.end();
    let began = Instant::now();
    const REPEAT: usize = 100;
    let mut sum = 0.0;
    for _ in 0..REPEAT {
        sum += thetas
            .iter()
            .map(|t| posed.density.value(t).unwrap_or(f64::NAN))
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
