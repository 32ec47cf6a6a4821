//! Importance weights: what draws say of another density than theirs (Robert and Casella, *Monte Carlo Statistical Methods*, 2004, section
//! 3.3), and how many of them it is worth (Kong 1992).

use crate::numeric::relative_weights;

/// Draws under another density.
#[derive(Debug)]
pub struct Weighed {
    /// Effective share of the draws, 1 where all weigh alike, 0 where the density has none of them.
    pub effective: f64,
    /// Draws that it does not have.
    pub impossible: usize,
    /// By how much the mean of each parameter moves, and the standard error of that, in the parameter's unit; zeros where it has no draw.
    pub shifts: Vec<[f64; 2]>,
}

/// Weigh points, each with the log of the other density over that of which it was drawn, -inf where it cannot be.
pub fn weigh(points: &[&[f64]], log_ratios: &[f64]) -> Weighed {
    let weights = relative_weights(log_ratios);
    let n = weights.len() as f64;
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    let impossible = weights.iter().filter(|w| **w == 0.0).count();
    let shift = |k: usize| {
        // about the points' own mean, so that their own scatter drops out
        let mean = points.iter().map(|x| x[k]).sum::<f64>() / n;
        let terms = points.iter().zip(&weights);
        let terms: Vec<f64> = terms
            .map(|(x, w)| (w * n / sum - 1.0) * (x[k] - mean))
            .collect();
        let shift = terms.iter().sum::<f64>() / n;
        let squares: f64 = terms.iter().map(|t| (t - shift).powi(2)).sum();
        [shift, squares.sqrt() / n]
    };
    let parameters = 0..points.first().map_or(0, |x| x.len());
    if sum == 0.0 {
        return Weighed {
            effective: 0.0,
            impossible,
            shifts: parameters.map(|_| [0.0; 2]).collect(),
        };
    }
    Weighed {
        effective: sum * sum / squares / n,
        impossible,
        shifts: parameters.map(shift).collect(),
    }
}
