//! A test about a point: its linear columns as they follow the constants, and the surface of its mean.

use rayon::prelude::*;

use serde::{Deserialize, Serialize};

use super::ratios::Ratios;
use super::surface::{BlockSnapshots, MeanSurface};
use crate::error::{Error, Result};
use crate::experiment::series::SeriesState;
use crate::infer::EffectUnderLaw;
use crate::linearise::{CandidateColumns, Forward, Sensitivities, StepStack};
use crate::reduce::latin_hypercube;

/// The test linearised about a point and, for every coordinate of the constants, about the point with that raised; with all
/// effects there too. Their fields are small, but an amplitude of what can be told from none of the load's scale (the sensitivity of both
/// components) is as good as one of the load, and follows the constants as the load does.
#[derive(Serialize, Deserialize)]
pub struct TestExpansion {
    pub here: Sensitivities,
    /// The same on the mesh of the raised ones, of which only differences to it are taken.
    pub about: Sensitivities,
    pub raised: Vec<Sensitivities>,
    /// How far, in each coordinate.
    pub by: Vec<f64>,
    pub surface: MeanSurface,
}

/// The point about which a test is expanded, and how far.
pub struct About<'a> {
    pub state: &'a SeriesState,
    pub declared: &'a [EffectUnderLaw],
    pub sought: &'a [EffectUnderLaw],
    /// The test linearised there on the fine mesh, where that is known.
    pub here: Option<Sensitivities>,
    /// Steps of the constants beside which slopes are taken, border units.
    pub steps: Vec<f64>,
    /// Half-widths of the surface's box, border units.
    pub reach: Vec<f64>,
    /// Norms of some errors of the block averages by the noise.
    pub norms: &'a (dyn Fn(&[StepStack]) -> Result<Vec<f64>> + Sync),
}

/// A test on a coarse mesh.
pub struct CoarseForwards<'a> {
    pub everywhere: Forward<'a>,
    pub at_few_points: Forward<'a>,
}

