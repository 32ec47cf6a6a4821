//! The phase difference of the two states at every pixel, its variance, and where it is measured at all.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::calibrate::Calibration;
use super::clear::{Clear, StateFrames};
use super::residuals::phase_difference;
use super::shifts::{Fringe, StateFit, variances};

/// A phase difference of a larger sd is not measured, rad: the article's fringes would then be drowned.
const MOST_SD_RAD: f64 = 0.35;
/// Frames or states that contradict each other by so many sds are of a spoiled pixel.
const MOST_DEVIATION: f64 = 6.0;
/// Finer fringes are not followed, per pixel: at half a fringe a pixel their direction is lost.
pub const FINEST: f64 = 0.42;
/// Pixels to each side over which the density of fringes is averaged.
const REACH: usize = 2;

/// Why a pixel is not measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pixel {
    Measured,
    /// Saturated, with less than three frames of a state that are not clipped.
    Clipped,
    /// No modulation above the noise, or none above the black level.
    Dark,
    /// Its frames contradict a fringe, or the two states each other.
    Spoiled,
    /// Fringes of the difference too fine to follow.
    TooFine,
    /// Too few connected pixels around it.
    Isolated,
}

/// One component's phase difference, row by row.
#[derive(Debug)]
pub struct PhaseMap {
    pub rows: usize,
    pub cols: usize,
    /// phi_final - phi_initial, rad; wrapped until it is unwrapped.
    pub difference: Vec<f64>,
    /// Its sd, rad.
    pub sd: Vec<f64>,
    /// Modulation of the initial state, in the recorded unit.
    pub modulation: Vec<f64>,
    pub pixel: Vec<Pixel>,
}

/// Density of fringes along a row and along a column, rad a pixel, averaged over the measured pixels nearby.
pub type FringeDensity = [Vec<f32>; 2];

/// What is said of one pixel: phase difference and sd, rad, modulation, and whether it is measured.
type Said = (f64, f64, f64, Pixel);

/// A state's fringe at a pixel, by the frames that are not clipped.
struct Solved {
    fringe: Fringe,
    /// Of the fringe, for noise of sd 1.
    covariance: Matrix3<f64>,
    /// Sum of squares that the frames leave, and how many they are beyond the unknowns.
    left: f64,
    freedom: usize,
}

/// The least squares of a component's frames, pixel by pixel.
pub struct Analysis<'a> {
    states: [&'a StateFrames; 2],
    calibration: &'a Calibration,
    clear: &'a Clear,
    fits: [StateFit; 2],
    /// All frames.
    every: Vec<usize>,
}

