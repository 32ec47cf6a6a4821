//! Whether the fields of a series are proportional to the load, apart from motion and from what is common to all frames.
//!
//! Frame contrasts orthogonal to (1, .., 1) and to the loads f hold nothing that is the same in all frames or grows with the load. One
//! of them goes as f^2: what yields, slips or is damaged goes along it, also where it stays after unloading; noise, and motion that is
//! another in each frame, go along all of them alike. So the energy there, in patterns that a specimen can have, is compared with that in
//! the other contrasts: F-distributed for a linear specimen whatever the size of the noise, as long as its frames are drawn from one
//! distribution. What goes partly along f^2 only is seen the less, because the other contrasts hold the rest of it, and frames that it makes
//! unlike the others pass for noisy ones: a jump at four fifths of the load that stays, of 100 sds in few patterns, had p = 0.08. A jump
//! halfway between the first and the last force, of a specimen that is not unloaded, goes as f^3 and is not seen at all.
//!
//! The patterns: what any change of stiffness beside the hole does elsewhere, and smooth fields over the window. What columns explain is
//! taken out of every contrast on its own, with an amplitude of its own.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::contrasts::weighted;
use super::in_frames::InFrames;
use crate::dense::{gram, product, tr_product};
use crate::noise::NormalEquations;

/// How a column takes part in the test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// One amplitude for all frames, of prior sd 1.
    Together,
    /// An amplitude in each frame, of this prior sd.
    InEach(f64),
    /// A pattern by which a specimen may depart from linearity, as it is under the largest force.
    Pattern,
    /// No part: it is not linear in the load.
    None,
}

/// A test against fields that are proportional to the load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linearity {
    /// Mean square along f^2 over that along the other contrasts.
    pub ratio: f64,
    /// Degrees of freedom of both.
    pub freedom: [usize; 2],
    /// Probability of so large a ratio for a linear specimen.
    pub p: f64,
}

/// Patterns of which the columns leave less than this part are theirs: with those counted, motion that is small beside its prior made
/// the ratio vary by half of what it should (22 simulated series).
const LEFT: f64 = 0.5;

/// Patterns that are nearly sums of others are none.
const DISTINCT: f64 = 1e-6;

impl InFrames {
    /// Test the data by all columns, each of a role, with `smooth` fields (blocks x any) for either component. None where the loads leave
    /// no contrast to compare with: below four frames, or of two loads only; nor where noise adds up from frame to frame.
    pub fn linearity(&self, roles: &[Role], smooth: &DMatrix<f64>) -> Option<Linearity> {
        let contrasts = weighted(&self.loads, &self.scales)?;
        if contrasts.ncols() < 2 || self.walks {
            return None;
        }
        let parts = [0, 1].map(|c: usize| Patterned::new(self, c, roles, smooth));
        let along = |j: usize| {
            let weights = contrasts.column(j).into_owned();
            parts[0].gram(&weights) + parts[1].gram(&weights)
        };
        let patterns = parts[0].patterns.ncols();
        let (square, rank) = explained(&along(0), patterns)?;
        let mut others = (0.0, 0);
        for j in 1..contrasts.ncols() {
            let (square, rank) = explained(&along(j), patterns)?;
            others = (others.0 + square, others.1 + rank);
        }
        let freedom = [rank, others.1];
        let ratio = (square / rank as f64) / (others.0 / others.1 as f64);
        let law = FisherSnedecor::new(rank as f64, others.1 as f64).ok()?;
        Some(Linearity {
            ratio,
            freedom,
            p: law.sf(ratio),
        })
    }
}

/// The columns of one component that take part, and the patterns, in one basis.
struct Patterned<'a> {
    frames: &'a [DMatrix<f64>],
    /// Inner product of the basis and, after it, the smooth fields.
    inner: DMatrix<f64>,
    /// Columns with one amplitude, and all slices of those with an amplitude in each frame.
    together: Vec<usize>,
    slices: DMatrix<f64>,
    patterns: DMatrix<f64>,
}

