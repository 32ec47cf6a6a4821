//! `plychain simulate`.

mod series;

use std::collections::HashSet;
use std::path::PathBuf;

use clap::Args;
use serde_json::{Map, Value, json};

use super::folder::Folder;
use super::{DEFAULT_MODEL, Global, print};
use crate::effect::{Acting, EFFECTS, Scene, why_not};
use crate::error::{Error, Result};
use crate::experiment::simulate::Truth;
use crate::field::fringes::{self, RenderPlan};
use crate::field::{READERS, Reader, Source};
use crate::files;
use crate::infer::{Model, simulated_field};
use crate::study::{SharedConstants, Study};

/// Arguments of `simulate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain simulate --effect load_misalignment=0.8 --set E1_GPa=140 --grid 121 --out simulated
  plychain simulate --fringes step_error=0.05,initial_fringes=12 --out images
  plychain simulate specimen.json --steps 0,700,1400,2100 --motion-mm 0.2 --effect uniform_strain=50,0,0:drift --out series")]
pub struct SimulateArguments {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    pub(super) model: PathBuf,
    /// Effect to add, may be repeated; `plychain effects` lists names, parameters and units
    ///
    /// With several fields, EXPERIMENT.NAME=VALUE acts in one of them, and NAME=VALUE in all. In a load series LAW says how the amplitude of a motion
    /// follows the steps: load (default), constant, seated, kept, drift or free. With free, give all values of the first step, then those of the
    /// second, and so on. The amplitude is that under the largest force; with drift it is that in the last loaded step.
    #[arg(long = "effect", value_name = "NAME=VALUE[,VALUE][:LAW]")]
    effects: Vec<String>,
    /// Value of an elastic constant or of thickness_mm (default: the prior's mean); may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Forces of the steps of a load series, N, in order (default: those of the model's steps)
    #[arg(
        long,
        value_name = "FORCE,...",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    steps: Vec<f64>,
    /// Random translation of the specimen in every step of a series, in x and in y, sd in mm
    #[arg(long, default_value_t = 0.0)]
    motion_mm: f64,
    /// Fringe images instead of a field, with their own noise: KEY=NUMBER,... of frames, step_deg, step_error, jitter_deg, flicker,
    /// gamma, noise, background, contrast (grey levels of 8 bit), initial_fringes, bits, fringe_frequency_per_mm
    #[arg(long, value_name = "KEY=NUMBER,...", num_args = 0..=1, default_missing_value = "")]
    fringes: Option<String>,
    /// Noise of a point, sd in nm (default: 10, of fringe images 0). In a series half of the variance comes from the reference picture and is
    /// the same in all steps. With image_correlation the noise is averaged over subsets
    #[arg(long)]
    noise_nm: Option<f64>,
    /// Correlation length of the noise (Matern-3/2), mm; 0 is white noise
    #[arg(long, default_value_t = 0.0)]
    correlation_mm: f64,
    /// Number of points along each side of the square window, 5 to 4000
    #[arg(long, default_value_t = 243, value_parser = clap::value_parser!(u16).range(5..=4000))]
    grid: u16,
    /// Format of the field: matrices, csv or fringes (default: matrices, of a series csv)
    #[arg(long)]
    format: Option<String>,
    /// Directory to make
    #[arg(long)]
    out: PathBuf,
}

/// What is added to the seed of a run for the readings of each experiment.
const READINGS: u64 = 1_000_003;

/// A field that was simulated.
struct Simulated {
    /// The field as the simulated model file declares it.
    model: Model,
    truth: Value,
    /// What was written, for people.
    said: String,
}

/// Where a field is simulated.
struct FieldTarget<'a> {
    arguments: &'a SimulateArguments,
    /// Arguments of `--effect` that act in it.
    effects: Vec<&'a String>,
    seed: u64,
    folder: &'a Folder,
    /// Within the folder, where its files go.
    within: PathBuf,
}