impl<'a> Analysis<'a> {
    /// `None` for steps that tell nothing.
    pub fn new(
        states: [&'a StateFrames; 2],
        calibration: &'a Calibration,
        clear: &'a Clear,
    ) -> Option<Self> {
        Some(Self {
            states,
            calibration,
            clear,
            fits: [calibration.shifts[0].fit()?, calibration.shifts[1].fit()?],
            every: (0..states[0].len()).collect(),
        })
    }

    /// `None` where too few frames are left.
    fn solved(&self, state: usize, i: usize) -> Option<Solved> {
        let frames = self.states[state];
        let light = |k: usize| self.calibration.light[usize::from(frames[k][i])];
        let by = |fit: &StateFit, frames: &[usize]| {
            let values = || frames.iter().map(|k| light(*k));
            let fringe = fit.fringe(values());
            Solved {
                fringe,
                covariance: fit.covariance,
                left: fit.residual(fringe, values()).map(|r| r * r).sum(),
                freedom: frames.len() - 3,
            }
        };
        if frames.iter().all(|f| self.clear.holds(f[i])) {
            return Some(by(&self.fits[state], &self.every));
        }
        let kept = self.every.iter().copied();
        let kept: Vec<usize> = kept.filter(|k| self.clear.holds(frames[*k][i])).collect();
        if kept.len() < 3 {
            return None;
        }
        let fit = self.calibration.shifts[state].of(&kept).fit()?;
        Some(by(&fit, &kept))
    }

    fn at(&self, i: usize) -> Said {
        let (Some(first), Some(second)) = (self.solved(0, i), self.solved(1, i)) else {
            let mut values = self.states.iter().flat_map(|s| s.iter().map(|f| f[i]));
            let pixel = if values.any(|v| self.clear.is_saturated(v)) {
                Pixel::Clipped
            } else {
                Pixel::Dark
            };
            return (f64::NAN, f64::NAN, f64::NAN, pixel);
        };
        let of = |s: &Solved| self.variance(s) * variances(&s.covariance, s.fringe).1;
        let variance = of(&first) + of(&second);
        let pixel = if variance.is_nan() || variance > MOST_SD_RAD.powi(2) {
            // a pixel of zeros has no phase, and no finite variance
            Pixel::Dark
        } else if self.is_contradicted(&first, &second) {
            Pixel::Spoiled
        } else {
            Pixel::Measured
        };
        let sd = (variance + self.calibration.left_rad.powi(2)).sqrt();
        let [_, c, s] = first.fringe;
        let fringes = [first.fringe, second.fringe];
        (phase_difference(fringes), sd, c.hypot(s), pixel)
    }

    /// Variance of an intensity about a fringe.
    fn variance(&self, solved: &Solved) -> f64 {
        self.calibration.noise.variance(solved.fringe[0])
    }

    /// Whether frames contradict a fringe, or the states that they are of one surface.
    fn is_contradicted(&self, first: &Solved, second: &Solved) -> bool {
        let noise2 = 0.5 * (self.variance(first) + self.variance(second));
        let freedom = (first.freedom + second.freedom) as f64;
        let most = freedom + MOST_DEVIATION * (2.0 * freedom).sqrt() + MOST_DEVIATION.powi(2);
        let covariance = [&first.covariance, &second.covariance];
        let fringes = [first.fringe, second.fringe];
        let shared = self.calibration.shared(covariance, fringes);
        let unshared = self.calibration.unshared;
        let far = |k: usize| {
            let (difference, variance) = shared[k];
            let sd = (variance * noise2 + unshared[k].powi(2)).sqrt();
            difference.abs() > MOST_DEVIATION * sd
        };
        first.left + second.left > most * noise2 || (0..2).any(far)
    }

    /// All pixels of a picture.
    pub fn phase(&self, rows: usize, cols: usize) -> PhaseMap {
        let pixels = (0..rows * cols).into_par_iter();
        let all: Vec<Said> = pixels.map(|i| self.at(i)).collect();
        let mut phase = PhaseMap {
            rows,
            cols,
            difference: all.iter().map(|a| a.0).collect(),
            sd: all.iter().map(|a| a.1).collect(),
            modulation: all.iter().map(|a| a.2).collect(),
            pixel: all.iter().map(|a| a.3).collect(),
        };
        phase.leave_out_fine(&phase.density());
        phase
    }

    /// Pixels of `phase` that are measured though a frame is clipped.
    pub fn partly_clipped(&self, phase: &PhaseMap) -> usize {
        let clipped = |i: &usize| phase.is_measured(*i) && !self.clear.shows(self.states, *i);
        (0..phase.pixel.len())
            .into_par_iter()
            .filter(clipped)
            .count()
    }

    /// What steps, gains and response leave of ripple: a wrong one modulates a state's modulation k times a fringe by as much as it shifts
    /// its phase. Relative to the other state's, so that the surface's own modulation does not enter; rad, for k = 1, 2, 3, of each state.
    pub fn ripple(&self, phase: &PhaseMap) -> [[f64; 3]; 2] {
        const LOOKED_AT: usize = 50_000;
        let stride = (phase.pixel.len() / LOOKED_AT) | 1;
        let ratio = self.calibration.ratio[1];
        let mut sums = [[[0.0; 2]; 3]; 2];
        let mut count = 0.0;
        let looked_at = (0..phase.pixel.len()).step_by(stride);
        for i in looked_at.filter(|i| phase.is_measured(*i) && self.clear.shows(self.states, *i)) {
            let (Some(first), Some(second)) = (self.solved(0, i), self.solved(1, i)) else {
                continue;
            };
            let fringes = [first.fringe, second.fringe];
            let [m0, m1] = fringes.map(|[_, c, s]| c.hypot(s));
            let beyond = 2.0 * (ratio * m0 - m1) / (ratio * m0 + m1);
            for (sums, [_, c, s]) in sums.iter_mut().zip(fringes) {
                let angle = s.atan2(c);
                for (k, sum) in sums.iter_mut().enumerate() {
                    let (sin, cos) = ((k + 1) as f64 * angle).sin_cos();
                    sum[0] += beyond * cos;
                    sum[1] += beyond * sin;
                }
            }
            count += 1.0;
        }
        sums.map(|of| of.map(|[c, s]| 2.0 * c.hypot(s) / f64::max(count, 1.0)))
    }
}

impl PhaseMap {
    pub fn is_measured(&self, i: usize) -> bool {
        self.pixel[i] == Pixel::Measured
    }

