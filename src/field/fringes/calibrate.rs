//! What the frames were: steps, gains and the detector's response, from the images themselves. All frames of both states are fitted at once,
//! by least squares over their parameters and, at each pixel, background, modulation and two phases: the two states are pictures of one
//! surface, so they share background and modulation up to their brightness. That fixes the steps where a picture holds few fringes, which
//! the frames of one state do not (with N = 4 one combination of the steps is left undetermined; Wang and Han, Opt. Lett. 29 (2004) 1671,
//! take it from many fringes).

use nalgebra::{DMatrix, Matrix3};
use rayon::prelude::*;

use super::parameters::Parameters;
use super::residuals::{Camera, Evaluated, Intensities, Normal, Scales, shared};
use super::response::Response;
use super::shifts::{Fringe, Shifts};
use super::spec::{FringeImages, Steps};

/// Frames of one component in one state: intensities of every pixel, frame after frame.
pub type Frames = Vec<Vec<u16>>;

/// Intensities that are fitted, of all frames together: the more frames, the fewer pixels are needed.
const INTENSITIES: usize = 60_000;
/// Fewer pixels with fringes are none.
const FEWEST: usize = 200;
/// A pixel whose modulation is below so many sds of noise is not fitted.
const LEAST_MODULATION_SD: f64 = 8.0;

/// What was found of one component.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Of the initial and the final state.
    pub shifts: [Shifts; 2],
    pub response: Response,
    /// Light intensity of every recorded value.
    pub light: Vec<f64>,
    /// Brightness of the final state's background and modulation relative to the initial one's.
    pub ratio: [f64; 2],
    /// Sd of an intensity, in the recorded unit.
    pub noise: f64,
    /// Sds by which the two states' backgrounds and modulations differ beyond noise, same unit.
    pub unshared: [f64; 2],
    /// rms error of the phase difference that the uncertainty of all this leaves, rad.
    pub left_rad: f64,
}

/// Which steps were taken, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen {
    /// Nominal or estimated.
    pub steps: Steps,
    /// Log likelihood of the estimated frames over that of the nominal ones, less the BIC's price of their parameters; `None` where
    /// the file says which to take.
    pub log_ratio: Option<f64>,
}

impl Calibration {
    /// Differences of background and of modulation between the states at a pixel, and their variances for noise of sd 1.
    pub fn shared(&self, covariance: [&Matrix3<f64>; 2], fringes: [Fringe; 2]) -> [(f64, f64); 2] {
        shared(self.ratio, covariance, fringes)
    }
}

/// Find what the frames of a component were; `None` without fringes.
pub fn calibrate(
    states: [&Frames; 2],
    spec: &FringeImages,
    full_scale: u16,
    saturated: u16,
) -> Option<(Calibration, Chosen)> {
    let nominal = Parameters::nominal(spec.frames, spec.step_deg.to_radians());
    let level = f64::from(full_scale) / 255.0;
    let noise = first_noise(states, &nominal.shifts[0], level)?;
    let pixels = fitted_pixels(states, &nominal.shifts[0], noise, saturated)?;
    let camera = Camera::new(&pixels, full_scale);
    let fit = |only_ratios| Fitted::new(&nominal, &pixels, &camera, noise, only_ratios);
    let (fitted, chosen) = match spec.steps {
        Steps::Nominal => (fit(true)?, None),
        Steps::Estimated => (fit(false)?, None),
        Steps::Auto => {
            let (plain, free) = (fit(true)?, fit(false)?);
            let gain = free.log_ratio(&plain, &pixels, &camera)?;
            (if gain > 0.0 { free } else { plain }, Some(gain))
        }
    };
    let chosen = Chosen {
        steps: if fitted.only_ratios {
            Steps::Nominal
        } else {
            Steps::Estimated
        },
        log_ratio: chosen,
    };
    Some((fitted.calibration(&camera), chosen))
}

/// Parameters at the least sum of squares.
struct Fitted {
    parameters: Parameters,
    covariance: DMatrix<f64>,
    sums: Normal,
    scales: Scales,
    only_ratios: bool,
}

impl Fitted {
    fn new(
        start: &Parameters,
        pixels: &[Intensities],
        camera: &Camera,
        noise: f64,
        only_ratios: bool,
    ) -> Option<Self> {
        const PASSES: usize = 30;
        const SETTLED: f64 = 1e-3;
        let mut parameters = start.clone();
        // the first pass brings steps within reach: everything counts alike
        let wide = 10.0 * noise.max(camera.level());
        let mut scales = Scales {
            noise: wide,
            unshared: [wide; 2],
        };
        for pass in 0..PASSES {
            let sums = Normal::of(&parameters, pixels, scales, camera, only_ratios)?;
            if sums.pixels < FEWEST / 2 {
                return None;
            }
            let (largest, covariance) = step(&mut parameters, start, &sums)?;
            if (pass > 3 && largest < SETTLED) || pass + 1 == PASSES {
                return Some(Self {
                    parameters,
                    covariance,
                    sums,
                    scales,
                    only_ratios,
                });
            }
            scales = sums.scales(start.frames());
        }
        None
    }

