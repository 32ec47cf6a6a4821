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

pub use basis::PlateEdge;
pub use expansion::Expansion;
pub use plate::{PlateParameter, TransverseShear, VibratingPlate, Weight};
pub use ritz::{Ritz, Settings, VibrationMode};
pub use spec::{EdgeSpec, FrequenciesSpec, Nuisance, Parity, PlateSpec, SupportSpec};
pub use theory::{EdgeLayers, PlateSupports, Theory};
