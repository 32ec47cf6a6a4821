//! Natural frequencies and the assignment of measured peaks.

#[path = "frequencies/hole.rs"]
mod hole;
#[path = "frequencies/inertia.rs"]
mod inertia;
#[path = "frequencies/limits.rs"]
mod limits;
#[path = "frequencies/peaks.rs"]
mod peaks;
#[path = "frequencies/plates.rs"]
mod plates;
#[path = "frequencies/simulated.rs"]
mod simulated;
#[path = "frequencies/support.rs"]
mod support;
#[path = "frequencies/weigh.rs"]
mod weigh;
