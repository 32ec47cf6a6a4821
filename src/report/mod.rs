//! What a run leaves behind: numbers gathered once, tables and figures made of them, and the page that shows them.

pub mod calibration;
mod cells;
mod figures;
mod gather;
mod html;
pub mod numbers;
mod page;
pub mod ranking;
mod sheet;
pub mod tables;
pub mod terminal;
pub mod traced;
pub mod validation;
mod widening;

pub use cells::Cells;
pub use figures::{Figure, Palette};
pub use html::comparison;
pub use page::{FIGURES, Page};
pub use sheet::Sheet;
pub use widening::Alone;
