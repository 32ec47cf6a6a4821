//! Ply, laminate, specimen: from elastic constants to the plate's membrane stiffness.

mod expansion;
mod ply;
mod slope;
mod specimen;
mod stack;

pub use expansion::free_expansion;
pub use ply::{Ply, rotate_stiffness, strain_rotation};
pub use slope::{Constant, stiffness_slope};
pub use specimen::{ClampSpec, End, HoleSpec, LoadSpec, Material, MeanSd, SpecimenSpec};
pub use stack::{Membrane, PlateStiffness, abd, stacked, transverse};
