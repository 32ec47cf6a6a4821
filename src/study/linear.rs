//! The kind `linear`: a scalar that depends linearly on the constants, y = sum of a_k c_k + error, with an offset that may act in it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use nalgebra::{DMatrix, DVector};

use super::{
    Experiment, ExperimentReader, ExperimentSection, Measuring, Observed, SharedConstants,
    Undeclared,
};
use crate::chain::Draws;
use crate::diagnose::{mean, sd};
use crate::error::{Error, Result};
use crate::experiment::check_name;
use crate::files::unique;
use crate::identify::Options;
use crate::infer::{ConstantsLikelihood, ExperimentEntry, Member, ModelOutline};
use crate::progress::Progress;
use crate::sample::{DensityError, LogDensity};
use crate::section::{Table, TableCell, row};
use crate::trace::Information;

pub const LINEAR: ExperimentReader = ExperimentReader {
    name: "linear",
    read,
};

/// The effect, and its parameter.
const OFFSET: &str = "offset";
const OFFSET_VALUE: &str = "offset.value";

/// An entry of `experiments` of this kind. Unknown keys are errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LinearSpec {
    name: String,
    kind: String,
    /// Coefficients by constant.
    #[serde(deserialize_with = "unique")]
    terms: BTreeMap<String, f64>,
    value: f64,
    sd: f64,
    /// Sd of an offset that acts.
    offset_sd: f64,
    #[serde(default)]
    effects: Vec<String>,
}

fn read(
    outline: &ModelOutline,
    entry: &ExperimentEntry,
    _path: &Path,
) -> Result<Arc<dyn Experiment>> {
    let spec: LinearSpec = entry.read()?;
    let names = outline.material.kind.constants();
    spec.validate(names).map_err(|e| entry.refuse(e))?;
    Ok(Arc::new(spec))
}

impl LinearSpec {
    fn validate(&self, constants: &[&str]) -> Result<()> {
        check_name(&self.name, "the experiment's own parameters")?;
        if let Some(name) = self.terms.keys().find(|n| !constants.contains(&n.as_str())) {
            return Err(Error::one_of("terms", constants.iter().copied(), name));
        }
        if let Some(effect) = self.effects.iter().find(|e| *e != OFFSET) {
            return Err(Error::input("effects", format!("\"{OFFSET}\"")).found(effect));
        }
        for (place, sd) in [("sd", self.sd), ("offset_sd", self.offset_sd)] {
            if sd.is_nan() || sd <= 0.0 {
                return Err(Error::input(place, "a number above 0").found(sd));
            }
        }
        Ok(())
    }

    /// Coefficients of all constants.
    fn row(&self, shared: &SharedConstants) -> Vec<f64> {
        let names = shared.constants.iter().map(|c| &c.0);
        names
            .map(|name| self.terms.get(name).copied().unwrap_or(0.0))
            .collect()
    }

    fn has_offset(&self) -> bool {
        !self.effects.is_empty()
    }
}

impl Experiment for LinearSpec {
    fn name(&self) -> &str {
        &self.name
    }

    fn json(&self, _absolute: bool) -> Result<Value> {
        super::json(self)
    }

    fn information(&self, shared: &SharedConstants, _measuring: Measuring) -> Result<Information> {
        let sds = shared.constants.iter().map(|c| c.1.sd);
        let scaled = self.row(shared).into_iter().zip(sds).map(|(a, sd)| a * sd);
        let row = DVector::from_iterator(shared.constants.len(), scaled);
        let precision = |offset_sd: f64| -> DMatrix<f64> {
            &row * row.transpose() / (self.sd.powi(2) + offset_sd.powi(2))
        };
        let declared = if self.has_offset() {
            self.offset_sd
        } else {
            0.0
        };
        Ok(Information {
            alone: precision(declared),
            with_effects: precision(self.offset_sd),
            hidden: Vec::new(),
        })
    }

    fn simulate(
        &self,
        shared: &SharedConstants,
        constants: &[f64],
        seed: u64,
    ) -> Result<Arc<dyn Experiment>> {
        let z: f64 = StandardNormal.sample(&mut Pcg64Dxsm::seed_from_u64(seed));
        Ok(Arc::new(Self {
            value: dot(&self.row(shared), constants) + self.sd * z,
            ..self.clone()
        }))
    }

