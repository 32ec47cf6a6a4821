//! The measured field: readers, frame, outliers, block averages.
//!
//! Inside this crate a field is points (s, t) and displacements (u1, u2) in mm, direction 1 along the load, origin
//! at the hole's centre. [`spec::MeasurementSpec::read`] makes one from files.

mod agreement;
pub mod blocks;
pub(crate) mod cells;
mod coincident;
mod common;
pub mod conventions;
pub mod correlation;
pub mod deviant;
mod forces;
pub mod frame;
pub mod fringes;
mod grid;
mod heading;
pub mod level;
pub(crate) mod local;
pub mod mask;
mod matlab;
pub mod matrices;
pub mod measured;
pub mod outliers;
pub mod places;
pub mod programs;
mod reader;
pub mod rigid;
mod row;
mod rows;
pub mod series;
mod sheet;
pub mod spec;
mod stated;
pub mod step;
pub mod table;
mod text;

pub use blocks::Blocks;
pub use correlation::{ImageCorrelation, PartialSubsets, SubsetShape};
pub use frame::{Axis, DATA_AXES, Frame};
pub use grid::Grid;
pub use mask::{MaskShape, MaskedCircle};
pub use measured::{Field, Reason, Rejected, bounds};
pub use reader::{ColumnMap, Columns, LEAST_CORRELATION, PIXEL, Reader, Units, unreadable};
pub use series::{Series, Step};
pub use spec::{MeasurementSpec, READERS, Source};
pub use step::StepSpec;
pub use text::of_settings;
