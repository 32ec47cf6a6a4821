//! How many POD modes are kept: a number, or by rule.

use serde::de::{Deserializer, Error, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::cross::CrossValidation;

/// The `modes` key of a model file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Modes {
    /// This many for each component; 4 is the article's setting.
    Count(usize),
    /// `"auto"`: the fewest with a leave-one-out field error (CV_RMS) of at most 0.05 nm in both components.
    Auto,
}

/// Largest truncation error under [`Modes::Auto`], mm: a twentieth of a nanometre. The quietest effect that is to be
/// traced leaves about one nanometre, and good moire noise is ten times that.
pub const AUTO_MM: f64 = 5e-8;

impl Modes {
    /// The number of modes of each component, given both components' cross-validation and the number of snapshots. [`Modes::Auto`] takes
    /// all modes that were cross-validated if even they are not enough.
    pub fn resolve(self, cross: &[CrossValidation; 2], snapshots: usize) -> usize {
        match self {
            Modes::Count(k) => k.min(snapshots),
            Modes::Auto => cross
                .iter()
                .map(|c| {
                    let enough = c.mm.iter().position(|&e| e <= AUTO_MM);
                    enough.map_or(c.mm.len(), |k| k + 1)
                })
                .max()
                .unwrap_or(1),
        }
    }
}

impl Serialize for Modes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Modes::Count(k) => serializer.serialize_u64(*k as u64),
            Modes::Auto => serializer.serialize_str("auto"),
        }
    }
}

impl<'de> Deserialize<'de> for Modes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ModesVisitor)
    }
}

struct ModesVisitor;

impl Visitor<'_> for ModesVisitor {
    type Value = Modes;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a whole number of modes, or \"auto\"")
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Modes, E> {
        usize::try_from(value)
            .map(Modes::Count)
            .map_err(|_| E::invalid_value(serde::de::Unexpected::Unsigned(value), &self))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Modes, E> {
        if value == "auto" {
            return Ok(Modes::Auto);
        }
        Err(E::invalid_value(serde::de::Unexpected::Str(value), &self))
    }
}
