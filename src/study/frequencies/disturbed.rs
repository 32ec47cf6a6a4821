//! What may act in a vibration test that nobody declared, weighed against its peaks.

use nalgebra::{DMatrix, DVector};

use super::super::Undeclared;
use super::peaks::{MODEL_ERROR_PRIOR, Peaks};
use crate::experiment::frequencies::VibrationMode;
use crate::experiment::frequencies::assignment::FrequencyPeak;
use crate::experiment::frequencies::disturbance::{DISTURBANCES, Disturbance};
use crate::noise::NormalEquations;
use crate::numeric::log_sum_exp;

/// Model errors over which evidence is summed, in sds of its logarithm about the prior's median.
const ERRORS: [f64; 9] = [-2.5, -1.75, -1.0, -0.5, 0.0, 0.5, 1.0, 1.75, 2.5];

/// Probability that a peak is a mode from which it counts.
const MATCHED: f64 = 0.5;

/// Peaks linearised about a point: what they leave, and columns of everything that varies in prior sds.
struct Linear {
    left: DVector<f64>,
    columns: DMatrix<f64>,
    /// Sd of each reading, relative.
    reading: Vec<f64>,
}

impl Peaks {
    /// Weigh each disturbance against the peaks about a point of this experiment's parameters (the posterior mean); none where no plate is.
    pub fn disturbed(&self, x: &[f64]) -> Vec<Undeclared> {
        let Some(seen) = self.seen(x) else {
            return Vec::new();
        };
        let (plate, _) = self.at(x);
        let mut pairs = Vec::new();
        for (j, mode) in seen.modes.iter().enumerate() {
            let likeliest = (0..self.peaks.len())
                .max_by(|&a, &b| {
                    let of = |i: usize| seen.assigned.matched[(j, i)];
                    of(a).total_cmp(&of(b))
                })
                .filter(|&i| seen.assigned.matched[(j, i)] > MATCHED);
            pairs.extend(likeliest.map(|i| (&self.peaks[i], mode)));
        }
        let Some(lowest) = seen.modes.first().map(|m| m.frequency_hz()) else {
            return Vec::new();
        };
        let parameters: Vec<_> = self.sampled.iter().map(|s| s.parameter).collect();
        let slopes = pairs.iter().flat_map(|(_, mode)| {
            let slope = self.ritz().sensitivities_hz(mode, &plate, &parameters);
            let scaled = slope.into_iter().zip(&self.sampled);
            let f = mode.frequency_hz();
            scaled
                .map(move |(s, own)| s * own.prior.sd * own.unit / f)
                .collect::<Vec<_>>()
        });
        let columns = DMatrix::from_row_iterator(pairs.len(), self.sampled.len(), slopes);
        let place = self.sampled.iter().zip(x);
        let place = place.map(|(s, x)| (x - s.prior.mean) / s.prior.sd);
        let place = DVector::from_iterator(self.sampled.len(), place);
        let log = |(peak, mode): &(&FrequencyPeak, &VibrationMode)| {
            (peak.frequency_hz / mode.frequency_hz()).ln()
        };
        let here = DVector::from_iterator(pairs.len(), pairs.iter().map(log));
        let linear = Linear {
            left: here + &columns * place,
            columns,
            reading: pairs
                .iter()
                .map(|(p, _)| p.sd_hz / p.frequency_hz)
                .collect(),
        };
        let mass = plate.mass_per_area() * plate.length * plate.width;
        let weighed = |disturbance: &Disturbance| {
            let plausible = disturbance.plausible(lowest);
            let shifts = pairs
                .iter()
                .map(|(_, mode)| disturbance.shift(self.ritz(), mode, mass, plausible));
            let column = DVector::from_iterator(pairs.len(), shifts);
            self.weighed(&linear, &column, disturbance, plausible)
        };
        DISTURBANCES.iter().filter_map(weighed).collect()
    }

