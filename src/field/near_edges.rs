//! How near to the specimen's edges the points of blocks lie.

/// Over these distances, in subsets, the error of subsets near an edge falls by e (prototype study).
pub const DECAYS: [f64; 2] = [0.5, 1.0];

/// Weights of the error near edges, block by block.
#[derive(Debug, Clone)]
pub struct NearEdges {
    /// Side of a subset, mm.
    pub subset_mm: f64,
    /// For each of [`DECAYS`] the mean over every block's points of exp((1/2 - d) / decay), d their distance from an edge in subsets.
    pub weight: [Vec<f64>; 2],
}