pub fn run(arguments: &SimulateArguments, global: &Global) -> Result<()> {
    let mut study = Study::load(&arguments.model)?;
    let fields: Vec<(usize, Model)> = study.fields().map(|(k, m)| (k, m.clone())).collect();
    if fields.is_empty() {
        refuse_field_arguments(arguments)?;
    }
    let shared = study.shared();
    let constants = constants(arguments, &shared, fields.is_empty())?;
    shared.material.ply(&constants).admissible("--set")?;
    let folder = Folder::create(Some(&arguments.out), study.name())?;
    let mut said = Vec::new();
    let mut truths = Vec::new();
    for (n, (k, model)) in fields.iter().enumerate() {
        let name = &model.experiment().name;
        let target = FieldTarget {
            arguments,
            effects: effects_in(arguments, name, &study)?,
            seed: global.seed.wrapping_add(n as u64),
            folder: &folder,
            within: if fields.len() == 1 {
                PathBuf::new()
            } else {
                name.into()
            },
        };
        let simulated = target.simulated(target.with_own_files(model.clone())?)?;
        study = study.with_field(*k, simulated.model);
        if fields.len() > 1 {
            folder.write_json(&format!("{name}/truth.json"), &simulated.truth)?;
        }
        said.push(simulated.said);
        truths.push((name.clone(), simulated.truth));
    }
    let mut readings = 0;
    for k in 0..study.experiments.len() {
        if study.experiments[k].field().is_none() {
            readings += 1;
            let seed = global.seed.wrapping_add(readings * READINGS);
            let other = study.experiments[k].simulate(&shared, &constants, seed)?;
            study = study.with(k, other);
        }
    }
    if readings > 0 {
        said.push(format!("{readings} other experiments"));
    }
    let set = named(shared.material.constants().iter().copied(), &constants);
    let truth = match (&mut truths[..], &fields[..]) {
        ([(_, truth)], _) => truth.take(),
        ([], _) => json!({
            "model": study.name(), "constants": set, "effects": {},
            "seed": global.seed,
        }),
        (several, _) => {
            let each = several
                .iter_mut()
                .map(|(name, truth)| (name.clone(), truth.take()));
            json!({
                "model": study.name(), "constants": set, "seed": global.seed,
                "experiments": each.collect::<Map<_, _>>(),
            })
        }
    };
    folder.write_json("truth.json", &truth)?;
    folder.write_json("model.json", &study.json(false)?)?;
    print(&format!(
        "{}, model.json and truth.json written to {}\n",
        said.join(", "),
        folder.path().display()
    ))?;
    folder.keep();
    Ok(())
}

fn refuse_field_arguments(arguments: &SimulateArguments) -> Result<()> {
    match arguments.effects.is_empty() && arguments.steps.is_empty() && arguments.fringes.is_none()
    {
        true => Ok(()),
        false => Err(
            Error::input("--effect, --steps, --fringes", "a model of a field")
                .found("experiments without one"),
        ),
    }
}

/// The constants that all experiments share: prior means but for what is set.
fn constants(
    arguments: &SimulateArguments,
    shared: &SharedConstants,
    alone: bool,
) -> Result<Vec<f64>> {
    let mut constants: Vec<f64> = shared.constants.iter().map(|c| c.1.mean).collect();
    for (name, value) in settings(arguments)? {
        match shared.constants.iter().position(|c| c.0 == name) {
            Some(k) => constants[k] = value,
            None if alone => {
                let known = shared.material.constants().iter().copied();
                return Err(Error::one_of("--set", known, &name));
            }
            // of a field: it says what else there is
            None => {}
        }
    }
    Ok(constants)
}

/// The effects that act in a field: those of its name, `EXPERIMENT.EFFECT=...`, and those of none.
fn effects_in<'a>(
    arguments: &'a SimulateArguments,
    name: &str,
    study: &Study,
) -> Result<Vec<&'a String>> {
    let mut own = Vec::new();
    for text in &arguments.effects {
        match experiment_of(text) {
            Some(other) if other != name => {
                let known = study.fields().map(|(_, m)| m.experiment().name.clone());
                let known: Vec<String> = known.collect();
                if !known.iter().any(|k| k == other) {
                    let expected = format!("the name of a field: {}", known.join(", "));
                    return Err(Error::input("--effect", expected).found(other));
                }
            }
            _ => own.push(text),
        }
    }
    Ok(own)
}

/// The experiment that an argument of `--effect` names before a dot.
fn experiment_of(text: &str) -> Option<&str> {
    let name = text.split_once('=').map_or(text, |(name, _)| name);
    name.rsplit_once('.')
        .map(|(experiment, _)| experiment.trim())
}

