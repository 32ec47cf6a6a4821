//! Residuals of all frames and of what the two states share, and the normal equations of a Gauss-Newton step.

use nalgebra::{DMatrix, DVector, Matrix3};
use rayon::prelude::*;

use super::parameters::ShiftParameters;
use super::shifts::{Fringe, StateFit, variances};

/// A pixel that deviates by more sds (of its sum of squares) is left out.
const MOST_DEVIATION: f64 = 5.0;

/// Intensities of a pixel in the frames of both states.
pub type Intensities = [Vec<u16>; 2];

/// The detector: the largest of its values that occurs, and how often the fitted pixels have some of them.
pub struct Camera {
    pub largest: u16,
    pub histogram: Vec<(u16, f64)>,
}

impl Camera {
    pub fn new(pixels: &[Intensities], largest: u16) -> Self {
        const COUNTED: usize = 256;
        let mut values: Vec<u16> = pixels.iter().flatten().flatten().copied().collect();
        values.sort_unstable();
        let stride = values.len() / COUNTED + 1;
        let histogram = values.into_iter().step_by(stride).map(|v| (v, 1.0));
        Self {
            largest,
            histogram: histogram.collect(),
        }
    }

    /// A grey level where eight bits are used, in the recorded unit.
    pub fn level(&self) -> f64 {
        f64::from(self.largest) / 255.0
    }
}

/// Sds that residuals are divided by: of an intensity, and by which backgrounds and modulations differ beyond noise.
#[derive(Debug, Clone, Copy)]
pub struct ResidualScales {
    pub noise: f64,
    pub unshared: [f64; 2],
}

/// phi_final - phi_initial, wrapped, rad.
pub fn phase_difference([[_, c0, s0], [_, c1, s1]]: [Fringe; 2]) -> f64 {
    (s1 * c0 - c1 * s0).atan2(c1 * c0 + s1 * s0)
}

/// Differences of background and of modulation between the states, and their variances for noise of sd 1.
pub fn shared(
    ratio: [f64; 2],
    covariance: [&Matrix3<f64>; 2],
    fringes: [Fringe; 2],
) -> [(f64, f64); 2] {
    let modulation = fringes.map(|[_, c, s]| c.hypot(s));
    let [of_b, of_m] = ratio;
    let variance_b = of_b.powi(2) * covariance[0][(0, 0)] + covariance[1][(0, 0)];
    let variance_m = of_m.powi(2) * variances(covariance[0], fringes[0]).0
        + variances(covariance[1], fringes[1]).0;
    [
        (of_b * fringes[0][0] - fringes[1][0], variance_b),
        (of_m * modulation[0] - modulation[1], variance_m),
    ]
}

/// Everything at one set of parameters.
pub struct Evaluated {
    fits: [StateFit; 2],
    table: Vec<f64>,
    ratio: [f64; 2],
}

impl Evaluated {
    /// `None` where the frames do not tell phase from background.
    pub fn new(parameters: &ShiftParameters, camera: &Camera) -> Option<Self> {
        Some(Self {
            fits: [parameters.shifts[0].fit()?, parameters.shifts[1].fit()?],
            table: parameters.response.table(&camera.histogram, camera.largest),
            ratio: parameters.ln_ratio.map(f64::exp),
        })
    }

    fn light<'a>(&'a self, values: &'a [u16]) -> impl Iterator<Item = f64> + 'a {
        values.iter().map(|v| self.table[usize::from(*v)])
    }

