//! The noise scale of each frame, by restricted likelihood on frame contrasts.

use nalgebra::{DMatrix, DVector};

use super::contrasts::{Metric, covariance_of_frames};
use super::restricted::{Fit, Restricted, Whitened};
use crate::error::Result;

/// Prior sd of the logarithm of a frame's scale: where the contrasts of few frames cannot tell whose noise it is (below five loaded
/// differently), all have the same.
const PRIOR: f64 = 0.7;

/// Steps of Fisher's scoring at most, and a step this small is the last.
const STEPS: usize = 30;
const SMALL: f64 = 1e-5;

/// The scales' search for given noise of blocks of both components.
pub(super) struct Scales<'a> {
    pub contrasts: &'a DMatrix<f64>,
    pub restricted: [&'a Restricted; 2],
    pub whitened: [&'a Whitened; 2],
}

/// The scales' logarithms, with what follows from them.
struct State {
    logs: DVector<f64>,
    metric: Metric,
    fits: [Fit; 2],
    /// Log posterior density.
    value: f64,
}

impl Scales<'_> {
    /// Scales (geometric mean 1) of the largest posterior density, from `start`.
    ///
    /// # Errors
    /// Those of a restricted likelihood.
    pub fn best(&self, start: &[f64]) -> Result<Vec<f64>> {
        let mut state = self.at(DVector::from_iterator(
            start.len(),
            start.iter().map(|d| d.ln()),
        ))?;
        for _ in 0..STEPS {
            let (step, expected) = self.newton(&state);
            let mut share = 1.0;
            let better = loop {
                let next = self.at(&state.logs + share * &step)?;
                if next.value > state.value {
                    break Some(next);
                }
                share *= 0.5;
                if share * step.amax() < SMALL {
                    break None;
                }
            };
            let Some(next) = better else { break };
            state = next;
            if expected < SMALL {
                break;
            }
        }
        Ok(state.logs.iter().map(|l| l.exp()).collect())
    }

    fn at(&self, mut logs: DVector<f64>) -> Result<State> {
        // the geometric mean belongs to s^2
        logs.add_scalar_mut(-logs.mean());
        let d: Vec<f64> = logs.iter().map(|l| l.exp()).collect();
        let metric = Metric::new(self.contrasts, &covariance_of_frames(&d, 0.0))?;
        let fit = |c: usize| self.restricted[c].fit(self.whitened[c], &metric);
        let fits = [fit(0)?, fit(1)?];
        let prior = 0.5 * logs.norm_squared() / (PRIOR * PRIOR);
        Ok(State {
            value: fits.iter().map(|f| f.log_likelihood).sum::<f64>() - prior,
            logs,
            metric,
            fits,
        })
    }

    /// A step of Fisher's scoring in the logarithms, and its largest entry. The information of contrasts of nu degrees of freedom is
    /// tr(V^-1 dV V^-1 dV) / 2, here S_st^2 for each block.
    fn newton(&self, state: &State) -> (DVector<f64>, f64) {
        let count = state.logs.len();
        let d = state.logs.map(f64::exp);
        let s = &state.metric.s;
        let mut slope = -&state.logs / (PRIOR * PRIOR);
        let mut freedom = 0.0;
        for (c, fit) in state.fits.iter().enumerate() {
            let own = self.restricted[c].slope(self.whitened[c], &state.metric, fit);
            slope += own.component_mul(&d);
            freedom += self.restricted[c].freedom() as f64;
        }
        let for_each = freedom / self.contrasts.ncols() as f64;
        let information = DMatrix::from_fn(count, count, |i, j| {
            let own = if i == j { 1.0 / (PRIOR * PRIOR) } else { 0.0 };
            own + 0.5 * for_each * d[i] * d[j] * s[(i, j)].powi(2)
        });
        let step = information
            .cholesky()
            .map_or_else(|| DVector::zeros(count), |f| f.solve(&slope));
        let mean = step.mean();
        let step = step.map(|x| (x - mean).clamp(-1.0, 1.0));
        let largest = step.amax();
        (step, largest)
    }
}
