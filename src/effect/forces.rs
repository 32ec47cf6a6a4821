//! What the declared forces of a series must be for an error of theirs to be seen.

use super::Scene;

/// Forces over the nominal one that differ by less are the same.
const SAME: f64 = 1e-3;

/// Why no error of a force can be told from a common factor of all moduli; nothing if it can.
pub(super) fn unless_compared(scene: &Scene) -> Option<&'static str> {
    (scene.declared_loads.len() < 2)
        .then_some("one load has no other to be compared with: a factor of it is one of all moduli")
}

/// Whether a declared force is one.
pub(super) fn is_loaded(load: &Option<f64>) -> bool {
    load.is_some_and(|f| f != 0.0)
}

/// The obstacle of an effect that goes over different forces in its own way.
pub(super) fn unless_different(scene: &Scene) -> Option<&'static str> {
    let mut loads = scene
        .declared_loads
        .iter()
        .filter(|f| is_loaded(f))
        .flatten();
    let first = loads.next();
    let differs = first.is_some_and(|first| loads.any(|f| (f - first).abs() > SAME));
    unless_compared(scene).or((!differs).then_some("no two different forces are declared"))
}

/// For every step whether a larger force has acted before it.
pub(super) fn returned(loads: &[f64]) -> Vec<bool> {
    let mut largest = 0.0_f64;
    let one = |f: &f64| {
        let returned = f.abs() < largest - SAME;
        largest = largest.max(f.abs());
        returned
    };
    loads.iter().map(one).collect()
}
