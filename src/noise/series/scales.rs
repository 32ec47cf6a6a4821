//! The noise scale of each frame, by restricted likelihood on frame contrasts.
//!
//! The logarithms of the scales are N(0, tau^2), tau by their marginal likelihood: frames that the contrasts hardly see (few frames, or
//! the largest load, which decides what grows with the load) take their scale from the others, and frames that are alike have one
//! scale. Independent scales left 10 % of error in each, in what grows with the load above all (tests/unit/series_noise.rs).

use nalgebra::{DMatrix, DVector};

use super::contrasts::{Metric, covariance_of_frames};
use super::restricted::{Restricted, RestrictedFit, WhitenedFrames};
use crate::error::Result;

/// Values of tau that are weighed, besides none; the last is what the search starts from.
const SPREADS: [f64; 6] = [0.03, 0.06, 0.12, 0.25, 0.5, 1.0];

/// Steps of Fisher's scoring at most, and a step this small is the last.
const STEPS: usize = 50;
const SMALL: f64 = 1e-7;

/// The scales' search for given noise of blocks of both components.
pub(super) struct FrameScales<'a> {
    pub contrasts: &'a DMatrix<f64>,
    pub restricted: [&'a Restricted; 2],
    pub whitened: [&'a WhitenedFrames; 2],
}

/// The scales' logarithms, with what follows from them.
struct ScaleState {
    logs: DVector<f64>,
    metric: Metric,
    fits: [RestrictedFit; 2],
    /// Log posterior density.
    value: f64,
}

impl FrameScales<'_> {
    /// Scales (geometric mean 1) of the largest posterior density, from `start`.
    ///
    /// # Errors
    /// Those of a restricted likelihood.
    pub fn best(&self, start: &[f64]) -> Result<Vec<f64>> {
        let logs = DVector::from_iterator(start.len(), start.iter().map(|d| d.ln()));
        let widest = SPREADS[SPREADS.len() - 1];
        let wide = self.highest(logs, widest)?;
        let Some(spread) = self.likeliest_spread(&wide, widest) else {
            return Ok(vec![1.0; start.len()]);
        };
        let found = self.highest(wide.logs, spread)?;
        Ok(found.logs.iter().map(|l| l.exp()).collect())
    }

    /// The scales of the largest posterior density under a `spread`.
    fn highest(&self, start: DVector<f64>, spread: f64) -> Result<ScaleState> {
        let mut state = self.at(start, spread)?;
        for _ in 0..STEPS {
            let step = self.newton(&state, spread);
            let mut share = 1.0;
            let better = loop {
                if share * step.amax() < SMALL {
                    break None;
                }
                let next = self.at(&state.logs + share * &step, spread)?;
                if next.value > state.value {
                    break Some(next);
                }
                share *= 0.5;
            };
            let Some(next) = better else { break };
            state = next;
        }
        Ok(state)
    }

    fn at(&self, mut logs: DVector<f64>, spread: f64) -> Result<ScaleState> {
        // the geometric mean belongs to s^2
        logs.add_scalar_mut(-logs.mean());
        let d: Vec<f64> = logs.iter().map(|l| l.exp()).collect();
        let metric = Metric::new(self.contrasts, &covariance_of_frames(&d, 0.0))?;
        let fit = |c: usize| self.restricted[c].fit(self.whitened[c], &metric);
        let fits = [fit(0)?, fit(1)?];
        let prior = 0.5 * logs.norm_squared() / (spread * spread);
        Ok(ScaleState {
            value: fits.iter().map(|f| f.log_likelihood).sum::<f64>() - prior,
            logs,
            metric,
            fits,
        })
    }

    /// A step of Fisher's scoring in the logarithms. The likelihood does not change with all of them together, s^2 being profiled out.
    fn newton(&self, state: &ScaleState, spread: f64) -> DVector<f64> {
        let d = state.logs.map(f64::exp);
        let mut slope = -&state.logs / (spread * spread);
        for (c, fit) in state.fits.iter().enumerate() {
            let own = self.restricted[c].slope(self.whitened[c], &state.metric, fit);
            slope += own.component_mul(&d);
        }
        let mut information = self.information(state);
        for s in 0..d.len() {
            information[(s, s)] += 1.0 / (spread * spread);
        }
        let step = information.cholesky().map(|f| f.solve(&slope));
        let step = step.unwrap_or(slope);
        let mean = step.mean();
        step.map(|x| (x - mean).clamp(-1.0, 1.0))
    }

    /// Information of the logarithms, tr(V^-1 dV V^-1 dV) / 2 of contrasts: S_st^2 for each of their blocks, s^2 profiled out.
    fn information(&self, state: &ScaleState) -> DMatrix<f64> {
        let count = state.logs.len();
        let d = state.logs.map(f64::exp);
        let freedom: usize = self.restricted.iter().map(|r| r.freedom()).sum();
        let for_each = 0.5 * freedom as f64 / self.contrasts.ncols() as f64;
        let s = &state.metric.s;
        let all = DMatrix::from_fn(count, count, |i, j| {
            for_each * d[i] * d[j] * s[(i, j)].powi(2)
        });
        let together = all.column_sum();
        let total = together.sum();
        if total > 0.0 {
            all - &together * together.transpose() / total
        } else {
            all
        }
    }

    /// The spread of the largest marginal likelihood, by the normal approximation at the scales found under a `wide` one; none where
    /// equal scales are as likely.
    fn likeliest_spread(&self, state: &ScaleState, wide: f64) -> Option<f64> {
        let information = self.information(state);
        let count = information.nrows();
        // J eta of the likelihood's own maximum eta, which need not exist
        let right = &information * &state.logs + &state.logs / (wide * wide);
        let log_marginal = |spread: f64| {
            let mut precision = information.clone() * (spread * spread);
            for s in 0..count {
                precision[(s, s)] += 1.0;
            }
            let factor = precision.cholesky()?;
            let square = spread * spread * right.dot(&factor.solve(&right));
            Some(0.5 * (square - factor.ln_determinant()))
        };
        let weighed = SPREADS.iter().filter_map(|&t| Some((t, log_marginal(t)?)));
        let none = (None, 0.0);
        let best = weighed.fold(none, |best, (spread, log)| {
            if log > best.1 {
                (Some(spread), log)
            } else {
                best
            }
        });
        best.0
    }
}
