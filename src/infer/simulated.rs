//! Simulated measurements of a model.

use super::model::Model;
use crate::error::Result;
use crate::experiment::simulate::series::{SeriesTruth, SimulatedSeries, simulate_series};
use crate::experiment::simulate::{FINER, HALF_WINDOW, Truth, simulate};
use crate::experiment::{FieldSolver, Subsets};
use crate::field::{Grid, PartialSubsets, SubsetShape};
use std::sync::Arc;

impl Model {
    /// Simulate a measurement of this model on a finer mesh, over a square about the hole that is nearly as wide as the plate.
    ///
    /// # Errors
    /// Those of [`simulate`]; a model of a load series.
    pub fn simulate(&self, truth: &Truth) -> Result<Grid> {
        self.refuse_series()?;
        let (experiment, half) = self.simulating()?;
        simulate(&*experiment, truth, half)
    }

    /// The same of a load series, whose loads are over [`crate::experiment::ExperimentSpec::nominal_load`].
    ///
    /// # Errors
    /// Those of [`simulate_series`].
    pub fn simulate_series(&self, truth: &SeriesTruth) -> Result<SimulatedSeries> {
        let (experiment, half) = self.simulating()?;
        simulate_series(&*experiment, truth, half)
    }

    /// The experiment on a finer mesh, and half the side of the window.
    fn simulating(&self) -> Result<(Arc<dyn FieldSolver>, f64)> {
        let spec = self.experiment();
        let [s, t] = spec.geometry().extents().map(|[low, high]| high - low);
        let narrow = if spec.mesh.is_some() { s.min(t) } else { t };
        let half = HALF_WINDOW * narrow;
        let experiment = self.experiment_over([[-half; 2], [half; 2]], FINER)?;
        Ok((experiment, half))
    }

    /// The subsets of the image correlation, where there is one.
    pub fn subsets(&self) -> Option<Subsets> {
        let images = self.experiment().measurement.image_correlation?;
        Some(Subsets {
            side_mm: images.effective_subset_mm.unwrap_or(images.subset_mm),
            declared_mm: images.subset_mm,
            shape: images.shape.unwrap_or(SubsetShape::Affine),
            kept: images.partial_subsets == PartialSubsets::Kept,
        })
    }
}
