//! What the residual of an identification says: sensitivities, evidence of effects, averaged posterior, conclusion.

mod account;
mod alias;
mod attribute;
mod averaged;
mod axis;
mod close;
mod columns;
mod conclusion;
mod evidence;
mod extend;
mod fisher;
mod fitted;
mod holdout;
mod insoluble;
mod layout;
mod left_out;
mod linearity;
mod quoted;
mod recording;
mod refused;
mod ridge;
mod round;
mod sensitivities;
mod series;
mod sought;
mod stiffness;
mod subsets;
mod suspect;
mod together;
mod tracing;
mod vetoes;
mod weighing;

pub use attribute::attribute;
pub use averaged::{BlindSpot, Interval};
pub use close::{Closed, Explained, LoopStage, ToQuote, close, closed_forms, explain, finished};
pub use conclusion::{Conclusion, Confirming, Status, texts};
pub use evidence::LARGEST_MULTIPLE;
pub use extend::extended;
pub use fisher::{Hidden, Information, field_information};
pub use linearity::NOT_LINEAR;
pub use quoted::{
    AnswerDraws, Importance, Quoted, Supposing, quote, rule as quoted_rule, with_density,
};
pub use round::Round;
pub use sought::{acting_in, candidates};
pub use subsets::SIZES;
pub use suspect::{Answer, Suspect, UNEXPLAINED};
pub use together::{field_alone, tension};
pub use tracing::{
    Found, Named, Predicted, Resembling, StepMaps, StepResidual, StiffnessAt, StiffnessField,
    Tracing,
};
