//! What the peaks of vibrating plates say of the constants: a model file whose experiments are frequencies, and the density of each.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::joint::{Joint, Member};
use super::model::Model;
use super::prior::{Marginal, PriorSpec};
use super::schema::{MaterialSpec, SCHEMA};
use crate::error::{Error, Result};
use crate::experiment::check_name;
use crate::experiment::frequencies::assignment::{
    Assigned, Peak, Predicted, assign, log_likelihood,
};
use crate::experiment::frequencies::estimate::{Estimate, Problem, Unknown, estimates, predicted};
use crate::experiment::frequencies::{
    Expansion, FrequenciesSpec, Mode, Nuisance, Parameter, Plate, Ritz,
};
use crate::files::parse_json;
use crate::laminate::Material;
use crate::sample::{DensityError, LogDensity};

/// Sd by which a model's frequencies are wrong beyond its parameters, percent.
pub const MODEL_ERROR: &str = "model_error_percent";

/// Prior of the model error: median, percent, and sd of its logarithm. Laminates of prepreg are at a third of a percent, wood at one.
pub(super) const MODEL_ERROR_PRIOR: [f64; 2] = [USUAL_ERROR, 1.0];
pub(super) const USUAL_ERROR: f64 = 0.3;

/// A model file of plates that vibrate. Unknown keys are errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrequenciesFile {
    pub schema: String,
    pub name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    pub material: MaterialSpec,
    pub experiments: Vec<FrequenciesSpec>,
}

/// A validated file and where it came from.
#[derive(Debug, Clone)]
pub struct FrequenciesModel {
    pub file: FrequenciesFile,
    pub path: PathBuf,
}

impl FrequenciesModel {
    /// The model in a file, if its experiments are frequencies and nothing else.
    ///
    /// # Errors
    /// The input's fault, with the place; a file that cannot be read is left to whoever reads fields.
    pub fn load(path: &Path) -> Result<Option<Self>> {
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, path),
            Err(_) => Ok(None),
        }
    }

    /// The same of a text.
    ///
    /// # Errors
    /// The input's fault, with the place.
    pub fn parse(text: &str, path: &Path) -> Result<Option<Self>> {
        let peeked: Value = serde_json::from_str(text).unwrap_or_default();
        let kinds: Vec<&str> = peeked["experiments"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|e| e["kind"].as_str().unwrap_or_default())
            .collect();
        if !kinds.contains(&"frequencies") || kinds.iter().any(|k| *k != "frequencies") {
            return Ok(None);
        }
        let place = path.display().to_string();
        let file: FrequenciesFile = parse_json(text, &place)?;
        let model = Self {
            file,
            path: path.to_path_buf(),
        };
        model.validate().map_err(|e| e.within(&place))?;
        Ok(Some(model))
    }

    /// The frequencies that stand beside the field of a model, as a model of their own; none where there are none.
    pub fn beside(model: &Model) -> Option<Self> {
        let file = &model.file;
        (!file.frequencies.is_empty()).then(|| Self {
            file: FrequenciesFile {
                schema: SCHEMA.into(),
                name: file.name.clone(),
                note: None,
                material: file.material.clone(),
                experiments: file.frequencies.clone(),
            },
            path: model.path.clone(),
        })
    }

    fn validate(&self) -> Result<()> {
        if self.file.schema != SCHEMA {
            let expected = format!("\"{SCHEMA}\"");
            return Err(Error::input("schema", expected).found(&self.file.schema));
        }
        check_name(&self.file.name, "run folders")?;
        self.file
            .material
            .validate()
            .map_err(|e| e.below("material."))?;
        let isotropic = self.material() == Material::Isotropic;
        for (k, experiment) in self.file.experiments.iter().enumerate() {
            let below = format!("experiments[{k}].");
            experiment
                .validate(isotropic)
                .map_err(|e| e.below(&below))?;
        }
        Ok(())
    }

    pub fn material(&self) -> Material {
        self.file.material.kind
    }

    /// Names and priors of the constants.
    pub fn constants(&self) -> Vec<(String, Marginal)> {
        let names = self.material().constants().iter();
        let of = |name: &&str| {
            let spec = &self.file.material.parameters[*name];
            let PriorSpec::Normal { mean, sd } = spec.prior;
            let marginal = Marginal {
                mean,
                sd,
                truncate: spec.truncate,
            };
            ((*name).to_string(), marginal)
        };
        names.map(of).collect()
    }

    /// Every experiment, ready to be asked, with the likeliest assignments of its peaks.
    ///
    /// # Errors
    /// The input's fault: priors within which no plate is.
    pub fn plates(&self) -> Result<Vec<Peaks>> {
        let of = |spec: &FrequenciesSpec| {
            Peaks::new(spec, self.material(), &self.constants())
                .map_err(|e| e.within(format!("{}: {}", self.path.display(), spec.name)))
        };
        self.file.experiments.iter().map(of).collect()
    }
}

