//! Where a field is looked at.

use std::sync::OnceLock;

use crate::fem::Observer;

/// Reported points, and further ones that only the gauge counts: places of outliers, which were measured all the same.
#[derive(Clone)]
pub struct PointSet {
    /// Points, then further ones, (s, t) mm.
    all: Vec<[f64; 2]>,
    seen: usize,
    /// Where all of them lie on the nominal specimen's mesh, if that is known.
    observer: Option<Observer>,
    /// What averages over subsets about them read on that mesh, and what the points themselves do, once it was asked for.
    smoothed: OnceLock<[Observer; 2]>,
    /// Whether a point stands for the subset about it, where images are correlated.
    correlated: bool,
}

impl PointSet {
    /// Points whose place on a mesh is not known beforehand.
    pub fn anywhere(points: &[[f64; 2]], further: &[[f64; 2]]) -> Self {
        Self {
            all: [points, further].concat(),
            seen: points.len(),
            observer: None,
            smoothed: OnceLock::new(),
            correlated: false,
        }
    }

    /// The same points with their places on the nominal mesh, in the order of [`PointSet::all`].
    pub(super) fn with_observer(mut self, observer: Observer) -> Self {
        self.observer = Some(observer);
        self
    }

    /// The same points, of which each stands for the subset about it.
    #[must_use]
    pub(super) fn correlated(self) -> Self {
        Self {
            correlated: true,
            ..self
        }
    }

    /// Whether a point stands for the subset about it.
    pub(super) fn is_correlated(&self) -> bool {
        self.correlated
    }

    /// Places on the nominal mesh.
    pub(super) fn observer(&self) -> Option<&Observer> {
        self.observer.as_ref()
    }

    /// Averages over subsets and their middles on the nominal mesh, located when they are first asked for. Threads that ask at once each
    /// locate them: one that waited could hold up the other's parallel loops.
    pub(super) fn smoothed(&self, locate: impl FnOnce() -> [Observer; 2]) -> &[Observer; 2] {
        if let Some(smoothed) = self.smoothed.get() {
            return smoothed;
        }
        let located = locate();
        self.smoothed.get_or_init(|| located)
    }

    /// The points that are looked at, mm.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.all[..self.seen]
    }

    /// Those points, then the further ones, mm.
    pub fn all(&self) -> &[[f64; 2]] {
        &self.all
    }

    /// Count the points for which `keep(index)` does not hold as further ones from now on.
    pub fn set_aside(&mut self, keep: impl Fn(usize) -> bool) {
        let (kept, gone): (Vec<usize>, Vec<usize>) = (0..self.seen).partition(|&i| keep(i));
        self.seen = kept.len();
        if gone.is_empty() {
            return;
        }
        let order: Vec<usize> = kept
            .into_iter()
            .chain(self.seen + gone.len()..self.all.len())
            .chain(gone)
            .collect();
        self.all = order.iter().map(|&i| self.all[i]).collect();
        self.smoothed = OnceLock::new();
        if let Some(observer) = &mut self.observer {
            observer.reorder(&order);
        }
    }
}
