//! A move is a pure proposal: points and the log factors of their Metropolis-Hastings ratios, for a whole half of an
//! ensemble. Whether a point is accepted is decided once, in the ensemble.

use super::numbers::{Needs, Numbers};

/// One half of an ensemble, parameter by parameter, so that loops over walkers are loops over neighbours.
#[derive(Debug, Clone, Copy)]
pub struct Walkers<'a> {
    values: &'a [f64],
    count: usize,
}

impl<'a> Walkers<'a> {
    /// `values` of `count` walkers: parameter k of walker w is `values[k * count + w]`.
    pub fn new(values: &'a [f64], count: usize) -> Self {
        Self { values, count }
    }

    /// Number of walkers.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of parameters.
    pub fn dim(&self) -> usize {
        self.values.len() / self.count
    }

    /// One parameter of all walkers.
    pub fn column(&self, parameter: usize) -> &'a [f64] {
        &self.values[parameter * self.count..(parameter + 1) * self.count]
    }

    /// All parameters, column by column.
    pub fn columns(&self) -> impl Iterator<Item = &'a [f64]> {
        self.values.chunks_exact(self.count)
    }
}

/// What a move learns from the complementary half before it proposes for the other: a location and a shape.
#[derive(Debug)]
pub struct Fit {
    /// Location, length dim.
    pub mean: Vec<f64>,
    /// Lower Cholesky factor of the shape matrix, dim x dim, row-major.
    pub lower: Vec<f64>,
    /// Degrees of freedom of a Student-t; 0 for a Gaussian.
    pub dof: usize,
}

impl Fit {
    /// Room for `dim` parameters.
    pub fn new(dim: usize) -> Self {
        Self {
            mean: vec![0.0; dim],
            lower: vec![0.0; dim * dim],
            dof: 0,
        }
    }
}

/// A proposal of the ensemble sampler that leaves the target invariant under the accept/reject of Metropolis-Hastings.
pub trait Move: Send + Sync {
    /// Canonical name (`stretch`).
    fn name(&self) -> &'static str;

    /// Fewest walkers of the complementary half it needs in `dim` dimensions.
    fn fewest(&self, dim: usize) -> usize;

    /// Random numbers that a proposal takes in `dim` dimensions with `others` walkers in the complementary half.
    fn needs(&self, dim: usize, others: usize) -> Needs;

    /// Learns from the complementary half once for all walkers of the other; false if it cannot, and then nobody
    /// moves. It may look at nothing else, or detailed balance is lost.
    fn fit(&self, _others: Walkers<'_>, _fit: &mut Fit) -> bool {
        true
    }

    /// Proposes a point for every walker of a half.
    fn propose(&self, proposal: Proposal<'_>);
}

/// What a proposal is made from, and where it goes.
pub struct Proposal<'a> {
    /// The walkers that may move.
    pub own: Walkers<'a>,
    /// The complementary half.
    pub others: Walkers<'a>,
    pub fit: &'a Fit,
    /// Random numbers, as many as [`Move::needs`] says.
    pub numbers: &'a Numbers,
    /// The proposed points, laid out as `own`.
    pub y: &'a mut [f64],
    /// Their log factors, log q(y -> x) - log q(x -> y) with the Jacobian.
    pub factor: &'a mut [f64],
}