/// The posterior of all experiments of a model.
///
/// # Errors
/// Of the input: names that collide.
pub fn joint(model: &FrequenciesModel, plates: Vec<Peaks>) -> Result<Joint> {
    let members = plates.into_iter().map(|r| Member {
        name: r.spec.name.clone(),
        start: r.start(),
        density: Box::new(r),
    });
    Joint::new(model.constants(), members.collect())
}

/// A sampled quantity: its prior, and what it is of the plate.
#[derive(Debug, Clone)]
pub(super) struct Sampled {
    pub prior: Marginal,
    pub parameter: Parameter,
    pub unit: f64,
}

/// The log likelihood of an experiment's peaks over the constants, what is uncertain of its plate, and the model's error, with the priors of
/// all but the constants.
#[derive(Clone)]
pub struct Peaks {
    pub spec: FrequenciesSpec,
    names: Vec<String>,
    pub(super) constants: usize,
    pub(super) sampled: Vec<Sampled>,
    ritz: Ritz,
    /// At the prior means.
    plate: Plate,
    pub(super) peaks: Vec<Peak>,
    modes: usize,
    /// About the best of them.
    expansion: Expansion,
    /// The likeliest constants for a fixed model error, with the assignments that they mean, best first.
    pub tops: Vec<Estimate>,
}

/// The peaks seen from a point.
pub struct Seen {
    pub modes: Vec<Mode>,
    pub assigned: Assigned,
}

impl Peaks {
    fn new(
        spec: &FrequenciesSpec,
        material: Material,
        constants: &[(String, Marginal)],
    ) -> Result<Self> {
        /// Points of the prior from which tops are looked for.
        const STARTS: usize = 48;
        /// Evidence over that of the best top, logarithm, below which no draw will be about another.
        const LEAST: f64 = -7.0;
        /// Percent: a better fit is luck.
        const LEAST_ERROR: f64 = 0.05;
        let mut names: Vec<String> = constants.iter().map(|c| c.0.clone()).collect();
        let mut sampled: Vec<Sampled> = constants.iter().map(sampled_constant).collect();
        for Nuisance {
            name,
            parameter,
            known,
            unit,
        } in spec.known()
        {
            if known.sd > 0.0 {
                names.push(name.to_string());
                let prior = Marginal {
                    mean: known.mean,
                    sd: known.sd,
                    truncate: None,
                };
                sampled.push(Sampled {
                    prior,
                    parameter,
                    unit,
                });
            }
        }
        if spec.model_error_percent.is_none() {
            names.push(MODEL_ERROR.into());
        }
        let means: Vec<f64> = constants.iter().map(|c| c.1.mean).collect();
        let plate = spec.plate(material.ply(&means));
        let full = spec.ritz(&plate)?;
        let about: Vec<[f64; 2]> = sampled.iter().map(|s| [s.prior.mean, s.prior.sd]).collect();
        let (ritz, modes) = spec.small(&full, &neighbours(&plate, &sampled, &about))?;
        let peaks = spec.peaks();
        let unknowns: Vec<Unknown> = sampled
            .iter()
            .map(|s| Unknown {
                parameter: s.parameter,
                mean: s.prior.mean * s.unit,
                sd: s.prior.sd * s.unit,
            })
            .collect();
        let tops_at = |percent: f64| {
            let problem = Problem {
                ritz: &ritz,
                plate: &plate,
                unknowns: &unknowns,
                peaks: &peaks,
                model: &spec.peak_model(percent / 100.0),
                modes,
            };
            estimates(&problem, STARTS)
        };
        let tops = match spec.model_error_percent {
            Some(percent) => tops_at(percent)?,
            // first with what is usual, then with what is left
            None => {
                let first = tops_at(MODEL_ERROR_PRIOR[0])?;
                let left = 100.0 * misfit(&first[0], &peaks);
                tops_at(left.max(LEAST_ERROR))?
            }
        };
        // what the draws need is smaller: the modes about the tops
        let near: Vec<Plate> = tops
            .iter()
            .take_while(|t| t.log_evidence > tops[0].log_evidence + LEAST)
            .flat_map(|top| {
                let of = |(k, s): (usize, &Sampled)| [top.values[k] / s.unit, top.sd(k) / s.unit];
                let about: Vec<[f64; 2]> = sampled.iter().enumerate().map(of).collect();
                neighbours(&top.plate, &sampled, &about)
            })
            .collect();
        let (ritz, modes) = spec.small(&full, &near)?;
        let steps = sampled.iter().enumerate();
        let steps: Vec<(Parameter, f64)> =
            steps.map(|(k, s)| (s.parameter, tops[0].sd(k))).collect();
        let expansion = Expansion::new(&ritz, &tops[0].plate, modes, &steps)?;
        Ok(Self {
            spec: spec.clone(),
            names,
            constants: constants.len(),
            sampled,
            ritz,
            plate,
            peaks,
            modes,
            expansion,
            tops,
        })
    }

