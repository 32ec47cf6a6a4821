//! The stretch move of Goodman & Weare (2010), Comm. App. Math. Comp. Sci. 5, 65, Eqs. 7 and 8.

use super::moves::{Fit, Move, Others};
use super::stream::Stream;

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

    fn propose(
        &self,
        x: &[f64],
        others: Others<'_>,
        _fit: &mut Fit,
        rng: &mut Stream,
        y: &mut [f64],
    ) -> f64 {
        let centre = others.point(rng.index(others.count()));
        let root = (self.a - 1.0) * rng.uniform() + 1.0;
        let z = root * root / self.a;
        for ((y, x), c) in y.iter_mut().zip(x).zip(centre) {
            *y = c + z * (x - c);
        }
        (x.len() as f64 - 1.0) * z.ln()
    }
}
