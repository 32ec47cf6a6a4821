//! Local quadratic fits: every point predicted from its nearest neighbours, without a model of the field.

use std::sync::Arc;

use nalgebra::{Cholesky, Const, SMatrix, SVector};
use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::numeric::median;

/// Neighbours of a fit: three to four times the six coefficients of a quadratic.
pub(crate) const NEIGHBOURS: usize = 20;

type LocalCoefficients = SVector<f64, 6>;
type Plane = SVector<f64, 3>;
type LocalFactor = Cholesky<f64, Const<6>>;

/// Displacements with an index of their points.
pub(crate) struct LocalFit<'a> {
    points: &'a [[f64; 2]],
    displacement: &'a [[f64; 2]],
    tree: Arc<RTree<GeomWithData<[f64; 2], u32>>>,
    /// Points that are nobody's neighbours: outliers already found.
    pub excluded: Vec<bool>,
}

/// Neighbours of a point in coordinates about it, scaled by the distance of the farthest.
pub(crate) struct ScaledNeighbours {
    /// Indices of the neighbours, nearest first.
    pub index: Vec<usize>,
    basis: Vec<LocalCoefficients>,
}

/// A robust local fit as it looks from its centre.
pub(crate) struct RobustFit {
    /// Measured minus predicted at the centre.
    pub residual: f64,
    /// Measured minus predicted at each neighbour.
    pub neighbours: Vec<f64>,
    /// sqrt(1 + h): sd of the centre's residual over the sd of one point.
    pub widening: f64,
    /// Size of the quadratic terms at the farthest neighbour: what the fit's next order may be a fraction of.
    pub curvature: f64,
}

impl<'a> LocalFit<'a> {
    pub fn new(points: &'a [[f64; 2]], displacement: &'a [[f64; 2]]) -> Self {
        // 2^32 points would not fit into memory as text
        let entries = points
            .iter()
            .enumerate()
            .map(|(i, p)| GeomWithData::new(*p, i as u32))
            .collect();
        Self {
            points,
            displacement,
            tree: Arc::new(RTree::bulk_load(entries)),
            excluded: vec![false; points.len()],
        }
    }

    /// The same points with other displacements, and no outliers yet.
    pub fn of(&self, displacement: &'a [[f64; 2]]) -> Self {
        Self {
            points: self.points,
            displacement,
            tree: Arc::clone(&self.tree),
            excluded: vec![false; self.points.len()],
        }
    }

    /// The nearest other points of point `i`.
    pub fn neighbourhood(&self, i: usize) -> ScaledNeighbours {
        let center = self.points[i];
        let index: Vec<usize> = self
            .tree
            .nearest_neighbor_iter(center)
            .map(|entry| entry.data as usize)
            .filter(|&j| j != i && !self.excluded[j])
            .take(NEIGHBOURS)
            .collect();
        let offset = |j: usize| [self.points[j][0] - center[0], self.points[j][1] - center[1]];
        let reach = index
            .iter()
            .map(|&j| offset(j))
            .map(|[a, b]| a.hypot(b))
            .fold(0.0, f64::max);
        let scale = if reach > 0.0 { 1.0 / reach } else { 0.0 };
        let basis = index
            .iter()
            .map(|&j| offset(j).map(|d| d * scale))
            .map(|[a, b]| LocalCoefficients::from([1.0, a, b, a * a, a * b, b * b]))
            .collect();
        ScaledNeighbours { index, basis }
    }

