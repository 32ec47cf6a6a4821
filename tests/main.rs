//! Every test of the crate, in one binary: known answers, convergence rates, invariants, samplers, the command line.

<<<<<<< HEAD
mod chain_files;
mod diagnostics;
mod measure;
mod samplers;
mod starts;
mod targets;
=======
mod field;
>>>>>>> field
