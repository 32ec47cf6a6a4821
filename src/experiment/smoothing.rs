//! What subsets of another size than the declared one add to displacements.

use std::sync::OnceLock;

use super::sight::PointSet;
use super::subset::Subsets;
use crate::fem::{Locator, Observer};
use crate::geometry::Mesh;

/// The declared subsets on the nominal mesh, seen by a plain camera: what another shape or picture does to so small a difference is of second
/// order.
pub(super) struct Smoothing<'a> {
    pub subsets: Subsets,
    pub mesh: &'a Mesh,
    /// What averages over subsets about the nodes read, and what the nodes themselves do, once it was asked for.
    pub of_nodes: &'a OnceLock<[Observer; 2]>,
}

impl Smoothing<'_> {
    /// What the subsets S do to a nodal field u (mm), at a sight's points (mm): (S - 1) u. Where the points stand for themselves, subsets will
    /// average over what is added there: then (1 - 1/S) u, to second order in S - 1.
    pub fn added(&self, nodal: &[f64], (sight, observer): (&PointSet, &Observer)) -> Vec<[f64; 2]> {
        if sight.is_correlated() {
            let both = sight.smoothed(|| self.averages_and_middles(sight.all()));
            return averages_less_middles(both, nodal);
        }
        // threads that ask at once each locate the nodes: one that waited could hold up the other's parallel loops
        let both = match self.of_nodes.get() {
            Some(both) => both,
            None => {
                let both = self.averages_and_middles(&self.mesh.nodes);
                self.of_nodes.get_or_init(|| both)
            }
        };
        let once = averages_less_middles(both, nodal).concat();
        let twice = averages_less_middles(both, &once).concat();
        let left: Vec<f64> = once.iter().zip(&twice).map(|(a, b)| a - b).collect();
        observer.displacement(&left)
    }

    /// What averages over subsets about places read, and what the places themselves do.
    fn averages_and_middles(&self, places: &[[f64; 2]]) -> [Observer; 2] {
        let locator = Locator::new(self.mesh);
        let averages = self.subsets.observe(places, &locator);
        [averages, locator.observe_extended(places)]
    }
}

/// By how much averages differ from the values in their middles.
fn averages_less_middles([averages, middles]: &[Observer; 2], nodal: &[f64]) -> Vec<[f64; 2]> {
    let averages = averages.displacement(nodal).into_iter();
    let pairs = averages.zip(middles.displacement(nodal));
    pairs.map(|(a, m)| [a[0] - m[0], a[1] - m[1]]).collect()
}
