//! The noise of an intensity: a part that is the same everywhere, and one that grows with the light (shot noise).

/// Variance of an intensity, `even` + `per_light` times its mean, in recorded units.
#[derive(Debug, Clone, Copy)]
pub struct IntensityNoise {
    pub even: f64,
    pub per_light: f64,
}

/// A mean brightness, and an estimate of the variance there.
pub type VarianceAt = (f64, f64);

/// Estimates so many times the typical one are of dust: a normal deviate of 4 sds.
const FARTHEST: f64 = 40.0;
/// Brightnesses that are told apart.
const BINS: usize = 12;

impl IntensityNoise {
    /// The same at every brightness.
    pub fn even(variance: f64) -> Self {
        Self {
            even: variance,
            per_light: 0.0,
        }
    }

    /// Variance at a mean intensity.
    pub fn variance(&self, brightness: f64) -> f64 {
        self.even + self.per_light * brightness.max(0.0)
    }

    /// Weighted least squares over bins of brightness, both parts not negative.
    pub fn fit(mut seen: Vec<VarianceAt>) -> Option<Self> {
        let mut sorted: Vec<f64> = seen.iter().map(|s| s.1).collect();
        sorted.sort_by(f64::total_cmp);
        let most = FARTHEST * sorted.get(sorted.len() / 2)?;
        seen.retain(|s| s.1 <= most);
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        let size = seen.len().div_ceil(BINS).max(1);
        let bins = seen.chunks(size).map(|bin| {
            let n = bin.len() as f64;
            let sum = bin.iter().fold((0.0, 0.0), |s, x| (s.0 + x.0, s.1 + x.1));
            (sum.0 / n, sum.1 / n, n)
        });
        let bins: Vec<(f64, f64, f64)> = bins.collect();
        let mut sums = [0.0; 5];
        for (b, v, n) in &bins {
            // a variance is known in proportion to itself
            let weight = n / v.powi(2).max(f64::MIN_POSITIVE);
            for (sum, value) in sums.iter_mut().zip([1.0, *b, b * b, *v, b * v]) {
                *sum += weight * value;
            }
        }
        let [w, wb, wbb, wv, wbv] = sums;
        let determinant = w * wbb - wb * wb;
        let slope = (w * wbv - wb * wv) / determinant;
        let even = (wv - slope * wb) / w;
        Some(match (even > 0.0, slope > 0.0) {
            (true, true) => Self {
                even,
                per_light: slope,
            },
            (false, true) => Self {
                even: 0.0,
                per_light: wbv / wbb,
            },
            _ => Self::even(wv / w),
        })
    }
}