    pub fn ritz(&self) -> &Ritz {
        &self.ritz
    }

    /// The plate and the model error (a fraction) of a point.
    pub(super) fn at(&self, x: &[f64]) -> (Plate, f64) {
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
    pub fn seen(&self, x: &[f64]) -> Option<Seen> {
        let (plate, error) = self.at(x);
        plate.validate().ok()?;
        let modes = self.ritz.modes(&plate.coefficients(), self.modes).ok()?;
        let frequencies: Vec<Predicted> = modes.iter().map(predicted).collect();
        let assigned = assign(&self.spec.peak_model(error), &self.peaks, &frequencies).ok()?;
        Some(Seen { modes, assigned })
    }

    /// Frequencies to second order.
    fn near(&self, x: &[f64]) -> Vec<Predicted> {
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
    pub fn correction(&self, x: &[f64], seen: &Seen) -> f64 {
        let (_, error) = self.at(x);
        let near = log_likelihood(&self.spec.peak_model(error), &self.peaks, &self.near(x));
        near.map_or(f64::NEG_INFINITY, |near| {
            seen.assigned.log_likelihood - near
        })
    }
}

/// Root mean square of ln y - ln f over the peaks that are modes in a top.
fn misfit(top: &Estimate, peaks: &[Peak]) -> f64 {
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
pub(super) fn of_constant(name: &str) -> (Parameter, f64) {
    match name {
        "E1_GPa" => (Parameter::E1, 1e3),
        "E2_GPa" => (Parameter::E2, 1e3),
        "G12_GPa" => (Parameter::G12, 1e3),
        "nu12" => (Parameter::Nu12, 1.0),
        "E_GPa" => (Parameter::E, 1e3),
        _ => (Parameter::Nu, 1.0),
    }
}

fn sampled_constant((name, prior): &(String, Marginal)) -> Sampled {
    let (parameter, unit) = of_constant(name);
    Sampled {
        prior: *prior,
        parameter,
        unit,
    }
}

/// A plate, and it with each of its elastic constants off by two sds to either side of a value (border units): what spans the small
/// problem. Dimensions and masses that are known to a percent hardly change the shapes of modes.
fn neighbours(plate: &Plate, sampled: &[Sampled], about: &[[f64; 2]]) -> Vec<Plate> {
    const SDS: f64 = 2.0;
    let is_elastic = |p: Parameter| {
        use Parameter::{E, E1, E2, G12, G13, G23, Nu, Nu12};
        [E, E1, E2, G12, G13, G23, Nu, Nu12].contains(&p)
    };
    let elastic = sampled
        .iter()
        .zip(about)
        .filter(|(s, _)| is_elastic(s.parameter));
    let of = |(s, [value, sd]): (&Sampled, &[f64; 2])| {
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
