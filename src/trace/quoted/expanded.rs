//! The slopes of what was traced as they change with the constants.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::files::stored;
use crate::linearise::{CandidateColumns, Forward, Sensitivities};
use crate::trace::traced::LinearisationPoint;

/// The test linearised about a point and, for every constant, about the point with that constant raised by some prior sds; with all
/// effects there too. Their fields are small, but an amplitude of what can be told from none of the load's scale (the sensitivity of both
/// components) is as good as one of the load, and follows the constants as the load does.
pub struct TestExpansion {
    pub here: Sensitivities,
    /// The same on the mesh of the raised ones, of which only differences to it are taken.
    pub about: Sensitivities,
    pub raised: Vec<Sensitivities>,
    /// How far, prior sds.
    pub by: Vec<f64>,
}

stored!(TestExpansion {
    here,
    about,
    raised,
    by
});

/// A test on a coarse mesh.
pub struct CoarseForwards<'a> {
    pub everywhere: Forward<'a>,
    pub at_few_points: Forward<'a>,
}

impl TestExpansion {
    /// Linearise about the traced point on the `fine` mesh, with candidates' columns from a `coarse` one where there is one, and beside it on
    /// that at few points; `by` has a step for each constant, prior sds.
    ///
    /// # Errors
    /// Those of finite-element solutions.
    pub fn new(
        point: &LinearisationPoint,
        fine: &Forward<'_>,
        coarse: Option<&CoarseForwards<'_>>,
        by: Vec<f64>,
    ) -> Result<Self> {
        let few = coarse.map(|c| &c.at_few_points);
        let beside = few.unwrap_or(fine);
        let of_field = coarse.filter(|_| !fine.observing.of_each_step());
        let columns = of_field.map_or(CandidateColumns::Here, |c| {
            CandidateColumns::On(&c.everywhere)
        });
        let linearised = |(forward, constant): (&Forward<'_>, Option<usize>)| {
            let mut state = point.state.clone();
            if let Some(k) = constant {
                state.shared.constants[k] += by[k] * forward.model.marginals()[k].sd;
            }
            let columns = match std::ptr::eq(forward, fine) {
                true => columns,
                false => CandidateColumns::Here,
            };
            forward.sensitivities_with(&state, &point.declared, &point.sought, columns)
        };
        let about = few.map(|forward| (forward, None));
        let raised = (0..by.len()).map(|k| (beside, Some(k)));
        let points: Vec<(&Forward<'_>, Option<usize>)> = [(fine, None)]
            .into_iter()
            .chain(about)
            .chain(raised)
            .collect();
        let all: Result<Vec<Sensitivities>> = points.into_par_iter().map(linearised).collect();
        let mut all = all?.into_iter();
        let mut next = || {
            let found = all.next();
            found.ok_or_else(|| Error::program("trace::quoted", "a linearisation"))
        };
        let here = next()?;
        let about = match few {
            Some(_) => next()?,
            None => here.clone(),
        };
        Ok(Self {
            here,
            about,
            raised: all.collect(),
            by,
        })
    }
}
