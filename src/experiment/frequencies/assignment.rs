//! How well measured peaks fit predicted modes when some modes leave no peak and some peaks are no mode.
//!
//! Every mode within the band leaves a peak with probability 1 - `missing`, at ln y ~ N(ln f, s^2), s^2 = (sd / y)^2 + `model_error`^2; further
//! peaks fall anywhere in the band, Poisson with `additional` expected. The likelihood is the sum over all assignments of modes to peaks,
//! so that it is smooth in the frequencies, whichever cross: no order is assumed, no assignment is chosen before the constants are known.

use nalgebra::DMatrix;

use super::lattice::{self, Choices, MOST_PEAKS, Sum};
use crate::error::{Error, Result};

/// A measured peak.
#[derive(Debug, Clone, Copy)]
pub struct FrequencyPeak {
    pub frequency_hz: f64,
    /// Standard deviation of the reading, Hz; the model's error comes on top.
    pub sd_hz: f64,
    /// Whether two opposite points of the plate moved against each other (m + n odd), where that was seen.
    pub odd: Option<bool>,
}

/// A predicted mode.
#[derive(Debug, Clone, Copy)]
pub struct PredictedFrequency {
    pub frequency_hz: f64,
    /// As [`super::VibrationMode::odd`].
    pub odd: Option<bool>,
}

/// What is stated about peaks and modes before they are compared.
#[derive(Debug, Clone, Copy)]
pub struct PeakModel {
    /// Sd of ln f by which the model is wrong beyond its parameters: 0.01 is one percent.
    pub model_error: f64,
    /// Probability that a mode within the band leaves no peak, in (0, 1).
    pub missing: f64,
    /// Expected number of peaks that are no mode, above 0.
    pub additional: f64,
    /// Probability that the observed parity of a true peak is wrong, in (0, 1).
    pub wrong_parity: f64,
    /// Lowest and highest frequency that was looked at, Hz.
    pub band_hz: [f64; 2],
}

/// The comparison of peaks with modes.
#[derive(Debug, Clone)]
pub struct Assigned {
    /// Log likelihood of the peaks (densities of ln y), summed over all assignments.
    pub log_likelihood: f64,
    /// Its derivatives by ln f of every mode.
    pub slope: Vec<f64>,
    /// Probability that a mode (row) is a peak (column), given the frequencies.
    pub matched: DMatrix<f64>,
    /// The likeliest single assignment: the peak of each mode.
    pub best: Vec<Option<usize>>,
}

impl Assigned {
    /// Probability that a mode left no peak.
    pub fn missing(&self, mode: usize) -> f64 {
        (1.0 - self.matched.row(mode).sum()).clamp(0.0, 1.0)
    }
}

impl PeakModel {
    /// Refuse what is no probability.
    ///
    /// # Errors
    /// The input's fault.
    pub fn validate(&self) -> Result<()> {
        for (place, p) in [
            ("probability of a missing mode", self.missing),
            ("probability of a wrong parity", self.wrong_parity),
        ] {
            if !(p > 0.0 && p < 1.0) {
                return Err(Error::input(place, "a number between 0 and 1").found(p));
            }
        }
        let [low, high] = self.band_hz;
        if !(low > 0.0 && high > low && high.is_finite()) {
            return Err(Error::input("band", "two increasing frequencies")
                .found(format!("{low} to {high}")));
        }
        if !(self.additional.is_finite() && self.additional > 0.0) {
            let expected = "a number above 0";
            return Err(Error::input("expected additional peaks", expected).found(self.additional));
        }
        if !(self.model_error.is_finite() && self.model_error >= 0.0) {
            let expected = "a number of at least 0";
            return Err(Error::input("model error", expected).found(self.model_error));
        }
        Ok(())
    }

    /// Sd of ln y of a peak about ln f of its mode.
    pub fn spread(&self, peak: &FrequencyPeak) -> f64 {
        self.model_error.hypot(peak.sd_hz / peak.frequency_hz)
    }

    /// Log density of ln y of an additional peak: uniform in Hz, either parity.
    fn log_additional(&self, peak: &FrequencyPeak) -> f64 {
        let [low, high] = self.band_hz;
        let parity: f64 = if peak.odd.is_some() { 0.5 } else { 1.0 };
        (self.additional * parity * peak.frequency_hz / (high - low)).ln()
    }

    /// Log density of ln y of a peak that is the mode; none beyond the reach of 8 sd, where it is 1e-14 of that at the mode.
    fn log_match(&self, peak: &FrequencyPeak, mode: &PredictedFrequency) -> Option<f64> {
        const REACH: f64 = 8.0;
        let s = self.spread(peak);
        let z = (peak.frequency_hz / mode.frequency_hz).ln() / s;
        let parity = match (peak.odd, mode.odd) {
            (Some(a), Some(b)) if a == b => 1.0 - self.wrong_parity,
            (Some(_), Some(_)) => self.wrong_parity,
            (Some(_), None) => 0.5,
            _ => 1.0,
        };
        let norm = (1.0 - self.missing) * parity / (s * std::f64::consts::TAU.sqrt());
        (z.abs() < REACH).then(|| norm.ln() - 0.5 * z * z)
    }

