//! What the peaks of a vibrating plate say of the constants: their log likelihood.

use crate::error::Result;
use crate::experiment::frequencies::assignment::{
    Assigned, FrequencyPeak, PredictedFrequency, assign, log_likelihood,
};
use crate::experiment::frequencies::estimate::{
    AssignmentProblem, LikeliestPlate, Unknown, estimates, predicted,
};
use crate::experiment::frequencies::{
    Expansion, FrequenciesSpec, Nuisance, PlateParameter, Ritz, VibratingPlate, VibrationMode,
};
use crate::infer::Marginal;
use crate::laminate::Material;
use crate::sample::{DensityError, LogDensity};

/// Sd by which a model's frequencies are wrong beyond its parameters, percent.
pub const MODEL_ERROR: &str = "model_error_percent";

/// Prior of the model error: median, percent, and sd of its logarithm. Laminates of prepreg are at a third of a percent, wood at one.
pub(super) const MODEL_ERROR_PRIOR: [f64; 2] = [USUAL_ERROR, 1.0];
pub(super) const USUAL_ERROR: f64 = 0.3;

/// A sampled quantity: its prior, and what it is of the plate.
#[derive(Debug, Clone)]
pub(super) struct Uncertain {
    pub prior: Marginal,
    pub parameter: PlateParameter,
    pub unit: f64,
}

/// The log likelihood of an experiment's peaks over the constants, what is uncertain of its plate, and the model's error, with the priors of
/// all but the constants.
#[derive(Clone)]
pub struct Peaks {
    pub spec: FrequenciesSpec,
    names: Vec<String>,
    pub(super) constants: usize,
    pub(super) sampled: Vec<Uncertain>,
    ritz: Ritz,
    /// At the prior means.
    plate: VibratingPlate,
    pub(super) peaks: Vec<FrequencyPeak>,
    modes: usize,
    /// About the best of them.
    expansion: Expansion,
    /// The likeliest constants for a fixed model error, with the assignments that they mean, best first.
    pub tops: Vec<LikeliestPlate>,
}

/// The peaks as a point has them.
pub struct SeenPeaks {
    pub modes: Vec<VibrationMode>,
    pub assigned: Assigned,
}

impl Peaks {
    /// Ready to be asked, with the likeliest assignments of the peaks.
    ///
    /// # Errors
    /// The input's fault: priors within which no plate is.
    pub fn new(
        spec: &FrequenciesSpec,
        material: Material,
        constants: &[(String, Marginal)],
    ) -> Result<Self> {
        /// Evidence over that of the best top, logarithm, below which no draw will be about another.
        const LEAST: f64 = -7.0;
        let constant = constants.iter().map(|c| (c.0.clone(), sampled_constant(c)));
        let known = spec.known().into_iter().filter(|n| n.known.sd > 0.0);
        let known = known.map(|n| (n.name.to_string(), sampled_nuisance(&n)));
        let (mut names, sampled): (Vec<String>, Vec<Uncertain>) = constant.chain(known).unzip();
        if spec.model_error_percent.is_none() {
            names.push(MODEL_ERROR.into());
        }
        let means: Vec<f64> = constants.iter().map(|c| c.1.mean).collect();
        let plate = spec.plate(material.ply(&means));
        let full = spec.ritz(&plate)?;
        let tops = likeliest(spec, &full, &plate, &sampled)?;
        // what the draws need is smaller: the modes about the tops
        let near: Vec<VibratingPlate> = tops
            .iter()
            .take_while(|t| t.log_evidence > tops[0].log_evidence + LEAST)
            .flat_map(|top| {
                let each = sampled.iter().enumerate();
                let about = each.map(|(k, s)| [top.values[k] / s.unit, top.sd(k) / s.unit]);
                neighbours(&top.plate, &sampled, &about.collect::<Vec<_>>())
            })
            .collect();
        let (ritz, modes) = spec.small(&full, &near)?;
        let steps = sampled.iter().enumerate();
        let steps: Vec<(PlateParameter, f64)> =
            steps.map(|(k, s)| (s.parameter, tops[0].sd(k))).collect();
        let expansion = Expansion::new(&ritz, &tops[0].plate, modes, &steps)?;
        Ok(Self {
            spec: spec.clone(),
            names,
            constants: constants.len(),
            sampled,
            ritz,
            plate,
            peaks: spec.peaks(),
            modes,
            expansion,
            tops,
        })
    }

