//! Specimens unlike the others.

use super::row::CampaignRow;
use crate::numeric::median;

/// Beyond this a specimen is called outlying (Iglewicz & Hoaglin 1993).
pub const MOST_Z: f64 = 3.5;

/// Fewer others have no spread to speak of.
const LEAST_OTHERS: usize = 4;

/// Of a normal distribution: sd over median absolute deviation, and variance of the median over that of the mean.
const SD_OF_MAD: f64 = 1.4826;
const VARIANCE_OF_MEDIAN: f64 = std::f64::consts::FRAC_PI_2;

/// How far each value lies from the median of the others, in sds of what it would be if it were one of them: their spread beyond their own
/// sds, its own sd, and the sd of their median. `[mean, sd]` each; none where there are too few others.
pub fn robust_z(values: &[[f64; 2]]) -> Vec<Option<f64>> {
    let z = |k: usize| {
        let others = || values.iter().enumerate().filter(move |(i, _)| *i != k);
        let mut means: Vec<f64> = others().map(|(_, v)| v[0]).collect();
        if means.len() < LEAST_OTHERS {
            return None;
        }
        let mut own: Vec<f64> = others().map(|(_, v)| v[1].powi(2)).collect();
        let n = means.len() as f64;
        let middle = median(&mut means);
        let mut off: Vec<f64> = means.iter().map(|m| (m - middle).abs()).collect();
        let spread = (SD_OF_MAD * median(&mut off)).powi(2);
        let own = median(&mut own);
        let between = (spread - own).max(0.0);
        let of_median = VARIANCE_OF_MEDIAN * (between + own) / n;
        let variance = between + values[k][1].powi(2) + of_median;
        Some((values[k][0] - middle) / variance.sqrt()).filter(|z| z.is_finite())
    };
    (0..values.len()).map(z).collect()
}

/// Put the robust z of a constant into the rows that have it.
pub fn mark(rows: &mut [CampaignRow], constant: &str) {
    let own: Vec<&mut super::row::Found> = rows
        .iter_mut()
        .filter_map(|r| r.constants.get_mut(constant))
        .collect();
    let values: Vec<[f64; 2]> = own.iter().map(|c| [c.mean, c.sd]).collect();
    for (own, z) in own.into_iter().zip(robust_z(&values)) {
        own.robust_z = z;
    }
}