    /// Neighbours and weights of the least-squares prediction of point `i`; none where the neighbours do not
    /// determine it.
    pub fn weights(&self, i: usize) -> Vec<(usize, f64)> {
        let near = self.neighbourhood(i);
        let Some(factor) = factorize(&near.basis, &vec![1.0; near.basis.len()]) else {
            return Vec::new();
        };
        // the prediction at the centre is the constant coefficient: weights phi' G^-1 e0
        let solved = factor.solve(&LocalCoefficients::from([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let weights = near.basis.iter().map(|phi| phi.dot(&solved));
        near.index.iter().copied().zip(weights).collect()
    }

    /// Least-squares residuals (u1, u2) at point `i`, predicted from its neighbours, and sqrt(1 + h), which is the sd
    /// of such a residual over the sd of a point.
    pub fn residual(&self, i: usize) -> ([f64; 2], f64) {
        let weights = self.weights(i);
        (
            predicted(&weights, i, self.displacement),
            widening(&weights),
        )
    }

    /// The same of several displacements at the same points.
    pub fn residuals(&self, i: usize, steps: &[&[[f64; 2]]]) -> (Vec<[f64; 2]>, f64) {
        let weights = self.weights(i);
        let residuals = steps.iter().map(|step| predicted(&weights, i, step));
        (residuals.collect(), widening(&weights))
    }

    /// A fit of component `k` about point `i` by least absolute deviations (reweighted), with deviations below
    /// `scale` counted alike: a few outliers among the neighbours do not move it.
    pub fn robust(&self, i: usize, k: usize, scale: f64) -> RobustFit {
        const SWEEPS: usize = 12;
        let near = self.neighbourhood(i);
        let center = self.displacement[i][k];
        let u: Vec<f64> = near
            .index
            .iter()
            .map(|&j| self.displacement[j][k] - center)
            .collect();
        let mut weights = vec![1.0; u.len()];
        let mut fit = LocalCoefficients::zeros();
        let mut widening = 1.0;
        for _ in 0..SWEEPS {
            let Some(factor) = factorize(&near.basis, &weights) else {
                break;
            };
            let mut right = LocalCoefficients::zeros();
            for ((phi, w), u) in near.basis.iter().zip(&weights).zip(&u) {
                right += phi * (w * u);
            }
            fit = factor.solve(&right);
            let solved = factor.solve(&LocalCoefficients::from([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
            let leverage: f64 = near
                .basis
                .iter()
                .zip(&weights)
                .map(|(phi, w)| (w * phi.dot(&solved)).powi(2))
                .sum();
            widening = (1.0 + leverage).sqrt();
            for ((phi, w), u) in near.basis.iter().zip(&mut weights).zip(&u) {
                *w = scale / (u - phi.dot(&fit)).abs().max(scale);
            }
        }
        RobustFit {
            residual: -fit[0],
            neighbours: near
                .basis
                .iter()
                .zip(&u)
                .map(|(phi, u)| u - phi.dot(&fit))
                .collect(),
            widening,
            curvature: (fit[3] * fit[3] + fit[4] * fit[4] + fit[5] * fit[5]).sqrt(),
        }
    }

    /// Whether a plane through the neighbours on one side of point `i` alone, for any of twelve sides, fits them to
    /// within twice `scale` and predicts the point to within `multiple` standard deviations: the point then
    /// belongs to that side of a step.
    pub fn joins_one_side(&self, i: usize, k: usize, scale: f64, multiple: f64) -> bool {
        const SIDES: usize = 12;
        let near = self.neighbourhood(i);
        let center = self.displacement[i][k];
        (0..SIDES).any(|side| {
            let (sin, cos) = (std::f64::consts::TAU * side as f64 / SIDES as f64).sin_cos();
            let members: Vec<(Plane, f64)> = near
                .index
                .iter()
                .zip(&near.basis)
                .filter(|(_, phi)| cos * phi[1] + sin * phi[2] > 0.05)
                .map(|(&j, phi)| {
                    (
                        Plane::new(phi[0], phi[1], phi[2]),
                        self.displacement[j][k] - center,
                    )
                })
                .collect();
            let mut normal = SMatrix::<f64, 3, 3>::zeros();
            let mut right = Plane::zeros();
            for (phi, u) in &members {
                normal.ger(1.0, phi, phi, 1.0);
                right += phi * *u;
            }
            let Some(inverse) = normal.try_inverse().filter(|_| members.len() >= 6) else {
                return false;
            };
            let fit = inverse * right;
            let square: f64 = members
                .iter()
                .map(|(phi, u)| (u - phi.dot(&fit)).powi(2))
                .sum();
            let clean = square < (members.len() - 3) as f64 * (2.0 * scale).powi(2);
            clean && fit[0].abs() < multiple * scale * (1.0 + inverse[(0, 0)]).sqrt()
        })
    }
}

/// Displacement of point `i` minus its prediction; zero without one.
fn predicted(weights: &[(usize, f64)], i: usize, displacement: &[[f64; 2]]) -> [f64; 2] {
    if weights.is_empty() {
        return [0.0; 2];
    }
    let mut residual = displacement[i];
    for &(j, weight) in weights {
        residual[0] -= weight * displacement[j][0];
        residual[1] -= weight * displacement[j][1];
    }
    residual
}

/// sd of a residual over the sd of a point.
fn widening(weights: &[(usize, f64)]) -> f64 {
    let leverage: f64 = weights.iter().map(|(_, weight)| weight * weight).sum();
    (1.0 + leverage).sqrt()
}

/// Cholesky factor of the weighted normal matrix. A trace of a ridge keeps it definite for points on a line.
fn factorize(basis: &[LocalCoefficients], weights: &[f64]) -> Option<LocalFactor> {
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    for (phi, w) in basis.iter().zip(weights) {
        normal.ger(*w, phi, phi, 1.0);
    }
    let ridge = 1e-9 * normal.trace();
    (0..6).for_each(|k| normal[(k, k)] += ridge);
    normal.cholesky()
}

/// Normal-consistent scale from the median absolute value.
pub(crate) fn mad(values: impl Iterator<Item = f64>) -> f64 {
    /// 1 / quantile(0.75) of the standard normal.
    const CONSISTENT: f64 = 1.482_602_218_505_602;
    let mut absolute: Vec<f64> = values.map(f64::abs).collect();
    CONSISTENT * median(&mut absolute)
}
