//! Prior, likelihood and posterior, and the model file that declares them.

mod design_box;
mod effect_under_law;
mod experiment;
mod joint;
mod known;
mod model;
mod observation;
mod prior;
mod schema;
mod series;
mod shipped;
mod simulated;
mod steps;
mod supplied;
mod tension;

pub use design_box::{drawn_in, may_have_side};
pub use effect_under_law::{Amplitude, EffectUnderLaw};
pub use experiment::{
    coarse_experiment, experiment_over, moved_experiment_over, problem_of, problem_within,
};
pub use joint::{GivenLinear, Joint, Member};
pub use known::ConstantsLikelihood;
pub use model::{FREE_MM, Model};
pub use observation::{Observation, RecordedAmplitude};
pub use prior::{Marginal, PriorSpec};
pub use schema::{
    ExperimentEntry, LikelihoodSpec, MaterialSpec, ModelFile, ModelOutline, RunNote, SCHEMA,
};
pub use shipped::{OPENHOLE, STEEL, unchanged};
pub use simulated::{simulated_field, simulated_series};
pub use steps::{Steps, with_the_load};
pub use supplied::box_to_solve;
pub use tension::{ExperimentFactor, Moments, Tension};
