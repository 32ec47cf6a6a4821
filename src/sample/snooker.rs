//! The snooker update of ter Braak & Vrugt (2008), Stat. Comput. 18, 435, Eqs. 3 to 5.

use super::moves::{Move, Proposal};
use super::numbers::{Needs, pick};
use crate::lanes::ln_all;

/// Along the line through x and a walker z of the complementary half, x moves by gamma times the difference of two
/// further walkers projected on that line; the factor is (|y - z| / |x - z|)^(d-1), from the polar Jacobian.
#[derive(Debug, Clone, Copy)]
pub struct Snooker {
    /// gamma is uniform on [lowest, highest]; [1.2, 2.2] in the paper.
    pub gamma: (f64, f64),
}

impl Default for Snooker {
    fn default() -> Self {
        Self { gamma: (1.2, 2.2) }
    }
}

impl Move for Snooker {
    fn name(&self) -> &'static str {
        "snooker"
    }

    fn fewest(&self, _dim: usize) -> usize {
        3
    }

    fn needs(&self, _dim: usize, _others: usize) -> Needs {
        Needs {
            uniforms: 4,
            normals: 0,
        }
    }

    fn propose(&self, proposal: Proposal<'_>) {
        let (own, others, numbers) = (proposal.own, proposal.others, proposal.numbers);
        let (y, factor) = (proposal.y, proposal.factor);
        for walker in 0..own.count() {
            let u = |k| numbers.uniform(k)[walker];
            let [axis, first, second] = pick([u(0), u(1), u(2)], others.count());
            let gamma = self.gamma.0 + (self.gamma.1 - self.gamma.0) * u(3);
            let (mut norm2, mut along) = (0.0, 0.0);
            for (x, z) in own.columns().zip(others.columns()) {
                let r = x[walker] - z[axis];
                norm2 += r * r;
                along += r * (z[first] - z[second]);
            }
            // y - z = stretch (x - z). A walker that sits on z has no line to move on: it stays.
            let stretch = if norm2 > 0.0 {
                1.0 + gamma * along / norm2
            } else {
                1.0
            };
            let columns = own.columns().zip(others.columns());
            for ((x, z), y) in columns.zip(y.chunks_exact_mut(own.count())) {
                y[walker] = z[axis] + stretch * (x[walker] - z[axis]);
            }
            factor[walker] = stretch.abs();
        }
        ln_all(factor);
        let power = own.dim() as f64 - 1.0;
        factor.iter_mut().for_each(|log| *log *= power);
    }
}
