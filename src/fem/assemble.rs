//! The stiffness matrix: its pattern and geometry integrals once, its values for any laminate by an affine refill.

use faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};

use super::element::{self, GAUSS};
use super::supports::Supports;
use crate::geometry::Mesh;
use crate::laminate::Membrane;

/// Lower triangle of K, assembled by pairs of nodes. For a pair (a, b) the four integrals of products of shape
/// gradients, [a1 b1, a1 b2, a2 b1, a2 b2], determine the 2 x 2 block of K for any membrane stiffness.
#[derive(Debug, Clone)]
pub struct Assembly {
    nodes: usize,
    /// Number of stacks.
    stacks: usize,
    /// CSC pattern of node pairs a >= b.
    first: Vec<usize>,
    row: Vec<u32>,
    /// The integrals over the elements of each stack, one stack after the other. Each has all pairs: few plates have more than some
    /// stacks, and a factorisation takes far longer than to pass over zeros.
    integral: Vec<[f64; 4]>,
    /// What is pinned; nodes that follow others are, and take their displacements afterwards.
    supports: Supports,
    followers: Vec<u32>,
    pinned: Vec<usize>,
    /// Stored entries of pinned rows and columns, and of their diagonals.
    cleared: Vec<usize>,
    unit: Vec<usize>,
    /// CSC pattern of the scalar matrix's lower triangle.
    pattern: SymbolicSparseColMat<usize>,
}

impl Assembly {
    /// Assemble for a mesh. The pinned unknowns are held at zero: they get unit rows and columns, and so do those of nodes that follow
    /// others, whose elements belong to their leaders.
    pub fn new(mesh: &Mesh, supports: &Supports) -> Self {
        let (first, row) = node_pattern(mesh, &|n| supports.leader(n));
        let pattern = scalar_pattern(&first, &row, 2);
        let nodes = 0..mesh.nodes.len() as u32;
        let followers: Vec<u32> = nodes.filter(|&n| supports.leader(n) != n).collect();
        let following = followers
            .iter()
            .flat_map(|&n| [0, 1].map(|k| 2 * n as usize + k));
        let mut pinned: Vec<usize> = supports.pinned.iter().copied().chain(following).collect();
        pinned.sort_unstable();
        pinned.dedup();
        let (cleared, unit) = pinned_entries(&pattern, &pinned);
        let mut assembly = Self {
            nodes: mesh.nodes.len(),
            stacks: mesh.stacks(),
            first,
            row,
            integral: Vec::new(),
            supports: supports.clone(),
            followers,
            pinned,
            cleared,
            unit,
            pattern,
        };
        assembly.integral = assembly.integrals(mesh, &|_| 1.0);
        assembly
    }

    /// The integrals for a mesh of the same connectivity whose membrane stiffness is multiplied by `scale(point)`: for each stack those of
    /// all node pairs.
    pub fn integrals(&self, mesh: &Mesh, scale: &dyn Fn([f64; 2]) -> f64) -> Vec<[f64; 4]> {
        let (first, row) = (&self.first, &self.row);
        let mut integral = vec![[0.0; 4]; self.stacks * row.len()];
        for (e, nodes) in mesh.elements.iter().enumerate() {
            let x = mesh.corners(e);
            let block = gradient_products(&x, scale);
            let nodes = nodes.map(|n| self.supports.leader(n));
            let own = mesh.region_of(e) * row.len();
            for (i, &a) in nodes.iter().enumerate() {
                for (j, &b) in nodes.iter().enumerate() {
                    if a < b {
                        continue;
                    }
                    let column = first[b as usize]..first[b as usize + 1];
                    if let Ok(k) = row[column.clone()].binary_search(&a) {
                        let slot = &mut integral[own + column.start + k];
                        for (sum, value) in slot.iter_mut().zip(block[i][j]) {
                            *sum += value;
                        }
                    }
                }
            }
        }
        integral
    }

