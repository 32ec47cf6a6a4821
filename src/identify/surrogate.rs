//! The finite elements against the density at draws of the posterior.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::numeric::shares;
use crate::posterior::{CompletedDraw, FullModels, Posed, PosedDraws};
use crate::quantity::NM_PER_MM;

/// What the density's own error does to the posterior, measured where the posterior is.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SurrogateError {
    /// Number of draws at which the finite elements were solved.
    pub draws: usize,
    /// Name of each constant, and the largest shift of its posterior mode that the error causes at any of the draws, posterior sds.
    pub shift_sd: Vec<(String, f64)>,
    /// The mean of those shifts with their signs: what does not average out.
    pub bias_sd: Vec<f64>,
    /// Log likelihood by the finite elements minus that by the density, at each draw.
    pub log_weights: Vec<f64>,
    /// Moments of each constant over those draws, plain and with the finite elements' likelihood.
    pub moments: Vec<Reweighted>,
    /// Largest difference of the block averages, nm.
    pub max_field_nm: f64,
    /// Root mean square difference, nm.
    pub rms_field_nm: f64,
}

/// Mean and sd of a constant over the draws at which the finite elements were solved.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Reweighted {
    pub name: String,
    /// With equal weights.
    pub plain: [f64; 2],
    /// With the importance weights of the finite elements' likelihood.
    pub weighted: [f64; 2],
}

/// Largest error, posterior sds, that is not worth a word.
pub const TOLERANCE: f64 = 0.05;

impl SurrogateError {
    /// The largest shift of any constant, in posterior standard deviations.
    pub fn max_sd(&self) -> f64 {
        self.shift_sd.iter().fold(0.0, |a, (_, s)| a.max(*s))
    }

    /// The constant that the error moves farthest, and by how many posterior sds; none that is worth a word. What it does at a single draw
    /// averages out.
    pub fn farthest(&self) -> Option<(&str, f64)> {
        let all = self.shift_sd.iter().zip(&self.bias_sd);
        let each = all.map(|((name, _), by)| (name.as_str(), *by));
        let most = each.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        most.filter(|(_, by)| by.abs() > TOLERANCE)
    }

    /// Effective number of draws with the finite elements' likelihood: (sum w)^2 / sum w^2 of the importance weights.
    pub fn effective_draws(&self) -> f64 {
        let weights = shares(&self.log_weights);
        1.0 / weights.iter().map(|w| w * w).sum::<f64>()
    }

    /// Compare at some completed `points` of the draws.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn measure(
        posed: &Posed,
        (points, drawn): (&[Vec<f64>], &[CompletedDraw]),
        models: FullModels<'_>,
    ) -> Result<Self> {
        let names = posed.density.constant_names();
        let compared = PosedDraws {
            posed,
            points,
            drawn,
        }
        .compared(models)?;
        let shifts = &compared.shifts;
        let largest = |k: usize| shifts.iter().fold(0.0_f64, |most, s| most.max(s[k].abs()));
        let bias = |k: usize| shifts.iter().map(|s| s[k]).sum::<f64>() / shifts.len() as f64;
        let errors = || compared.errors.iter().flatten().flat_map(|e| e.iter());
        let squares: f64 = errors().map(|e| e * e).sum();
        let own = compared.chosen.iter().map(|&k| &points[k][..names.len()]);
        let own: Vec<&[f64]> = own.collect();
        let each = names.iter().cloned().enumerate();
        Ok(Self {
            draws: compared.chosen.len(),
            shift_sd: each.map(|(k, name)| (name, largest(k))).collect(),
            bias_sd: (0..names.len()).map(bias).collect(),
            moments: reweighted(names, &own, &compared.logs),
            max_field_nm: errors().fold(0.0_f64, |most, e| most.max(e.abs())) * NM_PER_MM,
            rms_field_nm: (squares / errors().count().max(1) as f64).sqrt() * NM_PER_MM,
            log_weights: compared.logs,
        })
    }
}

fn reweighted(names: &[String], draws: &[&[f64]], log_weights: &[f64]) -> Vec<Reweighted> {
    let moments = |weights: &[f64], k: usize| {
        let values = || draws.iter().zip(weights).map(|(x, w)| (x[k], w));
        let mean: f64 = values().map(|(x, w)| w * x).sum();
        let variance: f64 = values().map(|(x, w)| w * (x - mean).powi(2)).sum();
        [mean, variance.sqrt()]
    };
    let equal = shares(&vec![0.0; draws.len()]);
    let weights = shares(log_weights);
    let reweighted = |(k, name): (usize, &String)| Reweighted {
        name: name.clone(),
        plain: moments(&equal, k),
        weighted: moments(&weights, k),
    };
    names.iter().enumerate().map(reweighted).collect()
}