    /// Log likelihood over that of another fit, less the BIC's price of the free parameters.
    fn log_ratio(&self, plain: &Self, pixels: &[Intensities], camera: &Camera) -> Option<f64> {
        let chi2 = |p: &Parameters| Some(Evaluated::new(p, camera)?.chi2(pixels, self.scales));
        // the overall phase of a state and its brightness are nobody's
        let free = self.parameters.count() - 6;
        let price = 0.5 * free as f64 * (pixels.len() as f64).ln();
        Some(0.5 * (chi2(&plain.parameters)? - chi2(&self.parameters)?) - price)
    }

    fn calibration(self, camera: &Camera) -> Calibration {
        let n = self.sums.pixels as f64;
        let mean = &self.sums.phase_mean / n;
        // the mean of the phase's error is a rigid displacement
        let centred = &self.sums.phase / n - &mean * mean.transpose();
        let Parameters {
            shifts,
            response,
            ln_ratio,
        } = self.parameters;
        Calibration {
            light: response.table(&camera.histogram, camera.full_scale),
            shifts,
            response,
            ratio: ln_ratio.map(f64::exp),
            noise: self.scales.noise,
            unshared: self.scales.unshared,
            left_rad: (&centred * &self.covariance).trace().max(0.0).sqrt(),
        }
    }
}

/// One step of Gauss and Newton, shortened to a prior sd: its largest part in prior sds, and the covariance.
fn step(
    parameters: &mut Parameters,
    start: &Parameters,
    sums: &Normal,
) -> Option<(f64, DMatrix<f64>)> {
    /// Precision with which a state's brightness is told by its ratio to the other, and not by its gains.
    const BRIGHTNESS: f64 = 1e12;
    let (count, frames) = (parameters.count(), parameters.frames());
    let mut matrix = sums.matrix.clone();
    let mut right = -sums.right.clone();
    let mut start = start.clone();
    for k in 0..count {
        let precision = parameters.sd(k).powi(-2);
        matrix[(k, k)] += precision;
        right[k] -= precision * (*parameters.at(k) - *start.at(k));
    }
    for first in [0, 1].map(|state| parameters.gains_of(state)) {
        let mut gains = matrix.view_mut((first, first), (frames, frames));
        gains.add_scalar_mut(BRIGHTNESS);
    }
    let factor = matrix.cholesky()?;
    let step = factor.solve(&right);
    let sizes = (0..count).map(|k| (step[k] / parameters.sd(k)).abs());
    let largest = sizes.fold(0.0, f64::max);
    let shorter = (1.0 / largest).min(1.0);
    for k in 0..count {
        *parameters.at(k) += shorter * step[k];
    }
    Some((largest, factor.inverse()))
}

/// Pixels that show fringes in both states and are clipped in neither, thinned.
fn fitted_pixels(
    states: [&Frames; 2],
    nominal: &Shifts,
    noise: f64,
    saturated: u16,
) -> Option<Vec<Intensities>> {
    let fit = nominal.fit()?;
    let least = LEAST_MODULATION_SD * noise;
    let shows = |frames: &Frames, i: usize| {
        let clear = frames.iter().all(|f| f[i] < saturated);
        let [_, c, s] = fit.fringe(frames.iter().map(|f| f64::from(f[i])));
        clear && c.hypot(s) > least
    };
    let all: Vec<usize> = (0..states[0][0].len())
        .into_par_iter()
        .filter(|&i| states.iter().all(|frames| shows(frames, i)))
        .collect();
    let most = INTENSITIES / states[0].len();
    // an odd stride visits all columns of most pictures
    let stride = all.len().div_ceil(most).max(1) | 1;
    let pixel = |i: &usize| states.map(|frames| frames.iter().map(|f| f[*i]).collect());
    let pixels: Vec<Intensities> = all.iter().step_by(stride).map(pixel).collect();
    (pixels.len() >= FEWEST).then_some(pixels)
}

/// About the noise of an intensity: what nominal frames leave at a typical pixel, at least half a grey level (`level`); a level where
/// three frames leave nothing.
fn first_noise(states: [&Frames; 2], nominal: &Shifts, level: f64) -> Option<f64> {
    const LOOKED_AT: usize = 20_000;
    let fit = nominal.fit()?;
    let freedom = states[0].len() - 3;
    if freedom == 0 {
        return Some(level);
    }
    let stride = states[0][0].len() / LOOKED_AT + 1;
    let left = |i: usize| {
        let light = || states[0].iter().map(|f| f64::from(f[i]));
        let residual = fit.residual(fit.fringe(light()), light());
        residual.map(|r| r * r).sum::<f64>()
    };
    let mut squares: Vec<f64> = (0..states[0][0].len()).step_by(stride).map(left).collect();
    squares.sort_by(f64::total_cmp);
    let middle = squares.get(squares.len() / 2)?;
    Some((middle / freedom as f64).sqrt().max(0.5 * level))
}