    /// Log probability that a mode leaves no peak in the band, and its derivative by ln f.
    fn log_missing(&self, mode: &PredictedFrequency) -> (f64, f64) {
        /// A band's edge sharper than this gains nothing.
        const SHARPEST: f64 = 1e-4;
        let s = self.model_error.max(SHARPEST);
        let [low, high] = self.band_hz.map(|f| (f / mode.frequency_hz).ln() / s);
        let inside = normal(high) - normal(low);
        let density = |z: f64| (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
        let absent = 1.0 - (1.0 - self.missing) * inside;
        let slope = (1.0 - self.missing) * (density(high) - density(low)) / s;
        (absent.ln(), slope / absent)
    }
}

/// What modes can be.
struct Links {
    /// Modes by frequency: neighbours one after the other keep the states few.
    order: Vec<usize>,
    /// Log density of each peak as an additional one.
    additional: Vec<f64>,
    /// Log probability of each mode to leave no peak, and its derivative by ln f.
    missing: Vec<(f64, f64)>,
    /// In that order.
    choices: Vec<Choices>,
}

impl Links {
    fn new(
        model: &PeakModel,
        peaks: &[FrequencyPeak],
        modes: &[PredictedFrequency],
    ) -> Result<Self> {
        model.validate()?;
        validate(model, peaks, modes)?;
        let mut order: Vec<usize> = (0..modes.len()).collect();
        order.sort_by(|&a, &b| modes[a].frequency_hz.total_cmp(&modes[b].frequency_hz));
        let additional: Vec<f64> = peaks.iter().map(|p| model.log_additional(p)).collect();
        let missing: Vec<(f64, f64)> = modes.iter().map(|m| model.log_missing(m)).collect();
        let choices: Vec<Choices> = order
            .iter()
            .map(|&j| {
                let link = |(i, peak)| Some((i, model.log_match(peak, &modes[j])? - additional[i]));
                Choices {
                    missing: missing[j].0,
                    links: peaks.iter().enumerate().filter_map(link).collect(),
                }
            })
            .collect();
        Ok(Self {
            order,
            additional,
            missing,
            choices,
        })
    }

    /// Log weight of no mode being a peak, beside the missing ones.
    fn log_empty(&self, model: &PeakModel) -> f64 {
        self.additional.iter().sum::<f64>() - model.additional
    }
}

/// The log likelihood of the peaks alone, as [`assign`] has it.
///
/// # Errors
/// Those of [`assign`].
pub fn log_likelihood(
    model: &PeakModel,
    peaks: &[FrequencyPeak],
    modes: &[PredictedFrequency],
) -> Result<f64> {
    let links = Links::new(model, peaks, modes)?;
    Ok(lattice::log_total(&links.choices) + links.log_empty(model))
}

/// Compare peaks with modes. Give modes to beyond the band's upper end, or peaks there have nothing to be.
///
/// # Errors
/// The input's fault: more peaks than 128, frequencies that are not above 0, [`PeakModel::validate`].
pub fn assign(
    model: &PeakModel,
    peaks: &[FrequencyPeak],
    modes: &[PredictedFrequency],
) -> Result<Assigned> {
    let links = Links::new(model, peaks, modes)?;
    let sum = lattice::sum(&links.choices, peaks.len());
    let mut assigned = sorted_back(&sum, &links.order);
    assigned.log_likelihood = sum.log_total + links.log_empty(model);
    assigned.slope = (0..modes.len())
        .map(|j| {
            let pull = peaks.iter().enumerate().map(|(i, peak)| {
                let off = (peak.frequency_hz / modes[j].frequency_hz).ln();
                assigned.matched[(j, i)] * off / model.spread(peak).powi(2)
            });
            pull.sum::<f64>() + assigned.missing(j) * links.missing[j].1
        })
        .collect();
    Ok(assigned)
}

fn validate(
    model: &PeakModel,
    peaks: &[FrequencyPeak],
    modes: &[PredictedFrequency],
) -> Result<()> {
    if peaks.len() > MOST_PEAKS {
        let expected = format!("at most {MOST_PEAKS} peaks");
        return Err(Error::input("frequencies_Hz", expected).found(peaks.len()));
    }
    for peak in peaks {
        let [low, high] = model.band_hz;
        if !(peak.frequency_hz >= low && peak.frequency_hz <= high) {
            let expected = format!("peaks within the band, {low} to {high} Hz");
            return Err(Error::input("frequencies_Hz", expected).found(peak.frequency_hz));
        }
        if !(model.spread(peak) > 0.0 && peak.sd_hz >= 0.0) {
            let expected = "an sd or a model error above 0";
            return Err(Error::input("frequencies_Hz", expected).found(peak.sd_hz));
        }
    }
    match modes
        .iter()
        .find(|m| m.frequency_hz.is_nan() || m.frequency_hz <= 0.0)
    {
        Some(mode) => {
            Err(Error::program("natural frequencies", "frequencies above 0")
                .found(mode.frequency_hz))
        }
        None => Ok(()),
    }
}

/// The sum's shares in the order in which the modes were given.
fn sorted_back(sum: &Sum, order: &[usize]) -> Assigned {
    let mut matched = DMatrix::zeros(sum.matched.nrows(), sum.matched.ncols());
    let mut best = vec![None; order.len()];
    for (place, &j) in order.iter().enumerate() {
        matched.set_row(j, &sum.matched.row(place));
        best[j] = sum.best[place];
    }
    Assigned {
        log_likelihood: 0.0,
        slope: Vec::new(),
        matched,
        best,
    }
}

/// The normal distribution's probability below z, to 1e-7 (Abramowitz and Stegun 7.1.26).
fn normal(z: f64) -> f64 {
    const TERMS: [f64; 5] = [
        0.254_829_592,
        -0.284_496_736,
        1.421_413_741,
        -1.453_152_027,
        1.061_405_429,
    ];
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let polynomial = TERMS.iter().rev().fold(0.0, |sum, c| (sum + c) * t);
    let tail = 0.5 * polynomial * (-x * x).exp();
    if z > 0.0 { 1.0 - tail } else { tail }
}
