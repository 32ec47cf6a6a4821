//! Whether a series is proportional to its load: which columns are linear, which are motion, and what departs from it.

use nalgebra::DMatrix;

use super::evidence::Evidence;
use crate::effect::{EFFECTS, Scope};
use crate::experiment::series::Law;
use crate::field::bounds;
use crate::linearise::Column;
use crate::noise::series::{Linearity, Role};

/// Below this probability a response is said not to be proportional to the load.
pub const NOT_LINEAR: f64 = 1e-3;

/// Sd of the error of a force, percent: a machine of class 1.
const FORCE_PERCENT: f64 = 0.5;

/// Motion of a step of its own, plausible sizes: as good as free.
const FREE: f64 = 10.0;

/// Smooth patterns: products of cosines over the window of so many half waves together.
const HALF_WAVES: usize = 3;

/// Test a series of at least four steps.
pub(super) fn linearity(evidence: &Evidence) -> Option<Linearity> {
    let series = evidence.weighing.noise.by_frames()?;
    let all = &evidence.sensitivities;
    let base = all.base.iter().map(|c| role(c, None));
    let sought = all.candidates.iter();
    let sought = sought.flat_map(|k| k.columns.iter().map(|c| role(c, k.law)));
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
    let name = column.name.split('.').next().unwrap_or_default();
    if column.is_load() {
        return Role::InEach(FORCE_PERCENT / column.sd);
    }
    let Some(effect) = EFFECTS.iter().find(|e| e.name() == name) else {
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
