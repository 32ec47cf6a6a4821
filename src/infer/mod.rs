//! Prior, likelihood and posterior, and the model file that declares them.

mod design_box;
mod effect_under_law;
mod joint;
mod kernel;
mod known;
mod likelihood;
mod model;
mod monomials;
mod observation;
mod posterior;
mod prior;
mod schema;
mod series;
mod shipped;
mod simulated;
mod sizes;
mod statistics;
mod steps;
mod supplied;
mod tabulated;
mod tension;
mod traced;
mod version1;

pub use effect_under_law::{Amplitude, EffectUnderLaw};
pub use joint::{Joint, Member};
pub use known::Known;
pub use likelihood::Likelihood;
pub use model::Model;
pub use observation::{Observation, RecordedAmplitude, SteppedColumn, UnitColumns};
pub use posterior::{Posterior, REASON_SDS};
pub use prior::{Marginal, PriorSpec};
pub use schema::{
    ExperimentEntry, LikelihoodSpec, MaterialSpec, ModelFile, ModelOutline, ParameterSpec, RunNote,
    SCHEMA,
};
pub use shipped::{OPENHOLE, STEEL, unchanged};
pub use sizes::FREE_MM;
pub use statistics::{Statistics, Whitened};
pub use steps::Steps;
pub use tabulated::{Tabulated, TabulatedMoments, TestPoint};
pub use tension::{Moments, Tension};
pub use traced::TracedSeries;
