//! A move is a pure proposal: a point and the log factor of its Metropolis-Hastings ratio. Whether the point is
//! accepted is decided once, in the ensemble.

use super::stream::Stream;

/// The complementary half of an ensemble, which a move may look at (the walker's own half it may not).
#[derive(Debug, Clone, Copy)]
pub struct Others<'a> {
    points: &'a [f64],
    dim: usize,
}

impl<'a> Others<'a> {
    /// Row-major `points` of `dim` parameters each.
    pub fn new(points: &'a [f64], dim: usize) -> Self {
        Self { points, dim }
    }

    /// Number of walkers.
    pub fn count(&self) -> usize {
        self.points.len() / self.dim
    }

    /// Number of parameters.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// One walker.
    pub fn point(&self, walker: usize) -> &'a [f64] {
        &self.points[walker * self.dim..(walker + 1) * self.dim]
    }

    /// All walkers, row by row.
    pub fn points(&self) -> &'a [f64] {
        self.points
    }

    /// `N` different walkers, in random order (there must be that many).
    pub fn pick<const N: usize>(&self, rng: &mut Stream) -> [usize; N] {
        let mut picked = [0; N];
        for k in 0..N {
            // A uniform choice among those left, by stepping over the picked ones in increasing order.
            let mut candidate = rng.index(self.count() - k);
            let mut taken = picked;
            if k > 1 {
                taken[..k].sort_unstable();
            }
            for &other in &taken[..k] {
                candidate += usize::from(candidate >= other);
            }
            picked[k] = candidate;
        }
        picked
    }
}

/// What a move learns from the complementary half before it proposes for the other: a location and a shape.
#[derive(Debug, Clone, Default)]
pub struct Fit {
    /// Location, length dim.
    pub mean: Vec<f64>,
    /// Lower Cholesky factor of the shape matrix, dim x dim, row-major.
    pub lower: Vec<f64>,
    /// Degrees of freedom of a Student-t; infinite for a Gaussian.
    pub dof: f64,
    /// Scratch, length dim.
    pub work: Vec<f64>,
}

impl Fit {
    /// Room for `dim` parameters.
    pub fn new(dim: usize) -> Self {
        Self {
            mean: vec![0.0; dim],
            lower: vec![0.0; dim * dim],
            dof: f64::INFINITY,
            work: vec![0.0; dim],
        }
    }
}

/// A proposal of the ensemble sampler that leaves the target invariant under the accept/reject of Metropolis-Hastings.
pub trait Move: Send + Sync {
    /// Canonical name (`stretch`).
    fn name(&self) -> &'static str;

    /// Fewest walkers of the complementary half it needs in `dim` dimensions.
    fn fewest(&self, dim: usize) -> usize;

    /// Learns from the complementary half once for all walkers of the other; false if it cannot, and then nobody
    /// moves. It may look at nothing else, or detailed balance is lost.
    fn fit(&self, _others: Others<'_>, _fit: &mut Fit) -> bool {
        true
    }

    /// Proposes `y` from `x` and returns the log factor, log q(y -> x) - log q(x -> y) with the Jacobian.
    fn propose(
        &self,
        x: &[f64],
        others: Others<'_>,
        fit: &mut Fit,
        rng: &mut Stream,
        y: &mut [f64],
    ) -> f64;

    /// Proposes for every walker of a half (`own`, `y`: walker by walker); `factor` takes the log factors. As a method of
    /// the move, its loop is compiled for it.
    fn propose_all(
        &self,
        own: &[f64],
        others: Others<'_>,
        fit: &mut Fit,
        streams: &mut [Stream],
        y: &mut [f64],
        factor: &mut [f64],
    ) {
        let dim = others.dim();
        let proposals = own.chunks_exact(dim).zip(y.chunks_exact_mut(dim));
        for (((x, y), rng), factor) in proposals.zip(streams).zip(factor) {
            *factor = self.propose(x, others, fit, rng, y);
        }
    }
}
