//! `plychain design`: what to measure next.

use std::path::{Path, PathBuf};

use clap::Args;

use super::console::Console;
use super::{DEFAULT_MODEL, print};
use crate::error::{Error, Result};
use crate::files;
use crate::infer::{FrequenciesModel, Marginal, Model};
use crate::laminate::{Material, MeanSd};
use crate::progress::Progress;
use crate::report::design::{Constants, DesignReport};
use crate::report::section::terminal;
use crate::validate::design::{
    Candidate, Measuring, assess, coupons, declared, declared_plates, plates,
};

/// Arguments of `design`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain design                                   beside the default model: coupons and plates of its laminate
  plychain design specimen.json --for E2_GPa,nu12   ranked by what they say of these
  plychain design specimen.json plate.json other.json    the candidates in files of your own, measured or not")]
pub struct DesignArguments {
    /// Model file: what is measured already, or will be
    #[arg(default_value = DEFAULT_MODEL)]
    model: PathBuf,
    /// Model files whose experiments are the candidates; without any, coupons and plates of the model's laminate, turned, of several sides
    /// and holes
    others: Vec<PathBuf>,
    /// Constants that matter (default: all)
    #[arg(long = "for", value_name = "NAME,...", value_delimiter = ',')]
    wanted: Vec<String>,
    /// Noise sd of a point of a field, nm
    #[arg(long, default_value_t = 10.0)]
    noise_nm: f64,
    /// Points along each side of a field's window
    #[arg(long, default_value_t = 243, value_parser = clap::value_parser!(u16).range(5..=4000))]
    grid: u16,
    /// Write everything as JSON too
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// A model file of either kind.
struct Declared {
    name: String,
    material: Material,
    constants: Vec<(String, Marginal)>,
    tests: Vec<Candidate>,
    /// Layup and thickness, for candidates like it.
    layup: Vec<f64>,
    thickness_mm: MeanSd,
    field: Option<Model>,
}

fn load(path: &Path) -> Result<Declared> {
    if let Some(model) = FrequenciesModel::load(path)? {
        let plate = &model.file.experiments[0].specimen;
        return Ok(Declared {
            name: model.file.name.clone(),
            material: model.material(),
            constants: model.constants(),
            tests: declared_plates(&model),
            layup: plate.layup_deg.clone(),
            thickness_mm: plate.thickness_mm,
            field: None,
        });
    }
    let model = Model::load(path)?;
    let names = model.constants().iter().map(|n| (*n).to_string());
    let specimen = &model.experiment().specimen;
    Ok(Declared {
        name: model.file.name.clone(),
        material: model.material(),
        constants: names.zip(model.marginals()).collect(),
        tests: declared(&model),
        layup: specimen.layup_deg.clone().unwrap_or_default(),
        thickness_mm: specimen.thickness_mm,
        field: Some(model),
    })
}

pub fn run(arguments: &DesignArguments, console: &Console) -> Result<()> {
    if !(arguments.noise_nm > 0.0 && arguments.noise_nm < 1e9) {
        return Err(Error::input("--noise-nm", "a number above 0").found(arguments.noise_nm));
    }
    let own = load(&arguments.model)?;
    let wanted = wanted(arguments, &own)?;
    let candidates = candidates(arguments, &own)?;
    let measuring = Measuring {
        noise_nm: arguments.noise_nm,
        grid: usize::from(arguments.grid),
    };
    let count = (own.tests.len() + candidates.len()) as u64;
    console.begin("what each experiment would say", Some(count));
    let assessed = |tests: &[Candidate]| {
        assess(tests, own.material, &own.constants, measuring, &|| {
            console.step()
        })
    };
    let (declared, others) = (assessed(&own.tests), assessed(&candidates));
    console.end();
    if declared.len() < own.tests.len() {
        return Err(Error::input(
            arguments.model.display(),
            "experiments that can be computed",
        )
        .hint("plychain identify says what is wrong with them"));
    }
    let constants = Constants {
        priors: &own.constants,
        wanted: &wanted,
    };
    let report = DesignReport::new(&own.name, &constants, &declared, others);
    print(&terminal(&report.sections()))?;
    if let Some(out) = &arguments.out {
        files::write_json(out, &report)?;
        print(&format!("\nwritten to {}\n", out.display()))?;
    }
    Ok(())
}

/// Places of the constants that matter.
fn wanted(arguments: &DesignArguments, own: &Declared) -> Result<Vec<usize>> {
    if arguments.wanted.is_empty() {
        return Ok((0..own.constants.len()).collect());
    }
    let place = |name: &String| {
        let at = own.constants.iter().position(|c| c.0 == *name);
        at.ok_or_else(|| {
            let known: Vec<&str> = own.constants.iter().map(|c| c.0.as_str()).collect();
            Error::input("--for", format!("some of {}", known.join(", "))).found(name)
        })
    };
    arguments.wanted.iter().map(place).collect()
}

fn candidates(arguments: &DesignArguments, own: &Declared) -> Result<Vec<Candidate>> {
    if arguments.others.is_empty() {
        let mut all: Vec<Candidate> = own.field.iter().flat_map(coupons).collect();
        all.extend(plates(&own.layup, own.thickness_mm));
        return Ok(all);
    }
    let mut all = Vec::new();
    for path in &arguments.others {
        let other = load(path)?;
        if other.material != own.material {
            return Err(
                Error::input(path.display(), "the material of the first model")
                    .found("another parameterisation"),
            );
        }
        all.extend(other.tests.into_iter().map(|test| Candidate {
            name: format!("{}: {}", other.name, test.name),
            ..test
        }));
    }
    Ok(all)
}