/// The argument without that name.
fn without_experiment(text: &str) -> &str {
    experiment_of(text).map_or(text, |experiment| {
        let start = text.find(experiment).unwrap_or(0) + experiment.len() + 1;
        &text[start..]
    })
}

impl FieldTarget<'_> {
    /// The model with the files beside its measurement that it reads: the mesh lies in the folder too, what other programs solved stays where
    /// it is.
    fn with_own_files(&self, mut model: Model) -> Result<Model> {
        let resolved = model.resolved_file()?;
        let resolved_mesh = resolved.experiments.into_iter().find_map(|e| e.mesh);
        model.file.reduced_model = resolved.reduced_model;
        let files = model.experiment().mesh_files().to_vec();
        let own = match &files[..] {
            [file] => file.file_name().map(|name| (file, self.within.join(name))),
            _ => None,
        };
        if let Some((file, own)) = &own {
            let place = self.folder.path().join(own);
            files::make_folder(&self.folder.path().join(&self.within))?;
            let failed = |e| Error::unwritable(place.display(), "a copy of the mesh").found(e);
            std::fs::copy(file, &place).map_err(failed)?;
        }
        if let (Some(mesh), Some(resolved)) = (&mut model.experiment_mut().mesh, resolved_mesh) {
            // several files name each other, and stay together where they are
            mesh.file = own.map_or(resolved.file, |(_, own)| own);
        }
        Ok(model)
    }

    fn simulated(&self, model: Model) -> Result<Simulated> {
        let arguments = self.arguments;
        if !arguments.steps.is_empty() || model.experiment().steps.is_some() {
            return series::simulated(self, model);
        }
        if arguments.motion_mm != 0.0 {
            return Err(
                Error::input("--motion-mm", "no such motion without --steps")
                    .found(arguments.motion_mm)
                    .hint("one field: --effect rigid_translation=TX,TY"),
            );
        }
        self.one_load(model)
    }

    fn one_load(&self, mut model: Model) -> Result<Simulated> {
        let arguments = self.arguments;
        let images = arguments.fringes.as_deref();
        let images = images
            .map(|text| RenderPlan::parse("--fringes", text))
            .transpose()?;
        let default = if images.is_some() {
            "fringes"
        } else {
            "matrices"
        };
        let reader = reader(arguments.format.as_deref().unwrap_or(default))?;
        if images.is_some() && reader.format() != default {
            return Err(
                Error::input("--fringes", "--format fringes, or none").found(reader.format())
            );
        }
        let mut truth = plan(arguments, &model, self.seed)?;
        let acting = self
            .effects
            .iter()
            .map(|text| Acting::parse("--effect", without_experiment(text)))
            .collect::<Result<Vec<_>>>()?;
        truth.effects = ordered(acting, &model.scene())?;
        let grid = simulated_field(&model, &truth)?;
        let path = self.within.join(reader.file_name());
        let place = self.folder.path().join(&path);
        // that of a folder's own files ends in a dot, which cannot be made with what is above it
        files::make_folder(&self.folder.path().join(&self.within))?;
        if let Some(parent) = place.parent() {
            files::make_folder(parent)?;
        }
        let frame = model.scene().frame;
        let columns = match &images {
            Some(plan) => fringes::write(&place, &grid, frame, plan, self.seed).map(|()| None)?,
            None => reader.write(&place, &grid, frame)?,
        };
        let truth = truth_json(&model, &truth);
        let measurement = &mut model.experiment_mut().measurement;
        measurement.source = Source {
            reader,
            path: Some(path),
            columns,
        };
        if let Some(plan) = &images {
            measurement.fringe_frequency_per_mm = Some(plan.fringe_frequency_per_mm);
        }
        Ok(Simulated {
            said: format!("{} x {} points", grid.rows, grid.cols),
            model,
            truth,
        })
    }
}

