//! What is known of one component's noise: the posterior over its correlation length l and ratio rho, from contrasts of
//! block averages and from local differences, and the point's variance averaged over it.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::error::Result;
use crate::field::covariance::{NOISE_LENGTHS_MM, RATIOS};
use crate::field::noise::Leftover;
use crate::field::reml::{Contrasts, Reml, Setting};
use crate::field::{BlockCovariance, Blocks, Matern};

/// The white noise of points as local differences see it.
pub(super) struct Local<'a> {
    /// Their variance, mm^2.
    pub variance: f64,
    /// Standard error of its logarithm.
    pub error: f64,
    /// What they see of correlated noise.
    pub leftover: &'a Leftover<'a>,
}

/// One component's noise.
pub(super) struct Component {
    /// The table of settings; `best` is the most likely one.
    pub reml: Reml,
    /// Covariance of block averages, averaged over the settings, at unit scale.
    pub covariance: BlockCovariance,
    /// Scale s^2 of that covariance, mm^2.
    pub scale2: f64,
    /// Mean of the logarithm of a point's variance (mm^2), and its variance.
    pub log_variance: (f64, f64),
}

/// A correlation length known to this (sd of its logarithm) is summed up by a normal approximation; one less known,
/// by the table.
const LOCALISED: f64 = 0.4;

/// Settings of smaller posterior probability are left out of the covariance.
const NEGLIGIBLE: f64 = 0.01;

/// Error of the logarithm of the variance that local differences see of correlated noise whose correlation has not
/// quite Matern's shape.
const SHAPE_ERROR: f64 = 0.5;

/// One setting with everything that is known at it.
#[derive(Clone, Copy)]
struct Weighed {
    /// The setting at its most likely s^2 given the blocks and the local differences.
    setting: Setting,
    /// Logarithm of a point's variance, and its variance at this setting.
    log_variance: (f64, f64),
    /// Log posterior density, up to a constant: s^2 integrated, before the prior over settings.
    log_density: f64,
}

struct Search<'a> {
    blocks: &'a Blocks,
    contrasts: &'a Contrasts<'a>,
    local: &'a Local<'a>,
}

impl Component {
    pub fn new(blocks: &Blocks, contrasts: &Contrasts<'_>, local: &Local<'_>) -> Result<Self> {
        let search = Search {
            blocks,
            contrasts,
            local,
        };
        let mut reml = contrasts.table(&NOISE_LENGTHS_MM, &RATIOS)?;
        let fractions = NOISE_LENGTHS_MM.map(|l| local.leftover.fraction(l));
        let table: Vec<Weighed> = reml
            .table
            .iter()
            .enumerate()
            .map(|(k, s)| search.weigh(s, fractions[k / RATIOS.len()]))
            .collect();
        let found = search.parts(&table)?;
        // White noise where it is the more probable, else the likeliest setting of correlated noise.
        let (white, correlated): (Vec<_>, Vec<_>) =
            found.iter().partition(|(_, w)| w.setting.ratio == 0.0);
        let is_white = white.iter().any(|(p, _)| *p >= 0.5);
        let kept = if is_white { white } else { correlated };
        let likeliest = kept.iter().map(|(_, w)| w);
        let likeliest = likeliest.reduce(|a, b| if b.log_density > a.log_density { b } else { a });
        reml.best = likeliest.map_or(reml.best, |w| w.setting);
        let mean = found.iter().map(|(p, w)| p * w.log_variance.0).sum::<f64>();
        let spread = found
            .iter()
            .map(|(p, w)| p * (w.log_variance.1 + (w.log_variance.0 - mean).powi(2)))
            .sum();
        let (covariance, scale2) = average(blocks, &found, mean)?;
        Ok(Self {
            reml,
            covariance,
            scale2,
            log_variance: (mean, spread),
        })
    }
}

