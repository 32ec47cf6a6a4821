//! Covariance of block averages: C = s^2 [diag(nbar / n_b) + rho K], a nugget of independent points and a
//! Matern-3/2 correlation of length l averaged over the blocks.
//!
//! A single point then has the variance s^2 (nbar + rho): a white part s^2 nbar, a correlated part s^2 rho.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{
    LltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::field::Blocks;
use crate::field::places::BlockPoints;
use crate::numeric::legendre;

/// Correlation lengths that count as noise, mm, the longest last. A likelihood of white noise raised false alarms in up to 97 % of fields
/// whose noise was correlated over 1 mm; with lengths of 0.4 to 1.5 mm in windows of 24 mm it was 0 of 500 (prototype study).
pub fn noise_lengths_mm(blocks: &Blocks) -> [f64; 3] {
    [0.28, 0.53, 1.0].map(|share| share * blocks.noise_length_mm)
}

/// Correlation lengths that count as discrepancy of the model, mm: 38 of 38 smooth random fields outside the dictionary were called
/// unexplained with lengths of 3 to 12 mm in windows of 24 mm (prototype study). The gap to the noise keeps apart what a few dozen
/// correlation areas can tell apart.
pub fn discrepancy_lengths_mm(blocks: &Blocks) -> [f64; 3] {
    [1.5, 3.0, 6.0].map(|share| share * blocks.noise_length_mm)
}
/// Ratios rho of the correlated to the white variance of a block, about half a decade apart; the last is noise that is correlated
/// alone, as overlapping subsets leave it.
pub const RATIOS: [f64; 11] = [
    0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0, 10_000.0,
];

/// Correlation of block averages for one length, averaged over both blocks: of the Matern-3/2 kernel (1 + a d) exp(-a d), a = sqrt(3) / l,
/// unless it was made as [`Matern::squared_exponential`].
#[derive(Debug, Clone)]
pub struct Matern {
    /// Correlation length l, mm.
    pub length_mm: f64,
    /// Symmetric, blocks x blocks; below one on the diagonal where l is not much longer than a block.
    pub correlation: DMatrix<f64>,
}

impl Matern {
    /// The correlation of `blocks` for the length `length_mm`.
    pub fn new(blocks: &Blocks, length_mm: f64) -> Self {
        let n = blocks.len();
        let kernel = BlockKernel::new(blocks, length_mm);
        let mut correlation = DMatrix::zeros(n, n);
        for j in 0..n {
            for i in j..n {
                let value = kernel.between(i, j);
                correlation[(i, j)] = value;
                correlation[(j, i)] = value;
            }
        }
        Self {
            length_mm,
            correlation,
        }
    }

    /// The smoother kernel exp(-d^2 / 2 l^2) in the place of Matern's. The points of a block count as spread normally with their variance.
    /// That is off by the fourth moment over l^4, and leaves the matrix positive semi-definite.
    pub fn squared_exponential(blocks: &Blocks, length_mm: f64) -> Self {
        let square = length_mm * length_mm;
        let (at, spread) = (&blocks.centroid, &blocks.spread);
        let along = |i: usize, j: usize, k: usize| {
            let variance = square + spread[i][k] + spread[j][k];
            (square / variance).sqrt() * (-0.5 * (at[i][k] - at[j][k]).powi(2) / variance).exp()
        };
        let n = blocks.len();
        Self {
            length_mm,
            correlation: DMatrix::from_fn(n, n, |i, j| along(i, j, 0) * along(i, j, 1)),
        }
    }
}

/// Of an offset. Nothing here is so large or small that `hypot` would be needed, which takes as long as all else.
fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// The kernel (1 + a d) exp(-a d), a = sqrt(3) / l.
pub(super) fn matern(length_mm: f64, distance: f64) -> f64 {
    let ad = 3_f64.sqrt() / length_mm * distance;
    (1.0 + ad) * (-ad).exp()
}

/// The kernel between two blocks: points of a lattice lie closer together than a square full of points, and where the
/// correlation is smooth over a block, small differences decide.
struct BlockKernel<'a> {
    blocks: &'a Blocks,
    length_mm: f64,
    /// Offsets between points of two squares in one direction, in units of their side, with the weights of their
    /// triangular distribution.
    offsets: [(f64, f64); 8],
    /// The kernel of points by the difference of their sites, on a lattice.
    of_sites: Vec<f64>,
}

impl<'a> BlockKernel<'a> {
    fn new(blocks: &'a Blocks, length_mm: f64) -> Self {
        // Gauss-Legendre on [0, 1], by halves of the triangle 1 - |d|, whose kink a joint rule would miss
        let mut offsets = [(0.0, 0.0); 8];
        for (k, (node, weight)) in legendre(4).into_iter().enumerate() {
            offsets[2 * k] = (node, weight * (1.0 - node));
            offsets[2 * k + 1] = (-node, weight * (1.0 - node));
        }
        let of_sites = match &blocks.places {
            BlockPoints::OnLattice(lattice) => lattice.tabulate(|d| matern(length_mm, d)),
            BlockPoints::Many | BlockPoints::Anywhere(_) => Vec::new(),
        };
        Self {
            blocks,
            length_mm,
            offsets,
            of_sites,
        }
    }