/// What is said of the specimen and the noise; no effect acts yet.
fn plan(arguments: &SimulateArguments, model: &Model, seed: u64) -> Result<Truth> {
    let mut truth = Truth {
        constants: model.marginals().iter().map(|m| m.mean).collect(),
        thickness_mm: model.experiment().specimen.thickness_mm.mean,
        effects: Vec::new(),
        noise_nm: not_negative("--noise-nm", noise_nm(arguments))?,
        correlation_mm: not_negative("--correlation-mm", arguments.correlation_mm)?,
        grid: usize::from(arguments.grid),
        seed,
    };
    let mut seen = HashSet::new();
    let names = arguments
        .set
        .iter()
        .chain(&arguments.effects)
        .filter_map(|text| text.split_once('='));
    for (name, _) in names {
        if !seen.insert(name.trim()) {
            return Err(Error::input("arguments", "every name at most once")
                .found(format!("a second {name}")));
        }
    }
    for (name, value) in settings(arguments)? {
        if name == "thickness_mm" && value > 0.0 {
            truth.thickness_mm = value;
        } else if let Some(k) = model.constants().iter().position(|c| *c == name) {
            truth.constants[k] = value;
        } else {
            let known = model.constants().join(", ");
            return Err(
                Error::input("--set", format!("one of {known}, thickness_mm (above 0)"))
                    .found(format!("{name}={value}")),
            );
        }
    }
    Ok(truth)
}

/// Names and values of `--set`.
fn settings(arguments: &SimulateArguments) -> Result<Vec<(String, f64)>> {
    let of = |text: &String| {
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| Error::input("--set", "NAME=VALUE").found(text))?;
        let number = value.parse().ok();
        let number = number.filter(|v: &f64| v.is_finite() && v.abs() < 1e9);
        let place = format!("--set {name}");
        let number =
            number.ok_or_else(|| Error::input(place, "a number below 1e9").found(value))?;
        Ok((name.to_string(), number))
    };
    arguments.set.iter().map(of).collect()
}

/// Noise of the field itself: fringe images have their own.
fn noise_nm(arguments: &SimulateArguments) -> f64 {
    let images = arguments.fringes.is_some() || arguments.format.as_deref() == Some("fringes");
    arguments
        .noise_nm
        .unwrap_or(if images { 0.0 } else { 10.0 })
}

/// Effects that can act, in the order of the dictionary, whatever the order of the arguments.
fn ordered(mut acting: Vec<Acting>, scene: &Scene) -> Result<Vec<Acting>> {
    for a in &acting {
        if let Some(reason) = why_not(a.effect, scene) {
            let expected = format!("an effect that can act, which this one cannot: {reason}");
            return Err(Error::input("--effect", expected).found(a.effect.name()));
        }
    }
    acting.sort_by_key(|a| EFFECTS.iter().position(|e| e.name() == a.effect.name()));
    Ok(acting)
}

/// The format of a name.
fn reader(format: &str) -> Result<&'static dyn Reader> {
    let found = READERS.iter().find(|reader| reader.format() == format);
    let known = READERS.iter().map(|reader| reader.format());
    found
        .copied()
        .ok_or_else(|| Error::one_of("--format", known, format))
}

fn not_negative(place: &str, value: f64) -> Result<f64> {
    if (0.0..1e9).contains(&value) {
        return Ok(value);
    }
    Err(Error::input(place, "a number from 0 to 1e9").found(value))
}

/// Values by name.
fn named<'a>(names: impl IntoIterator<Item = &'a str>, values: &[f64]) -> Map<String, Value> {
    let pairs = names.into_iter().zip(values);
    pairs.map(|(n, v)| (n.to_string(), json!(v))).collect()
}

fn truth_json(model: &Model, truth: &Truth) -> Value {
    let constants = named(model.constants().iter().copied(), &truth.constants);
    let effects: Map<_, _> = truth
        .effects
        .iter()
        .map(|a| (a.effect.name().to_string(), json!(amplitudes(a))))
        .collect();
    json!({
        "model": model.file.name, "constants": constants, "thickness_mm": truth.thickness_mm, "effects": effects,
        "noise_nm": truth.noise_nm, "correlation_mm": truth.correlation_mm, "seed": truth.seed,
    })
}

/// Amplitudes of an effect by its parameters' names.
fn amplitudes(acting: &Acting) -> Map<String, Value> {
    let names = acting.effect.parameters().iter().map(|p| p.name);
    named(names, &acting.amplitude)
}
