//! Fringe images to displacements (the article's section 2.1, Eq. 1 to 3): calibration of the frames, phase difference of the two states,
//! unwrapping, mask and standard deviations. Nothing is smoothed.

mod calibrate;
mod clear;
mod component;
mod copies;
mod images;
mod measure;
mod noise;
mod parameters;
mod phase;
pub mod picture;
mod reader;
mod render;
mod residuals;
mod response;
mod shifts;
mod spec;
mod unwrap;
mod warnings;

pub use calibrate::Calibration;
pub use component::{Counts, DisplacementMap};
pub use measure::Fringes;
pub use phase::Pixel;
pub use reader::FringeFile;
pub use render::{RenderPlan, write};
pub use spec::{COMPONENTS, Images, PhaseSteps, STATES};
