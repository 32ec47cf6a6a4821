//! `plychain effects`.

use std::fmt::Write;
use std::path::Path;

use clap::Args;
use serde_json::{Value, json};

use super::{print, results};
use crate::effect::{EFFECTS, Effect, EffectParameter, why_not};
use crate::error::{Error, Result};
use crate::infer::Model;
use crate::parameter::Parameter;
use crate::section::wrap;

/// Arguments of `effects`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain effects
  plychain effects lens rotation            those with these words in their names
  plychain effects models/openhole.json     with the sizes of this model")]
pub struct EffectsArguments {
    /// Parts of names, to list only such effects; a model file, to print the sizes that it declares and which effects cannot act there
    #[arg(value_name = "NAME|MODEL")]
    what: Vec<String>,
}

/// One effect as a model sees it.
struct ListedEffect {
    effect: &'static dyn Effect,
    /// Of each parameter.
    prior_sd: Vec<Option<f64>>,
    obstacle: Option<&'static str>,
    declared: bool,
    candidate: bool,
}

pub fn run(arguments: &EffectsArguments) -> Result<()> {
    let (files, names): (Vec<&String>, Vec<&String>) =
        arguments.what.iter().partition(|w| w.ends_with(".json"));
    let model = match &files[..] {
        [] => None,
        [file] => Some(Model::load(Path::new(file))?),
        [_, second, ..] => {
            return Err(Error::input("MODEL", "one model file").found(second));
        }
    };
    let is_wanted = |effect: &&&'static dyn Effect| {
        names.is_empty() || names.iter().any(|n| effect.name().contains(n.as_str()))
    };
    let effects = EFFECTS.iter().filter(is_wanted);
    let entries: Vec<ListedEffect> = effects.map(|e| entry(*e, model.as_ref())).collect();
    if entries.is_empty() {
        return Err(Error::input("NAME", "a part of an effect's name")
            .found(&arguments.what[0])
            .hint("plychain effects lists all; a model file ends in .json"));
    }
    let of_model = model.is_some();
    let value: Vec<Value> = entries.iter().map(|e| numbers(e, of_model)).collect();
    results(&value)?;
    print(&text(&entries, model.as_ref()))
}

fn entry(effect: &'static dyn Effect, model: Option<&Model>) -> ListedEffect {
    let named = |names: &[String]| names.iter().any(|name| name == effect.name());
    let prior_sd = effect.parameters().iter().enumerate();
    ListedEffect {
        effect,
        prior_sd: prior_sd
            .map(|(k, parameter)| match model {
                Some(model) => model.prior_sd(effect, k),
                None => parameter.prior_sd,
            })
            .collect(),
        obstacle: model.and_then(|m| why_not(effect, &m.scene())),
        declared: model.is_some_and(|m| named(&m.experiment().effects)),
        candidate: model.is_none_or(|m| m.experiment().candidates.as_deref().is_none_or(named)),
    }
}

fn numbers(entry: &ListedEffect, with_model: bool) -> Value {
    let effect = entry.effect;
    let parameters: Vec<Value> = effect
        .parameters()
        .iter()
        .zip(&entry.prior_sd)
        .map(|(p, plausible)| {
            json!({ "name": p.name, "unit": Parameter::read(p.name).unit(), "plausible": plausible, "bound": p.bound })
        })
        .collect();
    let mut value = json!({
        "name": effect.name(), "kind": effect.kind().words(), "parameters": parameters,
        "about": effect.entry().about, "confirm": effect.entry().confirm,
    });
    if with_model {
        value["cannot_act"] = json!(entry.obstacle);
        value["declared"] = json!(entry.declared);
        value["candidate"] = json!(entry.candidate);
    }
    value
}

fn text(entries: &[ListedEffect], model: Option<&Model>) -> String {
    let by_the_model = model.map_or_else(String::new, |m| format!(", as {} has them", m.file.name));
    let mut text = wrap(
        "",
        "",
        &format!(
            "The effects that may act on a measurement{by_the_model}. An amplitude's plausible size is the standard deviation of its prior; a model's \"plausible\" changes it."
        ),
    );
    let width = entries
        .iter()
        .flat_map(|e| e.effect.parameters())
        .map(|p| p.name.len())
        .max()
        .unwrap_or(0);
    for entry in entries {
        let effect = entry.effect;
        let _ = writeln!(text, "\n{}: {}", effect.name(), effect.kind().words());
        for (parameter, plausible) in effect.parameters().iter().zip(&entry.prior_sd) {
            let _ = writeln!(
                text,
                "  {:width$}  {}",
                parameter.name,
                size(parameter, *plausible)
            );
        }
        text += &wrap("  what     ", "           ", effect.entry().about);
        text += &wrap("  confirm  ", "           ", effect.entry().confirm);
        if entry.declared {
            text += "  declared in this model\n";
        }
        if !entry.candidate {
            text += "  not among this model's candidates\n";
        }
        if let Some(reason) = entry.obstacle {
            text += &wrap("  ", "  ", &format!("cannot act in this model: {reason}"));
        }
    }
    text
}

fn size(parameter: &EffectParameter, plausible: Option<f64>) -> String {
    match plausible {
        Some(sd) => format!("plausible {sd} {}", Parameter::read(parameter.name).unit()),
        None => format!("any size, in {}", Parameter::read(parameter.name).unit()),
    }
}
