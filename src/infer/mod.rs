//! Prior, likelihood and posterior, and the model file that declares them.

mod acts;
mod column;
mod design_box;
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
mod simulated;
mod sizes;
mod statistics;
mod stepped;
mod steps;
mod supplied;
mod tabulated;
mod tension;
mod traced;
mod unknown_axis;
mod version1;

pub use acts::{Acts, Amplitude};
pub use column::{Column, divide};
pub use joint::{Joint, Member};
pub use known::Known;
pub use likelihood::Likelihood;
pub use model::Model;
pub use observation::{Columns, Observation, RecordedAmplitude, SteppedColumn};
pub use posterior::{NOISE, Posterior, REASON_SDS};
pub use prior::{Marginal, PriorSpec};
pub use schema::{
    ExperimentEntry, LikelihoodSpec, MaterialSpec, ModelFile, ModelOutline, ParameterSpec, SCHEMA,
};
pub use statistics::{Statistics, Whitened};
pub use stepped::{AXIS_MM, Here, LENS, PIVOT_MM, Stack, Stepped, WEAK};
pub use steps::Steps;
pub use tabulated::{Tabulated, TabulatedMoments, TestPoint};
pub use tension::{Moments, Tension};
pub use traced::TracedSeries;