    fn observed(
        &self,
        shared: &SharedConstants,
        _options: &Options<'_>,
        _progress: &dyn Progress,
    ) -> Result<Box<dyn Observed>> {
        let constants = shared.constants.iter().map(|c| c.0.clone());
        let own = self.has_offset().then(|| OFFSET_VALUE.to_string());
        Ok(Box::new(ObservedScalar {
            names: constants.chain(own).collect(),
            row: self.row(shared),
            spec: self.clone(),
        }))
    }

    fn with_effect(&self, effect: &str) -> Option<Arc<dyn Experiment>> {
        (effect == OFFSET && !self.has_offset()).then(|| -> Arc<dyn Experiment> {
            Arc::new(Self {
                effects: vec![OFFSET.into()],
                ..self.clone()
            })
        })
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The scalar with its coefficients.
#[derive(Clone)]
struct ObservedScalar {
    names: Vec<String>,
    row: Vec<f64>,
    spec: LinearSpec,
}

impl LogDensity for ObservedScalar {
    fn names(&self) -> &[String] {
        &self.names
    }

    /// -((y - a'c - d) / s)^2 / 2 - (d / tau)^2 / 2 with d the offset, if it is declared.
    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        let (constants, own) = x.split_at(self.row.len());
        let offset = own.first().copied().unwrap_or(0.0);
        let left = (self.spec.value - dot(&self.row, constants) - offset) / self.spec.sd;
        DensityError::sort(-0.5 * (left.powi(2) + (offset / self.spec.offset_sd).powi(2)))
    }
}

impl Observed for ObservedScalar {
    fn member(&self, shared: &SharedConstants) -> Member {
        let (mut centre, mut spread): (Vec<f64>, Vec<f64>) =
            shared.constants.iter().map(|c| (c.1.mean, c.1.sd)).unzip();
        if self.spec.has_offset() {
            centre.push(0.0);
            spread.push(self.spec.offset_sd);
        }
        Member::new(&self.spec.name, Box::new(self.clone()), (centre, spread))
    }

    fn section(&self, draws: &Draws) -> Result<ExperimentSection> {
        let n = self.row.len();
        let predicted: Vec<f64> = draws
            .points()
            .map(|x| dot(&self.row, &x[..n]) + x.get(n).copied().unwrap_or(0.0))
            .collect();
        let (predicted, spread) = (mean(&predicted), sd(&predicted));
        let cells = [
            TableCell::mean_sd(Some((self.spec.value, self.spec.sd))),
            TableCell::mean_sd(Some((predicted, spread))),
        ];
        let table = Table::new("", ["", "measured", "predicted"], [row("value", cells)]);
        Ok(ExperimentSection {
            name: self.spec.name.clone(),
            pieces: vec![table.into()],
            value: json!({
                "name": self.spec.name, "measured": self.spec.value, "predicted": predicted, "predicted_sd": spread,
                "effects": self.spec.effects,
            }),
            ..ExperimentSection::default()
        })
    }

    /// N(y - a'm; 0, s^2 + a'C a + tau^2) over the same without tau, with m and C what all others say of the constants.
    fn undeclared(&self, _mean: &[f64], others: Option<&ConstantsLikelihood>) -> Vec<Undeclared> {
        let Some(others) = others
            .and_then(ConstantsLikelihood::moments)
            .filter(|_| !self.spec.has_offset())
        else {
            return Vec::new();
        };
        let row = DVector::from_column_slice(&self.row);
        let left = self.spec.value - row.dot(&others.mean);
        let without = self.spec.sd.powi(2) + row.dot(&(&others.covariance * &row));
        let with = without + self.spec.offset_sd.powi(2);
        let share = self.spec.offset_sd.powi(2) / with;
        let log = |variance: f64| -0.5 * (left * left / variance + variance.ln());
        vec![Undeclared {
            name: OFFSET,
            parameter: "value",
            plausible: self.spec.offset_sd,
            log_bayes_factor: log(with) - log(without),
            amplitude: [share * left, (share * without).sqrt()],
            shift_sds: Vec::new(),
            confirm: "measure the scalar again with another instrument",
        }]
    }
}
