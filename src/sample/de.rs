//! Differential evolution, ter Braak (2006), Stat. Comput. 16, 239, on the two halves of an ensemble (Nelson, Ford,
//! Payne 2014).

use super::moves::{Fit, Move, Others};
use super::stream::Stream;

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

    fn propose(
        &self,
        x: &[f64],
        others: Others<'_>,
        _fit: &mut Fit,
        rng: &mut Stream,
        y: &mut [f64],
    ) -> f64 {
        let [first, second] = others.pick(rng);
        let gamma = if rng.uniform() < self.jump {
            1.0
        } else {
            self.scale * 2.38 / (2.0 * x.len() as f64).sqrt()
        };
        let gamma = gamma * (1.0 + self.jitter * rng.normal());
        let (z1, z2) = (others.point(first), others.point(second));
        for (k, y) in y.iter_mut().enumerate() {
            *y = x[k] + gamma * (z1[k] - z2[k]);
        }
        0.0
    }
}
