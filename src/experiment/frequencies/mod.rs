//! Natural frequencies of a rectangular laminate by Rayleigh and Ritz, and the assignment of measured peaks to its modes.

mod air;
mod assembly;
pub mod assignment;
mod basis;
mod dense;
pub mod disturbance;
pub mod estimate;
mod expansion;
mod lattice;
mod perforated;
mod plate;
mod reduced;
mod ritz;
mod simulate;
mod spec;
mod theory;
pub mod weigh;

pub use basis::Edge;
pub use expansion::Expansion;
pub use plate::{
    Coefficients, HZ_LAMBDA, INERTIAS, PARAMETERS, Parameter, Plate, STIFFNESSES, TransverseShear,
    Weight,
};
pub use ritz::{Mode, Ritz, Settings};
pub use spec::{
    AddedMassSpec, EdgeSpec, FrequenciesSpec, Nuisance, Parity, PlateSpec, SupportSpec,
};
pub use theory::{EdgeLayers, Supports, Theory};
