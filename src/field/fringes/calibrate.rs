//! What the frames were: steps, gains and the detector's response, from the images themselves. All frames of both states are fitted at once,
//! by least squares over their parameters and, at each pixel, background, modulation and two phases: the two states are pictures of one
//! surface, so they share background and modulation up to their brightness. That fixes the steps where a picture holds few fringes, which
//! the frames of one state do not (with N = 4 one combination of the steps is left undetermined; Wang and Han, Opt. Lett. 29 (2004) 1671,
//! take it from many fringes).

use nalgebra::{DMatrix, Matrix3};
use rayon::prelude::*;

use super::clear::{Clear, StateFrames};
use super::images::ImageStack;
use super::noise::{IntensityNoise, VarianceAt};
use super::parameters::ShiftParameters;
use super::residuals::{Camera, Evaluated, Intensities, ResidualScales, ShiftEquations, shared};
use super::response::Response;
use super::shifts::{Fringe, Shifts};
use super::spec::{FringeImages, PhaseSteps};

/// Intensities that are fitted, of all frames together: the more frames, the fewer pixels are needed.
const INTENSITIES: usize = 60_000;
/// Fewer pixels with fringes are none.
const FEWEST: usize = 200;
/// A pixel whose modulation is below this share of that of bright ones is not fitted, and which pixels are bright. Not by the noise: what
/// wrong steps leave of the frames is not to be taken for it.
const DIMMEST: f64 = 0.3;
const BRIGHT: f64 = 0.99;

/// What was found of one component.
#[derive(Debug)]
pub struct Calibration {
    /// Of the initial and the final state.
    pub shifts: [Shifts; 2],
    pub response: Response,
    /// Light intensity of every recorded value.
    pub light: Vec<f64>,
    /// Brightness of the final state's background and modulation relative to the initial one's.
    pub ratio: [f64; 2],
    /// Of an intensity.
    pub noise: IntensityNoise,
    /// Sds by which the two states' backgrounds and modulations differ beyond noise, same unit.
    pub unshared: [f64; 2],
    /// rms error of the phase difference that the uncertainty of all this leaves, rad.
    pub left_rad: f64,
}

/// Which steps were taken, and why.
#[derive(Debug, Clone, Copy)]
pub struct ChosenSteps {
    /// Nominal or estimated.
    pub steps: PhaseSteps,
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
    states: [&StateFrames; 2],
    spec: &FringeImages,
    stack: &ImageStack,
) -> Option<(Calibration, ChosenSteps)> {
    let nominal = ShiftParameters::nominal(spec.frames, spec.step_deg.to_radians());
    let places = fitted_pixels(states, &nominal.shifts[0], stack)?;
    let gathered = |i: &usize| states.map(|frames| frames.iter().map(|f| f[*i]).collect());
    let pixels: Vec<Intensities> = places.iter().map(gathered).collect();
    let camera = Camera::new(&pixels, stack.largest);
    let noise = first_noise(&pixels, &nominal.shifts[0], camera.level())?;
    let fit = |only_ratios| Fitted::new(&nominal, &pixels, &camera, noise, only_ratios);
    let (fitted, chosen) = match spec.steps {
        PhaseSteps::Nominal => (fit(true)?, None),
        PhaseSteps::Estimated => (fit(false)?, None),
        PhaseSteps::Auto => {
            let (plain, free) = (fit(true)?, fit(false)?);
            let gain = free.log_ratio(&plain, &pixels, &camera)?;
            (if gain > 0.0 { free } else { plain }, Some(gain))
        }
    };
    let chosen = ChosenSteps {
        steps: if fitted.only_ratios {
            PhaseSteps::Nominal
        } else {
            PhaseSteps::Estimated
        },
        log_ratio: chosen,
    };
    let mut found = fitted.calibration(&camera);
    found.noise = measured_noise(states, &places, &stack.clear, &found)?;
    Some((found, chosen))
}

/// Parameters at the least sum of squares.
struct Fitted {
    parameters: ShiftParameters,
    covariance: DMatrix<f64>,
    sums: ShiftEquations,
    scales: ResidualScales,
    only_ratios: bool,
}

