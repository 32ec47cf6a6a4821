//! Prior, likelihood and posterior, and the model file that declares them.

mod density;
mod forms;
pub mod forward;
mod horner;
mod kernel;
pub(crate) mod lanes;
mod laplace;
mod likelihood;
mod model;
mod monomials;
mod nested;
mod observation;
mod posterior;
mod prior;
mod recorded;
pub mod simulate;
mod statistics;
mod sums;
mod tabulated;
mod validate;

pub use density::LogDensity;
pub use laplace::{Laplace, laplace};
pub use likelihood::Likelihood;
pub use model::{LikelihoodSpec, Model, ModelFile, ParameterSpec, SCHEMA};
pub use observation::{Columns, Observation};
pub use posterior::{NOISE, Posterior};
pub use prior::{Marginal, PriorSpec};
pub use recorded::{RecordedAmplitude, Tiles, recorded_columns, smooth_field};
pub use statistics::{Statistics, Whitened};
pub use tabulated::{Moments, Tabulated, TestPoint};
