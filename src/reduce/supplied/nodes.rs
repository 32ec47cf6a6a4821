//! What every format of a field holds.

/// Points (x, y) and displacements (ux, uy), mm.
pub(super) struct Nodes {
    pub points: Vec<[f64; 2]>,
    pub displacement: Vec<[f64; 2]>,
}
