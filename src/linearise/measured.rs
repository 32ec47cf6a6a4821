//! What was measured, as block averages.

use super::at_places::AtPlaces;
use super::column::StepStack;
use super::sensitivities::Sensitivities;
use super::slopes::averages;
use crate::experiment::{FieldSolver, PointSet};
use crate::field::{Blocks, Field};
use crate::infer::Steps;
use crate::noise::series::Frames;

/// The measured field as block averages; of a series those of all steps, one step after the other.
pub struct Measured {
    pub blocks: Blocks,
    /// Averages of (u1, u2), mm.
    pub averages: StepStack,
    /// Root mean square of the displacements of a field, mm; of a series that of what grows with the load.
    pub size_mm: f64,
    /// Of a series whose frames measure the noise.
    pub loading: Option<Loading>,
}

/// How the frames of a series were taken.
pub struct Loading {
    /// Force in each frame over the largest.
    pub relative: Vec<f64>,
    /// Side of the correlation subset, mm, where it is declared.
    pub subset_mm: Option<f64>,
}

impl Measured {
    /// Of the points of a field that are `used`; of a series all its steps. Blocks are 0.6 to 1 mm wide, at least half full (prototype study):
    /// small beside the fields of effects, large enough for a covariance of a thousand values.
    pub fn new(
        field: &Field,
        experiment: &dyn FieldSolver,
        (sight, steps): (&PointSet, Option<&Steps>),
        used: impl Fn(usize) -> bool,
    ) -> Self {
        let blocks = Blocks::new(field, Blocks::size_for(field), used);
        let square: f64 = field.displacement.iter().flatten().map(|u| u * u).sum();
        let over_places = |steps| AtPlaces::over_blocks(experiment, sight, steps, &blocks);
        Self {
            averages: match steps {
                Some(steps) => over_places(steps).measured(),
                None => averages(&blocks, &field.displacement),
            },
            size_mm: (square / field.len().max(1) as f64).sqrt(),
            loading: steps.map(|steps| Loading {
                relative: relative(&steps.loads),
                subset_mm: field.subset_mm,
            }),
            blocks,
        }
    }

    /// The frames, of a series whose frames measure the noise.
    pub fn frames(&self) -> Option<Frames<'_>> {
        self.loading.as_ref().map(|loading| Frames {
            blocks: &self.blocks,
            loads: loading.relative.clone(),
            subset_mm: loading.subset_mm,
        })
    }

    /// Measured minus predicted at the prior means of all parameters: block averages of (u1, u2), mm.
    pub fn residual(&self, sensitivities: &Sensitivities) -> StepStack {
        [0, 1].map(|c| &self.averages[c] - &sensitivities.predicted[c])
    }
}

/// Forces over the largest.
pub fn relative(loads: &[f64]) -> Vec<f64> {
    let largest = loads.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    loads.iter().map(|f| f / largest).collect()
}
