//! What the residual of an identification says: sensitivities, evidence of effects, averaged posterior, conclusion.

mod alias;
mod attribute;
mod averaged;
mod axis;
mod by_component;
mod by_frames;
mod close;
mod coarse;
mod conclusion;
mod converged;
mod evidence;
mod extend;
mod facts;
mod fisher;
mod fitted;
mod holdout;
mod layout;
mod left_out;
mod linearity;
mod load_rivals;
mod noise_choices;
mod noise_words;
mod patched;
pub mod patches;
mod priors;
mod quoted;
mod recording;
mod refused;
mod round;
mod sought;
mod stiffness;
mod subsets;
mod suspect;
mod together;
mod traced;
mod tracing;
mod vetoes;
mod weighing;

pub use attribute::attribute;
pub use averaged::{BlindSpot, Interval};
pub use close::{Closed, Explained, LoopStage, ToQuote, close, closed_forms, explain, finished};
pub use conclusion::{Conclusion, Confirming, texts};
pub use evidence::LARGEST_MULTIPLE;
pub use extend::extended;
pub use facts::Status;
pub use fisher::{Hidden, Information, field_information};
pub use linearity::NOT_LINEAR;
pub use patches::{LocalPatch, Patches};
pub use quoted::{
    AnswerDraws, Importance, Proposals, Quoted, Supposing, quote, rule as quoted_rule, with_density,
};
pub use round::Round;
pub use sought::{acting_in, candidates};
pub use subsets::SIZES;
pub use suspect::{ConditionalAnswer, Suspect, UNEXPLAINED};
pub use together::{field_alone, tension};
pub use tracing::{
    Accepted, Finding, HeldOutStep, Named, Resembling, StepMaps, StepResidual, StiffnessAt,
    StiffnessField, TracedSteps, Tracing,
};
