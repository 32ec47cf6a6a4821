//! Plane-stress finite elements of the whole plate: Q8 element, assembly, sparse Cholesky, observation.

mod anchor;
mod anderson;
mod assemble;
mod basis;
mod beyond;
mod columns;
pub mod element;
mod greedy;
mod initial_stress;
mod lekhnitskii;
mod load;
mod observe;
mod plastic;
mod plastic_table;
mod plasticity;
mod plate;
mod ply_law;
mod profile;
mod setup;
mod solve;
mod span;
pub mod verify;
mod yielding;

pub use anchor::Anchor;
pub use basis::{Answer, Basis, Query, TOLERANCE};
pub use lekhnitskii::{HoleSolution, stress_concentration};
pub use load::EndLoad;
pub use observe::{Locator, Nodal, Observer};
pub use plastic::{EdgeStress, YieldFrame};
pub use plastic_table::{Metal, PlasticTable};
pub use plasticity::{J2, Plastic, von_mises};
pub use plate::{Plate, Solution};
pub use profile::{Annulus, Profile};
pub use setup::{Setup, Yield};
pub use solve::Factor;
pub use span::Certificate;