    /// Mean over the points of two blocks.
    fn between(&self, i: usize, j: usize) -> f64 {
        let blocks = self.blocks;
        let (a, b) = (blocks.centroid[i], blocks.centroid[j]);
        let offset = [a[0] - b[0], a[1] - b[1]];
        let variance = [0, 1].map(|k| blocks.spread[i][k] + blocks.spread[j][k]);
        let distance = length(offset);
        // blocks of scattered points have higher moments, which the expansion leaves out
        let reach = match &blocks.places {
            BlockPoints::Anywhere(_) => 10.0,
            BlockPoints::Many | BlockPoints::OnLattice(_) => 4.0,
        };
        if distance > reach * (3.0 * (variance[0] + variance[1])).sqrt() {
            return self.far(offset, distance, variance);
        }
        match &blocks.places {
            BlockPoints::Many => self.near(offset, variance),
            BlockPoints::Anywhere(points) => mean_over(&points[i], &points[j], |p, q| {
                matern(self.length_mm, length([p[0] - q[0], p[1] - q[1]]))
            }),
            BlockPoints::OnLattice(lattice) => {
                let sites = &lattice.sites;
                mean_over(&sites[i], &sites[j], |p, q| {
                    self.of_sites[p.abs_diff(*q) as usize]
                })
            }
        }
    }

    /// Far off the mean differs by half the variance of the offset times the second derivative.
    fn far(&self, offset: [f64; 2], distance: f64, variance: [f64; 2]) -> f64 {
        let rate = 3_f64.sqrt() / self.length_mm;
        let decay = (-rate * distance).exp();
        let rate2 = rate * rate;
        let curved: f64 = (0..2)
            .map(|k| variance[k] * rate2 * decay * (rate * offset[k] * offset[k] / distance - 1.0))
            .sum();
        // the kernel there, with the exponential at hand
        ((1.0 + rate * distance) * decay + 0.5 * curved).max(0.0)
    }

    /// Mean over two rectangles full of points, their centres `offset` apart, where the offset of their points has the
    /// given variance along each direction.
    fn near(&self, offset: [f64; 2], variance: [f64; 2]) -> f64 {
        // a triangle over two sides has the variance of side^2 / 6
        let side = variance.map(|v| (6.0 * v).sqrt());
        let mut sum = 0.0;
        for (dx, wx) in self.offsets {
            for (dy, wy) in self.offsets {
                let place = [offset[0] + side[0] * dx, offset[1] + side[1] * dy];
                sum += wx * wy * matern(self.length_mm, length(place));
            }
        }
        sum
    }
}

/// Mean of `f` over all pairs of `a` and `b`.
fn mean_over<T>(a: &[T], b: &[T], f: impl Fn(&T, &T) -> f64) -> f64 {
    let to = |p: &T| b.iter().map(|q| f(p, q)).sum::<f64>();
    a.iter().map(to).sum::<f64>() / (a.len() * b.len()) as f64
}

/// Parts of the identity beside K that are tried; the expansion for far blocks of scattered points was off by 4e-3 at most
/// where it began at a reach of 4.
const INEXACT: [f64; 4] = [0.0, 1e-4, 1e-3, 1e-2];

/// The lower Cholesky factor of a matrix, if it has one.
fn factorised(mut matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    let scratch = cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch);
    cholesky_in_place(
        MatMut::from_column_major_slice_mut(matrix.as_mut_slice(), n, n),
        LltRegularization::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .ok()?;
    matrix.fill_upper_triangle(0.0, 1);
    Some(matrix)
}

/// A factorised covariance of block averages at s = 1.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BlockCovariance {
    /// Correlation length l, mm.
    pub length_mm: f64,
    /// Ratio rho.
    pub ratio: f64,
    /// Variance of a single point's white part at s = 1.
    white: f64,
    /// Lower Cholesky factor of C at s = 1.
    lower: DMatrix<f64>,
}

impl BlockCovariance {
    /// Variance of each block average at s = 1.
    pub fn variances(&self) -> Vec<f64> {
        let rows = self.lower.row_iter();
        rows.map(|row| row.norm_squared()).collect()
    }

    /// Factorise diag(nbar / n_b) + `ratio` K.
    ///
    /// # Errors
    /// Of the program, if the matrix is not positive definite.
    pub fn new(blocks: &Blocks, matern: &Matern, ratio: f64) -> Result<Self> {
        Self::of_several(blocks, &[(matern, ratio)])
    }

    /// Factorise diag(nbar / n_b) + sum of ratios times K: noise whose length is not known for certain. `length_mm` is
    /// that of the largest ratio, `ratio` the sum. K is exact to a few parts in a thousand: where that leaves it without
    /// a factor, it gains the smallest of some parts of the identity that gives it one.
    ///
    /// # Errors
    /// Of the program, if the matrix is not positive definite.
    pub fn of_several(blocks: &Blocks, parts: &[(&Matern, f64)]) -> Result<Self> {
        let mean_count = blocks.mean_count();
        let shares = blocks.worth.iter().map(|n| mean_count / n);
        let white = DMatrix::from_diagonal(&DVector::from_iterator(blocks.len(), shares));
        Self::over(&white, mean_count, parts)
    }

