//! Whether a series is proportional to its load: which columns are linear, which are motion, and what departs from it.

use nalgebra::DMatrix;

use super::evidence::Evidence;
use crate::effect::Scope;
use crate::experiment::series::Law;
use crate::field::bounds;
use crate::field::step::CLASS_1_SD_PERCENT;
use crate::linearise::Column;
use crate::noise::series::{Linearity, Role};

/// Below this probability a response is said not to be proportional to the load.
pub const NOT_LINEAR: f64 = 1e-3;

/// Motion of a step of its own, plausible sizes: as good as free.
const FREE: f64 = 10.0;

/// Smooth patterns: products of cosines over the window of so many half waves together.
const HALF_WAVES: usize = 3;

/// Test a series of at least four steps.
pub(super) fn linearity(evidence: &Evidence) -> Option<Linearity> {
    let series = evidence.weighing.noise.by_frames()?;
    let all = &evidence.sensitivities;
    let errors = all.base.iter().filter(|c| c.is_force_error());
    let force_percent = errors.map(|c| c.sd).reduce(f64::max);
    let force_percent = force_percent.unwrap_or(CLASS_1_SD_PERCENT);
    let role = |column: &Column, law| match column.is_load() {
        true => Role::InEach(force_percent / column.sd),
        false => role(column, law),
    };
    let base = all.base.iter().map(|c| role(c, None));
    let sought = all.candidates.iter();
    let sought = sought.flat_map(|k| {
        // what an error of the load adds that is not declared is what the test looks for
        let of_load = k.effect.scope() == Scope::Force;
        let of = move |c| if of_load { Role::None } else { role(c, k.law) };
        k.columns.iter().map(of)
    });
    let near_edge = all.near_edge.iter().map(|_| Role::Pattern);
    let roles: Vec<Role> = base.chain(sought).chain(near_edge).collect();
    let smooth = smooth(&evidence.measured.blocks.centroid);
    series.in_frames.linearity(&roles, &smooth)
}

/// Smooth fields over places.
fn smooth(places: &[[f64; 2]]) -> DMatrix<f64> {
    let [low, high] = bounds(places);
    let waves = (0..=HALF_WAVES).flat_map(|i| (0..=HALF_WAVES - i).map(move |j| [i, j]));
    let waves: Vec<[usize; 2]> = waves.filter(|w| w[0] + w[1] > 0).collect();
    DMatrix::from_fn(places.len(), waves.len(), |b, k| {
        let along = |axis: usize| {
            let at = (places[b][axis] - low[axis]) / (high[axis] - low[axis]);
            (std::f64::consts::PI * waves[k][axis] as f64 * at).cos()
        };
        along(0) * along(1)
    })
}

/// How a column takes part, of a candidate with its law.
fn role(column: &Column, law: Option<Law>) -> Role {
    if column.is_force_error() {
        // that of the load stands for all
        return Role::None;
    }
    let Some(effect) = column.effect() else {
        return Role::Together;
    };
    match effect.scope() {
        // one law stands for all: what it does in each frame, with an amplitude of its own there
        Scope::Motion if law.is_some_and(|law| law != Law::Constant) => Role::None,
        Scope::Motion => Role::InEach(FREE),
        Scope::Mechanical if !effect.scales() => Role::None,
        _ => Role::Together,
    }
}
