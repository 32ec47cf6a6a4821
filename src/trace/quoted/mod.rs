//! The posterior to quote, sampled: the constants by the samplers, with sensitivities that follow them; everything that enters linearly (load,
//! thickness, the amplitudes of all effects) is integrated out of the density, the choices of noise, of acting effects and of the size of all
//! others are summed, and all of these are drawn afterwards (DESIGN: posterior, samplers, chains).

mod choices;
mod pose;
mod run;
mod variables;

pub use run::{Proposals, Quoted, quote, rule};

/// What an answer supposes beside what is declared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scenario {
    /// Others as small as the data say, or with their full prior sds where the evidence calls for it.
    Small,
    /// All effects of the dictionary with their full prior sds, and any change of stiffness beside the hole.
    All,
    /// No effect, and any change of stiffness beside the hole.
    None,
}

impl Scenario {
    /// The name in files.
    pub fn key(self) -> &'static str {
        match self {
            Self::Small => "small",
            Self::All => "all",
            Self::None => "none",
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Small => "effects as small as the data say",
            Self::All => "all effects at full size",
            Self::None => "no effects",
        }
    }
}
