//! Where the slopes of a field are looked at.

use nalgebra::DVector;

use super::column::StepStack;
use crate::error::Result;
use crate::experiment::State;
use crate::experiment::{FieldSolver, PointSet, Prediction, predict};
use crate::field::Blocks;
use crate::field::blocks::one_a_tile;

/// Points over which slopes are averaged: all, or of blocks of hundreds of points some that stand for the others. A slope within a block
/// is a plane but for a thousandth; the prediction itself, which is held against the data, is averaged over all points.
pub enum Slopes<'a> {
    Everywhere(&'a PointSet, &'a Blocks),
    /// At the points that stand for all of the others.
    Thinned(Box<(PointSet, Blocks)>, &'a PointSet, &'a Blocks),
    /// At single points in place of averages.
    Points(&'a PointSet),
}

/// Along a side of a block, points that stand for the others.
const ALONG: f64 = 8.0;

impl<'a> Slopes<'a> {
    /// Over blocks of a sight's points.
    pub fn new(experiment: &dyn FieldSolver, sight: &'a PointSet, blocks: &'a Blocks) -> Self {
        thinned(experiment, sight, blocks).map_or(Self::Everywhere(sight, blocks), |few| {
            Self::Thinned(few.into(), sight, blocks)
        })
    }

    pub(super) fn sight(&self) -> &PointSet {
        match self {
            Self::Everywhere(sight, _) | Self::Points(sight) => sight,
            Self::Thinned(few, ..) => &few.0,
        }
    }

    pub(super) fn average(&self, field: &[[f64; 2]]) -> StepStack {
        match self {
            Self::Everywhere(_, blocks) => averages(blocks, field),
            Self::Thinned(few, ..) => averages(&few.1, field),
            Self::Points(_) => {
                [0, 1].map(|c| DVector::from_iterator(field.len(), field.iter().map(|u| u[c])))
            }
        }
    }

    /// The prediction, which is `here` at the points of slopes.
    pub(super) fn predicted(
        &self,
        experiment: &dyn FieldSolver,
        at: &State,
        here: &Prediction,
    ) -> Result<StepStack> {
        match self {
            Self::Thinned(_, sight, blocks) => {
                Ok(averages(blocks, &predict(experiment, at, sight)?.field))
            }
            _ => Ok(self.average(&here.field)),
        }
    }
}

/// Points that stand for all others of large blocks.
fn thinned(
    experiment: &dyn FieldSolver,
    sight: &PointSet,
    blocks: &Blocks,
) -> Option<(PointSet, Blocks)> {
    if blocks.mean_count() < 2.0 * ALONG * ALONG {
        return None;
    }
    let points = sight.points();
    let kept = one_a_tile(points, blocks.size_mm / ALONG);
    let kept: Vec<usize> = (0..points.len())
        .filter(|&i| kept[i] && blocks.of_point[i].is_some())
        .collect();
    let places: Vec<[f64; 2]> = kept.iter().map(|&i| points[i]).collect();
    let (sight, inside) = experiment.locate(&places, &[]);
    let of_point: Vec<Option<u32>> = kept.iter().map(|&i| blocks.of_point[i]).collect();
    let few = blocks.thinned(of_point)?;
    inside.iter().all(|i| *i).then_some((sight, few))
}

/// Block averages of both components of a field.
pub(super) fn averages(blocks: &Blocks, field: &[[f64; 2]]) -> StepStack {
    [0, 1].map(|c| {
        let values: Vec<f64> = field.iter().map(|u| u[c]).collect();
        blocks.average(&values)
    })
}
