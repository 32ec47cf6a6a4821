//! How many POD modes are kept: a number, or by rule.

use serde::de::{Deserializer, Error, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::pod::Pod;

/// The `modes` key of a model file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Modes {
    /// This many for each component; 4 is the article's setting.
    Count(usize),
    /// `"auto"`: the fewest that leave at most 0.005 nm (root mean square) of the snapshots of both components.
    Auto,
}

/// Largest truncation error under [`Modes::Auto`], root mean square over points and snapshots, mm. A choice: the quietest effect that is to be
/// traced leaves about a nanometre, and of the 7 modes that the default test has by it the largest error (CV_RMS) is 0.005 nm.
pub const AUTO_MM: f64 = 5e-9;

impl Modes {
    /// The number of modes of each component, given their decompositions, each of snapshots at so many `points`.
    pub fn resolve(self, pods: &[Pod; 2], points: usize) -> usize {
        let most = pods[0].singular.len();
        match self {
            Modes::Count(k) => k.min(most),
            Modes::Auto => {
                let enough = |k: &usize| pods.iter().all(|pod| pod.left_mm(*k, points) <= AUTO_MM);
                (1..most).find(enough).unwrap_or(most)
            }
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
