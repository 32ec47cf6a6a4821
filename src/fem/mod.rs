//! Plane-stress finite elements of the whole plate: Q8 element, assembly, sparse Cholesky, observation.

mod anchor;
mod assemble;
mod basis;
mod beyond;
pub mod element;
mod initial_stress;
mod lekhnitskii;
mod load;
mod observe;
mod plate;
mod ply_law;
mod profile;
mod setup;
mod solve;
pub mod verify;

pub use anchor::Anchor;
pub use basis::{Answer, Basis, Query, TOLERANCE};
pub use lekhnitskii::{HoleSolution, stress_concentration};
pub use load::EndLoad;
pub use observe::{Locator, Nodal, Observer};
pub use plate::{Certificate, Plate, Solution};
pub use profile::{Annulus, Profile};
pub use setup::Setup;
pub use solve::Factor;
