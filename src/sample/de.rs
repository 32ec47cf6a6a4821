//! Differential evolution, ter Braak (2006), Stat. Comput. 16, 239, on the two halves of an ensemble (Nelson, Ford,
//! Payne 2014).

use super::moves::{Move, Proposal};
use super::numbers::{Needs, pick};

/// y = x + gamma (z1 - z2) with z1, z2 two walkers of the complementary half; symmetric, so the factor is 1.
#[derive(Debug, Clone, Copy)]
pub struct De {
    /// Scale in units of 2.38 / sqrt(2 d).
    pub scale: f64,
    /// Relative jitter (sd) of gamma, which keeps few walkers from living on a lattice.
    pub jitter: f64,
    /// Probability of gamma = 1, which jumps between modes.
    pub jump: f64,
}

impl Default for De {
    fn default() -> Self {
        Self {
            scale: 1.0,
            jitter: 0.05,
            jump: 0.1,
        }
    }
}

impl Move for De {
    fn name(&self) -> &'static str {
        "de"
    }

    fn fewest(&self, _dim: usize) -> usize {
        2
    }

    fn needs(&self, _dim: usize, _others: usize) -> Needs {
        Needs {
            uniforms: 3,
            normals: 1,
        }
    }

    fn propose(&self, proposal: Proposal<'_>) {
        let (own, others, numbers) = (proposal.own, proposal.others, proposal.numbers);
        let (y, factor) = (proposal.y, proposal.factor);
        let usual = self.scale * 2.38 / (2.0 * own.dim() as f64).sqrt();
        for walker in 0..own.count() {
            let u = |k| numbers.uniform(k)[walker];
            let [first, second] = pick([u(0), u(1)], others.count());
            let gamma = if u(2) <= self.jump { 1.0 } else { usual };
            let gamma = gamma * (1.0 + self.jitter * numbers.normal(0)[walker]);
            let columns = own.columns().zip(others.columns());
            for ((x, z), y) in columns.zip(y.chunks_exact_mut(own.count())) {
                y[walker] = x[walker] + gamma * (z[first] - z[second]);
            }
        }
        factor.fill(0.0);
    }
}
