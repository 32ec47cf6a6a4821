//! What is known of one component's noise: the posterior over its correlation length l and ratio rho, from contrasts of
//! block averages and from local differences, and the point's variance averaged over it.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::covariance::{RATIOS, noise_lengths_mm};
use super::lattice::{FLAT, Quadratic};
use super::reml::{Contrasts, Hyperparameters, Reml};
use super::white::Leftover;
use super::{BlockCovariance, Matern};
use crate::error::Result;
use crate::field::Blocks;
use crate::numeric::{hermite, legendre, shares};

/// The white noise of points as local differences see it.
pub(super) struct LocalVariance<'a> {
    /// Their variance, mm^2.
    pub variance: f64,
    /// Standard error of its logarithm.
    pub error: f64,
    /// What they see of correlated noise.
    pub leftover: &'a Leftover<'a>,
}

/// One component's noise.
pub(super) struct OneComponent {
    /// The restricted likelihood; `best` is what is most likely given the local differences too.
    pub reml: Reml,
    /// Covariance of block averages, averaged over length and ratio, at unit scale.
    pub covariance: BlockCovariance,
    /// Scale s^2 of that covariance, mm^2.
    pub scale2: f64,
    /// Mode of the logarithm of a point's variance (mm^2), as of an inverse chi^2, and its variance.
    pub log_variance: (f64, f64),
}

/// Quadrature nodes in each direction.
const NODES: usize = 5;

/// A correlation length known to this (sd of its logarithm) is summed up by a normal approximation; one less known,
/// by the table.
const LOCALISED: f64 = 0.4;

/// Hyperparameters of smaller posterior probability are left out of the covariance.
const NEGLIGIBLE: f64 = 0.01;

/// Error of the logarithm of the variance that local differences see of correlated noise whose correlation has not
/// quite Matern's shape.
const SHAPE_ERROR: f64 = 0.5;

/// Hyperparameters with everything that is known at them.
#[derive(Clone, Copy)]
struct ScoredPoint {
    /// With the most likely s^2 given the blocks and the local differences.
    at: Hyperparameters,
    /// Mode of the logarithm of a point's variance, and its variance, there.
    log_variance: (f64, f64),
    /// Log posterior density, up to a constant: s^2 integrated, before the prior over length and ratio.
    log_density: f64,
}

struct HyperparameterSearch<'a> {
    blocks: &'a Blocks,
    contrasts: &'a Contrasts<'a>,
    locals: &'a [LocalVariance<'a>],
    /// Smallest and largest logarithm of the length, and of the share, of correlated noise.
    low: [f64; 2],
    high: [f64; 2],
}

/// Mean distance of points, mm.
fn spacing(blocks: &Blocks) -> f64 {
    blocks.size_mm / blocks.mean_count().sqrt()
}

/// Correlation lengths at which the restricted likelihood is tabulated, mm.
fn lengths_mm(blocks: &Blocks) -> Vec<f64> {
    let mut lengths_mm = noise_lengths_mm(blocks).to_vec();
    // what blocks cannot tell from white noise, local differences can
    while lengths_mm[0] > 2.0 * FINER * spacing(blocks) {
        lengths_mm.insert(0, lengths_mm[0] / FINER);
    }
    lengths_mm
}

