//! Meshes of other programs: what is read is what was written, and what cannot be used is refused with what to do.

mod abaqus;
mod as_found;
mod broken;
mod broken_abaqus;
mod exact;
mod gmsh;
mod init;
mod introduction;
mod mangled;
mod model;
mod nastran;
mod plate;
mod raised;
mod region_models;
pub mod regions;
mod round_trips;
mod sizes;
pub mod writers;
