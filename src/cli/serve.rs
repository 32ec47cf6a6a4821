//! `plychain serve`: a model's log posterior and its predictions for other programs.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::{DEFAULT_MODEL, print};
use crate::bridge::{BoundServer, HostedModel, ModelAnswer, serve};
use crate::effect::amplitude_name;
use crate::error::{Error, Result};
use crate::identify::{InverseProblem, inverse_problem, prepare};
use crate::infer::Model;
use crate::sample::LogDensity;
use crate::study::Study;

/// Arguments of `serve`.
#[derive(Debug, Args)]
#[command(after_help = "Two models are served, in the UM-Bridge protocol:
  posterior    the log posterior of the constants and the noise (-1.8e308 outside its support)
  forward      the displacements in mm at the measured points, by finite elements: u1 of all points, then u2 of all
The order of the inputs is printed at the start. End it with Ctrl-C.

Example:
  plychain serve models/openhole.json --port 4242
  python -c \"import umbridge; print(umbridge.HTTPModel('http://localhost:4242', 'posterior')([[160, 7.5, 0.33, 4.5, 10]]))\"")]
pub struct ServeArguments {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    model: PathBuf,
    /// Measured data in place of the model's: a directory of matrices, or a CSV file
    #[arg(long)]
    data: Option<PathBuf>,
    /// Port on this machine; 0 takes a free one. Other machines cannot reach it
    #[arg(long, default_value_t = 4242)]
    port: u16,
}

pub fn run(arguments: &ServeArguments, console: &Console) -> Result<()> {
    let bound = BoundServer::new(arguments.port)?;
    let study = Study::load_with(&arguments.model, arguments.data.as_ref())?.settled()?;
    let models: Vec<&Model> = study.fields().map(|(_, model)| model).collect();
    let [model] = models[..] else {
        let place = arguments.model.display();
        return Err(
            Error::input(place, "a model of one field").found(format!("{} fields", models.len()))
        );
    };
    let prepared = prepare(model, console)?;
    let inverse = inverse_problem(model, prepared, console)?;
    let names = inverse.posed.density.names();
    let unknowns = unknowns(model);
    let points = inverse.prepared.observation.field.len();
    let url = &bound.url;
    print(&format!(
        "serving at {url}\n  posterior: {}\n  forward: {} -> {} displacements, mm\n",
        names.join(", "),
        unknowns.join(", "),
        2 * points
    ))?;
    let hosted = [
        HostedModel {
            name: "posterior",
            inputs: names.len(),
            outputs: 1,
            evaluate: Box::new(|x| density(&inverse, x)),
        },
        HostedModel {
            name: "forward",
            inputs: unknowns.len(),
            outputs: 2 * points,
            evaluate: Box::new(|x| displacements((model, &inverse), &unknowns, x)),
        },
    ];
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    // who asks for many at a time waits for each: more workers than processors cost nothing
    serve(&bound, &hosted, 4 * workers)
}

/// The constants, and the amplitudes of the declared effects.
fn unknowns(model: &Model) -> Vec<String> {
    let constants = model.constants().iter().map(|name| (*name).to_string());
    let effects = model.effects.iter().flat_map(|effect| {
        let parameters = effect.parameters().iter();
        parameters.map(|p| amplitude_name(*effect, p))
    });
    constants.chain(effects).collect()
}

fn density(inverse: &InverseProblem, x: &[f64]) -> ModelAnswer {
    let value = inverse.posed.density.value(x).map_err(|e| e.to_string())?;
    match value.is_nan() {
        true => Err(format!("the log posterior is not defined at {x:?}")),
        false => Ok(vec![value]),
    }
}

fn displacements(
    (model, inverse): (&Model, &InverseProblem),
    names: &[String],
    x: &[f64],
) -> ModelAnswer {
    let value = |name: &str| names.iter().position(|n| n == name).map(|k| x[k]);
    let state = model.state(&value);
    if !model.material().ply(&state.constants).is_admissible() {
        return Err(format!("no material has the constants {x:?}"));
    }
    let predicted = inverse.prepared.predict(&state);
    let field = predicted.map_err(|e| e.to_string())?.field;
    let component = |k: usize| field.iter().map(move |u| u[k]);
    Ok(component(0).chain(component(1)).collect())
}
