//! Every test of the crate, in one binary: known answers, convergence rates, invariants, samplers, the command line.

mod chain_files;
mod diagnostics;
mod field;
mod formats;
mod kernel;
mod measure;
mod resume;
mod samplers;
mod starts;
mod targets;