    /// Steps from pixel to pixel along rows and along columns, averaged as complex numbers over a square.
    pub fn density(&self) -> FringeDensity {
        let pixels = (0..self.pixel.len()).into_par_iter();
        // each measured pixel's phase as a complex number of the size of its precision
        let directions: Vec<[f32; 2]> = pixels
            .map(|i| {
                if !self.is_measured(i) {
                    return [0.0; 2];
                }
                let (sin, cos) = (self.difference[i] as f32).sin_cos();
                let weight = (1.0 / self.sd[i]) as f32;
                [weight * cos, weight * sin]
            })
            .collect();
        [1, self.cols].map(|next| {
            let step = |i: usize| {
                let j = i + next;
                let inside =
                    j < directions.len() && (next > 1 || !(i + 1).is_multiple_of(self.cols));
                if !inside {
                    return [0.0; 2];
                }
                let ([a, b], [c, d]) = (directions[i], directions[j]);
                [a * c + b * d, a * d - b * c]
            };
            let pixels = (0..directions.len()).into_par_iter();
            let products: Vec<[f32; 2]> = pixels.map(step).collect();
            let sums = self.summed(&products).into_par_iter();
            sums.map(|[c, s]| s.atan2(c)).collect()
        })
    }

    /// Sums over squares of side 2 [`REACH`] + 1.
    fn summed(&self, values: &[[f32; 2]]) -> Vec<[f32; 2]> {
        let (rows, cols) = (self.rows, self.cols);
        let mut along = vec![[0.0; 2]; values.len()];
        along
            .par_chunks_mut(cols)
            .enumerate()
            .for_each(|(row, out)| {
                for (col, out) in out.iter_mut().enumerate() {
                    for k in col.saturating_sub(REACH)..(col + REACH + 1).min(cols) {
                        let value = values[row * cols + k];
                        out[0] += value[0];
                        out[1] += value[1];
                    }
                }
            });
        let mut sums = vec![[0.0; 2]; values.len()];
        sums.par_chunks_mut(cols)
            .enumerate()
            .for_each(|(row, out)| {
                for k in row.saturating_sub(REACH)..(row + REACH + 1).min(rows) {
                    for (out, value) in out.iter_mut().zip(&along[k * cols..]) {
                        out[0] += value[0];
                        out[1] += value[1];
                    }
                }
            });
        sums
    }

    /// Leave out what cannot be followed.
    fn leave_out_fine(&mut self, density: &FringeDensity) {
        let most = (FINEST * std::f64::consts::TAU) as f32;
        for (i, pixel) in self.pixel.iter_mut().enumerate() {
            if *pixel == Pixel::Measured && density.iter().any(|d| d[i].abs() > most) {
                *pixel = Pixel::TooFine;
            }
        }
    }
}
