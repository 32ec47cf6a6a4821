//! Gaussian random fields with Matern-3/2 correlation on a regular lattice, exact but for rounding.
//!
//! Circulant embedding (Dietrich and Newsam 1997): the lattice is part of a torus large enough for the correlation to
//! have died off around it, whose covariance a discrete Fourier transform diagonalises.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Correlation lengths that the torus extends beyond the lattice: the correlation there is below 1e-5.
const MARGIN_LENGTHS: f64 = 8.0;

/// Points of a torus along one axis, at most.
const MOST_POINTS: f64 = 2048.0;

/// Points of a coarser lattice to the correlation length, at least.
const FINE: f64 = 100.0;

/// Two independent fields of unit variance and correlation length `l` (mm) on `shape` (rows, columns) points with the
/// `spacing` (mm) of rows and of columns, row by row. Where the correlation reaches over more points than a torus may have,
/// they are made on a coarser lattice and interpolated.
pub fn matern_pair(
    shape: [usize; 2],
    spacing: [f64; 2],
    l: f64,
    rng: &mut impl Rng,
) -> [Vec<f64>; 2] {
    let coarser = [0, 1].map(|k| {
        let wanted = (shape[k] as f64 + MARGIN_LENGTHS * l / spacing[k]) / MOST_POINTS;
        wanted
            .ceil()
            .clamp(1.0, (l / spacing[k] / FINE).max(1.0).floor())
    });
    if coarser == [1.0; 2] {
        return on_lattice(shape, spacing, l, rng);
    }
    let nodes = [0, 1].map(|k| (shape[k].max(2) as f64 / coarser[k]).ceil() as usize + 1);
    let pair = on_lattice(nodes, [0, 1].map(|k| coarser[k] * spacing[k]), l, rng);
    pair.map(|values| {
        let at = |i: usize, j: usize| values[i * nodes[1] + j];
        let between = |i: usize, j: usize| {
            let (y, x) = (i as f64 / coarser[0], j as f64 / coarser[1]);
            let (row, col) = (y as usize, x as usize);
            let (b, a) = (y.fract(), x.fract());
            (1.0 - b) * ((1.0 - a) * at(row, col) + a * at(row, col + 1))
                + b * ((1.0 - a) * at(row + 1, col) + a * at(row + 1, col + 1))
        };
        (0..shape[0] * shape[1])
            .map(|k| between(k / shape[1], k % shape[1]))
            .collect()
    })
}

/// The same on a torus of the lattice's own spacing.
fn on_lattice(shape: [usize; 2], spacing: [f64; 2], l: f64, rng: &mut impl Rng) -> [Vec<f64>; 2] {
    let size = [0, 1].map(|k| {
        let beyond = (MARGIN_LENGTHS * l / spacing[k]).ceil() as usize;
        (shape[k] + beyond).next_power_of_two()
    });
    let distance = |i: usize, k: usize| i.min(size[k] - i) as f64 * spacing[k];
    let rate = 3_f64.sqrt() / l;
    let mut spectrum = vec![Complex::default(); size[0] * size[1]];
    for i in 0..size[0] {
        for j in 0..size[1] {
            let ad = rate * distance(i, 0).hypot(distance(j, 1));
            spectrum[i * size[1] + j].re = (1.0 + ad) * (-ad).exp();
        }
    }
    transform(&mut spectrum, size);
    let points = (size[0] * size[1]) as f64;
    for value in &mut spectrum {
        // What rounding and the cut at the margin make negative is as good as zero.
        let amplitude = (value.re.max(0.0) / points).sqrt();
        let (a, b): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
        *value = Complex::new(amplitude * a, amplitude * b);
    }
    transform(&mut spectrum, size);
    let rows = (0..shape[0]).map(|i| &spectrum[i * size[1]..i * size[1] + shape[1]]);
    rows.flatten()
        .map(|value| (value.re, value.im))
        .unzip()
        .into()
}

/// Discrete Fourier transform of both axes, in place.
fn transform(values: &mut [Complex<f64>], [rows, cols]: [usize; 2]) {
    let mut planner = FftPlanner::new();
    planner.plan_fft_forward(cols).process(values);
    let along_columns = planner.plan_fft_forward(rows);
    let mut column = vec![Complex::default(); rows];
    for j in 0..cols {
        for (i, value) in column.iter_mut().enumerate() {
            *value = values[i * cols + j];
        }
        along_columns.process(&mut column);
        for (i, value) in column.iter().enumerate() {
            values[i * cols + j] = *value;
        }
    }
}
