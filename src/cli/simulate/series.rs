//! `plychain simulate` of a load series.

use std::path::Path;

use serde_json::{Value, json};

use super::{
    FieldTarget, SimulateArguments, Simulated, amplitudes, not_negative, ordered, plan, reader,
    truth_json, without_experiment,
};
use crate::effect::{Acting, Scope};
use crate::error::{Error, Result};
use crate::experiment::Gauge;
use crate::experiment::series::{Law, Moving};
use crate::experiment::simulate::series::{SeriesTruth, SimulatedSeries};
use crate::field::{ColumnMap, Frame, Grid, Reader, Source, StepSpec};
use crate::files;
use crate::infer::{EffectUnderLaw, Model, simulated_series};

/// An effect whose amplitude varies over the steps, by a law where it moves the specimen: one amplitude, of a free one as many as there are
/// steps.
struct ByLaw {
    law: Option<Law>,
    acting: Vec<Acting>,
}

pub fn simulated(target: &FieldTarget<'_>, mut model: Model) -> Result<Simulated> {
    let arguments = target.arguments;
    let reader = reader(arguments.format.as_deref().unwrap_or("csv"))?;
    if arguments.fringes.is_some() || reader.format() == "fringes" {
        return Err(Error::input(
            "--fringes",
            "one load: images of a series are those of each step",
        ));
    }
    let forces = forces(arguments, &model)?;
    let declared = declare(&mut model, (&forces, &target.within), reader);
    let mut shared = plan(arguments, &model, target.seed)?;
    let (own, by_law) = effects(&target.effects, forces.len())?;
    shared.effects = ordered(own, &model.scene())?;
    let largest = forces.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    let relative: Vec<f64> = forces.iter().map(|f| f / largest).collect();
    let nominal = model.experiment().nominal_load().force_n;
    let truth = SeriesTruth {
        shared,
        loads: forces.iter().map(|f| f / nominal).collect(),
        moving: by_law.iter().flat_map(|e| e.over(&relative)).collect(),
        motion_mm: not_negative("--motion-mm", arguments.motion_mm)?,
        subsets: model.subsets(),
    };
    let simulated = simulated_series(&model, &truth)?;
    let frame = model.scene().frame;
    let steps = model.experiment().steps.clone().unwrap_or_default();
    let folder = target.folder.path();
    files::make_folder(&folder.join(&target.within))?;
    let mut columns = None;
    for (k, (step, grid)) in steps.iter().zip(&simulated.grids).enumerate() {
        columns = write(reader, &folder.join(&step.file), (grid, frame), declared[k])?;
    }
    let mut of_shared = truth_json(&model, &truth.shared);
    add(&mut of_shared, (&truth, &by_law), &steps, &simulated);
    let experiment = model.experiment_mut();
    experiment.measurement.source = Source {
        reader,
        path: None,
        columns,
    };
    for (step, force) in experiment.steps.iter_mut().flatten().zip(&declared) {
        step.force_n = *force;
    }
    Ok(Simulated {
        said: format!(
            "{} steps of {} x {} points",
            steps.len(),
            truth.shared.grid,
            truth.shared.grid
        ),
        model,
        truth: of_shared,
    })
}

/// True forces of the steps, N.
fn forces(arguments: &SimulateArguments, model: &Model) -> Result<Vec<f64>> {
    let steps = model.experiment().steps.as_deref().unwrap_or_default();
    let forces = if arguments.steps.is_empty() {
        let known: Option<Vec<f64>> = steps.iter().map(|s| s.force_n).collect();
        known.ok_or_else(|| {
            Error::input(
                "--steps",
                "the true force of every step, because the model does not know all",
            )
            .found("force_N null")
            .hint("in the simulated model.json they stay null")
        })?
    } else {
        arguments.steps.clone()
    };
    let finite = forces.iter().all(|f| f.abs() < 1e9);
    if !finite || forces.iter().all(|f| *f == 0.0) {
        return Err(
            Error::input("--steps", "forces below 1e9 N, not all of them 0")
                .found(format!("{forces:?}")),
        );
    }
    Ok(forces)
}

/// Make the model that of a series of true forces; returns the forces as they are declared, `None` where the model does not know one.
fn declare(
    model: &mut Model,
    (forces, within): (&[f64], &Path),
    reader: &dyn Reader,
) -> Vec<Option<f64>> {
    let old = model.experiment().steps.clone().unwrap_or_default();
    let is_unknown = |k: usize| {
        let step = old.get(k).filter(|_| old.len() == forces.len());
        step.is_some_and(|s| s.force_n.is_none())
    };
    let declared = forces.iter().enumerate();
    let declared = declared.map(|(k, f)| (!is_unknown(k)).then_some(*f));
    let declared = declared.collect();
    let ending = if reader.is_directory() { "" } else { ".csv" };
    let digits = 2.max((forces.len() - 1).to_string().len());
    let steps = forces.iter().enumerate().map(|(k, f)| StepSpec {
        file: within.join(format!("step-{k:0digits$}{ending}")),
        force_n: Some(*f),
    });
    let experiment = model.experiment_mut();
    experiment.steps = Some(steps.collect());
    experiment.load = None;
    experiment.measurement.source.path = None;
    // no point of a specimen that moves stands still
    experiment.gauge = Gauge::Window;
    declared
}

