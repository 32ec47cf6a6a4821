//! `plychain design`: what to measure next.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::{DEFAULT_MODEL, print, results};
use crate::error::{Error, Result};
use crate::experiment::simulate::HALF_WINDOW;
use crate::files;
use crate::identify;
use crate::laminate::MeanSd;
use crate::progress::Progress;
use crate::quantity::{NM_PER_MM, significant};
use crate::report::design::{Constants, DesignReport};
use crate::section::terminal;
use crate::study::{Measuring, SharedConstants, Study};
use crate::validate::design::{ProposedExperiment, assess, coupons, declared, plates};

/// Arguments of `design`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain design                                   beside the default model: coupons and plates of its laminate
  plychain design specimen.json --for E2_GPa,nu12   ranked by what they say of these
  plychain design specimen.json plate.json other.json    the candidates in files of your own, measured or not")]
pub struct DesignArguments {
    /// Model file of the test that you have, or plan
    #[arg(default_value = DEFAULT_MODEL)]
    pub(super) model: PathBuf,
    /// Model files of the tests to compare (default: coupons and plates of the model's laminate, of several angles, sizes and holes)
    others: Vec<PathBuf>,
    /// Constants to rank the tests by (default: all)
    #[arg(long = "for", value_name = "NAME,...", value_delimiter = ',')]
    wanted: Vec<String>,
    /// Noise of a point of a field, sd in nm; above 0 (default: that of the model's own measurement, or else what is usual)
    #[arg(long)]
    noise_nm: Option<f64>,
    /// Number of points along each side of a field's window, 5 to 4000 (default: as many points as the model's own measurement has)
    #[arg(long, value_parser = clap::value_parser!(u16).range(5..=4000))]
    grid: Option<u16>,
    /// File to write the numbers to, as JSON
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Layup and thickness of what was or will be measured, for candidates like it.
fn laminate(study: &Study) -> Result<(Vec<f64>, MeanSd)> {
    #[derive(serde::Deserialize)]
    struct LaidUp {
        #[serde(default)]
        layup_deg: Vec<f64>,
        thickness_mm: MeanSd,
    }
    for experiment in &study.experiments {
        let json = experiment.json(false)?;
        if let Ok(found) = serde_json::from_value::<LaidUp>(json["specimen"].clone()) {
            return Ok((found.layup_deg, found.thickness_mm));
        }
    }
    Ok((Vec::new(), MeanSd { mean: 1.0, sd: 0.0 }))
}

pub fn run(arguments: &DesignArguments, console: &Console) -> Result<()> {
    if let Some(noise) = arguments.noise_nm.filter(|n| !(*n > 0.0 && *n < 1e9)) {
        return Err(Error::input("--noise-nm", "a number above 0").found(noise));
    }
    let own = Study::load(&arguments.model)?;
    let (shared, tests) = (own.shared(), declared(&own));
    let wanted = wanted(arguments, &shared)?;
    let candidates = candidates(arguments, &own)?;
    let (measuring, assumed) = measuring(arguments, &own, console);
    let count = (tests.len() + candidates.len()) as u64;
    console.begin("what each experiment would say", Some(count));
    let assessed =
        |tests: &[ProposedExperiment]| assess(tests, &shared, measuring, &|| console.step());
    let (declared, others) = (assessed(&tests), assessed(&candidates));
    console.end();
    if declared.len() < tests.len() {
        return Err(Error::input(
            arguments.model.display(),
            "experiments that can be computed",
        )
        .hint("plychain identify says what is wrong with them"));
    }
    let constants = Constants {
        priors: &shared.constants,
        wanted: &wanted,
    };
    let report = DesignReport {
        assumed,
        ..DesignReport::new(own.name(), &constants, &declared, others)
    };
    results(&report)?;
    print(&terminal(&report.sections()))?;
    if let Some(out) = &arguments.out {
        files::write_json(out, &report)?;
        print(&format!("\nwritten to {}\n", out.display()))?;
    }
    Ok(())
}

/// Noise of moire and of image correlation, nm, and points along a side, where nothing says them.
const MOIRE: (f64, usize) = (10.0, 243);
const IMAGES_PX: f64 = 0.02;
const IMAGES_NM: f64 = 400.0;

/// Points of image correlation along a side of a subset.
const STEPS_A_SUBSET: f64 = 3.0;

/// How a field would be measured, and in words what says so: the options, the measurement that the model has, or what is usual.
fn measuring(arguments: &DesignArguments, own: &Study, console: &Console) -> (Measuring, String) {
    let Some((_, model)) = own.fields().next() else {
        let (noise_nm, grid) = MOIRE;
        return (Measuring { noise_nm, grid }, String::new());
    };
    let wants_both = arguments.noise_nm.is_some() && arguments.grid.is_some();
    let measured = || {
        let prepared = identify::prepare(model, console).ok()?;
        let points = prepared.observation.field.len();
        let inverse = identify::inverse_problem(model, prepared, console).ok()?;
        Some((
            inverse.noise.reference_nm(),
            (points as f64).sqrt() as usize,
        ))
    };
    let found = if wants_both { None } else { measured() };
    let images = model.experiment().measurement.image_correlation;
    let usual = images.map_or(MOIRE, |images| {
        let noise = images.pixel_mm.map(|px| IMAGES_PX * px * NM_PER_MM);
        let side = 2.0 * HALF_WINDOW * model.experiment().specimen.width_mm;
        let grid = STEPS_A_SUBSET * side / images.subset_mm;
        (noise.unwrap_or(IMAGES_NM), grid as usize)
    });
    let (noise, grid) = found.unwrap_or(usual);
    let measuring = Measuring {
        noise_nm: arguments.noise_nm.unwrap_or(noise),
        grid: arguments.grid.map_or(grid, usize::from),
    };
    let source = match found.is_some() || wants_both {
        true => "as the model's own measurement or the options have them",
        false => {
            "ASSUMED, because the model's measurement cannot be read: give --noise-nm and --grid"
        }
    };
    let noise = significant(measuring.noise_nm, 0.1 * measuring.noise_nm);
    let said = format!(
        "fields of {0} x {0} points with {noise} nm of noise, {source}",
        measuring.grid
    );
    (measuring, said)
}

/// Places of the constants that matter.
fn wanted(arguments: &DesignArguments, own: &SharedConstants) -> Result<Vec<usize>> {
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

fn candidates(arguments: &DesignArguments, own: &Study) -> Result<Vec<ProposedExperiment>> {
    if arguments.others.is_empty() {
        let field = own.fields().next();
        let mut all: Vec<ProposedExperiment> =
            field.map_or_else(Vec::new, |(_, model)| coupons(model));
        let (layup, thickness_mm) = laminate(own)?;
        all.extend(plates(&layup, thickness_mm));
        return Ok(all);
    }
    let mut all = Vec::new();
    for path in &arguments.others {
        let other = Study::load(path)?;
        if other.shared().material != own.shared().material {
            return Err(
                Error::input(path.display(), "the material of the first model")
                    .found("another parameterisation"),
            );
        }
        all.extend(declared(&other).into_iter().map(|test| ProposedExperiment {
            name: format!("{}: {}", other.name(), test.name),
            ..test
        }));
    }
    Ok(all)
}