impl Search<'_> {
    /// A setting with the white noise of local differences taken into account: the restricted likelihood times a
    /// lognormal for what they see, s^2 (nbar + rho f).
    fn weigh(&self, setting: &Setting, fraction: f64) -> Weighed {
        let nu = self.contrasts.count() as f64;
        let nbar = self.blocks.mean_count();
        let seen = nbar + setting.ratio * fraction;
        let expected = (self.local.variance / seen).max(f64::MIN_POSITIVE).ln();
        // Real noise need not be Matern's at distances far below its length: the blocks decide over its correlated part.
        let share = setting.ratio * fraction / seen;
        let precision = 1.0 / (self.local.error.powi(2) + (SHAPE_ERROR * share).powi(2));
        let profile = setting.scale2.ln();
        let mut x = profile;
        let mut curvature = 0.5 * nu;
        for _ in 0..50 {
            let ratio = (profile - x).exp();
            let slope = -0.5 * nu * (1.0 - ratio) - (x - expected) * precision;
            curvature = 0.5 * nu * ratio + precision;
            x += (slope / curvature).clamp(-1.0, 1.0);
        }
        let lost = 0.5 * nu * (x - profile + (profile - x).exp() - 1.0);
        let penalty = 0.5 * (x - expected).powi(2) * precision;
        Weighed {
            setting: Setting {
                scale2: x.exp(),
                ..*setting
            },
            log_variance: (x + (nbar + setting.ratio).ln(), 1.0 / curvature),
            log_density: setting.log_likelihood - lost - penalty
                + 0.5 * (precision / curvature).ln(),
        }
    }

    fn at(&self, matern: &Matern, fraction: f64, ratio: f64) -> Result<Weighed> {
        let covariance = BlockCovariance::new(self.blocks, matern, ratio)?;
        Ok(self.weigh(&self.contrasts.at(&covariance)?, fraction))
    }

    /// Settings with their posterior probabilities. Half the prior probability lies on white noise, half on
    /// correlated noise, evenly over the logarithms of length and ratio: a correlation is found where the data ask for it.
    fn parts(&self, table: &[Weighed]) -> Result<Vec<(f64, Weighed)>> {
        let better = |a: Weighed, b: Weighed| if b.log_density > a.log_density { b } else { a };
        let correlated: Vec<Weighed> = table
            .iter()
            .filter(|w| w.setting.ratio > 0.0)
            .copied()
            .collect();
        let white = table.iter().find(|w| w.setting.ratio == 0.0).copied();
        let Some(start) = correlated.iter().copied().reduce(better) else {
            return Ok(white.into_iter().map(|w| (1.0, w)).collect());
        };
        let prior = -(correlated.len() as f64).ln();
        let mut weighed: Vec<(f64, Weighed)> = Vec::new();
        weighed.extend(white.map(|w| (w.log_density, w)));
        // Where no setting of the table is much likelier than white noise there is nothing to refine.
        let hopeless = white.is_some_and(|w| start.log_density < w.log_density + NEGLIGIBLE_NATS);
        match if hopeless { None } else { self.refine(start)? } {
            Some(found) => weighed.extend(found),
            None => weighed.extend(correlated.iter().map(|w| (w.log_density + prior, *w))),
        }
        let largest = weighed.iter().fold(f64::NEG_INFINITY, |a, w| a.max(w.0));
        let sum: f64 = weighed.iter().map(|w| (w.0 - largest).exp()).sum();
        Ok(weighed
            .into_iter()
            .map(|(log, w)| ((log - largest).exp() / sum, w))
            .collect())
    }

    /// Climb to the most likely length and share, and integrate the density around them. None if the data do not say
    /// where the length is.
    ///
    /// The share is the logit of the part of what local differences see that is correlated noise: at a given share
    /// both sources of information ask for the same scale at each length.
    fn refine(&self, start: Weighed) -> Result<Option<Vec<(f64, Weighed)>>> {
        let length = start.setting.length_mm;
        let fraction = self.local.leftover.fraction(length);
        let share = (start.setting.ratio * fraction / self.blocks.mean_count()).ln();
        let mut centre = [length.ln(), share.clamp(LOW[1], HIGH[1])];
        let mut step = [0.25, 0.8];
        let mut around = self.around(centre, step)?;
        for _ in 0..ROUNDS {
            let fit = Quadratic::new(&around, |w| w.log_density);
            let (newton, sd) = fit.newton();
            let best = (0..9).fold(4, |a, b| {
                if around[b].log_density > around[a].log_density {
                    b
                } else {
                    a
                }
            });
            let lattice = [(best / 3) as f64 - 1.0, (best % 3) as f64 - 1.0];
            let mut close = true;
            for k in 0..2 {
                // towards the maximum, but not to where the lattice says it is lower
                let by = newton[k].clamp(lattice[k] - 0.6, lattice[k] + 0.6);
                let to = (centre[k] + by * step[k]).clamp(LOW[k], HIGH[k]);
                close &= (to - centre[k]).abs() < 0.3 * sd[k] * step[k];
                centre[k] = to;
                let wanted = sd[k].clamp(0.3, 1.5);
                close &= (0.5..1.5).contains(&sd[k]);
                step[k] = (step[k] * wanted).min(LARGEST_STEP[k]);
            }
            around = self.around(centre, step)?;
            if close {
                break;
            }
        }
        let covariance = Quadratic::new(&around, |w| w.log_density).covariance();
        self.integrate(centre, step, covariance)
    }

    /// Quadrature over the density about `centre`: settings with the logs of their probabilities relative to the
    /// prior's. In the length the density is nearly normal (Gauss-Hermite); in the share it may be level up to its
    /// bound, where there is no white noise (Gauss-Legendre over what lies within [`REACH`] sds and the bounds).
    fn integrate(
        &self,
        centre: [f64; 2],
        step: [f64; 2],
        covariance: [[f64; 2]; 2],
    ) -> Result<Option<Vec<(f64, Weighed)>>> {
        let sd = [0, 1].map(|k| covariance[k][k].sqrt() * step[k]);
        if sd[0] > LOCALISED {
            return Ok(None);
        }
        let correlation = covariance[0][1] / (covariance[0][0] * covariance[1][1]).sqrt();
        let rest = sd[1] * (1.0 - correlation * correlation).sqrt();
        let area: f64 = (0..2).map(|k| HIGH[k] - LOW[k]).product();
        let (mut places, mut logs) = (Vec::new(), Vec::new());
        for (z, weight) in HERMITE {
            let middle = centre[1] + sd[1] * correlation * z;
            let middle = middle.clamp(LOW[1] + rest, HIGH[1] - rest.min(1.0));
            let low = (middle - REACH * rest).max(LOW[1]);
            let high = (middle + REACH * rest).min(HIGH[1]);
            let volume = weight.ln() + 0.5 * z * z + (TAU.sqrt() * sd[0]).ln() - area.ln();
            for (x, weight) in LEGENDRE {
                places.push([centre[0] + sd[0] * z, low + x * (high - low)]);
                logs.push(volume + (weight * (high - low)).ln());
            }
        }
        let settings = self.settings(&places, LEGENDRE.len())?;
        let parts = settings.into_iter().zip(logs);
        Ok(Some(
            parts.map(|(w, log)| (w.log_density + log, w)).collect(),
        ))
    }

    /// The nine settings `step` around `centre`, shares innermost.
    fn around(&self, centre: [f64; 2], step: [f64; 2]) -> Result<Vec<Weighed>> {
        let places: Vec<[f64; 2]> = (0..9)
            .map(|i| {
                let by = [(i / 3) as f64 - 1.0, (i % 3) as f64 - 1.0];
                [0, 1].map(|k| centre[k] + by[k] * step[k])
            })
            .collect();
        self.settings(&places, 3)
    }

    /// Settings at places (log length, share), `each` of one length in a row.
    fn settings(&self, places: &[[f64; 2]], each: usize) -> Result<Vec<Weighed>> {
        let lengths: Vec<(Matern, f64)> = places
            .par_chunks(each)
            .map(|row| {
                let l = row[0][0].exp();
                (Matern::new(self.blocks, l), self.local.leftover.fraction(l))
            })
            .collect();
        let one = |(i, place): (usize, &[f64; 2])| -> Result<Weighed> {
            let (matern, fraction) = &lengths[i / each];
            let ratio = place[1].exp() * self.blocks.mean_count() / fraction.max(1e-9);
            self.at(matern, *fraction, ratio)
        };
        let results: Vec<Result<Weighed>> = places.par_iter().enumerate().map(one).collect();
        results.into_iter().collect()
    }
}

