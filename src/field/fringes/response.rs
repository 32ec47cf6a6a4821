//! The detector's response: recorded intensities as a light intensity, x -> (2 x)^p / 2 + q x (1 - x) (1 - 2 x), x in shares of the largest value (its half
//! stays what it is). A response that is
//! not straight gives fringes harmonics, which least squares of a sinusoid take for phase.

/// Exponent and cubic part of the inverse response; (1, 0) is a straight one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    pub ln_exponent: f64,
    pub cubic: f64,
}

impl Response {
    pub const STRAIGHT: Self = Self {
        ln_exponent: 0.0,
        cubic: 0.0,
    };

    /// The power of the light that the detector records, near half of the largest value.
    pub fn gamma(&self) -> f64 {
        1.0 / (self.ln_exponent.exp() - 0.5 * self.cubic)
    }

    /// Light intensity of every recorded value up to `largest`, in a unit in which the response has slope 1 on (geometric) average over
    /// the intensities that `histogram` counts: residuals of different responses are then comparable (Box and Cox, J. R. Stat. Soc. B 26
    /// (1964) 211).
    pub fn table(&self, histogram: &[(u16, f64)], largest: u16) -> Vec<f64> {
        if *self == Self::STRAIGHT {
            return (0..=largest).map(f64::from).collect();
        }
        let full = f64::from(largest);
        let exponent = self.ln_exponent.exp();
        let light =
            |x: f64| 0.5 * (2.0 * x).powf(exponent) + self.cubic * x * (1.0 - x) * (1.0 - 2.0 * x);
        let slope = |x: f64| {
            exponent * (2.0 * x).powf(exponent - 1.0) + self.cubic * (1.0 - 6.0 * x + 6.0 * x * x)
        };
        let (mut sum, mut count) = (0.0, 0.0);
        for (value, times) in histogram {
            // the middle of the recorded step; black has no finite slope
            let x = f64::from(*value).max(0.5) / full;
            sum += times * slope(x).max(1e-3).ln();
            count += times;
        }
        let unit = full / (sum / f64::max(count, 1.0)).exp();
        (0..=largest)
            .map(|value| unit * light(f64::from(value) / full))
            .collect()
    }
}
