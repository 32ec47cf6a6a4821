//! The snooker update of ter Braak & Vrugt (2008), Stat. Comput. 18, 435, Eqs. 3 to 5.

use super::moves::{Fit, Move, Others};
use super::stream::Stream;

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

    fn propose(
        &self,
        x: &[f64],
        others: Others<'_>,
        _fit: &mut Fit,
        rng: &mut Stream,
        y: &mut [f64],
    ) -> f64 {
        let [axis, first, second] = others.pick(rng);
        let (z, z1, z2) = (
            others.point(axis),
            others.point(first),
            others.point(second),
        );
        let gamma = self.gamma.0 + (self.gamma.1 - self.gamma.0) * rng.uniform();
        let (mut norm2, mut along) = (0.0, 0.0);
        for k in 0..x.len() {
            norm2 += (x[k] - z[k]) * (x[k] - z[k]);
            along += (x[k] - z[k]) * (z1[k] - z2[k]);
        }
        // y - z = stretch (x - z). A walker that sits on z has no line to move on: it stays.
        let stretch = if norm2 > 0.0 {
            1.0 + gamma * along / norm2
        } else {
            1.0
        };
        for (k, y) in y.iter_mut().enumerate() {
            *y = z[k] + stretch * (x[k] - z[k]);
        }
        (x.len() as f64 - 1.0) * stretch.abs().ln()
    }
}