/// Nodes and weights of the mean over a standard normal distribution.
const HERMITE: [(f64, f64); 5] = [
    (-2.856_970_013_872_805_6, 0.011_257_411_327_720_69),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_64),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_64),
    (2.856_970_013_872_805_6, 0.011_257_411_327_720_69),
];

/// Nodes and weights of the mean over [0, 1].
const LEGENDRE: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_5),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// Sds of the share to either side over which the density is integrated.
const REACH: f64 = 3.0;

/// Logarithms of the lengths (0.2 to 1.5 mm), and the shares, between which correlated noise is sought.
const LOW: [f64; 2] = [-1.609, -6.0];
const HIGH: [f64; 2] = [0.405, 6.0];

/// The lattice is not made coarser than this.
const LARGEST_STEP: [f64; 2] = [0.3, 1.5];

/// Rounds of the climb.
const ROUNDS: usize = 6;

/// Nats by which some correlated setting must beat white noise to make a climb worth its while.
const NEGLIGIBLE_NATS: f64 = 3.0;

/// A quadratic through the nine values of a 3 x 3 lattice, in units of its steps.
struct Quadratic {
    gradient: [f64; 2],
    hessian: [[f64; 2]; 2],
}

/// Variance, in steps, of a direction in which the density hardly bends.
const FLAT: f64 = 9.0;

