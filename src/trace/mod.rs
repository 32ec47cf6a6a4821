//! What the residual of an identification says: sensitivities, evidence of effects, averaged posterior, conclusion.

mod alias;
mod attribute;
pub mod averaged;
mod axis;
mod blind_spot;
mod close;
pub mod conclusion;
pub mod converged;
mod evidence;
mod extend;
pub mod facts;
mod fisher;
mod fitted;
pub mod holdout;
mod layout;
mod left_out;
mod linearity;
mod load_rivals;
mod noise_words;
mod patched;
pub mod patches;
mod phases;
mod priors;
pub mod quoted;
mod recording;
mod refused;
mod round;
mod stiffness;
mod subsets;
mod suspect;
mod together;
mod traced;
mod tracing;
mod vetoes;
pub mod wedge;

pub use attribute::attribute;
pub use averaged::Interval;
pub use blind_spot::{BlindSpot, LINEAR_PERCENT};
pub use close::{Closed, Explained, LoopStage, ToQuote, close, explain, finished};
pub use conclusion::{Conclusion, FORCE_UNSEEN, texts};
pub use evidence::LARGEST_MULTIPLE;
pub use extend::extended;
pub use facts::Status;
pub use fisher::{Hidden, Information, field_information};
pub use linearity::NOT_LINEAR;
pub use patches::Patches;
pub use quoted::{Proposals, Quoted, quote, rule as quoted_rule};
pub use round::Round;
pub use subsets::SIZES;
pub use suspect::{Suspect, UNEXPLAINED};
pub use together::{field_alone, tension};
pub use traced::LinearisedEvidence;
pub use tracing::{
    Accepted, Finding, HeldOutStep, Named, Resembling, StepMaps, StiffnessAt, Tracing,
};