impl<'a> Patterned<'a> {
    fn new(all: &'a InFrames, c: usize, roles: &[Role], smooth: &DMatrix<f64>) -> Self {
        let part = &all.parts[c];
        let frames = &part.slices.frames;
        let (covariance, sd) = &all.noise[c];
        let (k, extra) = (part.white.ncols(), smooth.ncols());
        let mut white = part.white.clone().resize_horizontally(k + extra, 0.0);
        white
            .columns_mut(k, extra)
            .copy_from(&(covariance.whiten(smooth) / *sd));
        let of = |role: Role| (0..roles.len()).filter(move |i| roles[*i] == role);
        let mut slices: Vec<DVector<f64>> = Vec::new();
        for (i, role) in roles.iter().enumerate() {
            if let Role::InEach(sd) = role {
                slices.extend(frames.iter().map(|t| t.column(i) * *sd));
            }
        }
        let slices = if slices.is_empty() {
            DMatrix::zeros(k, 0)
        } else {
            DMatrix::from_columns(&slices)
        };
        let largest = |a: usize, b: usize| {
            if all.loads[b].abs() > all.loads[a].abs() {
                b
            } else {
                a
            }
        };
        let loaded = &frames[(1..frames.len()).fold(0, largest)];
        let own: Vec<usize> = of(Role::Pattern).collect();
        // of the smooth fields those of u1 come first
        let mut patterns = DMatrix::zeros(k + extra, own.len() + 2 * extra);
        for (j, i) in own.iter().enumerate() {
            patterns
                .view_mut((0, j), (k, 1))
                .copy_from(&loaded.column(*i));
        }
        for j in 0..extra {
            patterns[(k + j, own.len() + c * extra + j)] = 1.0;
        }
        Self {
            frames,
            inner: gram(&white),
            together: of(Role::Together).collect(),
            slices,
            patterns,
        }
    }

    /// Inner products, along one contrast, of the columns, the patterns after them and, last, the data.
    fn gram(&self, weights: &DVector<f64>) -> DMatrix<f64> {
        let (rows, last) = self.frames.first().map_or((0, 1), DMatrix::shape);
        let mut sum = DMatrix::zeros(rows, last);
        for (t, weight) in self.frames.iter().zip(weights.iter()) {
            sum += *weight * t;
        }
        let explaining = self.together.len() + self.slices.ncols();
        let patterns = self.patterns.ncols();
        let mut all = DMatrix::zeros(self.inner.nrows(), explaining + patterns + 1);
        for (j, i) in self.together.iter().enumerate() {
            all.view_mut((0, j), (rows, 1)).copy_from(&sum.column(*i));
        }
        let slices = (rows, self.slices.ncols());
        all.view_mut((0, self.together.len()), slices)
            .copy_from(&self.slices);
        all.columns_mut(explaining, patterns)
            .copy_from(&self.patterns);
        all.view_mut((0, explaining + patterns), (rows, 1))
            .copy_from(&sum.column(last - 1));
        tr_product(&all, &product(&self.inner, &all))
    }
}

/// What patterns explain of the data beside the columns, of prior sd 1 each, before them, and how many they are.
fn explained(gram: &DMatrix<f64>, patterns: usize) -> Option<(f64, usize)> {
    let first = gram.nrows() - 1 - patterns;
    let xx = gram.view((0, 0), (first, first)).into_owned();
    let columns = NormalEquations::with_unit_prior(xx, DVector::zeros(first))?;
    let with = gram.view((0, first), (first, patterns + 1)).into_owned();
    let own = gram
        .view((first, first), (patterns + 1, patterns + 1))
        .into_owned();
    let left = &own - with.tr_mul(&columns.solve(&with));
    // patterns orthogonal and of length one before anything is taken out of them: what is left of each is the part that is its own
    let length = DVector::from_fn(patterns, |k, _| own[(k, k)].max(f64::MIN_POSITIVE).sqrt());
    let scaled = |m: &DMatrix<f64>| {
        DMatrix::from_fn(patterns, patterns, |i, j| {
            m[(i, j)] / (length[i] * length[j])
        })
    };
    let eigen = scaled(&own).symmetric_eigen();
    let distinct: Vec<usize> = (0..patterns)
        .filter(|k| eigen.eigenvalues[*k] > DISTINCT)
        .collect();
    let mut basis = eigen.eigenvectors.select_columns(&distinct);
    for (mut column, k) in basis.column_iter_mut().zip(&distinct) {
        column /= eigen.eigenvalues[*k].sqrt();
    }
    let data = DVector::from_fn(patterns, |k, _| left[(k, patterns)] / length[k]);
    let eigen = (basis.tr_mul(&scaled(&left)) * &basis).symmetric_eigen();
    let along = eigen.eigenvectors.tr_mul(&basis.tr_mul(&data));
    let kept = eigen.eigenvalues.iter().zip(along.iter());
    let kept: Vec<f64> = kept
        .filter(|(e, _)| **e > LEFT)
        .map(|(e, v)| v * v / e)
        .collect();
    (!kept.is_empty()).then(|| (kept.iter().sum(), kept.len()))
}
