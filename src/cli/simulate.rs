//! `plychain simulate`.

mod frequencies;
mod series;

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::folder::Folder;
use super::{DEFAULT_MODEL, Global, print};
use crate::effect::{Acting, EFFECTS, Effect, Scene, obstacle};
use crate::error::{Error, Result};
use crate::experiment::simulate::Truth;
use crate::field::fringes::{self, RenderPlan};
use crate::field::{READERS, Reader, Source};
use crate::infer::{FrequenciesModel, Model};

/// Arguments of `simulate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain simulate --effect load_misalignment=0.8 --set E1_GPa=140 --grid 121 --out simulated
  plychain simulate --fringes step_error=0.05,initial_fringes=12 --out images
  plychain simulate specimen.json --steps 0,700,1400,2100 --motion-mm 0.2 --effect uniform_strain=50,0,0:drift --out series")]
pub struct SimulateArguments {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    model: PathBuf,
    /// An effect that acts; may be repeated. Names and the parameters' units are listed by --help
    #[arg(long = "effect", value_name = "NAME=VALUE[,VALUE][:LAW]", long_help = effects_help())]
    effects: Vec<String>,
    /// An elastic constant or thickness_mm, NAME=VALUE (default: the prior's mean); may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Force of every step of a load series, N, in the order taken (default: those of the model's steps)
    #[arg(
        long,
        value_name = "FORCE,...",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    steps: Vec<f64>,
    /// Sd of a random translation of the specimen in every step of a series, in x and in y, mm
    #[arg(long, default_value_t = 0.0)]
    motion_mm: f64,
    /// Fringe images instead of a field, with their own noise: KEY=NUMBER,... of frames, step_deg, step_error, jitter_deg, flicker,
    /// gamma, noise, background, contrast (grey levels of 8 bit), initial_fringes, bits, fringe_frequency_per_mm
    #[arg(long, value_name = "KEY=NUMBER,...", num_args = 0..=1, default_missing_value = "")]
    fringes: Option<String>,
    /// Noise sd of a point, nm (default: 10, of fringe images 0); in a series half of the variance is the reference picture's, the same in all steps, and where the
    /// model has image_correlation it is averaged over subsets
    #[arg(long)]
    noise_nm: Option<f64>,
    /// Correlation length of the noise (Matern-3/2), mm; 0 for white noise
    #[arg(long, default_value_t = 0.0)]
    correlation_mm: f64,
    /// Points along each side of the square window
    #[arg(long, default_value_t = 243, value_parser = clap::value_parser!(u16).range(5..=4000))]
    grid: u16,
    /// Format of the field: matrices, csv or fringes (default: matrices, of a series csv)
    #[arg(long)]
    format: Option<String>,
    /// Directory to make
    #[arg(long)]
    out: PathBuf,
}

/// What `--help` says of `--effect`.
fn effects_help() -> String {
    let lines = EFFECTS.iter().map(|effect| {
        let parameters: Vec<_> = effect.parameters().iter().map(|p| p.name).collect();
        format!(
            "  {}={}: {}",
            effect.name(),
            parameters.join(","),
            effect.entry().about
        )
    });
    std::iter::once(
        "An effect that acts; may be repeated. In a load series the amplitude of one that moves the specimen goes by a law: NAME=VALUE:LAW with constant, load (the default), seated, kept, drift, or free with all values of the first step, then those of the second ... The amplitude stated is that under the largest force, of drift that in the last loaded step. The effects, with their parameters and units:"
            .to_string(),
    )
    .chain(lines)
    .collect::<Vec<_>>()
    .join("\n")
}

