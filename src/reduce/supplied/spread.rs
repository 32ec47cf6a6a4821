//! From scattered points to others: through the values at the nearest ones by radial basis functions.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// Weights of values at other points.
pub type Weights = Vec<(u32, f64)>;

/// Points that one value is made of: three times the ten coefficients of a cubic.
const NEIGHBOURS: usize = 30;

/// Points nearer than this are one, mm.
const SAME_MM: f64 = 1e-6;

/// The weights that make a value at each of the points `wanted` of values at the points `known`: the value itself where they coincide, and
/// else the interpolation by r^5 that reproduces cubics (Flyer et al., J. Comput. Phys. 321, 2016).
///
/// # Errors
/// The first of the points `wanted` that the others do not reach, with its distance to them.
pub fn weights(
    known: &[[f64; 2]],
    wanted: &[[f64; 2]],
) -> std::result::Result<Vec<Weights>, ([f64; 2], f64)> {
    let entries = known.iter().zip(0..);
    let tree = RTree::bulk_load(entries.map(|(&p, k)| GeomWithData::new(p, k)).collect());
    let all = wanted.par_iter();
    all.map(|&p| at(&tree, p).ok_or_else(|| (p, gap(&tree, p))))
        .collect()
}

type Tree = RTree<GeomWithData<[f64; 2], u32>>;

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn gap(tree: &Tree, p: [f64; 2]) -> f64 {
    let nearest = tree.nearest_neighbor(p);
    nearest.map_or(f64::INFINITY, |node| distance(*node.geom(), p))
}

/// The weights at a point; none where the nearest of the others is farther than they are from each other.
fn at(tree: &Tree, p: [f64; 2]) -> Option<Weights> {
    /// Distances of the nearest point's fourth neighbour.
    const FARTHEST: f64 = 3.0;
    let near: Vec<([f64; 2], u32)> = tree
        .nearest_neighbor_iter(p)
        .take(NEIGHBOURS)
        .map(|node| (*node.geom(), node.data))
        .collect();
    let (nearest, node) = *near.first()?;
    if distance(nearest, p) <= SAME_MM {
        return Some(vec![(node, 1.0)]);
    }
    let fourth = tree.nearest_neighbor_iter(nearest).nth(4)?;
    if distance(nearest, p) > FARTHEST * distance(*fourth.geom(), nearest) {
        return None;
    }
    // about the point, in units of the farthest
    let scale = near.last().map_or(1.0, |(q, _)| distance(*q, p));
    let local: Vec<[f64; 2]> = near
        .iter()
        .map(|(q, _)| [0, 1].map(|k| (q[k] - p[k]) / scale))
        .collect();
    let (n, terms) = (local.len(), 10);
    let radial = |a: [f64; 2], b: [f64; 2]| distance(a, b).powi(5);
    let mut matrix = DMatrix::zeros(n + terms, n + terms);
    let mut right = DVector::zeros(n + terms);
    for (i, a) in local.iter().enumerate() {
        for (j, b) in local.iter().enumerate() {
            matrix[(i, j)] = radial(*a, *b);
        }
        for (k, term) in cubic(*a).into_iter().enumerate() {
            matrix[(i, n + k)] = term;
            matrix[(n + k, i)] = term;
        }
        right[i] = radial(*a, [0.0; 2]);
    }
    right[n] = 1.0;
    let solved = matrix.lu().solve(&right)?;
    let weights = near.iter().zip(solved.iter());
    let weights: Weights = weights.map(|((_, node), w)| (*node, *w)).collect();
    weights
        .iter()
        .all(|(_, w)| w.is_finite())
        .then_some(weights)
}

/// All monomials to degree 3.
fn cubic([x, y]: [f64; 2]) -> [f64; 10] {
    let (xx, xy, yy) = (x * x, x * y, y * y);
    [1.0, x, y, xx, xy, yy, xx * x, xx * y, x * yy, yy * y]
}