    /// Residuals of a pixel in units of their sds: of all frames, then of the two shared quantities; and its fringes.
    fn residuals(
        &self,
        pixel: &Intensities,
        scales: ResidualScales,
        out: &mut [f64],
    ) -> [Fringe; 2] {
        let frames = pixel[0].len();
        let fringes = [0, 1].map(|s| self.fits[s].fringe(self.light(&pixel[s])));
        for state in 0..2 {
            let left = self.fits[state].residual(fringes[state], self.light(&pixel[state]));
            for (out, left) in out[state * frames..].iter_mut().zip(left) {
                *out = left / scales.noise;
            }
        }
        let shared = self.shared(fringes);
        for k in 0..2 {
            let (difference, variance) = shared[k];
            let sd = (variance * scales.noise.powi(2) + scales.unshared[k].powi(2)).sqrt();
            out[2 * frames + k] = difference / sd;
        }
        fringes
    }

    fn shared(&self, fringes: [Fringe; 2]) -> [(f64, f64); 2] {
        let [first, second] = &self.fits;
        shared(self.ratio, [&first.covariance, &second.covariance], fringes)
    }

    /// Sum of squares over pixels of which no one counts more than a far one.
    pub fn chi2(&self, pixels: &[Intensities], scales: ResidualScales) -> f64 {
        let rows = pixels.first().map_or(0, |p| 2 * p[0].len() + 2);
        let of = |pixel: &Intensities| {
            let mut out = vec![0.0; rows];
            self.residuals(pixel, scales, &mut out);
            let sum: f64 = out.iter().map(|r| r * r).sum();
            sum.min(farthest(pixel[0].len()))
        };
        // in order, so that the sum does not depend on the threads
        let all: Vec<f64> = pixels.par_iter().map(of).collect();
        all.iter().sum()
    }
}

/// Largest sum of squares of a pixel that is taken for one of its own kind.
fn farthest(frames: usize) -> f64 {
    let freedom = (2 * frames - 4) as f64;
    freedom + MOST_DEVIATION * (2.0 * freedom).sqrt() + MOST_DEVIATION.powi(2)
}

/// Normal equations, and what the residuals are.
pub struct ShiftEquations {
    pub matrix: DMatrix<f64>,
    pub right: DVector<f64>,
    /// Sum over chunks of neighbouring pixels of the squares of their parts of `right`: as much as `matrix` where residuals are independent.
    pub scatter: DMatrix<f64>,
    /// Sums over pixels of g g' and g, g the derivative of the phase difference.
    pub phase: DMatrix<f64>,
    pub phase_mean: DVector<f64>,
    pub pixels: usize,
    /// Sums of squares of the frames' residuals and of the differences of background and modulation, in the recorded unit.
    pub squares: [f64; 3],
    /// Noise's part in the latter two, for noise of sd 1.
    pub expected: [f64; 2],
}

