//! The forward model of a test linearised about a point: what every parameter does to what each step shows.
//!
//! A field is a series of one step. How displacements are observed, at all points of a field or at the places of averages over them in
//! every step, is [`Observing`]'s; columns, ridge and places that nobody knows are the same for both.

mod at_places;
mod at_points;
mod column;
mod exported;
mod forward;
mod insoluble;
mod linearisation;
mod measured;
mod observing;
mod ridge;
mod sensitivities;
mod slopes;
mod sought;
mod unknown_places;

pub use at_places::AtPlaces;
pub use at_points::AtPoints;
pub use column::{Column, StepStack, divide};
pub use forward::{CandidateColumns, Forward};
pub use insoluble::{Insoluble, insoluble, without_insoluble};
pub use measured::{Loading, Measured, relative};
pub use observing::Observing;
pub use ridge::{CONVERGED, STEPS};
pub use sensitivities::{Candidate, Sensitivities};
pub use slopes::Slopes;
pub use sought::{acting_in, candidates, is_of_a_rotation, lift_of, shares};
pub use unknown_places::{AXIS_MM, PIVOT_MM};
