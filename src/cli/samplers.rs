//! How draws are made: the sampler, its moves and their shares, walkers, ensembles and thinning.

use clap::Args;
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::sample::{Ensemble, Mixture, SAMPLERS, Sampler, Schedule};

/// What each sampler and each move is good for.
pub const MOVES_HELP: &str = "Samplers and moves:
  ensemble       walkers that propose from each other; needs no tuning and no gradient
    independence   Student-t fitted to the other walkers; best where the density is nearly normal
    de             difference of two walkers; correlated densities, jumps between modes
    snooker        along the line to another walker; heavy tails
    stretch        Goodman and Weare, as in emcee; few parameters
  adaptive       one chain an ensemble, adaptive Metropolis with delayed rejection; few, slow evaluations, one mode
The default is ensemble with independence:0.7,de:0.25,stretch:0.05. It finds the shares of modes 20 sds apart where the
box reaches over both. A funnel converges with none of them: take other parameters.";

/// Arguments of every verb that samples.
#[derive(Debug, Args)]
pub struct SamplerOptions {
    /// Sampler: ensemble or adaptive
    #[arg(long, default_value = "ensemble")]
    sampler: String,
    /// Moves of the ensemble with their shares, as de:0.6,stretch:0.4: independence, de, snooker, stretch
    #[arg(long = "move", value_name = "NAME:SHARE,...")]
    moves: Option<String>,
    /// Walkers of an ensemble (default: 8 a parameter, at least 64)
    #[arg(long, value_name = "N")]
    walkers: Option<usize>,
    /// Independent ensembles, or chains (default: 4)
    #[arg(long, value_name = "N")]
    ensembles: Option<usize>,
    /// Steps between stored draws (default: half of an autocorrelation time)
    #[arg(long, value_name = "N")]
    thin: Option<usize>,
}

impl SamplerOptions {
    /// The sampler.
    ///
    /// # Errors
    /// The input's fault: an unknown sampler or move, a share that is none, moves of a sampler without any.
    pub fn sampler(&self) -> Result<Box<dyn Sampler>> {
        if self.sampler != "ensemble" {
            let only = self.moves.is_some() || self.walkers.is_some();
            if let Some(option) = only.then_some("--move, --walkers") {
                return Err(Error::input(option, "the sampler ensemble").found(&self.sampler));
            }
            return named(&self.sampler);
        }
        let mixture = match &self.moves {
            Some(text) => Mixture::parse(text).map_err(|e| e.within("--move"))?,
            None => Mixture::default(),
        };
        Ok(Box::new(Ensemble {
            mixture,
            walkers: self.walkers,
        }))
    }

    /// Put ensembles and thinning into a schedule.
    ///
    /// # Errors
    /// The input's fault: a number that is 0.
    pub fn apply(&self, schedule: &mut Schedule) -> Result<()> {
        for (option, number) in [("--ensembles", self.ensembles), ("--thin", self.thin)] {
            if number == Some(0) {
                return Err(Error::input(option, "a number above 0").found(0));
            }
        }
        schedule.ensembles = self.ensembles.unwrap_or(schedule.ensembles);
        schedule.thin = self.thin.or(schedule.thin);
        Ok(())
    }

    /// What is not the default, which a resumed run must share.
    pub fn identity(&self) -> Option<Value> {
        let is_default = self.moves.is_none() && self.walkers.is_none() && self.thin.is_none();
        (!is_default)
            .then(|| json!({ "moves": self.moves, "walkers": self.walkers, "thin": self.thin }))
    }
}

/// A sampler by its name, with its default constants.
///
/// # Errors
/// The input's fault: a name that is none.
pub fn named(name: &str) -> Result<Box<dyn Sampler>> {
    let found = SAMPLERS.iter().find(|entry| entry.name == name);
    let known = SAMPLERS.iter().map(|entry| entry.name);
    let found = found.map(|entry| (entry.build)());
    found.ok_or_else(|| Error::one_of("--sampler", known, name))
}
