//! The scan: every patch held against every part of the residual, whitened by its noise and beside all columns of the model.
//!
//! With whitened residual r, templates T and P = I - J (J'J + I)^-1 J' of the columns J, q = r'PT (T'PT)^-1 T'Pr is chi^2 of as many degrees
//! of freedom as a patch has amplitudes. It is turned into a two-sided z, and divided by the root of the part's own chi^2 per degree of freedom
//! where that is above 1, because frames differ in noise. Of some 4000 patches the largest z is above 4.6 in 1 % and above 5.2 in 0.1 % of
//! nulls, for 12 shapes of noise and 19 layouts of blocks alike (prototype study): no simulation is needed here.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::parts::{FramePart, PatchPart, parts};
use super::templates::{PatchFamily, PatchPlace, VALUES};
use crate::dense::{product, tr_product};
use crate::error::{Error, Result};
use crate::noise::series::FrameNoise;
use crate::noise::{BlockCovariance, NormalEquations};
use crate::numeric::bisect;

/// From this z on a patch is spoken of.
pub const REMARKABLE: f64 = 4.6;

/// Patches that are taken out of one part, at most.
const MOST: usize = 5;

/// Directions of a patch's amplitudes that hold less than this of the largest are none.
const DISTINCT: f64 = 0.02;

/// Less than this of a patch beside the columns is theirs.
const BESIDE: f64 = 1e-4;

/// Sd of the amplitudes of a patch that was taken out, over what the noise tells of them alone.
const FREE: f64 = 1e3;

/// A patch that the residual holds, mm.
#[derive(Debug, Clone)]
pub struct FoundPatch {
    pub part: PatchPart,
    pub family: PatchFamily,
    /// Its middle (s, t) and its radius.
    pub at: [f64; 2],
    pub radius_mm: f64,
    pub z: f64,
    /// Largest displacement of a block's average.
    pub largest_mm: f64,
    /// Share of the strain that is lost, and its sd, where it does not follow.
    pub share: Option<[f64; 2]>,
}

