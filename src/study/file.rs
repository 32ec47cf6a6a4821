//! A model file with all its experiments.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use serde_json::Value;

use super::{EXPERIMENTS, Experiment, MeasuredField, SharedConstants};
use crate::error::{Error, Result};
use crate::identify::settle_force;
use crate::infer::{
    ExperimentEntry, LikelihoodSpec, MaterialSpec, Model, ModelOutline, RunNote, SCHEMA,
    may_have_side,
};
use crate::reduce::ReducedSpec;

/// A validated model file and where it came from.
#[derive(Clone)]
pub struct Study {
    pub outline: ModelOutline,
    pub experiments: Vec<Arc<dyn Experiment>>,
    pub path: PathBuf,
}

/// The file as it is written.
#[derive(Serialize)]
struct Written<'a> {
    schema: &'static str,
    name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    note: &'a Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    run: &'a Option<RunNote>,
    material: &'a MaterialSpec,
    experiments: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reduced_model: Option<&'a ReducedSpec>,
    #[serde(skip_serializing_if = "Option::is_none")]
    likelihood: Option<&'a LikelihoodSpec>,
}

impl Study {
    /// Read and validate a model file.
    ///
    /// # Errors
    /// The input's fault, with file, line and key.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&Model::text(path)?, path)
    }

    /// The same, with the measurement of its one field elsewhere if `data` says so.
    ///
    /// # Errors
    /// Those of [`Study::load`]; data for a study without a field, or with several.
    pub fn load_with(path: &Path, data: Option<&PathBuf>) -> Result<Self> {
        let study = Self::load(path)?;
        let Some(data) = data else { return Ok(study) };
        let fields: Vec<(usize, &Model)> = study.fields().collect();
        let [(k, model)] = fields[..] else {
            let place = format!("--data {}", data.display());
            let found = match fields.len() {
                0 => "no field, and other measurements stand in the model file".to_string(),
                several => format!("{several} fields"),
            };
            return Err(Error::input(place, "a model of a field").found(found));
        };
        let mut model = model.clone();
        model.measured_in(data)?;
        Ok(study.with_field(k, model))
    }

    /// Parse and validate the text of a model file at `path`.
    ///
    /// # Errors
    /// The input's fault, with line or key.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let outline = ModelOutline::read(text, &place)?;
        let read = |entry: &ExperimentEntry| {
            let kind = EXPERIMENTS.iter().find(|k| k.name == entry.kind());
            let kind = kind.ok_or_else(|| {
                let known: Vec<String> = EXPERIMENTS
                    .iter()
                    .map(|k| format!("\"{}\"", k.name))
                    .collect();
                let expected = format!("one of {}", known.join(", "));
                entry.refuse(Error::input("kind", expected).found(format!("\"{}\"", entry.kind())))
            })?;
            (kind.read)(&outline, entry, path)
        };
        let experiments: Vec<Arc<dyn Experiment>> = outline
            .experiments
            .iter()
            .map(read)
            .collect::<Result<_>>()?;
        let study = Self {
            experiments,
            path: path.to_path_buf(),
            outline: outline.clone(),
        };
        study.validate().map_err(|e| e.within(&place))?;
        Ok(study)
    }

    fn validate(&self) -> Result<()> {
        let mut names: Vec<&str> = Vec::new();
        for experiment in &self.experiments {
            if names.contains(&experiment.name()) {
                return Err(Error::input("experiments", "a name of its own for each")
                    .found(format!("a second {}", experiment.name())));
            }
            names.push(experiment.name());
        }
        if names.is_empty() {
            return Err(Error::input("experiments", "at least one experiment").found("none"));
        }
        let unused = self.outline.reduced_model.is_some() || self.outline.likelihood.is_some();
        if unused && self.fields().next().is_none() {
            let expected = "no such key, because no experiment is a field";
            return Err(Error::input("reduced_model, likelihood", expected));
        }
        Ok(())
    }

    pub fn name(&self) -> &str {
        &self.outline.name
    }

    pub fn shared(&self) -> SharedConstants {
        SharedConstants {
            material: self.outline.material.kind,
            constants: self.outline.material.constants(),
        }
    }

    /// The fields among the experiments, each with its place.
    pub fn fields(&self) -> impl Iterator<Item = (usize, &Model)> {
        let all = self.experiments.iter().enumerate();
        all.filter_map(|(k, e)| Some((k, e.field()?)))
    }

    /// The study with another experiment in place of one.
    #[must_use]
    pub fn with(&self, k: usize, experiment: Arc<dyn Experiment>) -> Self {
        let mut other = self.clone();
        other.experiments[k] = experiment;
        other
    }

    /// The study with another model of a field.
    #[must_use]
    pub fn with_field(&self, k: usize, model: Model) -> Self {
        self.with(k, Arc::new(MeasuredField { model }))
    }

    /// The study ready for a run, with forces that nobody stated.
    ///
    /// # Errors
    /// Those of [`settle_force`].
    pub fn settled(self) -> Result<Self> {
        let mut study = self.clone();
        for (k, model) in self.fields() {
            let mut model = model.clone();
            settle_force(&mut model)?;
            study = study.with_field(k, model);
        }
        Ok(study)
    }

    /// Files that the experiments read.
    ///
    /// # Errors
    /// Those of [`Experiment::files`].
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for experiment in &self.experiments {
            files.extend(experiment.files()?);
        }
        Ok(files)
    }

    /// The model file; `absolute` if its paths are to be readable from anywhere.
    ///
    /// # Errors
    /// Those of [`Experiment::json`].
    pub fn json(&self, absolute: bool) -> Result<Value> {
        let field = self.fields().next().map(|(_, model)| model);
        let file = field.map(|model| match absolute {
            true => model.resolved_file(),
            false => Ok(model.file.clone()),
        });
        let mut file = file.transpose()?;
        // one box serves all fields: sides of what acts in one of them alone are not written
        if let Some(doe) = file.as_mut().and_then(|f| f.reduced_model.doe.as_mut()) {
            doe.retain(|name, _| self.fields().all(|(_, field)| may_have_side(field, name)));
        }
        let experiments = self.experiments.iter().map(|e| e.json(absolute));
        let written = Written {
            schema: SCHEMA,
            name: &self.outline.name,
            note: &self.outline.note,
            run: &self.outline.run,
            material: &self.outline.material,
            experiments: experiments.collect::<Result<_>>()?,
            reduced_model: file.as_ref().map(|f| &f.reduced_model),
            likelihood: file.as_ref().map(|f| &f.likelihood),
        };
        super::json(&written)
    }
}