impl TestExpansion {
    /// Expand on the `fine` mesh, with candidates' columns from a `coarse` one where there is one, and beside the point on that at few points.
    ///
    /// # Errors
    /// Those of finite-element solutions.
    pub fn new(
        at: &About<'_>,
        fine: &Forward<'_>,
        coarse: Option<&CoarseForwards<'_>>,
    ) -> Result<Self> {
        let ratios = Ratios::about(&at.state.shared.constants);
        let by = ratios.steps(&at.steps);
        let few = coarse.map(|c| &c.at_few_points);
        let beside = few.unwrap_or(fine);
        let of_field = coarse.filter(|_| !fine.observing.of_each_step());
        let columns = of_field.map_or(CandidateColumns::Here, |c| {
            CandidateColumns::On(&c.everywhere)
        });
        let linearised = |(forward, coordinate): (&Forward<'_>, Option<usize>)| {
            let mut coordinates = vec![0.0; by.len()];
            if let Some(j) = coordinate {
                coordinates[j] = by[j];
            }
            let columns = match std::ptr::eq(forward, fine) {
                true => columns,
                false => CandidateColumns::Here,
            };
            let state = moved(at.state, &ratios, &coordinates);
            forward.sensitivities_with(&state, at.declared, at.sought, columns)
        };
        let about = few.map(|forward| (forward, None));
        let raised = (0..by.len()).map(|j| (beside, Some(j)));
        let unknown = at.here.is_none().then_some((fine, None));
        let points: Vec<(&Forward<'_>, Option<usize>)> =
            unknown.into_iter().chain(about).chain(raised).collect();
        let all: Result<Vec<Sensitivities>> = points.into_par_iter().map(linearised).collect();
        let mut all = all?.into_iter();
        let mut next = || {
            let found = all.next();
            found.ok_or_else(|| Error::program("posterior", "a linearisation"))
        };
        let here = match &at.here {
            Some(here) => here.clone(),
            None => next()?,
        };
        let about = match few {
            Some(_) => next()?,
            None => here.clone(),
        };
        // where a reduced basis answers, the fine mesh is the cheaper one
        let spanned = fine.observing.experiment().coordinates(&at.state.shared);
        let solved = if spanned.is_some() { fine } else { beside };
        Ok(Self {
            surface: surface(at, solved, &ratios)?,
            here,
            about,
            raised: all.collect(),
            by,
        })
    }

    /// How fast the mean changes along coordinate `j` at the point, mm, as a mesh has it on which the test is linearised.
    pub fn slope(&self, on: &Sensitivities, j: usize) -> StepStack {
        let mut slope = [0, 1].map(|c| &on.predicted[c] * 0.0);
        let along = self.surface.ratios.slope(j);
        for (column, by) in on.base[..on.constants].iter().zip(along) {
            for (sum, values) in slope.iter_mut().zip(&column.values) {
                sum.axpy(by / column.sd, values, 1.0);
            }
        }
        slope
    }
}

/// A state with its constants elsewhere.
fn moved(state: &SeriesState, ratios: &Ratios, coordinates: &[f64]) -> SeriesState {
    let mut state = state.clone();
    state.shared.constants = ratios.constants(coordinates);
    state
}

/// Degrees that are tried, one after the other, and snapshots for each number of a surface.
const DEGREES: [usize; 4] = [3, 5, 6, 7];
const SNAPSHOTS: f64 = 1.7;

/// A surface is good enough where it is so many noise norms off (half its square, in nats, is what a candidate could feed on).
const GOOD: f64 = 0.3;

/// Points at which that is looked at, and the share of the box in which they lie.
const CHECKED: usize = 20;
const WITHIN: f64 = 0.5;

/// Seeds of the designs.
const DESIGN: u64 = 1;
const CHECK: u64 = 2;

/// The surface of the lowest degree that is good enough, or else the highest.
fn surface(at: &About<'_>, forward: &Forward<'_>, ratios: &Ratios) -> Result<MeanSurface> {
    let constants = &at.state.shared.constants;
    if constants.is_empty() {
        return Ok(MeanSurface::flat(ratios.clone()));
    }
    let origin = forward.shown(at.state)?;
    let snapshots = |count: usize, within: f64, seed: u64| -> Result<BlockSnapshots> {
        let coordinates = design(at, ratios, (count, within, seed));
        let one = |x: &Vec<f64>| {
            let mut shown = forward.shown(&moved(at.state, ratios, x))?;
            for (u, here) in shown.iter_mut().zip(&origin) {
                *u -= here;
            }
            Ok(shown)
        };
        let fields: Result<Vec<StepStack>> = coordinates.par_iter().map(one).collect();
        Ok(BlockSnapshots {
            fields: fields?,
            coordinates,
        })
    };
    let check = snapshots(CHECKED, WITHIN, CHECK)?;
    let mut found = None;
    for degree in DEGREES {
        let count = SNAPSHOTS * MeanSurface::regressors(constants.len(), degree) as f64;
        let own = snapshots(count.ceil() as usize, 1.0, DESIGN)?;
        let surface = MeanSurface::fit(ratios.clone(), degree, &own)?;
        let off = check.coordinates.iter().zip(&check.fields);
        let off: Vec<StepStack> = off.map(|(x, u)| surface.off(x, u)).collect();
        let largest = (at.norms)(&off)?.into_iter().fold(0.0, f64::max);
        found = Some(surface);
        if largest <= GOOD {
            break;
        }
    }
    found.ok_or_else(|| Error::program("posterior", "a surface"))
}

/// Coordinates of a Latin hypercube of constants in a share of the box; none that no material can have.
fn design(
    at: &About<'_>,
    ratios: &Ratios,
    (count, within, seed): (usize, f64, u64),
) -> Vec<Vec<f64>> {
    let constants = &at.state.shared.constants;
    let reach = ratios.steps(&at.reach);
    let place = |u: Vec<f64>| -> Vec<f64> {
        let each = u.iter().zip(constants.iter().zip(&reach));
        let point = each.enumerate().map(|(k, (u, (about, reach)))| {
            let by = within * (2.0 * u - 1.0) * reach;
            match ratios.is_modulus(k) {
                true => about * by.exp(),
                false => about + by,
            }
        });
        ratios.of(&admissible(point.collect()))
    };
    let all = latin_hypercube(count, constants.len(), seed);
    all.into_iter().map(place).collect()
}

/// Some constants with Poisson's ratio drawn in to what a material can have.
fn admissible(mut constants: Vec<f64>) -> Vec<f64> {
    /// Share of the largest possible one.
    const INSIDE: f64 = 0.93;
    let (nu, most) = match constants[..] {
        [e1, e2, _, _] => (2, INSIDE * (e1 / e2).sqrt()),
        _ => (1, INSIDE),
    };
    if let Some(nu) = constants.get_mut(nu) {
        *nu = nu.clamp(-most, most);
    }
    constants
}