    pub fn ritz(&self) -> &Ritz {
        &self.ritz
    }

    /// The plate and the model error (a fraction) of a point.
    pub(super) fn at(&self, x: &[f64]) -> (VibratingPlate, f64) {
        let each = self.sampled.iter().zip(x);
        let plate = each.fold(self.plate.clone(), |plate, (s, x)| {
            plate.with(s.parameter, x * s.unit)
        });
        let percent = self
            .spec
            .model_error_percent
            .unwrap_or_else(|| x[self.sampled.len()]);
        (plate, percent / 100.0)
    }

    /// The peaks as a point of this experiment's parameters has them; none where no plate is.
    pub fn seen(&self, x: &[f64]) -> Option<SeenPeaks> {
        let (plate, error) = self.at(x);
        plate.validate().ok()?;
        let modes = self.ritz.modes(&plate.coefficients(), self.modes).ok()?;
        let frequencies: Vec<PredictedFrequency> = modes.iter().map(predicted).collect();
        let assigned = assign(&self.spec.peak_model(error), &self.peaks, &frequencies).ok()?;
        Some(SeenPeaks { modes, assigned })
    }

    /// Frequencies to second order.
    fn near(&self, x: &[f64]) -> Vec<PredictedFrequency> {
        let values: Vec<f64> = self
            .sampled
            .iter()
            .zip(x)
            .map(|(s, x)| s.unit * x)
            .collect();
        self.expansion.predicted(&values)
    }

    /// Where to start, and the sds to start with.
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let top = &self.tops[0];
        let mut centre: Vec<f64> = top
            .values
            .iter()
            .zip(&self.sampled)
            .map(|(v, s)| v / s.unit)
            .collect();
        let mut sd: Vec<f64> = (0..centre.len())
            .map(|k| top.sd(k) / self.sampled[k].unit)
            .collect();
        if self.spec.model_error_percent.is_none() {
            let error = 100.0 * misfit(top, &self.peaks).max(1e-3);
            centre.push(error);
            // within what is left of zero at twice the spread
            sd.push(error / 6.0);
        }
        (centre, sd)
    }

    /// What the exact likelihood of a point is over the density's, logarithm.
    pub fn exact_over_near(&self, x: &[f64], seen: &SeenPeaks) -> f64 {
        let (_, error) = self.at(x);
        let near = log_likelihood(&self.spec.peak_model(error), &self.peaks, &self.near(x));
        near.map_or(f64::NEG_INFINITY, |near| {
            seen.assigned.log_likelihood - near
        })
    }
}

/// The likeliest constants with the assignments that they mean, for a model error that is stated or fits.
fn likeliest(
    spec: &FrequenciesSpec,
    full: &Ritz,
    plate: &VibratingPlate,
    sampled: &[Uncertain],
) -> Result<Vec<LikeliestPlate>> {
    /// Points of the prior from which tops are looked for.
    const STARTS: usize = 48;
    /// Percent: a better fit is luck.
    const LEAST_ERROR: f64 = 0.05;
    let about: Vec<[f64; 2]> = sampled.iter().map(|s| [s.prior.mean, s.prior.sd]).collect();
    let (ritz, modes) = spec.small(full, &neighbours(plate, sampled, &about))?;
    let peaks = spec.peaks();
    let unknown = |s: &Uncertain| Unknown {
        parameter: s.parameter,
        mean: s.prior.mean * s.unit,
        sd: s.prior.sd * s.unit,
    };
    let unknowns: Vec<Unknown> = sampled.iter().map(unknown).collect();
    let tops_with = |percent: f64| {
        let problem = AssignmentProblem {
            ritz: &ritz,
            plate,
            unknowns: &unknowns,
            peaks: &peaks,
            model: &spec.peak_model(percent / 100.0),
            modes,
        };
        estimates(&problem, STARTS)
    };
    match spec.model_error_percent {
        Some(percent) => tops_with(percent),
        // first with what is usual, then with what is left
        None => {
            let first = tops_with(MODEL_ERROR_PRIOR[0])?;
            let left = 100.0 * misfit(&first[0], &peaks);
            tops_with(left.max(LEAST_ERROR))
        }
    }
}

