//! Without finite elements: samplers, chains, diagnostics, readers, noise, effects in closed form, and the order of the sources.

#[path = "../common/mod.rs"]
mod common;

mod campaign;
mod chain_files;
mod diagnostics;
mod effect;
mod field;
mod formats;
mod hard_targets;
mod identify;
mod independent;
mod jumps;
mod kernel;
mod laminate;
mod lanes;
mod layering;
#[cfg(target_os = "linux")]
mod measures;
mod memory;
mod mesh_files;
mod model;
mod patches;
mod phase;
mod population;
mod posterior;
mod posteriordb;
mod reduce;
mod rivals;
mod sample;
mod samplers;
mod section;
mod series_noise;
mod starts;
mod stored;
mod targets;
mod trace;
mod validate;
