//! The stretch move of Goodman & Weare (2010), Comm. App. Math. Comp. Sci. 5, 65, Eqs. 7 and 8.

use super::moves::{Move, Proposal};
use super::numbers::{Needs, index};
use crate::lanes::ln_all;

/// y = c + z (x - c) with c a walker of the complementary half and z of density proportional to 1/sqrt(z) on
/// [1/a, a]; the factor is z^(d-1).
#[derive(Debug, Clone, Copy)]
pub struct Stretch {
    /// Largest stretch, > 1; 2 by convention.
    pub a: f64,
}

impl Default for Stretch {
    fn default() -> Self {
        Self { a: 2.0 }
    }
}

impl Move for Stretch {
    fn name(&self) -> &'static str {
        "stretch"
    }

    fn fewest(&self, _dim: usize) -> usize {
        1
    }

    fn needs(&self, _dim: usize, _others: usize) -> Needs {
        Needs {
            uniforms: 2,
            normals: 0,
        }
    }

    fn propose(&self, proposal: Proposal<'_>) {
        let (own, others, numbers) = (proposal.own, proposal.others, proposal.numbers);
        let (y, factor) = (proposal.y, proposal.factor);
        let (pick, root) = (numbers.uniform(0), numbers.uniform(1));
        for (z, u) in factor.iter_mut().zip(root) {
            let root = (self.a - 1.0) * u + 1.0;
            *z = root * root / self.a;
        }
        let columns = own.columns().zip(others.columns());
        for ((x, c), y) in columns.zip(y.chunks_exact_mut(own.count())) {
            for (k, y) in y.iter_mut().enumerate() {
                let centre = c[index(pick[k], c.len())];
                *y = centre + factor[k] * (x[k] - centre);
            }
        }
        ln_all(factor);
        let power = own.dim() as f64 - 1.0;
        factor.iter_mut().for_each(|log_z| *log_z *= power);
    }
}
