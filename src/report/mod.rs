//! What a run leaves behind: one typed [`Report`], gathered once, and what is made of it: JSON, the terminal's summary, figures
//! and the page that shows them.

// Fields are published keys: their names say what they hold, in which unit, and have a comment where that is not enough.
#![allow(missing_docs)]

pub mod calibration;
pub mod chains;
pub mod design;
pub mod document;
mod figures;
pub mod fringes;
pub mod gather;
mod html;
pub mod json;
pub mod learned;
pub mod manifest;
mod numbers;
mod page;
mod publish;
mod quoted;
pub mod residual;
pub mod round;
pub mod run;
pub mod sources;
pub mod steps;
pub mod study;
pub mod tables;
pub mod together;
pub mod told;
pub mod traced;
pub mod tracing;
pub mod validation;
pub mod verdict;
mod words;

pub use document::Report;
pub use figures::{Palette, mesh_figure};
pub use html::html;
pub use numbers::{FieldCells, mesh_lines, on_mesh};
pub use page::Page;
pub use quoted::QuotedReport;
pub use words::SILENT_HELD_PERCENT;
