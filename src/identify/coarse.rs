//! The test on a coarse mesh: for columns of what may act unseen and, at few points of every block, for what is only a difference between
//! two solutions or a slope of a slope.
//!
//! Measured: with columns of the default test from all points the closed form moves by less than 0.001 sd. Of a series they are taken from
//! the fine mesh. With slopes that follow the constants from few points the means of the constants move by 0.001 sd and less.

use std::sync::Arc;

use super::forward::over_blocks;
use super::prepared::Prepared;
use crate::error::Result;
use crate::experiment::{FieldSolver, PointSet};
use crate::field::Blocks;
use crate::field::blocks::one_a_tile;
use crate::infer::{Model, coarse_experiment};
use crate::linearise::{AtPlaces, AtPoints, Forward, Measured, Observing, Slopes};
use crate::posterior::CoarseForwards;

/// A test that is solved on a coarse mesh.
pub struct CoarseTest {
    experiment: Arc<dyn FieldSolver>,
    /// All points, as the fine mesh has them.
    all: PointSet,
    /// Of one field a few points in every block, of a series the blocks' middles.
    few: PointSet,
    /// The blocks with the few points alone, of one field.
    thinned: Option<Blocks>,
}

/// Along a side of a block, points that stand for the others: at the middle alone log weights of a field are off by 0.07.
const ALONG: f64 = 2.0;

impl CoarseTest {
    /// Of a test, unless its mesh is another program's or it has none.
    ///
    /// # Errors
    /// A specimen that cannot be meshed.
    pub fn new(model: &Model, prepared: &Prepared, measured: &Measured) -> Result<Option<Self>> {
        let Some(experiment) = coarse_experiment(model, &*prepared.problem.experiment)? else {
            return Ok(None);
        };
        let (sight, blocks) = (&prepared.observation.sight, &measured.blocks);
        let (points, further) = sight.all().split_at(sight.points().len());
        let all = experiment.extended(points, further);
        let (few, thinned) = match prepared.observation.steps {
            Some(_) => (experiment.extended(&blocks.centroid, &[]), None),
            None => match few_points(points, blocks) {
                Some((few, thinned)) => (experiment.extended(&few, &[]), Some(thinned)),
                None => (all.clone(), None),
            },
        };
        Ok(Some(Self {
            experiment,
            all,
            few,
            thinned,
        }))
    }

    /// The forward models of what was measured.
    pub fn forwards<'a>(
        &'a self,
        model: &'a Model,
        prepared: &'a Prepared,
        measured: &'a Measured,
    ) -> CoarseForwards<'a> {
        CoarseForwards {
            everywhere: self.everywhere(model, prepared, measured),
            at_few_points: self.at_few_points(model, prepared, measured),
        }
    }

    /// That at all points.
    pub fn everywhere<'a>(
        &'a self,
        model: &'a Model,
        prepared: &'a Prepared,
        measured: &'a Measured,
    ) -> Forward<'a> {
        let test = (&*self.experiment, &self.all);
        silent(model, over_blocks(test, prepared, measured))
    }

    /// The same at few points.
    pub fn at_few_points<'a>(
        &'a self,
        model: &'a Model,
        prepared: &'a Prepared,
        measured: &'a Measured,
    ) -> Forward<'a> {
        let (experiment, sight, blocks) = (&*self.experiment, &self.few, &measured.blocks);
        let observing: Box<dyn Observing> = match &prepared.observation.steps {
            Some(steps) => Box::new(AtPlaces {
                experiment,
                sight,
                steps,
                places: &blocks.centroid,
                counts: &blocks.count,
                blocks: None,
            }),
            None => Box::new(AtPoints {
                experiment,
                slopes: Slopes::Everywhere(sight, self.thinned.as_ref().unwrap_or(blocks)),
                size_mm: measured.size_mm,
            }),
        };
        silent(model, observing)
    }
}

fn silent<'a>(model: &'a Model, observing: Box<dyn Observing + 'a>) -> Forward<'a> {
    Forward {
        model,
        observing,
        solves_width: false,
        step: &|| (),
    }
}

/// A few points of every block, and the blocks with those alone; none where a block would have none.
fn few_points(points: &[[f64; 2]], blocks: &Blocks) -> Option<(Vec<[f64; 2]>, Blocks)> {
    let kept = one_a_tile(points, blocks.size_mm / ALONG);
    let kept: Vec<usize> = (0..points.len())
        .filter(|&i| kept[i] && blocks.of_point[i].is_some())
        .collect();
    let few = blocks.thinned(kept.iter().map(|&i| blocks.of_point[i]).collect())?;
    Some((kept.into_iter().map(|i| points[i]).collect(), few))
}