    /// The same about another covariance `white` of blocks than diag(nbar / n_b), of points of variance `point`.
    ///
    /// # Errors
    /// Of the program, if the matrix is not positive definite.
    pub fn over(white: &DMatrix<f64>, point: f64, parts: &[(&Matern, f64)]) -> Result<Self> {
        let ratio: f64 = parts.iter().map(|(_, ratio)| ratio).sum();
        let largest = parts.iter().fold(
            (0.0, -1.0),
            |a, (m, r)| {
                if *r > a.1 { (m.length_mm, *r) } else { a }
            },
        );
        let length_mm = largest.0;
        let with = |more: f64| {
            let mut covariance = white.clone();
            for (matern, ratio) in parts {
                covariance
                    .iter_mut()
                    .zip(&matern.correlation)
                    .for_each(|(sum, k)| *sum += ratio * k);
            }
            for b in 0..covariance.nrows() {
                covariance[(b, b)] += more * ratio;
            }
            covariance
        };
        let mut factors = INEXACT.iter().map(|&more| factorised(with(more)));
        let lower = factors.find_map(|factor| factor).ok_or_else(|| {
            Error::program(
                "the noise of the measurement",
                "a positive definite covariance of the averages over squares of the field",
            )
            .found(format!("l = {length_mm} mm, rho = {ratio}"))
            .hint("are there many points in one place, or a few far from all others?")
        })?;
        Ok(Self {
            length_mm,
            ratio,
            white: point,
            lower,
        })
    }

    /// L^-1 X for columns X (blocks x p): identity covariance s^2 I if X's rows had C.
    pub fn whiten(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, p) = columns.shape();
        let mut white = columns.clone();
        solve_lower_triangular_in_place(
            MatRef::from_column_major_slice(self.lower.as_slice(), n, n),
            MatMut::from_column_major_slice_mut(white.as_mut_slice(), n, p),
            Par::Seq,
        );
        white
    }

    /// L^-1 y for one vector of block averages.
    pub fn whiten_vector(&self, y: &DVector<f64>) -> DVector<f64> {
        let white = self.whiten(&DMatrix::from_column_slice(y.len(), 1, y.as_slice()));
        DVector::from_column_slice(white.as_slice())
    }

    /// C^-1 at s = 1, blocks x blocks.
    pub fn inverse(&self) -> DMatrix<f64> {
        let n = self.lower.nrows();
        crate::dense::gram(&self.whiten(&DMatrix::identity(n, n)))
    }

    /// L X for columns X (blocks x p): covariance s^2 C if X's rows were independent of variance s^2.
    pub fn colour(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        &self.lower * columns
    }

    /// log det C at s = 1.
    pub fn log_det(&self) -> f64 {
        2.0 * (0..self.lower.nrows())
            .map(|b| self.lower[(b, b)].ln())
            .sum::<f64>()
    }

    /// Mean variance of a block's average at s = 1.
    pub fn mean_variance(&self) -> f64 {
        self.lower.norm_squared() / self.lower.nrows() as f64
    }

    /// Variance of a single point at s = 1: nbar, or that of the given white part, + rho (correlated).
    pub fn point_variance(&self) -> f64 {
        self.white + self.ratio
    }

    /// Effective number of independent points, n_eff = s_total^2 1' C^-1 1: the number of independent points with
    /// the same total variance that would know the mean as well. It does not depend on s.
    pub fn effective_points(&self) -> f64 {
        let ones = self.whiten_vector(&DVector::from_element(self.lower.nrows(), 1.0));
        self.point_variance() * ones.norm_squared()
    }
}

/// `f` of the covariance of `blocks` for every length and ratio, lengths outermost, ratios within; in parallel, with only the
/// covariances at work in memory. Without correlation every length is the same: a ratio of zero comes with the first length only.
///
/// # Errors
/// Of the program: a factorisation that fails, or the first error of `f`.
pub fn over_grid<T: Send>(
    blocks: &Blocks,
    lengths_mm: &[f64],
    ratios: &[f64],
    f: impl Fn(&BlockCovariance) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let materns: Vec<Matern> = lengths_mm
        .par_iter()
        .map(|&l| Matern::new(blocks, l))
        .collect();
    let places: Vec<(usize, &Matern, f64)> = materns
        .iter()
        .enumerate()
        .flat_map(|(k, m)| ratios.iter().map(move |&r| (k, m, r)))
        .filter(|(k, _, ratio)| *k == 0 || *ratio != 0.0)
        .collect();
    // collected in full first, so that the error reported is the first one for any number of threads
    let results: Vec<Result<T>> = places
        .into_par_iter()
        .map(|(_, matern, ratio)| f(&BlockCovariance::new(blocks, matern, ratio)?))
        .collect();
    results.into_iter().collect()
}