/// The restricted likelihoods of both components that [`OneComponent::new`] starts from.
///
/// # Errors
/// Those of [`Contrasts::table`].
pub(super) fn tables(blocks: &Blocks, both: [&Contrasts<'_>; 2]) -> Result<[Reml; 2]> {
    Contrasts::tables(both, &lengths_mm(blocks), &RATIOS)
}

impl OneComponent {
    pub fn new(
        blocks: &Blocks,
        contrasts: &Contrasts<'_>,
        mut reml: Reml,
        locals: &[LocalVariance<'_>],
    ) -> Result<Self> {
        let longest = blocks.noise_length_mm;
        let spacing = spacing(blocks);
        let search = HyperparameterSearch {
            blocks,
            contrasts,
            locals,
            low: [spacing.min(longest / SHORTEST).ln(), -SHARE],
            high: [longest.ln(), SHARE],
        };
        let fractions: Vec<(f64, Vec<f64>)> = lengths_mm(blocks)
            .into_iter()
            .map(|l| (l, search.fractions(l)))
            .collect();
        let of = |at: &Hyperparameters| fractions.iter().find(|(l, _)| *l == at.length_mm);
        let table: Vec<ScoredPoint> = reml
            .table
            .iter()
            .map(|at| search.weigh(at, of(at).map_or(&[], |f| &f.1)))
            .collect();
        let found = search.parts(&table)?;
        // White noise where it is the more probable, else the likeliest correlated noise.
        let (white, correlated): (Vec<_>, Vec<_>) =
            found.iter().partition(|(_, w)| w.at.ratio == 0.0);
        let is_white = white.iter().any(|(p, _)| *p >= 0.5);
        let kept = if is_white { white } else { correlated };
        let likeliest = kept.iter().map(|(_, w)| w);
        let likeliest = likeliest.reduce(|a, b| if b.log_density > a.log_density { b } else { a });
        reml.best = likeliest.map_or(reml.best, |w| w.at);
        // the mean of an inverse chi^2's logarithm lies half its variance above its mode
        let centre = |w: &ScoredPoint| w.log_variance.0 + 0.5 * w.log_variance.1;
        let mean = found.iter().map(|(p, w)| p * centre(w)).sum::<f64>();
        let spread = found
            .iter()
            .map(|(p, w)| p * (w.log_variance.1 + (centre(w) - mean).powi(2)))
            .sum::<f64>();
        let mode = mean - 0.5 * spread;
        let (covariance, scale2) = average(blocks, &found, mode)?;
        Ok(Self {
            reml,
            covariance,
            scale2,
            log_variance: (mode, spread),
        })
    }
}

impl HyperparameterSearch<'_> {
    /// Hyperparameters with the white noise of local differences taken into account: the restricted likelihood times a
    /// lognormal for what they see, s^2 (nbar + rho f).
    fn weigh(&self, at: &Hyperparameters, fractions: &[f64]) -> ScoredPoint {
        let nu = self.contrasts.count() as f64;
        let nbar = self.blocks.mean_count();
        // what each of the local differences says of ln s^2, and how precisely
        let said: Vec<(f64, f64)> = self
            .locals
            .iter()
            .zip(fractions.iter().chain(std::iter::repeat(&0.0)))
            .map(|(local, fraction)| {
                let seen = nbar + at.ratio * fraction;
                let expected = (local.variance / seen).max(f64::MIN_POSITIVE).ln();
                // Real noise need not be Matern's at distances far below its length: of what is hardly seen there the blocks decide.
                let share = at.ratio * fraction / seen;
                let shape = SHAPE_ERROR * share * (1.0 - fraction);
                (expected, 1.0 / (local.error.powi(2) + shape.powi(2)))
            })
            .collect();
        let precision: f64 = said.iter().map(|(_, p)| p).sum();
        let expected = said.iter().map(|(e, p)| e * p).sum::<f64>() / precision;
        let profile = at.scale2.ln();
        let mut x = profile;
        let mut curvature = 0.5 * nu;
        for _ in 0..50 {
            let ratio = (profile - x).exp();
            let slope = -0.5 * nu * (1.0 - ratio) - (x - expected) * precision;
            curvature = 0.5 * nu * ratio + precision;
            x += (slope / curvature).clamp(-1.0, 1.0);
        }
        let lost = 0.5 * nu * (x - profile + (profile - x).exp() - 1.0);
        let penalty: f64 = said.iter().map(|(e, p)| 0.5 * (x - e).powi(2) * p).sum();
        let known: f64 = said.iter().map(|(_, p)| p.ln()).sum();
        ScoredPoint {
            at: Hyperparameters {
                scale2: x.exp(),
                ..*at
            },
            log_variance: (x + (nbar + at.ratio).ln(), 1.0 / curvature),
            log_density: at.log_likelihood - lost - penalty + 0.5 * (known - curvature.ln()),
        }
    }

    /// What each of the local differences sees of correlated noise of unit variance.
    fn fractions(&self, length_mm: f64) -> Vec<f64> {
        let seen = self.locals.iter().map(|l| l.leftover.fraction(length_mm));
        seen.collect()
    }

    fn at(&self, matern: &Matern, fractions: &[f64], ratio: f64) -> Result<ScoredPoint> {
        let covariance = BlockCovariance::new(self.blocks, matern, ratio)?;
        Ok(self.weigh(&self.contrasts.at(&covariance)?, fractions))
    }

    /// Hyperparameters with their posterior probabilities. Half the prior probability lies on white noise: a correlation is found where
    /// the data ask for it. A quarter lies on correlated noise alone, as of overlapping subsets, evenly over the
    /// logarithm of its length, and a quarter on both, evenly over the logarithms of length and ratio. Where the data do not say
    /// how long the correlation is, the half that is correlated lies evenly on the table.
    fn parts(&self, table: &[ScoredPoint]) -> Result<Vec<(f64, ScoredPoint)>> {
        let better =
            |a: ScoredPoint, b: ScoredPoint| if b.log_density > a.log_density { b } else { a };
        let correlated: Vec<ScoredPoint> =
            table.iter().filter(|w| w.at.ratio > 0.0).copied().collect();
        let white = table.iter().find(|w| w.at.ratio == 0.0).copied();
        let Some(start) = correlated.iter().copied().reduce(better) else {
            return Ok(white.into_iter().map(|w| (1.0, w)).collect());
        };
        let prior = -(correlated.len() as f64).ln();
        let mut weighed: Vec<(f64, ScoredPoint)> = Vec::new();
        weighed.extend(white.map(|w| (w.log_density, w)));
        // Where nothing of the table is much likelier than white noise there is nothing to refine.
        let hopeless = white.is_some_and(|w| start.log_density < w.log_density + WORTH_A_CLIMB);
        match if hopeless { None } else { self.refine(start)? } {
            Some(found) => weighed.extend(found),
            None => weighed.extend(correlated.iter().map(|w| (w.log_density + prior, *w))),
        }
        let (logs, scored): (Vec<f64>, Vec<ScoredPoint>) = weighed.into_iter().unzip();
        Ok(shares(&logs).into_iter().zip(scored).collect())
    }

    /// Climb to the most likely length and share, and integrate the density around them. None if the data do not say
    /// where the length is.
    ///
    /// The share is the logit of the part of what local differences see that is correlated noise: at a given share
    /// both sources of information ask for the same scale at each length.
    fn refine(&self, start: ScoredPoint) -> Result<Option<Vec<(f64, ScoredPoint)>>> {
        let length = start.at.length_mm;
        let fraction = self.fractions(length)[0];
        let share = (start.at.ratio * fraction / self.blocks.mean_count()).ln();
        let mut centre = [length.ln(), share.clamp(self.low[1], self.high[1])];
        let mut step = [0.25, 0.8];
        let mut around = self.around(centre, step)?;
        for _ in 0..ROUNDS {
            let fit = Quadratic::new(&log_densities(&around));
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
                let to = (centre[k] + by * step[k]).clamp(self.low[k], self.high[k]);
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
        let covariance = Quadratic::new(&log_densities(&around)).covariance();
        self.integrate(centre, step, covariance)
    }

    /// Quadrature over the density about `centre`: hyperparameters with the logs of their probabilities relative to the
    /// prior's. In the length the density is nearly normal (Gauss-Hermite); in the share it may be level up to its
    /// bound, where there is no white noise (Gauss-Legendre over what lies within [`REACH`] sds and the bounds).
    fn integrate(
        &self,
        centre: [f64; 2],
        step: [f64; 2],
        covariance: [[f64; 2]; 2],
    ) -> Result<Option<Vec<(f64, ScoredPoint)>>> {
        let sd = [0, 1].map(|k| covariance[k][k].sqrt() * step[k]);
        if sd[0] > LOCALISED {
            return Ok(None);
        }
        let correlation = covariance[0][1] / (covariance[0][0] * covariance[1][1]).sqrt();
        let rest = sd[1] * (1.0 - correlation * correlation).sqrt();
        let area: f64 = (0..2).map(|k| self.high[k] - self.low[k]).product();
        let (mut places, mut logs) = (Vec::new(), Vec::new());
        let legendre = legendre(NODES);
        for (z, weight) in hermite(NODES) {
            let middle = centre[1] + sd[1] * correlation * z;
            let middle = middle.clamp(self.low[1] + rest, self.high[1] - rest.min(1.0));
            let low = (middle - REACH * rest).max(self.low[1]);
            let high = (middle + REACH * rest).min(self.high[1]);
            let volume = weight.ln() + 0.5 * z * z + (TAU.sqrt() * sd[0]).ln() - area.ln();
            for &(x, weight) in &legendre {
                places.push([centre[0] + sd[0] * z, low + x * (high - low)]);
                logs.push(volume + (weight * (high - low)).ln());
            }
        }
        let found = self.at_places(&places, NODES)?;
        let mut parts: Vec<(f64, ScoredPoint)> = found
            .into_iter()
            .zip(logs)
            .map(|(w, log)| (w.log_density + log, w))
            .collect();
        parts.extend(self.alone(centre[0], sd[0])?);
        // both kinds of correlated noise are as probable
        let half = std::f64::consts::LN_2;
        Ok(Some(
            parts.into_iter().map(|(log, w)| (log - half, w)).collect(),
        ))
    }

    /// Quadrature over the logarithm of the length, known to about `sd` near `start`, of correlated noise alone: hyperparameters with
    /// the logs of their probabilities relative to the prior's.
    fn alone(&self, start: f64, sd: f64) -> Result<Vec<(f64, ScoredPoint)>> {
        let places = |around: f64, sd: f64, z: &[f64]| -> Vec<[f64; 2]> {
            z.iter().map(|z| [around + sd * z, self.high[1]]).collect()
        };
        let near = self.at_places(&places(start, sd, &[-1.0, 0.0, 1.0]), 1)?;
        let [low, middle, high] = [0, 1, 2].map(|k: usize| near[k].log_density);
        let bend = (2.0 * middle - low - high).max(1.0 / FLAT);
        let centre = start + sd * (0.5 * (high - low) / bend).clamp(-2.0, 2.0);
        let sd = sd / bend.sqrt();
        let rule = hermite(NODES);
        let nodes: Vec<f64> = rule.iter().map(|(z, _)| *z).collect();
        let found = self.at_places(&places(centre, sd, &nodes), 1)?;
        let side = self.high[0] - self.low[0];
        let log =
            |(z, weight): (f64, f64)| weight.ln() + 0.5 * z * z + (TAU.sqrt() * sd / side).ln();
        let parts = found.into_iter().zip(rule);
        Ok(parts
            .map(|(w, node)| (w.log_density + log(node), w))
            .collect())
    }

    /// The nine places `step` around `centre`, shares innermost.
    fn around(&self, centre: [f64; 2], step: [f64; 2]) -> Result<Vec<ScoredPoint>> {
        let places: Vec<[f64; 2]> = (0..9)
            .map(|i| {
                let by = [(i / 3) as f64 - 1.0, (i % 3) as f64 - 1.0];
                [0, 1].map(|k| centre[k] + by[k] * step[k])
            })
            .collect();
        self.at_places(&places, 3)
    }

    /// Hyperparameters at places (log length, share), `each` of one length in a row.
    fn at_places(&self, places: &[[f64; 2]], each: usize) -> Result<Vec<ScoredPoint>> {
        let lengths: Vec<(Matern, Vec<f64>)> = places
            .par_chunks(each)
            .map(|row| {
                let l = row[0][0].exp();
                (Matern::new(self.blocks, l), self.fractions(l))
            })
            .collect();
        let one = |(i, place): (usize, &[f64; 2])| -> Result<ScoredPoint> {
            let (matern, fractions) = &lengths[i / each];
            let ratio = place[1].exp() * self.blocks.mean_count() / fractions[0].max(1e-9);
            self.at(matern, fractions, ratio)
        };
        let results: Vec<Result<ScoredPoint>> = places.par_iter().enumerate().map(one).collect();
        results.into_iter().collect()
    }
}

/// The log densities on a lattice of nine places.
fn log_densities(around: &[ScoredPoint]) -> [f64; 9] {
    std::array::from_fn(|k| around[k].log_density)
}

/// Sds of the share to either side over which the density is integrated.
const REACH: f64 = 3.0;

/// Correlated noise is sought down to the spacing of points, at least to this part of the longest length.
const SHORTEST: f64 = 7.5;

/// Ratio of neighbouring lengths in the table.
const FINER: f64 = 1.9;

/// Largest logit of the share of correlated noise.
const SHARE: f64 = 6.0;

/// The lattice is not made coarser than this.
const LARGEST_STEP: [f64; 2] = [0.3, 1.5];

/// Rounds of the climb.
const ROUNDS: usize = 6;

/// Log Bayes factor against white noise that some correlated noise must reach to make a climb worth its while.
const WORTH_A_CLIMB: f64 = 3.0;

/// The covariance averaged over hyperparameters with their probabilities, scaled so that a point has the variance
/// exp(`log_variance`).
fn average(
    blocks: &Blocks,
    found: &[(f64, ScoredPoint)],
    log_variance: f64,
) -> Result<(BlockCovariance, f64)> {
    let kept: Vec<&(f64, ScoredPoint)> = found.iter().filter(|(p, _)| *p > NEGLIGIBLE).collect();
    let white: f64 = kept.iter().map(|(p, w)| p * w.at.scale2).sum();
    let mut lengths: Vec<(f64, f64)> = Vec::new();
    for (p, w) in &kept {
        let ratio = p * w.at.scale2 * w.at.ratio / white;
        match lengths.iter_mut().find(|(l, _)| *l == w.at.length_mm) {
            Some((_, sum)) => *sum += ratio,
            None => lengths.push((w.at.length_mm, ratio)),
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
