//! `plychain simulate` of the natural frequencies of plates.

use serde_json::json;

use super::{SimulateArguments, named, settings};
use crate::cli::folder::Folder;
use crate::cli::print;
use crate::error::{Error, Result};
use crate::experiment::frequencies::FrequenciesSpec;
use crate::infer::{FrequenciesModel, Model};
use crate::laminate::{Material, Ply};

/// What is added to the seed of a run for the readings of each plate.
const READINGS: u64 = 1_000_003;

/// Of a model of plates alone.
pub fn run(arguments: &SimulateArguments, model: &FrequenciesModel, seed: u64) -> Result<()> {
    if !arguments.effects.is_empty() || !arguments.steps.is_empty() || arguments.fringes.is_some() {
        return Err(
            Error::input("--effect, --steps, --fringes", "a model of a field")
                .found("frequencies alone"),
        );
    }
    let names = model.material().constants();
    let mut constants: Vec<f64> = model.constants().iter().map(|c| c.1.mean).collect();
    for (name, value) in settings(arguments)? {
        let known = names.iter().position(|n| *n == name);
        let k = known.ok_or_else(|| {
            Error::input("--set", format!("one of {}", names.join(", "))).found(&name)
        })?;
        constants[k] = value;
    }
    let folder = Folder::create(Some(&arguments.out), &model.file.name)?;
    let mut file = model.file.clone();
    let ply = ply(model.material(), &constants)?;
    file.experiments = simulated(&file.experiments, ply, seed)?;
    folder.write_json("model.json", &file)?;
    let truth = json!({ "model": file.name, "constants": named(names, &constants), "effects": {}, "seed": seed });
    folder.write_json("truth.json", &truth)?;
    print(&format!(
        "{} peaks, model.json and truth.json written to {}\n",
        file.experiments
            .iter()
            .map(|e| e.frequencies_hz.len())
            .sum::<usize>(),
        folder.path().display()
    ))?;
    folder.keep();
    Ok(())
}

/// Put simulated peaks in the place of those that stand beside a model's field.
///
/// # Errors
/// The input's fault: constants or a plate that cannot be.
pub fn beside(model: &mut Model, constants: &[f64], seed: u64) -> Result<()> {
    if model.file.frequencies.is_empty() {
        return Ok(());
    }
    let ply = ply(model.material(), constants)?;
    model.file.frequencies = simulated(&model.file.frequencies, ply, seed)?;
    Ok(())
}

fn ply(material: Material, constants: &[f64]) -> Result<Ply> {
    let ply = material.ply(constants);
    ply.admissible("--set")
}

fn simulated(plates: &[FrequenciesSpec], ply: Ply, seed: u64) -> Result<Vec<FrequenciesSpec>> {
    let plates = plates.iter().zip(1..);
    let of =
        |(spec, k): (&FrequenciesSpec, u64)| spec.simulated(ply, seed.wrapping_add(k * READINGS));
    plates.map(of).collect()
}
