//! Prior, likelihood and posterior, and the model file that declares them.

mod density;
mod kernel;
pub(crate) mod lanes;
mod laplace;
mod likelihood;
mod linear;
mod model;
mod monomials;
mod noise;
mod observation;
mod posterior;
mod prior;
pub mod simulate;
mod statistics;
mod tabulated;

pub use density::LogDensity;
pub use laplace::{Laplace, laplace};
pub use likelihood::Likelihood;
pub use model::{LikelihoodSpec, Model, ModelFile, ParameterSpec, SCHEMA};
pub use noise::{Noise, component};
pub use observation::{Columns, Observation};
pub use posterior::{NOISE, Posterior};
pub use prior::{Marginal, PriorSpec};
pub use statistics::{Statistics, Whitened};
pub use tabulated::{Moments, Tabulated, TestPoint};
