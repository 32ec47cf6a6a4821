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

use super::blocks::Blocks;
use crate::error::{Error, Result};

/// Correlation lengths that count as noise, mm.
pub const NOISE_LENGTHS_MM: [f64; 3] = [0.4, 0.8, 1.5];
/// Correlation lengths that count as discrepancy of the model, mm.
pub const DISCREPANCY_LENGTHS_MM: [f64; 3] = [3.0, 6.0, 12.0];
/// Ratios rho of the correlated to the white variance of a block.
pub const RATIOS: [f64; 10] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0];

/// Correlation of block averages for one length: the Matern-3/2 kernel (1 + a d) exp(-a d), a = sqrt(3) / l, averaged
/// over both blocks.
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
        let kernel = BlockKernel::new(blocks.size_mm, length_mm);
        let mut correlation = DMatrix::zeros(n, n);
        for j in 0..n {
            for i in j..n {
                let (a, b) = (blocks.centroid[i], blocks.centroid[j]);
                let value = kernel.average([a[0] - b[0], a[1] - b[1]]);
                correlation[(i, j)] = value;
                correlation[(j, i)] = value;
            }
        }
        Self {
            length_mm,
            correlation,
        }
    }
}

/// The kernel between two squares of side `size`.
struct BlockKernel {
    /// a = sqrt(3) / l.
    rate: f64,
    size: f64,
    /// Offsets between points of two blocks in one direction, with the weights of their triangular distribution.
    offsets: [(f64, f64); 8],
}

impl BlockKernel {
    fn new(size: f64, length_mm: f64) -> Self {
        // Gauss-Legendre on [0, 1], by halves of the triangle 1 - |d|, whose kink a joint rule would miss
        const NODES: [(f64, f64); 4] = [
            (0.069_431_844_202_973_7, 0.173_927_422_568_726_9),
            (0.330_009_478_207_571_9, 0.326_072_577_431_273_1),
            (0.669_990_521_792_428_1, 0.326_072_577_431_273_1),
            (0.930_568_155_797_026_3, 0.173_927_422_568_726_9),
        ];
        let mut offsets = [(0.0, 0.0); 8];
        for (k, (node, weight)) in NODES.into_iter().enumerate() {
            offsets[2 * k] = (node * size, weight * (1.0 - node));
            offsets[2 * k + 1] = (-node * size, weight * (1.0 - node));
        }
        Self {
            rate: 3_f64.sqrt() / length_mm,
            size,
            offsets,
        }
    }

    fn point(&self, distance: f64) -> f64 {
        let ad = self.rate * distance;
        (1.0 + ad) * (-ad).exp()
    }

    /// Mean over both blocks, their centres `offset` apart.
    fn average(&self, offset: [f64; 2]) -> f64 {
        let distance = offset[0].hypot(offset[1]);
        if distance > 4.0 * self.size {
            // far off the mean differs by the Laplacian times the variance of a point's place: 2 size^2 / 12 / 2
            let ad = self.rate * distance;
            let laplacian = -self.rate * self.rate * (-ad).exp() * (2.0 - ad);
            return (self.point(distance) + self.size * self.size / 12.0 * laplacian).max(0.0);
        }
        let mut sum = 0.0;
        for (dx, wx) in self.offsets {
            for (dy, wy) in self.offsets {
                sum += wx * wy * self.point((offset[0] + dx).hypot(offset[1] + dy));
            }
        }
        sum
    }
}

/// A factorised covariance of block averages at s = 1.
#[derive(Debug, Clone)]
pub struct BlockCovariance {
    /// Correlation length l, mm.
    pub length_mm: f64,
    /// Ratio rho.
    pub ratio: f64,
    mean_count: f64,
    /// Lower Cholesky factor of C at s = 1.
    lower: DMatrix<f64>,
}

impl BlockCovariance {
    /// Factorise diag(nbar / n_b) + `ratio` K.
    ///
    /// # Errors
    /// Of the program, if the matrix is not positive definite.
    pub fn new(blocks: &Blocks, matern: &Matern, ratio: f64) -> Result<Self> {
        let n = blocks.len();
        let mean_count = blocks.mean_count();
        let mut lower = &matern.correlation * ratio;
        for (b, count) in blocks.count.iter().enumerate() {
            lower[(b, b)] += mean_count / *count as f64;
        }
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(
            n,
            Par::Seq,
            Default::default(),
        ));
        cholesky_in_place(
            MatMut::from_column_major_slice_mut(lower.as_mut_slice(), n, n),
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .map_err(|_| {
            let at = format!("l = {} mm, rho = {ratio}", matern.length_mm);
            Error::program(
                "field::covariance",
                "a positive definite covariance of the block averages",
            )
            .found(at)
        })?;
        lower.fill_upper_triangle(0.0, 1);
        Ok(Self {
            length_mm: matern.length_mm,
            ratio,
            mean_count,
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

    /// Variance of a single point at s = 1: nbar (white) + rho (correlated).
    pub fn point_variance(&self) -> f64 {
        self.mean_count + self.ratio
    }

    /// Effective number of independent points, n_eff = s_total^2 1' C^-1 1: the number of independent points with
    /// the same total variance that would know the mean as well. It does not depend on s.
    pub fn effective_points(&self) -> f64 {
        let ones = self.whiten_vector(&DVector::from_element(self.lower.nrows(), 1.0));
        self.point_variance() * ones.norm_squared()
    }
}

/// `f` of the covariance of `blocks` for every length and ratio, lengths outermost, ratios within; in parallel, with only the
/// covariances at work in memory.
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
    let settings: Vec<(&Matern, f64)> = materns
        .iter()
        .flat_map(|m| ratios.iter().map(move |&r| (m, r)))
        .collect();
    // collected in full first, so that the error reported is the first one for any number of threads
    let results: Vec<Result<T>> = settings
        .into_par_iter()
        .map(|(matern, ratio)| f(&BlockCovariance::new(blocks, matern, ratio)?))
        .collect();
    results.into_iter().collect()
}