/// What is scanned: the frames of a series, or one field.
pub struct Scanned<'a> {
    /// Patches to hold against it.
    pub places: &'a [PatchPlace],
    /// Force over the largest of each frame, and the scale of each frame's noise.
    pub loads: &'a [f64],
    pub scales: &'a [f64],
    /// Share of the reference picture in a frame's noise.
    pub reference: f64,
    /// Noise of a frame of scale 1: its covariance at s = 1, and s^2, mm^2.
    pub noise: [(&'a BlockCovariance, f64); 2],
    /// Of u1 and u2: columns of the model, each for one prior sd, and last the data, mm; (frames n) x (p + 1).
    pub columns: [&'a DMatrix<f64>; 2],
}

impl<'a> Scanned<'a> {
    /// Of a series whose noise its frames have measured.
    pub fn of_frames(
        places: &'a [PatchPlace],
        loads: &'a [f64],
        (noise, reference): (&'a FrameNoise, f64),
        columns: [&'a DMatrix<f64>; 2],
    ) -> Self {
        let of = |c: usize| {
            let spatial = &noise.spatial[c];
            (&*spatial.covariance, spatial.scale2)
        };
        Self {
            places,
            loads,
            scales: &noise.scales,
            reference,
            noise: [of(0), of(1)],
            columns,
        }
    }

    /// All patches from [`REMARKABLE`] on, part by part, the clearest of each first.
    ///
    /// # Errors
    /// Of the program: columns that are not finite.
    pub fn patches(&self) -> Result<Vec<FoundPatch>> {
        let inverse = self.noise.map(|(covariance, s2)| covariance.inverse() / s2);
        let gram = |place: &PatchPlace| {
            inverse.each_ref().map(|inverse| {
                let near = inverse.select_rows(&place.blocks);
                let near = near.select_columns(&place.blocks);
                tr_product(&place.values, &product(&near, &place.values))
            })
        };
        let grams: Vec<[DMatrix<f64>; 2]> = self.places.par_iter().map(gram).collect();
        let mut all = Vec::new();
        for part in parts(self.loads, self.scales, self.reference) {
            let mut columns = [0, 1].map(|c| self.combined(c, &part));
            for _ in 0..MOST {
                let projection = Projection::new(&inverse, &columns, &part)?;
                let each = (0..self.places.len())
                    .into_par_iter()
                    .map(|k| projection.clearest(&self.places[k], &grams[k]));
                let each: Vec<Option<HeldPatch>> = each.collect();
                let clearer =
                    |best: Option<(usize, HeldPatch)>, (k, held): (usize, Option<HeldPatch>)| match (
                        best, held,
                    ) {
                        (Some(best), Some(held)) if held.z > best.1.z => Some((k, held)),
                        (None, Some(held)) => Some((k, held)),
                        (best, _) => best,
                    };
                let best = each.into_iter().enumerate().fold(None, clearer);
                let Some((k, held)) = best.filter(|(_, held)| held.z > REMARKABLE) else {
                    break;
                };
                let place = &self.places[k];
                all.push(held.found(place, &part));
                for (c, columns) in columns.iter_mut().enumerate() {
                    let own = projection.taken_out(place, &grams[k], (held.family, c));
                    let at = columns.ncols() - 1;
                    let mut wider = columns.clone().insert_columns(at, own.ncols(), 0.0);
                    wider.columns_mut(at, own.ncols()).copy_from(&own);
                    *columns = wider;
                }
            }
        }
        Ok(all)
    }

    /// The columns and the data of one component in a part, blocks x (p + 1).
    fn combined(&self, c: usize, part: &FramePart) -> DMatrix<f64> {
        let n = self.columns[c].nrows() / self.loads.len().max(1);
        let mut sum = DMatrix::zeros(n, self.columns[c].ncols());
        for (t, weight) in part.weights.iter().enumerate() {
            sum += *weight * self.columns[c].rows(t * n, n);
        }
        sum
    }
}

/// What is left of a part beside the columns of the model, and what that takes from patches.
struct Projection {
    /// N^-1 J and N^-1 of what is left, of either component.
    columns: [DMatrix<f64>; 2],
    left: [DVector<f64>; 2],
    fit: NormalEquations,
    /// Variance of the part's noise over that of a frame.
    scale: f64,
    /// Root of chi^2 a degree of freedom, at least 1.
    spread: f64,
    blocks: usize,
}

/// How a patch of one family fits.
#[derive(Clone)]
struct HeldPatch {
    family: PatchFamily,
    z: f64,
    amplitude: DVector<f64>,
    /// Sd of the first amplitude.
    sd: f64,
}

impl Projection {
    fn new(
        inverse: &[DMatrix<f64>; 2],
        columns: &[DMatrix<f64>; 2],
        part: &FramePart,
    ) -> Result<Self> {
        let last = columns[0].ncols() - 1;
        let weighted = [0, 1].map(|c: usize| product(&inverse[c], &columns[c]) / part.scale);
        let all = tr_product(&columns[0], &weighted[0]) + tr_product(&columns[1], &weighted[1]);
        let inside = all.view((0, 0), (last, last)).into_owned();
        let right = all.view((0, last), (last, 1)).column(0).into_owned();
        let fit = NormalEquations::with_unit_prior(inside, right)
            .ok_or_else(|| Error::program("trace::patches", "finite columns"))?;
        let amplitude = fit.mean();
        let mut chi2 = amplitude.norm_squared();
        let left = [0, 1].map(|c: usize| {
            let own = columns[c].columns(0, last);
            let left = columns[c].column(last) - own * &amplitude;
            let weighted = &inverse[c] * &left / part.scale;
            chi2 += left.dot(&weighted);
            weighted
        });
        let blocks = columns[0].nrows();
        Ok(Self {
            columns: weighted.map(|m| m.columns(0, last).into_owned()),
            left,
            fit,
            scale: part.scale,
            spread: (chi2 / (2 * blocks) as f64).max(1.0).sqrt(),
            blocks,
        })
    }

    /// The family of the largest z at a place.
    fn clearest(&self, place: &PatchPlace, grams: &[DMatrix<f64>; 2]) -> Option<HeldPatch> {
        let along = [0, 1].map(|c: usize| {
            let near = self.columns[c].select_rows(&place.blocks);
            tr_product(&place.values, &near)
        });
        let data = [0, 1].map(|c: usize| {
            let near = self.left[c].select_rows(&place.blocks);
            place.values.tr_mul(&near)
        });
        let fitted = PatchFamily::ALL
            .into_iter()
            .filter_map(|family| self.held(family, grams, (&along, &data)));
        fitted.reduce(|best, held| if held.z > best.z { held } else { best })
    }

    fn held(
        &self,
        family: PatchFamily,
        grams: &[DMatrix<f64>; 2],
        (along, data): (&[DMatrix<f64>; 2], &[DVector<f64>; 2]),
    ) -> Option<HeldPatch> {
        let amplitudes = family.amplitudes();
        let n = amplitudes.len();
        let sum = |i: usize, of: &dyn Fn(usize, usize) -> f64| -> f64 {
            let used = amplitudes[i].iter().enumerate();
            used.filter_map(|(c, k)| Some(of(c, (*k)?))).sum()
        };
        let columns =
            DMatrix::from_fn(along[0].ncols(), n, |j, i| sum(i, &|c, k| along[c][(k, j)]));
        let right = DVector::from_fn(n, |i, _| sum(i, &|c, k| data[c][k]));
        let own = DMatrix::from_fn(n, n, |i, j| {
            let both =
                (0..2).filter_map(|c| Some(grams[c][(amplitudes[i][c]?, amplitudes[j][c]?)]));
            both.sum::<f64>() / self.scale
        });
        let left = &own - columns.tr_mul(&self.fit.solve(&columns));
        let scaling = DVector::from_fn(n, |i, _| {
            let seen = left[(i, i)] > BESIDE * own[(i, i)] && own[(i, i)] > 0.0;
            if seen {
                left[(i, i)].sqrt().recip()
            } else {
                0.0
            }
        });
        let scaled = DMatrix::from_fn(n, n, |i, j| left[(i, j)] * scaling[i] * scaling[j]);
        let eigen = scaled.symmetric_eigen();
        let floor = DISTINCT * eigen.eigenvalues.max();
        if floor <= 0.0 {
            return None;
        }
        let mut solved = eigen.eigenvectors.tr_mul(&right.component_mul(&scaling));
        let (mut q, mut freedom) = (0.0, 0);
        for (x, &e) in solved.iter_mut().zip(&eigen.eigenvalues) {
            if e < floor {
                *x = 0.0;
                continue;
            }
            q += *x * *x / e;
            freedom += 1;
            *x /= e;
        }
        Some(HeldPatch {
            family,
            z: two_sided(q, freedom) / self.spread,
            amplitude: (&eigen.eigenvectors * solved).component_mul(&scaling),
            sd: scaling[0] * self.spread,
        })
    }

    /// Columns of a family's amplitudes at a place, of one component, as good as free.
    fn taken_out(
        &self,
        place: &PatchPlace,
        grams: &[DMatrix<f64>; 2],
        (family, c): (PatchFamily, usize),
    ) -> DMatrix<f64> {
        let amplitudes = family.amplitudes();
        let mut columns = DMatrix::zeros(self.blocks, amplitudes.len());
        for (i, used) in amplitudes.iter().enumerate() {
            let both = (0..2).filter_map(|c| Some(grams[c][(used[c]?, used[c]?)]));
            let size = (both.sum::<f64>() / self.scale)
                .max(f64::MIN_POSITIVE)
                .sqrt();
            let Some(k) = used[c] else { continue };
            for (row, block) in place.blocks.iter().enumerate() {
                columns[(*block, i)] = FREE / size * place.values[(row, k)];
            }
        }
        columns
    }
}

impl HeldPatch {
    fn found(&self, place: &PatchPlace, part: &FramePart) -> FoundPatch {
        let amplitude = &self.amplitude / part.share;
        let displaced = |row: usize| {
            let of = |c: usize| {
                let each = self.family.amplitudes().iter().zip(amplitude.iter());
                each.filter_map(|(used, a)| Some(a * place.values[(row, used[c]?)]))
                    .sum::<f64>()
            };
            of(0).hypot(of(1))
        };
        let share = (self.family == PatchFamily::NotFollowing)
            .then(|| [amplitude[0], self.sd / part.share]);
        FoundPatch {
            part: part.part,
            family: self.family,
            at: place.at,
            radius_mm: place.radius_mm,
            z: self.z,
            largest_mm: (0..place.blocks.len()).map(displaced).fold(0.0, f64::max),
            share,
        }
    }
}

/// The z whose two-sided probability is that of a chi^2 above `q`, of 1 to 4 degrees of freedom.
fn two_sided(q: f64, freedom: usize) -> f64 {
    debug_assert!(freedom <= VALUES);
    let half = 0.5 * q;
    let log = match freedom {
        1 => return q.sqrt(),
        2 => -half,
        3 => {
            let tail = (log_erfc(half.sqrt()) + half).exp();
            (tail + (2.0 * q / std::f64::consts::PI).sqrt()).ln() - half
        }
        _ => half.ln_1p() - half,
    };
    let is_below = |z: f64| log_erfc(z / std::f64::consts::SQRT_2) > log;
    bisect(0.0, q.sqrt() + 1.0, is_below)
}

/// log erfc(x) of x >= 0.
fn log_erfc(x: f64) -> f64 {
    if x < 5.0 {
        return statrs::function::erf::erfc(x).ln();
    }
    let y = (x * x).recip();
    (0.75 * y * y - 0.5 * y).ln_1p() - x * x - (x * std::f64::consts::PI.sqrt()).ln()
}
