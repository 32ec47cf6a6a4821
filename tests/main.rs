//! Every test of the crate, in one binary: known answers, convergence rates, invariants, samplers, the command line.

mod browser;
mod chain_files;
mod cli;
mod diagnostics;
mod dictionary;
mod experiment;
mod fem;
mod field;
mod formats;
mod fuzz;
mod geometry;
mod identify;
mod joint;
mod jumps;
mod kernel;
mod laminate;
mod layering;
mod marginal;
mod mechanics;
#[cfg(target_os = "linux")]
mod memory;
mod model;
mod newcomer;
mod optics;
mod patterns;
mod phase;
mod program;
mod reduce;
mod report;
mod resume;
mod samplers;
mod schema;
mod starts;
mod targets;
mod tracing;
mod validation;
