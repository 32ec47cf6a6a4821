//! Finite elements of the whole plate: Q8 element in plane stress, its assembly, sparse Cholesky and observation; plate bending.

mod anchor;
mod anderson;
mod assemble;
mod basis;
mod bending;
mod beyond;
mod columns;
mod edge;
pub mod element;
mod greedy;
mod initial_stress;
mod introduction;
mod inverse;
mod load;
mod observe;
mod plastic;
mod plastic_table;
mod plasticity;
mod plate;
pub mod plate_element;
mod ply_law;
mod probes;
mod profile;
mod setup;
mod solve;
mod span;
mod supports;
pub mod verify;
mod vibration;
mod view;
mod yielding;

pub use anchor::{Anchor, Bump};
pub use basis::{Answer, Query, SpanBasis, TOLERANCE};
pub use bending::{
    BendingFactor, BendingPattern, Bent, EndMoment, bend, plain_deflection, plain_rotation,
};
pub use load::{EndLoad, edge_forces, end_forces, load_parts};
pub use observe::{Locator, Nodal, Observer};
pub use plastic::{EdgeStress, YieldFrame};
pub use plastic_table::{Metal, PlasticTable};
pub use plasticity::{J2, Plastic, von_mises};
pub use plate::{Plate, Solution};
pub use profile::{Annulus, Profile};
pub use setup::{Region, Setup, Yield};
pub use solve::Factor;
pub use span::{Certificate, span};
pub use supports::Supports;
pub use vibration::{NaturalModes, Vibrating};
pub use view::{Motion, View};
