//! Every test of the crate, in one binary: known answers, convergence rates, invariants, samplers, the command line.

mod fem;
mod laminate;