    fn weighed(
        &self,
        linear: &Linear,
        column: &DVector<f64>,
        disturbance: &Disturbance,
        plausible: f64,
    ) -> Option<Undeclared> {
        let base = linear.columns.ncols();
        let mut with = linear.columns.clone().insert_column(base, 0.0);
        with.set_column(base, column);
        let errors: Vec<(f64, f64)> = match self.spec.model_error_percent {
            Some(percent) => vec![(percent, 0.0)],
            None => {
                let [median, sd] = MODEL_ERROR_PRIOR;
                let of = |z: &f64| (median * (sd * z).exp(), -0.5 * z * z);
                ERRORS.iter().map(of).collect()
            }
        };
        let (mut logs, mut found) = ([Vec::new(), Vec::new()], Vec::new());
        for (percent, log_prior) in errors {
            let sds: Vec<f64> = linear
                .reading
                .iter()
                .map(|s| s.hypot(0.01 * percent))
                .collect();
            let norm: f64 = sds.iter().map(|s| s.ln()).sum();
            let scaled = |m: &DMatrix<f64>| {
                let mut scaled = m.clone();
                for (mut row, s) in scaled.row_iter_mut().zip(&sds) {
                    row /= *s;
                }
                scaled
            };
            let y = DVector::from_fn(sds.len(), |i, _| linear.left[i] / sds[i]);
            let data = -0.5 * y.norm_squared() - norm + log_prior;
            for (logs, columns) in logs.iter_mut().zip([&linear.columns, &with]) {
                let x = scaled(columns);
                let fit = NormalEquations::with_unit_prior(x.tr_mul(&x), x.tr_mul(&y))?;
                let mut log = data + fit.log_evidence();
                if columns.ncols() > base {
                    let (mean, sd) = (fit.mean()[base], fit.covariance()[(base, base)].sqrt());
                    // only positive sizes can be: half of the prior, and what is left of the posterior
                    let (size, spread, inside) = above_zero(mean, sd);
                    log += (2.0 * inside).ln();
                    found.push((log, size, spread));
                }
                logs.push(log);
            }
        }
        let sum = |logs: &[f64]| log_sum_exp(logs.iter().copied());
        let total = sum(&logs[1]);
        let average = |pick: &dyn Fn(&(f64, f64, f64)) -> f64| {
            found
                .iter()
                .map(|f| (f.0 - total).exp() * pick(f))
                .sum::<f64>()
        };
        let [mean, sd] = [average(&|f| f.1), average(&|f| f.2)];
        let root = |m: f64| plausible * m.max(0.0).powf(1.0 / f64::from(disturbance.power));
        let usual = self
            .spec
            .model_error_percent
            .unwrap_or(MODEL_ERROR_PRIOR[0]);
        Some(Undeclared {
            name: disturbance.name,
            parameter: disturbance.parameter,
            plausible,
            log_bayes_factor: total - sum(&logs[0]),
            amplitude: [root(mean), 0.5 * (root(mean + sd) - root(mean - sd))],
            shift_sds: self.shifts(linear, column, 0.01 * usual)?,
            confirm: disturbance.confirm,
        })
    }

    /// What a relative change of the frequencies does to the constants, prior sds.
    fn shifts(&self, linear: &Linear, column: &DVector<f64>, error: f64) -> Option<Vec<f64>> {
        let weights = linear.reading.iter().map(|s| 1.0 / s.hypot(error));
        let weights = DVector::from_iterator(linear.reading.len(), weights);
        let x = DMatrix::from_diagonal(&weights) * &linear.columns;
        let y = column.component_mul(&weights);
        let fit = NormalEquations::with_unit_prior(x.tr_mul(&x), x.tr_mul(&y))?;
        Some(fit.mean().iter().take(self.constants).copied().collect())
    }
}

/// Mean and sd of a normal distribution cut below zero, and what is left of it.
fn above_zero(mean: f64, sd: f64) -> (f64, f64, f64) {
    let a = -mean / sd;
    let density = (-0.5 * a * a).exp() / std::f64::consts::TAU.sqrt();
    let inside = 0.5 * statrs::function::erf::erfc(a / std::f64::consts::SQRT_2);
    if inside < 1e-12 {
        return (0.0, sd / a.max(1.0), inside.max(f64::MIN_POSITIVE));
    }
    let ratio = density / inside;
    let variance = sd * sd * (1.0 + a * ratio - ratio * ratio).max(0.0);
    (mean + sd * ratio, variance.sqrt(), inside)
}