impl Fitted {
    fn new(
        start: &ShiftParameters,
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
        let mut scales = ResidualScales {
            noise: wide,
            unshared: [wide; 2],
        };
        for pass in 0..PASSES {
            let sums = ShiftEquations::of(&parameters, pixels, scales, camera, only_ratios)?;
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
        let chi2 = |p: &ShiftParameters| Some(Evaluated::new(p, camera)?.chi2(pixels, self.scales));
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
        let rms = |covariance: &DMatrix<f64>| (&centred * covariance).trace().max(0.0).sqrt();
        // where what the states do not share varies smoothly over the picture, the residuals of neighbours are not independent, and the
        // parameters less sure than their number says (Liang and Zeger, Biometrika 73 (1986) 13)
        let of_scatter = &self.covariance * &self.sums.scatter * &self.covariance;
        let left_rad = rms(&self.covariance).max(rms(&of_scatter));
        let ShiftParameters {
            shifts,
            response,
            ln_ratio,
        } = self.parameters;
        Calibration {
            light: response.table(&camera.histogram, camera.largest),
            shifts,
            response,
            ratio: ln_ratio.map(f64::exp),
            noise: IntensityNoise::even(self.scales.noise.powi(2)),
            unshared: self.scales.unshared,
            left_rad,
        }
    }
}

/// One step of Gauss and Newton, shortened to a prior sd: its largest part in prior sds, and the covariance.
fn step(
    parameters: &mut ShiftParameters,
    start: &ShiftParameters,
    sums: &ShiftEquations,
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

/// Places of pixels that show fringes in both states and are clipped in neither, thinned; none at the end of a row.
fn fitted_pixels(
    states: [&StateFrames; 2],
    nominal: &Shifts,
    stack: &ImageStack,
) -> Option<Vec<usize>> {
    let fit = nominal.fit()?;
    let modulation = |frames: &StateFrames, i: usize| {
        let [_, c, s] = fit.fringe(frames.iter().map(|f| f64::from(f[i])));
        c.hypot(s)
    };
    let both = |i: usize| modulation(states[0], i).min(modulation(states[1], i));
    let inner = (0..states[0][0].len()).filter(|i| !(i + 1).is_multiple_of(stack.cols));
    let inner: Vec<usize> = inner.collect();
    let all: Vec<(usize, f64)> = inner
        .par_iter()
        .filter(|&&i| stack.clear.shows(states, i))
        .map(|&i| (i, both(i)))
        .collect();
    let mut sorted: Vec<f64> = all.iter().map(|(_, m)| *m).collect();
    sorted.sort_by(f64::total_cmp);
    let least = DIMMEST * sorted.get((BRIGHT * sorted.len() as f64) as usize)?;
    let shown: Vec<usize> = all
        .iter()
        .filter(|(_, m)| *m > least)
        .map(|(i, _)| *i)
        .collect();
    let most = INTENSITIES / states[0].len();
    // an odd stride visits all columns of most pictures
    let stride = shown.len().div_ceil(most).max(1) | 1;
    let places: Vec<usize> = shown.into_iter().step_by(stride).collect();
    (places.len() >= FEWEST).then_some(places)
}

/// About the noise of an intensity, to begin with: what nominal frames leave at a typical pixel, at least half a grey level (`level`); a level
/// where three frames leave nothing.
fn first_noise(pixels: &[Intensities], nominal: &Shifts, level: f64) -> Option<f64> {
    let fit = nominal.fit()?;
    let freedom = nominal.gain.len() - 3;
    if freedom == 0 {
        return Some(level);
    }
    let left = |pixel: &Intensities| {
        let light = || pixel[0].iter().map(|v| f64::from(*v));
        let residual = fit.residual(fit.fringe(light()), light());
        residual.map(|r| r * r).sum::<f64>()
    };
    let mut squares: Vec<f64> = pixels.iter().map(left).collect();
    squares.sort_by(f64::total_cmp);
    let middle = squares.get(squares.len() / 2)?;
    Some((middle / freedom as f64).sqrt().max(0.5 * level))
}

/// From what the frames of pixels leave beyond their fringes; of three frames, which leave nothing, from what the difference of the
/// states' backgrounds and modulations varies by from pixel to pixel. `pixels` are places in the picture, none at the end of a row.
fn measured_noise(
    states: [&StateFrames; 2],
    pixels: &[usize],
    clear: &Clear,
    calibration: &Calibration,
) -> Option<IntensityNoise> {
    let fits = [calibration.shifts[0].fit()?, calibration.shifts[1].fit()?];
    let light = |s: usize, i: usize| {
        let values = states[s].iter().map(move |f| usize::from(f[i]));
        values.map(|v| calibration.light[v])
    };
    let fringes = |i: usize| [0, 1].map(|s| fits[s].fringe(light(s, i)));
    let covariance = [&fits[0].covariance, &fits[1].covariance];
    let freedom = 2 * states[0].len() - 6;
    let mean = |f: &[Fringe; 2]| 0.5 * (f[0][0] + f[1][0]);
    let seen = |&i: &usize| -> Option<VarianceAt> {
        let here = fringes(i);
        if freedom > 0 {
            let of = |s: usize| fits[s].residual(here[s], light(s, i));
            let left: f64 = (0..2).flat_map(of).map(|r| r * r).sum();
            return Some((mean(&here), left / freedom as f64));
        }
        if !clear.shows(states, i + 1) {
            return None;
        }
        let there = fringes(i + 1);
        let shared = [here, there].map(|f| calibration.shared(covariance, f));
        let of = |k: usize| {
            let difference = shared[0][k].0 - shared[1][k].0;
            difference * difference / (shared[0][k].1 + shared[1][k].1)
        };
        Some((mean(&here), 0.5 * (of(0) + of(1))))
    };
    IntensityNoise::fit(pixels.iter().filter_map(seen).collect())
}