    /// Pattern of the lower triangle of K.
    pub fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }

    /// Number of stacks.
    pub fn stacks(&self) -> usize {
        self.stacks
    }

    /// Number of stored entries of the lower triangle.
    pub fn stored(&self) -> usize {
        4 * self.row.len() - self.nodes
    }

    /// The integrals of the mesh that was assembled.
    pub fn nominal(&self) -> &[[f64; 4]] {
        &self.integral
    }

    /// The 2 x 2 block of K for pair `k`, of all stacks together.
    fn block(&self, integral: &[[f64; 4]], a: &[Membrane], k: usize) -> [f64; 4] {
        let mut sum = block(&a[0], &integral[k]);
        for (stack, a) in a.iter().enumerate().skip(1) {
            let own = block(a, &integral[stack * self.row.len() + k]);
            sum.iter_mut().zip(own).for_each(|(s, x)| *s += x);
        }
        sum
    }

    /// Fill `values` (in the order of [`Assembly::pattern`]) for some integrals and the membrane stiffness of every stack.
    pub fn refill(&self, integral: &[[f64; 4]], a: &[Membrane], values: &mut [f64]) {
        let mut at = 0;
        for b in 0..self.nodes {
            let column = self.first[b]..self.first[b + 1];
            let blocks = column
                .clone()
                .map(|k| (self.row[k] as usize, self.block(integral, a, k)));
            let height = 2 * column.len();
            for (k, (node, [xx, xy, yx, yy])) in blocks.enumerate() {
                // Column 2b holds both rows of every block; column 2b + 1 starts at its own diagonal.
                values[at + 2 * k] = xx;
                values[at + 2 * k + 1] = yx;
                let second = at + height + 2 * k;
                if node != b {
                    values[second - 1] = xy;
                }
                values[second] = yy;
            }
            at += 2 * height - 1;
        }
        for &entry in &self.cleared {
            values[entry] = 0.0;
        }
        for &entry in &self.unit {
            values[entry] = 1.0;
        }
    }

    /// Give what acts on nodes that follow to their leaders, and set the pinned entries to zero, of load vectors one after the other.
    pub fn pin_loads(&self, loads: &mut [f64]) {
        for load in loads.chunks_mut(2 * self.nodes) {
            for &node in &self.followers {
                let leader = self.supports.leader(node) as usize;
                load[2 * leader] += load[2 * node as usize];
                load[2 * leader + 1] += load[2 * node as usize + 1];
            }
            for &dof in &self.pinned {
                load[dof] = 0.0;
            }
        }
    }

    /// Give the nodes that follow the displacements of their leaders.
    pub fn follow(&self, displacements: &mut [f64]) {
        if self.followers.is_empty() {
            return;
        }
        for u in displacements.chunks_mut(2 * self.nodes) {
            for &node in &self.followers {
                let leader = self.supports.leader(node) as usize;
                u[2 * node as usize] = u[2 * leader];
                u[2 * node as usize + 1] = u[2 * leader + 1];
            }
        }
    }

    /// The unknown that an unknown is, or follows.
    pub fn leading(&self, unknown: usize) -> usize {
        2 * self.supports.leader((unknown / 2) as u32) as usize + unknown % 2
    }

    /// K u for one displacement vector, some integrals and the membrane stiffness of every stack (without the pinning).
    pub fn multiply(&self, integral: &[[f64; 4]], a: &[Membrane], u: &[f64]) -> Vec<f64> {
        let mut force = vec![0.0; u.len()];
        for b in 0..self.nodes {
            let column = self.first[b]..self.first[b + 1];
            for k in column {
                let node = self.row[k] as usize;
                let [xx, xy, yx, yy] = self.block(integral, a, k);
                force[2 * node] += xx * u[2 * b] + xy * u[2 * b + 1];
                force[2 * node + 1] += yx * u[2 * b] + yy * u[2 * b + 1];
                if node != b {
                    force[2 * b] += xx * u[2 * node] + yx * u[2 * node + 1];
                    force[2 * b + 1] += xy * u[2 * node] + yy * u[2 * node + 1];
                }
            }
        }
        force
    }

    /// The same for each component of the membrane stiffness of every stack alone, those of a stack together in the order of [`Membrane`].
    pub fn multiply_components(&self, integral: &[[f64; 4]], u: &[f64]) -> Vec<Vec<f64>> {
        let stacks = integral.chunks(self.row.len());
        stacks.flat_map(|own| self.multiply_stack(own, u)).collect()
    }

    /// Those of one stack, in one sweep.
    fn multiply_stack(&self, integral: &[[f64; 4]], u: &[f64]) -> [Vec<f64>; 6] {
        let mut force = [0; 6].map(|_| vec![0.0; u.len()]);
        for b in 0..self.nodes {
            let [ub, vb] = [u[2 * b], u[2 * b + 1]];
            let mut own = [[0.0; 2]; 6];
            let column = self.first[b]..self.first[b + 1];
            for (&a, integral) in self.row[column.clone()].iter().zip(&integral[column]) {
                let a = a as usize;
                let &[g11, g12, g21, g22] = integral;
                let both = g12 + g21;
                // rows of the blocks in [`block`], one component at a time
                let blocks = [
                    [g11, 0.0, 0.0, 0.0],
                    [0.0, g12, g21, 0.0],
                    [0.0, 0.0, 0.0, g22],
                    [both, g11, g11, 0.0],
                    [0.0, g22, g22, both],
                    [g22, g21, g12, g11],
                ];
                let [ua, va] = [u[2 * a], u[2 * a + 1]];
                for ((force, own), [xx, xy, yx, yy]) in force.iter_mut().zip(&mut own).zip(blocks) {
                    force[2 * a] += xx * ub + xy * vb;
                    force[2 * a + 1] += yx * ub + yy * vb;
                    if a != b {
                        own[0] += xx * ua + yx * va;
                        own[1] += xy * ua + yy * va;
                    }
                }
            }
            for (force, own) in force.iter_mut().zip(own) {
                force[2 * b] += own[0];
                force[2 * b + 1] += own[1];
            }
        }
        force
    }
}

