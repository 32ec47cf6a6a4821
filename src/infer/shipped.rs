//! The models that `init` starts from, and what of a model is still theirs.

use serde_json::Value;

/// A model that comes with the program.
#[derive(Debug, Clone, Copy)]
pub struct Shipped {
    pub name: &'static str,
    pub text: &'static str,
}

pub const OPENHOLE: Shipped = Shipped {
    name: "openhole",
    text: include_str!("../../models/openhole.json"),
};

pub const STEEL: Shipped = Shipped {
    name: "steel-s235",
    text: include_str!("../../models/steel-s235.json"),
};

/// What no measurement says and everybody has to state, below the field or the material.
const STATED: [&str; 6] = [
    "/specimen/length_mm",
    "/specimen/width_mm",
    "/specimen/hole/diameter_mm",
    "/specimen/layup_deg",
    "/specimen/thickness_mm/mean",
    "/load/force_N",
];

/// Values of a model file that are those of the shipped model that it began as: keys in the field's entry, and names of constants whose
/// priors are. A shipped model itself has none.
pub fn unchanged(model: &Value) -> Vec<String> {
    let names = [OPENHOLE, STEEL].map(|s| s.name);
    if names.iter().any(|n| model["name"] == *n) {
        return Vec::new();
    }
    let kind = &model["material"]["kind"];
    let templates = [OPENHOLE, STEEL].into_iter();
    let mut templates = templates.filter_map(|s| serde_json::from_str::<Value>(s.text).ok());
    let Some(template) = templates.find(|t| t["material"]["kind"] == *kind) else {
        return Vec::new();
    };
    let [own, its] = [model, &template].map(|m| &m["experiments"][0]);
    let same = |key: &&str| own.pointer(key).is_some() && number(own, key) == number(its, key);
    let stated = STATED.iter().copied().filter(same);
    let stated = stated.map(|key| key[1..].replace('/', "."));
    let priors = model["material"]["parameters"].as_object();
    let of_template = &template["material"]["parameters"];
    let priors = priors.into_iter().flatten();
    let priors = priors
        .filter(|(name, p)| number(p, "/prior") == number(of_template, &format!("/{name}/prior")));
    stated
        .chain(priors.map(|(name, _)| format!("prior of {name}")))
        .collect()
}

/// A value whose numbers compare as numbers: 162 and 162.0 are one.
fn number(value: &Value, pointer: &str) -> Option<String> {
    fn written(value: &Value) -> String {
        match value {
            Value::Number(n) => n.as_f64().map_or(String::new(), |n| n.to_string()),
            Value::Array(all) => all.iter().map(|v| written(v) + ",").collect(),
            Value::Object(all) => all
                .iter()
                .map(|(k, v)| format!("{k}:{},", written(v)))
                .collect(),
            other => other.to_string(),
        }
    }
    value.pointer(pointer).map(written)
}
