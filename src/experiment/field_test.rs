//! What makes a field experiment.

use serde::Serialize;

use super::gauge::Gauge;
use super::subset::Imaging;
use crate::field::Frame;
use crate::geometry::Density;
use crate::laminate::{LoadSpec, SpecimenSpec};

/// Everything that determines what a field experiment predicts.
#[derive(Debug, Clone, Serialize)]
pub struct FieldTest {
    pub specimen: SpecimenSpec,
    pub load: LoadSpec,
    /// The data's frame.
    pub frame: Frame,
    /// How the rigid motion of predictions is fixed.
    pub gauge: Gauge,
    /// Frequency of the fringes a mm of displacement, where displacements are read from fringes.
    pub fringe_frequency_per_mm: Option<f64>,
    /// How images are correlated, where they are.
    pub images: Option<Imaging>,
    /// Bounding box of the measured points, (s, t) mm, low and high corner.
    pub window: [[f64; 2]; 2],
    /// Mesh density.
    pub density: Density,
    /// Solve for every prediction: no reduced basis, no table of what yields, no corrections of a solution nearby.
    pub full_order: bool,
}
