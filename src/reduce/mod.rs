//! The reduced model: Latin hypercube, snapshots, POD, response surfaces.

pub mod cache;
mod design;
mod gauge;
mod model;
mod pod;
mod problem;
mod rigid;
mod snapshots;
mod surface;
mod variables;

pub use design::{Dimension, latin_hypercube};
pub use gauge::{Gauge, ZeroAt, remove_rigid_motion};
pub use model::ReducedModel;
pub use pod::{Pod, decompose};
pub use problem::{Problem, ReducedSpec, THICKNESS};
pub use rigid::{RigidMotion, fit as fit_rigid_motion};
pub use snapshots::Snapshots;
pub use surface::{Quality, Surface, exponents, monomial};
pub use variables::{Choice, Variables};
