//! Prior, likelihood and posterior, and the model file that declares them.

mod acts;
mod column;
mod density;
mod joint;
mod kernel;
pub(crate) mod lanes;
mod laplace;
mod likelihood;
mod model;
mod monomials;
mod observation;
mod posterior;
mod prior;
mod schema;
mod series;
mod statistics;
mod stepped;
mod steps;
mod tabulated;
mod version1;

pub use acts::{Acts, Amplitude};
pub use column::Column;
pub use density::LogDensity;
pub use joint::{Joint, Member};
pub use laplace::{Laplace, laplace};
pub use likelihood::Likelihood;
pub use model::Model;
pub use observation::{Columns, Observation, RecordedAmplitude, SteppedColumn};
pub use posterior::{NOISE, Posterior, REASON_SDS};
pub use prior::{Marginal, PriorSpec};
pub use schema::{LikelihoodSpec, MaterialSpec, ModelFile, ParameterSpec, SCHEMA};
pub use series::TracedSeries;
pub use statistics::{Statistics, Whitened};
pub use stepped::{Here, LENS, Stack, Stepped, WEAK};
pub use steps::Steps;
pub use tabulated::{Tabulated, TabulatedMoments, TestPoint};
