//! The material, not the coupon: mean and scatter of the constants over specimens, by MCMC from the specimens' chains (hierarchical model by
//! importance weights: Hogg, Myers & Bovy 2010, ApJ 725, 2166), the specimens given all others, and A- and B-basis values.

mod copies;
mod density;
mod gather;
mod report;
mod sampled;
pub mod specimen;
mod unlike;
mod write;

pub use copies::copied;
pub use gather::gather;
pub use report::{Estimate, OfConstant, PopulationReport};
pub use sampled::{LEAST, Sampled, sample};
pub use specimen::Specimen;
pub use unlike::unlike;
pub use write::write;