/// Root mean square of ln y - ln f over the peaks that are modes in a top.
fn misfit(top: &LikeliestPlate, peaks: &[FrequencyPeak]) -> f64 {
    let pairs = top.assigned.best.iter().zip(&top.modes);
    let squares: Vec<f64> = pairs
        .filter_map(|(peak, mode)| {
            let peak = &peaks[(*peak)?];
            Some((peak.frequency_hz / mode.frequency_hz()).ln().powi(2))
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// What a constant is of a plate, and its unit there.
pub(super) fn of_constant(name: &str) -> (PlateParameter, f64) {
    match name {
        "E1_GPa" => (PlateParameter::E1, 1e3),
        "E2_GPa" => (PlateParameter::E2, 1e3),
        "G12_GPa" => (PlateParameter::G12, 1e3),
        "nu12" => (PlateParameter::Nu12, 1.0),
        "E_GPa" => (PlateParameter::E, 1e3),
        _ => (PlateParameter::Nu, 1.0),
    }
}

fn sampled_constant((name, prior): &(String, Marginal)) -> Uncertain {
    let (parameter, unit) = of_constant(name);
    Uncertain {
        prior: *prior,
        parameter,
        unit,
    }
}

fn sampled_nuisance(nuisance: &Nuisance) -> Uncertain {
    let prior = Marginal {
        mean: nuisance.known.mean,
        sd: nuisance.known.sd,
        truncate: None,
    };
    Uncertain {
        prior,
        parameter: nuisance.parameter,
        unit: nuisance.unit,
    }
}

/// A plate, and it with each of its elastic constants off by two sds to either side of a value (border units): what spans the small
/// problem. Dimensions and masses that are known to a percent hardly change the shapes of modes.
fn neighbours(
    plate: &VibratingPlate,
    sampled: &[Uncertain],
    about: &[[f64; 2]],
) -> Vec<VibratingPlate> {
    const SDS: f64 = 2.0;
    let is_elastic = |p: PlateParameter| {
        use PlateParameter::{E, E1, E2, G12, G13, G23, Nu, Nu12};
        [E, E1, E2, G12, G13, G23, Nu, Nu12].contains(&p)
    };
    let elastic = sampled
        .iter()
        .zip(about)
        .filter(|(s, _)| is_elastic(s.parameter));
    let of = |(s, [value, sd]): (&Uncertain, &[f64; 2])| {
        [-SDS, SDS].map(|sds| {
            let moved = plate.clone().with(s.parameter, s.unit * (value + sds * sd));
            Some(moved).filter(|p| p.validate().is_ok())
        })
    };
    let beside = elastic.flat_map(of).flatten();
    std::iter::once(plate.clone()).chain(beside).collect()
}

impl LogDensity for Peaks {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        let own = self.sampled.iter().zip(x).skip(self.constants);
        let mut sum: f64 = own.map(|(s, x)| s.prior.log_density(*x)).sum();
        if self.spec.model_error_percent.is_none() {
            let error = x[self.sampled.len()];
            if error.is_nan() || error <= 0.0 {
                return Err(DensityError::Outside);
            }
            let [median, sd] = MODEL_ERROR_PRIOR;
            sum -= 0.5 * ((error / median).ln() / sd).powi(2) + error.ln();
        }
        let (plate, error) = self.at(x);
        if sum == f64::NEG_INFINITY || plate.validate().is_err() {
            return Err(DensityError::Outside);
        }
        let peaks = log_likelihood(&self.spec.peak_model(error), &self.peaks, &self.near(x));
        DensityError::sort(peaks.map_or(f64::NEG_INFINITY, |l| sum + l))
    }
}
