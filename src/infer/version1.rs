//! Model files of version 1, read as the one experiment that they declare.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::schema::{ExperimentEntry, LikelihoodSpec, MaterialSpec, ModelOutline, ParameterSpec};
use crate::error::{Error, Result};
use crate::experiment::{ExperimentKind, ExperimentSpec, Gauge};
use crate::field::MeasurementSpec;
use crate::files::{parse_json, unique};
use crate::laminate::{ClampSpec, HoleSpec, LoadSpec, Material, MeanSd, SpecimenSpec};
use crate::reduce::ReducedSpec;

/// The schema of these files.
pub const SCHEMA: &str = "plychain-model/1";

/// Name of the experiment: all of version 1 are tensile tests.
const NAME: &str = "tension";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileVersion1 {
    #[serde(rename = "schema")]
    _schema: String,
    name: String,
    note: Option<String>,
    specimen: SpecimenVersion1,
    load: LoadSpec,
    #[serde(default)]
    gauge: Gauge,
    #[serde(deserialize_with = "unique")]
    parameters: BTreeMap<String, ParameterSpec>,
    measurement: MeasurementSpec,
    window_mm: Option<[[f64; 2]; 2]>,
    reduced_model: ReducedSpec,
    likelihood: LikelihoodSpec,
    effects: Vec<String>,
    candidates: Option<Vec<String>>,
    #[serde(default, deserialize_with = "unique")]
    plausible: BTreeMap<String, f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SpecimenVersion1 {
    length_mm: f64,
    width_mm: f64,
    hole: HoleSpec,
    #[serde(default)]
    material: Kind1,
    layup_deg: Option<Vec<f64>>,
    thickness_mm: MeanSd,
    clamp: Option<ClampSpec>,
    #[serde(rename = "expansion_per_K")]
    expansion_per_k: Option<[f64; 2]>,
    note: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind1 {
    #[default]
    Laminate,
    Isotropic,
}

/// Parse the text of `place`.
///
/// # Errors
/// The input's fault, with line and key.
pub fn parse(text: &str, place: &str) -> Result<ModelOutline> {
    let file: FileVersion1 = parse_json(text, place)?;
    let specimen = file.specimen;
    let experiment = ExperimentSpec {
        load_cell: String::new(),
        name: NAME.into(),
        kind: ExperimentKind::Field,
        specimen: SpecimenSpec {
            length_mm: specimen.length_mm,
            width_mm: specimen.width_mm,
            hole: Some(specimen.hole),
            layup_deg: specimen.layup_deg,
            thickness_mm: specimen.thickness_mm,
            clamp: specimen.clamp,
            note: specimen.note,
        },
        mesh: None,
        meshed: None,
        load: Some(file.load),
        gauge: file.gauge,
        measurement: file.measurement,
        steps: None,
        force_sd_percent: None,
        fitted_n: None,
        window_mm: file.window_mm,
        effects: file.effects,
        laws: BTreeMap::new(),
        candidates: file.candidates,
        plausible: file.plausible,
        mesh_density: 1.0,
    };
    let fail = |e| Error::program(place, "an experiment that JSON can hold").found(e);
    let experiment = serde_json::to_string(&experiment).map_err(fail)?;
    Ok(ModelOutline {
        name: file.name,
        note: file.note,
        run: None,
        material: MaterialSpec {
            kind: match specimen.material {
                Kind1::Laminate => Material::Ply,
                Kind1::Isotropic => Material::Isotropic,
            },
            parameters: file.parameters,
            expansion_per_k: specimen.expansion_per_k,
            yield_mpa: None,
        },
        experiments: vec![ExperimentEntry::alone(experiment, place)],
        reduced_model: Some(file.reduced_model),
        likelihood: Some(file.likelihood),
    })
}
