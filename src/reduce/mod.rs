//! The reduced model: Latin hypercube, snapshots, POD, response surfaces.

mod design;
mod model;
mod modes;
pub mod pod;
mod problem;
mod snapshot_experiment;
mod snapshots;
pub mod supplied;
mod surface;
mod variables;

pub use design::{Dimension, THICKNESS, exponents, latin_hypercube, monomial};
pub use model::ReducedModel;
pub use modes::Modes;
pub use pod::{Pod, decompose};
pub use problem::{Problem, ReducedSpec, SnapshotsSpec};
pub use snapshot_experiment::SnapshotExperiment;
pub use snapshots::{Snapshots, design, rows_to_solve, spread_over};
pub use supplied::{SuppliedSpec, doe_text, is_solved_for, ranges};
pub use surface::{Quality, Surface};
pub use variables::{Choice, Variables};