/// Stored entries of the rows and columns of the pinned unknowns, and of their diagonals (first in their columns).
pub(super) fn pinned_entries(
    pattern: &SymbolicSparseColMat<usize>,
    pinned: &[usize],
) -> (Vec<usize>, Vec<usize>) {
    let mut held = vec![false; pattern.nrows()];
    for &dof in pinned {
        held[dof] = true;
    }
    let starts = pattern.col_ptr();
    let mut cleared = Vec::new();
    for column in 0..pattern.ncols() {
        for entry in starts[column]..starts[column + 1] {
            if held[column] || held[pattern.row_idx()[entry]] {
                cleared.push(entry);
            }
        }
    }
    (cleared, pinned.iter().map(|&dof| starts[dof]).collect())
}

/// The 2 x 2 block [11, 12, 21, 22] of K for a node pair.
fn block(a: &Membrane, &[g11, g12, g21, g22]: &[f64; 4]) -> [f64; 4] {
    [
        a.a11 * g11 + a.a66 * g22 + a.a16 * (g12 + g21),
        a.a12 * g12 + a.a66 * g21 + a.a16 * g11 + a.a26 * g22,
        a.a12 * g21 + a.a66 * g12 + a.a16 * g11 + a.a26 * g22,
        a.a22 * g22 + a.a66 * g11 + a.a26 * (g12 + g21),
    ]
}

/// Integrals over an element of [a1 b1, a1 b2, a2 b1, a2 b2] for every pair of its nodes.
fn gradient_products(x: &[[f64; 2]; 8], scale: &dyn Fn([f64; 2]) -> f64) -> [[[f64; 4]; 8]; 8] {
    let mut block = [[[0.0; 4]; 8]; 8];
    for (a, wa) in GAUSS {
        for (b, wb) in GAUSS {
            let (g, det) = element::physical_gradient(x, a, b);
            let w = wa * wb * det * scale(element::position(x, &element::shape(a, b)));
            for i in 0..8 {
                for j in 0..8 {
                    block[i][j][0] += w * g[i][0] * g[j][0];
                    block[i][j][1] += w * g[i][0] * g[j][1];
                    block[i][j][2] += w * g[i][1] * g[j][0];
                    block[i][j][3] += w * g[i][1] * g[j][1];
                }
            }
        }
    }
    block
}

/// Lower-triangular CSC pattern of the node graph, each node standing for its leader.
pub(super) fn node_pattern(mesh: &Mesh, leader: &dyn Fn(u32) -> u32) -> (Vec<usize>, Vec<u32>) {
    let mut below: Vec<Vec<u32>> = (0..mesh.nodes.len() as u32).map(|n| vec![n]).collect();
    for nodes in &mesh.elements {
        let nodes = nodes.map(leader);
        for a in nodes {
            for b in nodes {
                if a >= b {
                    below[b as usize].push(a);
                }
            }
        }
    }
    let mut first = vec![0];
    let mut row = Vec::new();
    for mut rows in below {
        rows.sort_unstable();
        rows.dedup();
        row.extend(rows);
        first.push(row.len());
    }
    (first, row)
}

/// Lower-triangular CSC pattern of the unknowns, `each` a node.
pub(super) fn scalar_pattern(
    first: &[usize],
    row: &[u32],
    each: usize,
) -> SymbolicSparseColMat<usize> {
    let nodes = first.len() - 1;
    let mut starts = vec![0];
    let mut rows = Vec::with_capacity(each * each * row.len());
    for b in 0..nodes {
        let below = &row[first[b]..first[b + 1]];
        for column in 0..each {
            let all = below
                .iter()
                .flat_map(|&a| (0..each).map(move |c| each * a as usize + c));
            rows.extend(all.skip(column));
            starts.push(rows.len());
        }
    }
    SymbolicSparseColMat::new_checked(each * nodes, each * nodes, starts, None, rows)
}