/// Effects that all steps share, and those that move the specimen by a law.
fn effects(texts: &[&String], steps: usize) -> Result<(Vec<Acting>, Vec<ByLaw>)> {
    let (mut shared, mut by_law) = (Vec::new(), Vec::new());
    for text in texts.iter().map(|text| without_experiment(text)) {
        let (values, law) = match text.rsplit_once(':') {
            Some((values, law)) => (values, Some(parse_law(law)?)),
            None => (text, None),
        };
        let acting = match law {
            Some(Law::Free) => free(values, steps)?,
            _ => vec![Acting::parse("--effect", values)?],
        };
        let effect = acting[0].effect;
        match (effect.scope(), law) {
            (Scope::Motion, law) => by_law.push(ByLaw {
                law: law.or(Some(Law::Load)),
                acting,
            }),
            (_, Some(law)) => {
                let expected = "no law of an effect that does not move the specimen: what acts on specimen or picture does so in every step";
                let found = match law {
                    Law::Free => effect.name(),
                    _ => text,
                };
                return Err(Error::input("--effect", expected).found(found));
            }
            (Scope::Force, None) => by_law.push(ByLaw { law: None, acting }),
            (_, None) => shared.extend(acting),
        }
    }
    Ok((shared, by_law))
}

fn parse_law(name: &str) -> Result<Law> {
    serde_json::from_value(json!(name.trim())).map_err(|_| {
        let known: Vec<String> = Law::ALL.iter().map(|law| law.key()).collect();
        Error::input(
            "--effect",
            format!("NAME=VALUE:LAW with one of {}", known.join(", ")),
        )
        .found(name)
    })
}

/// An amplitude for each step: all values of the first, then those of the second ...
fn free(text: &str, steps: usize) -> Result<Vec<Acting>> {
    let (name, values) = text
        .split_once('=')
        .ok_or_else(|| Error::input("--effect", "NAME=VALUE:free").found(text))?;
    let values: Vec<&str> = values.split(',').collect();
    let each = crate::effect::find("--effect", name.trim())?
        .parameters()
        .len();
    if values.len() != each * steps {
        let expected =
            format!("{each} value(s) for each of {steps} steps, those of the first step first");
        return Err(Error::input(format!("--effect {name}"), expected)
            .found(format!("{} values", values.len())));
    }
    let of_step = |own: &[&str]| Acting::parse("--effect", &format!("{}={}", name, own.join(",")));
    values.chunks(each).map(of_step).collect()
}

impl ByLaw {
    /// The effect over steps whose forces are over the largest.
    fn over(&self, loads: &[f64]) -> Vec<Moving> {
        let under_law = EffectUnderLaw {
            effect: self.acting[0].effect,
            law: self.law,
        };
        let sets = under_law.weights(loads).into_iter().zip(&self.acting);
        let one = |(weights, acting): (Vec<f64>, &Acting)| Moving {
            effect: acting.effect,
            weights,
            amplitude: acting.amplitude.clone(),
        };
        sets.map(one).collect()
    }

    /// Amplitudes as a report names them, and the law.
    fn json(&self, steps: &[StepSpec]) -> Value {
        let mut all = serde_json::Map::new();
        for (acting, step) in self.acting.iter().zip(steps) {
            for (name, value) in amplitudes(acting) {
                let stem = step.file.file_stem().unwrap_or_default().to_string_lossy();
                let key = match self.law {
                    Some(Law::Free) => format!("{name} in {stem}"),
                    _ => name,
                };
                all.insert(key, value);
            }
        }
        if let Some(law) = self.law {
            all.insert("law".into(), json!(law));
        }
        Value::Object(all)
    }
}

/// Write a step; a table says its force where that is declared.
fn write(
    reader: &dyn Reader,
    path: &Path,
    (grid, frame): (&Grid, Frame),
    force_n: Option<f64>,
) -> Result<Option<ColumnMap>> {
    if reader.is_directory() {
        std::fs::create_dir(path)
            .map_err(|e| Error::input(path.display(), "a folder that can be made").found(e))?;
        return reader.write(path, grid, frame);
    }
    let columns = reader.write(path, grid, frame)?;
    if let Some(force) = force_n {
        let text = std::fs::read_to_string(path)
            .map_err(|e| Error::input(path.display(), "the file just written").found(e))?;
        files::replace(path, format!("# force : {force}\n{text}"))?;
    }
    Ok(columns)
}

/// What was simulated beside what all steps share.
fn add(
    of_shared: &mut Value,
    (truth, by_law): (&SeriesTruth, &[ByLaw]),
    steps: &[StepSpec],
    simulated: &SimulatedSeries,
) {
    for effect in by_law {
        let name = effect.acting[0].effect.name();
        of_shared["effects"][name] = effect.json(steps);
    }
    let motions = steps.iter().zip(&simulated.rigid);
    let motions = motions.map(|(step, m)| {
        json!({
            "file": step.file, "force_N": step.force_n,
            "shift_mm": m.shift, "angle_rad": m.angle,
        })
    });
    of_shared["steps"] = Value::Array(motions.collect());
    of_shared["motion_mm"] = json!(truth.motion_mm);
}
