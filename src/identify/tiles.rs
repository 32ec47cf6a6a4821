//! Blocks with a plane over each: what varies within them, and what does not.

use crate::field::{Blocks, Field};

/// A block of fewer points gets a constant instead of a plane.
const FEWEST_FOR_PLANE: usize = 8;

/// Points by block, and an orthonormal basis of the planes over each block's points.
pub struct Tiles {
    /// The points, block by block.
    pub members: Vec<usize>,
    /// Where each block begins in `members`, and the end.
    start: Vec<usize>,
    /// Values of the basis at each member; zeros where a block has no such term.
    basis: Vec<[f64; 3]>,
    /// Number of basis functions of all blocks together.
    pub terms: usize,
    /// The fringe order, mm.
    pub order_mm: f64,
}

impl Tiles {
    pub fn new(field: &Field, blocks: &Blocks, order_mm: f64) -> Self {
        let mut start = vec![0; blocks.len() + 1];
        for block in blocks.of_point.iter().flatten() {
            start[*block as usize + 1] += 1;
        }
        for block in 0..blocks.len() {
            start[block + 1] += start[block];
        }
        let mut next = start.clone();
        let mut members = vec![0; start[blocks.len()]];
        for (i, block) in blocks.of_point.iter().enumerate() {
            if let Some(block) = block {
                members[next[*block as usize]] = i;
                next[*block as usize] += 1;
            }
        }
        let mut basis = vec![[0.0; 3]; members.len()];
        let mut terms = 0;
        for (block, range) in start.windows(2).enumerate() {
            let count = range[1] - range[0];
            let raw = |k: usize, i: usize| match k {
                0 => 1.0,
                _ => (field.points[i][k - 1] - blocks.centroid[block][k - 1]) / blocks.size_mm,
            };
            let wanted = if count >= FEWEST_FOR_PLANE { 3 } else { 1 };
            let slots = &mut basis[range[0]..range[1]];
            for k in 0..wanted {
                for (slot, &i) in slots.iter_mut().zip(&members[range[0]..range[1]]) {
                    slot[k] = raw(k, i);
                }
                for earlier in 0..k {
                    let dot: f64 = slots.iter().map(|b| b[k] * b[earlier]).sum();
                    slots.iter_mut().for_each(|b| b[k] -= dot * b[earlier]);
                }
                let norm = slots.iter().map(|b| b[k] * b[k]).sum::<f64>().sqrt();
                // points on a line have no slope across it
                let kept = norm > 1e-6 * (count as f64).sqrt();
                terms += usize::from(kept);
                let scale = if kept { 1.0 / norm } else { 0.0 };
                slots.iter_mut().for_each(|b| b[k] *= scale);
            }
        }
        Self {
            members,
            start,
            basis,
            terms,
            order_mm,
        }
    }

    /// The blocks' least-squares planes through one value a member.
    pub fn planes(&self, values: &[f64]) -> Vec<f64> {
        let mut planes = vec![0.0; values.len()];
        for range in self.start.windows(2) {
            let mut coefficients = [0.0; 3];
            let members = range[0]..range[1];
            let basis = &self.basis[members.clone()];
            for (value, basis) in values[members.clone()].iter().zip(basis) {
                for (a, b) in coefficients.iter_mut().zip(basis) {
                    *a += b * value;
                }
            }
            for (plane, basis) in planes[members].iter_mut().zip(basis) {
                *plane = coefficients.iter().zip(basis).map(|(a, b)| a * b).sum();
            }
        }
        planes
    }

    /// A component's displacement (mm) at every point from its argument at the members: outside of the blocks `model` with the mean
    /// offset of the nearest block, whose plane is not to be trusted there.
    pub fn everywhere(
        &self,
        field: &Field,
        blocks: &Blocks,
        argument: &[f64],
        model: impl Fn(usize) -> f64,
    ) -> Vec<f64> {
        let mut all: Vec<f64> = (0..field.len()).map(&model).collect();
        let per_mm = std::f64::consts::TAU / self.order_mm;
        for (&i, a) in self.members.iter().zip(argument) {
            all[i] = a / per_mm;
        }
        let offset: Vec<f64> = self
            .start
            .windows(2)
            .map(|range| {
                let members = &self.members[range[0]..range[1]];
                let sum: f64 = members.iter().map(|&i| all[i] - model(i)).sum();
                sum / members.len().max(1) as f64
            })
            .collect();
        for (i, p) in field.points.iter().enumerate() {
            if blocks.of_point[i].is_none() {
                let distance = |c: &[f64; 2]| (c[0] - p[0]).hypot(c[1] - p[1]);
                let nearest = blocks.centroid.iter().zip(&offset);
                let nearest = nearest.min_by(|a, b| distance(a.0).total_cmp(&distance(b.0)));
                all[i] += nearest.map_or(0.0, |(_, offset)| *offset);
            }
        }
        all
    }

    /// What the planes leave of one value a member.
    pub fn without_planes(&self, values: &[f64]) -> Vec<f64> {
        let planes = self.planes(values);
        values.iter().zip(planes).map(|(v, p)| v - p).collect()
    }
}
