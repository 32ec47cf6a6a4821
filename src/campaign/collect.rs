//! One table of all runs of a campaign: constants side by side, verdicts, and specimens unlike the others.

mod collected;
pub mod outlying;
mod row;
mod write;

pub use collected::Collected;
pub use outlying::{MOST_Z, robust_z};
pub use row::Found;
pub use write::{priors_section, write};
