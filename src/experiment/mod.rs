//! What was done with a specimen and how it was observed.

mod gauge;
mod spec;

pub use gauge::{
    Gauge, ZeroAt, check as check_gauge, remove_rigid_motion, remove_rigid_motion_of_nodes,
    remove_rigid_motion_over, settle,
};
pub use spec::{ExperimentKind, ExperimentSpec, check_name};