impl ShiftEquations {
    fn new(parameters: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(parameters, parameters),
            right: DVector::zeros(parameters),
            scatter: DMatrix::zeros(parameters, parameters),
            phase: DMatrix::zeros(parameters, parameters),
            phase_mean: DVector::zeros(parameters),
            pixels: 0,
            squares: [0.0; 3],
            expected: [0.0; 2],
        }
    }

    /// At all pixels. With `only_ratios` nothing but the two ratios is free.
    pub fn of(
        parameters: &ShiftParameters,
        pixels: &[Intensities],
        scales: ResidualScales,
        camera: &Camera,
        only_ratios: bool,
    ) -> Option<Self> {
        const CHUNK: usize = 500;
        let base = Evaluated::new(parameters, camera)?;
        let free = (0..parameters.count()).filter(|k| !only_ratios || parameters.is_ratio(*k));
        let moved = |k: usize| {
            let mut moved = parameters.clone();
            *moved.at(k) += STEP;
            Some((k, Evaluated::new(&moved, camera)?))
        };
        let moved: Vec<(usize, Evaluated)> = free.map(moved).collect::<Option<_>>()?;
        let sums: Vec<Self> = pixels
            .par_chunks(CHUNK)
            .map(|chunk| Self::of_chunk(parameters.count(), chunk, scales, &base, &moved))
            .collect();
        sums.into_iter().reduce(Self::add)
    }

    fn of_chunk(
        count: usize,
        chunk: &[Intensities],
        scales: ResidualScales,
        base: &Evaluated,
        moved: &[(usize, Evaluated)],
    ) -> Self {
        let mut sum = Self::new(count);
        let frames = chunk.first().map_or(0, |p| p[0].len());
        let rows = 2 * frames + 2;
        let (mut here, mut there) = (vec![0.0; rows], vec![0.0; rows]);
        // columns of the free parameters alone
        let mut slope = DMatrix::zeros(rows * chunk.len(), moved.len());
        let mut all = DVector::zeros(rows * chunk.len());
        let mut of_phase = DMatrix::zeros(chunk.len(), moved.len());
        for (i, pixel) in chunk.iter().enumerate() {
            let fringes = base.residuals(pixel, scales, &mut here);
            if here.iter().map(|r| r * r).sum::<f64>() > farthest(frames) {
                continue;
            }
            sum.count(&here[..2 * frames], scales, base.shared(fringes));
            let phase = phase_difference(fringes);
            for (column, (_, moved)) in moved.iter().enumerate() {
                let to = phase_difference(moved.residuals(pixel, scales, &mut there));
                for row in 0..rows {
                    slope[(i * rows + row, column)] = (there[row] - here[row]) / STEP;
                }
                of_phase[(i, column)] = wrapped(to - phase) / STEP;
            }
            all.rows_mut(i * rows, rows).copy_from_slice(&here);
        }
        let (matrix, right) = (slope.tr_mul(&slope), slope.tr_mul(&all));
        let (phase, phase_mean) = (of_phase.tr_mul(&of_phase), of_phase.row_sum_tr());
        for (a, (i, _)) in moved.iter().enumerate() {
            sum.right[*i] = right[a];
            sum.phase_mean[*i] = phase_mean[a];
            for (b, (j, _)) in moved.iter().enumerate() {
                sum.matrix[(*i, *j)] = matrix[(a, b)];
                sum.phase[(*i, *j)] = phase[(a, b)];
            }
        }
        sum.scatter = &sum.right * sum.right.transpose();
        sum
    }

    fn count(&mut self, of_frames: &[f64], scales: ResidualScales, shared: [(f64, f64); 2]) {
        self.pixels += 1;
        self.squares[0] += of_frames
            .iter()
            .map(|r| (r * scales.noise).powi(2))
            .sum::<f64>();
        for (k, (difference, variance)) in shared.into_iter().enumerate() {
            self.squares[1 + k] += difference * difference;
            self.expected[k] += variance;
        }
    }

    fn add(mut self, other: Self) -> Self {
        self.matrix += other.matrix;
        self.right += other.right;
        self.scatter += other.scatter;
        self.phase += other.phase;
        self.phase_mean += other.phase_mean;
        self.pixels += other.pixels;
        (0..3).for_each(|k| self.squares[k] += other.squares[k]);
        (0..2).for_each(|k| self.expected[k] += other.expected[k]);
        self
    }

    /// Scales that these residuals speak for.
    pub fn scales(&self, frames: usize) -> ResidualScales {
        let n = self.pixels as f64;
        let variance = if frames > 3 {
            self.squares[0] / (n * (2 * frames - 6) as f64)
        } else {
            // three frames leave no residual of their own: what the states share is all there is
            let of = |k: usize| self.squares[1 + k] / self.expected[k];
            of(0).min(of(1))
        };
        let excess = |k: usize| (self.squares[1 + k] - variance * self.expected[k]) / n;
        ResidualScales {
            noise: variance.sqrt(),
            unshared: [0, 1].map(|k| excess(k).max(0.0).sqrt()),
        }
    }
}

/// Step of the difference quotients: steps in rad, gains and logarithms are of the order 1.
const STEP: f64 = 1e-5;

fn wrapped(x: f64) -> f64 {
    x - std::f64::consts::TAU * (x / std::f64::consts::TAU).round()
}
