//! Noise of correlated pictures: white in the pixels, and smooth patterns.

use rand::{RngExt, SeedableRng};
use rand_distr::{ChiSquared, Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;

use super::subsets::Filter;

/// The noise of one picture, in each component.
#[derive(Debug, Clone, Default)]
pub struct Noise {
    /// Sd of a whole subset, from white noise of the pixels, mm.
    pub sd_mm: f64,
    /// Smooth patterns beside it.
    pub smooth: Option<Smooth>,
    /// By how much of itself the noise grows from the field's middle to its farthest corner.
    pub growth: f64,
    /// Factors for the loaded pictures' own noise, in their order; 1 where there is none.
    pub scales: Vec<f64>,
}

/// A stationary random field.
#[derive(Debug, Clone, Copy)]
pub struct Smooth {
    /// Its sd over that of the white part.
    pub ratio: f64,
    pub length_mm: f64,
    pub family: Family,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Correlation (1 + q) exp(-q), q = sqrt(3) r / l.
    Matern32,
    /// Correlation exp(-r^2 / (2 l^2)).
    Gaussian,
}

/// Waves of which a smooth field is made: by the central limit theorem it is Gaussian to 1 part in their number.
const WAVES: usize = 600;

impl Smooth {
    /// A field of unit sd at some points: waves of random phase whose vectors have the correlation's spectrum as their distribution.
    pub fn field(&self, points: &[[f64; 2]], rng: &mut Pcg64Dxsm) -> Vec<f64> {
        let normal = |rng: &mut Pcg64Dxsm| -> f64 { StandardNormal.sample(rng) };
        let waves: Vec<[f64; 4]> = (0..WAVES)
            .map(|_| {
                // the spectrum of Matern-3/2 is a multivariate t of 3 degrees of freedom
                let spread: f64 = match self.family {
                    Family::Gaussian => 1.0,
                    Family::Matern32 => {
                        (3.0_f64 / ChiSquared::new(3.0).unwrap().sample(rng)).sqrt()
                    }
                };
                let k = [(); 2].map(|()| spread * normal(rng) / self.length_mm);
                [k[0], k[1], normal(rng), normal(rng)]
            })
            .collect();
        let size = (WAVES as f64).sqrt().recip();
        let at = |&[x, y]: &[f64; 2]| {
            let wave = |[kx, ky, a, b]: &[f64; 4]| {
                let (sin, cos) = (kx * x + ky * y).sin_cos();
                a * cos + b * sin
            };
            size * waves.iter().map(wave).sum::<f64>()
        };
        points.par_iter().map(at).collect()
    }
}

impl Noise {
    /// What both components of one picture add at the subsets, mm.
    fn picture(&self, filter: &Filter, pixels: usize, seed: u64) -> Vec<[f64; 2]> {
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let reach = filter.points.iter().map(|[x, y]| x.hypot(*y));
        let reach = reach.fold(f64::MIN_POSITIVE, f64::max);
        let mut component = || -> Vec<f64> {
            let pixel = self.sd_mm / filter.gain();
            let white: Vec<f64> = (0..pixels)
                .map(|_| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    pixel * z
                })
                .collect();
            let mut all = filter.apply(&white);
            if let Some(smooth) = self.smooth {
                let field = smooth.field(&filter.points, &mut rng);
                for (value, s) in all.iter_mut().zip(field) {
                    *value += smooth.ratio * self.sd_mm * s;
                }
            }
            for (value, [x, y]) in all.iter_mut().zip(&filter.points) {
                *value *= 1.0 + self.growth * x.hypot(*y) / reach;
            }
            all
        };
        let (u, v) = (component(), component());
        u.into_iter().zip(v).map(|(u, v)| [u, v]).collect()
    }

    /// Noise of some exposures against one reference picture, which is noisy as they are: the exposure's own less the reference's.
    pub fn exposures(
        &self,
        filter: &Filter,
        pixels: usize,
        count: usize,
        seed: u64,
    ) -> Vec<Vec<[f64; 2]>> {
        let mut seeds = Pcg64Dxsm::seed_from_u64(seed);
        let reference = self.picture(filter, pixels, seeds.random());
        (0..count)
            .map(|k| {
                let own = self.picture(filter, pixels, seeds.random());
                let scale = self.scales.get(k).copied().unwrap_or(1.0);
                let pairs = own.iter().zip(&reference);
                pairs
                    .map(|(own, common)| [0, 1].map(|c| scale * own[c] - common[c]))
                    .collect()
            })
            .collect()
    }
}
