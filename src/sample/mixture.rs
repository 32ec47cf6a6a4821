//! A declared mixture of moves: each step takes one of them, with a fixed probability, for the whole ensemble.

use super::de::De;
use super::independence::Independence;
use super::moves::Move;
use super::snooker::Snooker;
use super::stretch::Stretch;
use crate::error::{Error, Result};

/// Every move with its default constants. A new one is one file and one line here.
pub static MOVES: &[fn() -> Box<dyn Move>] = &[
    || Box::new(Stretch::default()),
    || Box::new(De::default()),
    || Box::new(Snooker::default()),
    || Box::new(Independence::default()),
];

/// Moves with their probabilities.
pub struct Mixture {
    parts: Vec<(Box<dyn Move>, f64)>,
}

impl Default for Mixture {
    /// 70 % independence (Student-t), 25 % DE, 5 % stretch. Chosen by measurement (`cargo bench --bench moves`,
    /// and the standard errors of the samplers' tests): on nearly normal targets four times the ESS per evaluation of DE alone,
    /// nowhere below DE, and standard errors that hold on heavy tails too.
    fn default() -> Self {
        Self {
            parts: vec![
                (Box::new(Independence::default()), 0.7),
                (Box::new(De::default()), 0.25),
                (Box::new(Stretch::default()), 0.05),
            ],
        }
    }
}

impl Mixture {
    /// Moves with positive weights, which are normalised.
    ///
    /// # Errors
    /// The input's fault if there is no move or a weight is not positive and finite.
    pub fn new(parts: Vec<(Box<dyn Move>, f64)>) -> Result<Self> {
        let total: f64 = parts.iter().map(|(_, w)| w).sum();
        let sound = parts.iter().all(|(_, w)| *w > 0.0 && w.is_finite());
        if parts.is_empty() || !sound {
            let found: Vec<String> = parts
                .iter()
                .map(|(m, w)| format!("{}={w}", m.name()))
                .collect();
            return Err(
                Error::input("mixture", "at least one move, each of positive weight")
                    .found(found.join(",")),
            );
        }
        Ok(Self {
            parts: parts.into_iter().map(|(m, w)| (m, w / total)).collect(),
        })
    }

    /// Reads `de:0.6,stretch:0.4`, or the same with `=` (a name alone has weight 1).
    ///
    /// # Errors
    /// The input's fault: an unknown move, or a weight that is no positive number.
    pub fn parse(text: &str) -> Result<Self> {
        let mut parts = Vec::new();
        for item in text.split(',').map(str::trim) {
            let (name, weight) = item.split_once([':', '=']).unwrap_or((item, "1"));
            let known = || MOVES.iter().map(|build| build());
            let chosen = known().find(|m| m.name() == name).ok_or_else(|| {
                let known: Vec<&str> = known().map(|m| m.name()).collect();
                Error::input("mixture", format!("one of {}", known.join(", "))).found(name)
            })?;
            let weight = weight.parse().map_err(|_| {
                Error::input(format!("mixture, weight of {name}"), "a number").found(weight)
            })?;
            parts.push((chosen, weight));
        }
        Self::new(parts)
    }

    pub fn parts(&self) -> &[(Box<dyn Move>, f64)] {
        &self.parts
    }

    /// The index of the move that a uniform number on [0, 1) chooses.
    pub fn choose(&self, uniform: f64) -> usize {
        let mut below = 0.0;
        for (index, (_, weight)) in self.parts.iter().enumerate() {
            below += weight;
            if uniform < below {
                return index;
            }
        }
        self.parts.len() - 1
    }

    /// Fewest walkers of a half that every move of the mixture can work with.
    pub fn fewest(&self, dim: usize) -> usize {
        let needs = self.parts.iter().map(|(m, _)| m.fewest(dim));
        needs.max().unwrap_or(1)
    }
}
