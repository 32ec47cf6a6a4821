//! Every test of the crate, in one binary: known answers, convergence rates, invariants, samplers, the command line.

mod chain_files;
mod cli;
mod diagnostics;
mod dictionary;
mod fem;
mod field;
mod formats;
mod identify;
mod jumps;
mod kernel;
mod laminate;
mod layering;
mod measure;
mod mechanics;
mod memory;
mod optics;
mod phase;
mod program;
mod reduce;
mod resume;
mod samplers;
mod starts;
mod targets;
mod tracing;
mod validation;