impl Quadratic {
    fn new(around: &[Weighed], value: impl Fn(&Weighed) -> f64) -> Self {
        let at = |i: usize, j: usize| value(&around[3 * i + j]);
        let middle = at(1, 1);
        let mixed = 0.25 * (at(2, 2) + at(0, 0) - at(2, 0) - at(0, 2));
        Self {
            gradient: [0.5 * (at(2, 1) - at(0, 1)), 0.5 * (at(1, 2) - at(1, 0))],
            hessian: [
                [at(2, 1) + at(0, 1) - 2.0 * middle, mixed],
                [mixed, at(1, 2) + at(1, 0) - 2.0 * middle],
            ],
        }
    }

    /// Inverse of the negative Hessian, with a variance of at most [`FLAT`] in each direction.
    fn covariance(&self) -> [[f64; 2]; 2] {
        let h = &self.hessian;
        let (a, b) = ((-h[0][0]).max(1.0 / FLAT), (-h[1][1]).max(1.0 / FLAT));
        let limit = 0.95 * (a * b).sqrt();
        let c = (-h[0][1]).clamp(-limit, limit);
        let determinant = a * b - c * c;
        [
            [b / determinant, -c / determinant],
            [-c / determinant, a / determinant],
        ]
    }

    /// Newton's step to the maximum, and the sd of each direction.
    fn newton(&self) -> ([f64; 2], [f64; 2]) {
        let c = self.covariance();
        let g = self.gradient;
        (
            [0, 1].map(|k| c[k][0] * g[0] + c[k][1] * g[1]),
            [0, 1].map(|k| c[k][k].sqrt()),
        )
    }
}

/// The covariance averaged over settings with their probabilities, scaled so that a point has the variance
/// exp(`log_variance`).
fn average(
    blocks: &Blocks,
    found: &[(f64, Weighed)],
    log_variance: f64,
) -> Result<(BlockCovariance, f64)> {
    let kept: Vec<&(f64, Weighed)> = found.iter().filter(|(p, _)| *p > NEGLIGIBLE).collect();
    let white: f64 = kept.iter().map(|(p, w)| p * w.setting.scale2).sum();
    let mut lengths: Vec<(f64, f64)> = Vec::new();
    for (p, w) in &kept {
        let ratio = p * w.setting.scale2 * w.setting.ratio / white;
        match lengths.iter_mut().find(|(l, _)| *l == w.setting.length_mm) {
            Some((_, sum)) => *sum += ratio,
            None => lengths.push((w.setting.length_mm, ratio)),
        }
    }
    lengths.retain(|(_, ratio)| *ratio > 0.0);
    let materns: Vec<Matern> = lengths
        .iter()
        .map(|(l, _)| Matern::new(blocks, *l))
        .collect();
    let parts: Vec<(&Matern, f64)> = materns
        .iter()
        .zip(&lengths)
        .map(|(m, (_, r))| (m, *r))
        .collect();
    let covariance = BlockCovariance::of_several(blocks, &parts)?;
    let scale2 = log_variance.exp() / covariance.point_variance();
    Ok((covariance, scale2))
}