pub fn run(arguments: &SimulateArguments, global: &Global) -> Result<()> {
    if let Some(plates) = FrequenciesModel::load(&arguments.model)? {
        return frequencies::run(arguments, &plates, global.seed);
    }
    let mut model = Model::load(&arguments.model)?;
    if !arguments.steps.is_empty() || model.experiment().steps.is_some() {
        return series::run(arguments, model, global.seed);
    }
    if arguments.motion_mm != 0.0 {
        return Err(
            Error::input("--motion-mm", "no such motion without --steps")
                .found(arguments.motion_mm)
                .hint("one field: --effect rigid_translation=TX,TY"),
        );
    }
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
        return Err(Error::input("--fringes", "--format fringes, or none").found(reader.format()));
    }
    let mut truth = plan(arguments, &model, global.seed)?;
    let acting = arguments
        .effects
        .iter()
        .map(|text| Acting::parse("--effect", text))
        .collect::<Result<Vec<_>>>()?;
    truth.effects = ordered(acting, &model.scene())?;
    frequencies::beside(&mut model, &truth.constants, global.seed)?;
    let folder = Folder::create(Some(&arguments.out), &model.file.name)?;
    let grid = model.simulate(&truth)?;
    let path = PathBuf::from(reader.file_name());
    let (place, frame) = (folder.path().join(&path), model.scene().frame);
    let columns = match &images {
        Some(plan) => fringes::write(&place, &grid, frame, plan, global.seed).map(|()| None)?,
        None => reader.write(&place, &grid, frame)?,
    };
    let source = Source {
        reader,
        path: Some(path),
        columns,
    };
    folder.write_json("truth.json", &truth_json(&model, &truth))?;
    if let Some(plan) = &images {
        model.experiment_mut().measurement.fringe_frequency_per_mm =
            Some(plan.fringe_frequency_per_mm);
    }
    folder.write_json("model.json", &model_json(&model, source)?)?;
    print(&format!(
        "{} x {} points, model.json and truth.json written to {}\n",
        grid.rows,
        grid.cols,
        folder.path().display()
    ))?;
    folder.keep();
    Ok(())
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
    let mut seen: Vec<&str> = Vec::new();
    let names = arguments
        .set
        .iter()
        .chain(&arguments.effects)
        .filter_map(|text| text.split_once('='));
    for (name, _) in names {
        if seen.contains(&name.trim()) {
            return Err(Error::input("arguments", "every name at most once")
                .found(format!("a second {name}")));
        }
        seen.push(name.trim());
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
fn ordered(acting: Vec<Acting>, scene: &Scene) -> Result<Vec<Acting>> {
    for a in &acting {
        if let Some(reason) = obstacle(a.effect, scene) {
            let expected = format!("an effect that can act, which this one cannot: {reason}");
            return Err(Error::input("--effect", expected).found(a.effect.name()));
        }
    }
    let of = |effect: &'static dyn Effect| {
        let own = acting.iter();
        own.filter(move |a| a.effect.name() == effect.name())
            .cloned()
    };
    Ok(EFFECTS.iter().flat_map(|e| of(*e)).collect())
}

/// The format of a name.
fn reader(format: &str) -> Result<&'static dyn Reader> {
    let known = || READERS.iter().map(|reader| reader.format());
    let at = known().position(|name| name == format).ok_or_else(|| {
        let known: Vec<_> = known().collect();
        Error::input("--format", format!("one of {}", known.join(", "))).found(format)
    })?;
    Ok(READERS[at])
}

/// The model with the simulated field as its measurement: `plychain identify DIR/model.json`.
fn model_json(model: &Model, source: Source) -> Result<serde_json::Value> {
    let mut model = model.clone();
    model.experiment_mut().measurement.source = source;
    model.file.to_json()
}

fn not_negative(place: &str, value: f64) -> Result<f64> {
    if (0.0..1e9).contains(&value) {
        return Ok(value);
    }
    Err(Error::input(place, "a number from 0 to 1e9").found(value))
}

/// Values by name.
fn named(names: &[&str], values: &[f64]) -> serde_json::Map<String, serde_json::Value> {
    let pairs = names.iter().zip(values);
    pairs.map(|(n, v)| ((*n).to_string(), json!(v))).collect()
}

fn truth_json(model: &Model, truth: &Truth) -> serde_json::Value {
    let constants = named(model.constants(), &truth.constants);
    let effects: serde_json::Map<_, _> = truth
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
fn amplitudes(acting: &Acting) -> serde_json::Map<String, serde_json::Value> {
    let parameters = acting.effect.parameters().iter();
    parameters
        .zip(&acting.amplitude)
        .map(|(p, v)| (p.name.to_string(), json!(v)))
        .collect()
}
