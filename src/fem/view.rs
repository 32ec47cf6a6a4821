//! A reduced basis as points of the plate see it: how far a displacement can be off, given the bound of the error's energy.
//!
//! A displacement at a point is a linear functional l of the nodal ones, and so is the rigid motion that a gauge takes off. An error e that
//! vanishes at the supports has |l(e)| <= |l| |e|, with |e| its energy norm under the reference stiffness K and |l|^2 = l^T K^-1 l, which is how far
//! the point moves under a unit force on it, without the rigid motion. There is an error for which this is an equality.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::basis::{Answer, SpanBasis};
use super::inverse::Inverse;
use super::observe::Observer;
use super::plate::Plate;
use super::solve::Kept;
use crate::error::{Error, Result};
use crate::geometry::Mesh;

/// A part of the rigid motion that is taken off a field.
pub struct Motion {
    /// How much of it a field has: the factors of its nodal displacements.
    pub forces: Vec<f64>,
    /// Displacement of a unit of it at every point, mm.
    pub at: Vec<[f64; 2]>,
}

/// A basis as points of its mesh see it.
pub struct View {
    pub basis: Arc<SpanBasis>,
    observer: Observer,
    motions: Vec<Motion>,
    reach: f64,
}

impl View {
    /// Look at a basis of `mesh` from the observer's points, its rigid motion taken off.
    ///
    /// # Errors
    /// Those of a factorisation.
    pub fn new(
        plate: &Plate,
        basis: Arc<SpanBasis>,
        mesh: &Mesh,
        observer: Observer,
        motions: Vec<Motion>,
    ) -> Result<Self> {
        let mut factor = plate.factor();
        let uniform = plate.uniform_integrals(mesh);
        factor.factorise_with(&uniform, &basis.reference)?;
        let factor = factor.keep();
        let reach = reach(plate, &factor, mesh, &observer, &motions)?;
        Ok(Self {
            basis,
            observer,
            motions,
            reach,
        })
    }

    /// Displacements at the points that are not outside of it, mm a unit of energy norm: the largest |l|, mm / (N mm)^1/2.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Bound of either component of an answer's error at the points, mm.
    pub fn bound_mm(&self, answer: &Answer) -> f64 {
        self.reach * answer.bound
    }

    /// Displacements at the points without the rigid motion, mm, of nodal ones that vanish at the supports.
    pub fn seen(&self, nodal: &[f64]) -> Vec<[f64; 2]> {
        let mut seen = self.observer.displacement(nodal);
        for motion in &self.motions {
            let amount = dot(&motion.forces, nodal);
            for (u, m) in seen.iter_mut().zip(&motion.at) {
                *u = [u[0] - amount * m[0], u[1] - amount * m[1]];
            }
        }
        seen
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The largest |l| of any point and component, from the factorised reference stiffness: with f_k the motions' forces, m_k their
/// displacements there and z_k = K^-1 f_k, |l - sum m_k f_k|^2 = l^T K^-1 l - 2 sum m_k l(z_k) + sum m_j m_k f_j^T z_k.
fn reach(
    plate: &Plate,
    factor: &Kept,
    mesh: &Mesh,
    observer: &Observer,
    motions: &[Motion],
) -> Result<f64> {
    let n = mesh.unknowns();
    let mut responses: Vec<f64> = motions.iter().flat_map(|m| m.forces.clone()).collect();
    plate.solve_with(factor, &mut responses);
    let responses: Vec<&[f64]> = responses.chunks(n).collect();
    let gram = DMatrix::from_fn(motions.len(), motions.len(), |j, k| {
        dot(&motions[j].forces, responses[k])
    });
    let responses = responses.iter().map(|z| observer.displacement(z));
    let responses: Vec<_> = responses.collect();
    let compliances = compliances(plate, factor, mesh, observer)?;
    let square = |(k, own): (usize, &[f64; 2])| {
        [0, 1].map(|i| {
            let at = |of: &dyn Fn(usize) -> f64| DVector::from_fn(motions.len(), |j, _| of(j));
            let taken = at(&|j| motions[j].at[k][i]);
            let moved = at(&|j| responses[j][k][i]);
            own[i] - 2.0 * taken.dot(&moved) + taken.dot(&(&gram * &taken))
        })
    };
    let squares = compliances.iter().enumerate().flat_map(square);
    Ok(squares.fold(0.0, f64::max).sqrt())
}

/// How far every point moves along either direction under a unit force on it along the same, mm/N.
fn compliances(
    plate: &Plate,
    factor: &Kept,
    mesh: &Mesh,
    observer: &Observer,
) -> Result<Vec<[f64; 2]>> {
    let count = observer.count();
    let elements = (0..count).filter_map(|k| observer.spot(k).map(|(e, _)| e));
    let mut blocks: BTreeMap<usize, InverseBlock> =
        elements.map(|e| (e, [[[0.0; 2]; 8]; 8])).collect();
    let nodes = blocks.keys().flat_map(|&e| mesh.elements[e]);
    let leading = |a, i| plate.assembly.leading(unknown(a, i));
    let unknowns: Vec<usize> = nodes.flat_map(|a| [0, 1].map(|i| leading(a, i))).collect();
    let inverse = plate.inverse_of(factor, &unknowns)?;
    let mut free = vec![1.0; mesh.unknowns()];
    plate.assembly.pin_loads(&mut free);
    // a leader was given what its followers had
    for entry in &mut free {
        *entry = entry.min(1.0);
    }
    blocks.par_iter_mut().try_for_each(|(&e, block)| {
        *block = block_of(&inverse, (plate, &free), mesh.elements[e])?;
        Ok::<(), Error>(())
    })?;
    let own = |k: usize| match observer.spot(k) {
        Some((e, shape)) => [0, 1].map(|i| {
            let row = |(a, row): (usize, &[[f64; 2]; 8])| -> f64 {
                let products = row.iter().zip(&shape).map(|(z, n)| z[i] * n);
                shape[a] * products.sum::<f64>()
            };
            blocks[&e].iter().enumerate().map(row).sum()
        }),
        None => [0, 1].map(|i| {
            let mut at_points = vec![[0.0; 2]; count];
            at_points[k][i] = 1.0;
            let force = observer.forces(&at_points, mesh.unknowns());
            let mut moved = force.clone();
            plate.solve_with(factor, &mut moved);
            dot(&force, &moved)
        }),
    };
    Ok((0..count).into_par_iter().map(own).collect())
}

/// Entries of the inverse between the nodes of an element, along either direction.
type InverseBlock = [[[f64; 2]; 8]; 8];

fn unknown(node: u32, i: usize) -> usize {
    2 * node as usize + i
}

fn block_of(
    inverse: &Inverse<'_>,
    (plate, free): (&Plate, &[f64]),
    nodes: [u32; 8],
) -> Result<InverseBlock> {
    let mut block = [[[0.0; 2]; 8]; 8];
    for (row, a) in block.iter_mut().zip(nodes) {
        for (entries, b) in row.iter_mut().zip(nodes) {
            for (i, entry) in entries.iter_mut().enumerate() {
                let [a, b] = [a, b].map(|n| plate.assembly.leading(unknown(n, i)));
                let known = inverse.entry(a, b).ok_or_else(|| {
                    Error::program("inverse", "an entry for nodes of one element")
                })?;
                *entry = free[a] * free[b] * known;
            }
        }
    }
    Ok(block)
}
