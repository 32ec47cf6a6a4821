//! Targets with known moments and quantiles, shared by the tests of samplers.

use plychain::sample::{DensityError, LogDensity};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Quantile of parameter `.0` at probability `.1`.
type Quantile = Box<dyn Fn(usize, f64) -> Option<f64> + Sync>;

/// A log density.
type Density = Box<dyn Fn(&[f64]) -> f64 + Sync>;

/// A target whose answers are known.
pub struct Known {
    /// For messages.
    pub name: &'static str,
    names: Vec<String>,
    density: Density,
    /// Exact means.
    pub mean: Vec<f64>,
    /// Exact standard deviations.
    pub sd: Vec<f64>,
    /// Exact marginal quantiles, where they are known.
    pub quantile: Quantile,
}

impl LogDensity for Known {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> Result<f64, DensityError> {
        DensityError::sort((self.density)(x))
    }
}

impl Known {
    fn new(
        name: &'static str,
        mean: Vec<f64>,
        sd: Vec<f64>,
        quantile: Quantile,
        density: Density,
    ) -> Self {
        let names = (0..mean.len()).map(|k| format!("x{k}")).collect();
        Self {
            name,
            names,
            density,
            mean,
            sd,
            quantile,
        }
    }

    /// Diagonal guess of the covariance, from the exact sds.
    pub fn diagonal(&self) -> Vec<f64> {
        let dim = self.sd.len();
        let mut guess = vec![0.0; dim * dim];
        for (k, sd) in self.sd.iter().enumerate() {
            guess[k * dim + k] = sd * sd;
        }
        guess
    }
}

/// Quantile of the standard normal.
pub fn probit(p: f64) -> f64 {
    Normal::standard().inverse_cdf(p)
}

/// Every target a sampler must get right.
pub fn all() -> Vec<Known> {
    vec![
        correlated(5, 1e6),
        bounded(),
        bimodal(),
        student(3, 5.0),
        banana(),
    ]
}

/// Normal in `dim` dimensions whose covariance has eigenvalues from 1 to `condition` along directions that are no axes.
pub fn correlated(dim: usize, condition: f64) -> Known {
    let value = |k: usize| condition.powf(k as f64 / (dim as f64 - 1.0).max(1.0));
    // Householder reflection of a vector with all entries different.
    let v: Vec<f64> = (0..dim).map(|k| 1.0 + 0.5 * k as f64).collect();
    let norm2: f64 = v.iter().map(|v| v * v).sum();
    let q = move |i: usize, j: usize| f64::from(u8::from(i == j)) - 2.0 * v[i] * v[j] / norm2;
    let sd: Vec<f64> = (0..dim)
        .map(|i| {
            (0..dim)
                .map(|k| q(i, k).powi(2) * value(k))
                .sum::<f64>()
                .sqrt()
        })
        .collect();
    let mean: Vec<f64> = (0..dim).map(|k| 10.0 * k as f64).collect();
    let (m, s) = (mean.clone(), sd.clone());
    let centre = mean.clone();
    Known::new(
        "correlated normal",
        mean,
        sd,
        Box::new(move |k, p| Some(m[k] + s[k] * probit(p))),
        Box::new(move |x| {
            let along = |k: usize| -> f64 { (0..dim).map(|i| q(i, k) * (x[i] - centre[i])).sum() };
            (0..dim)
                .map(|k| {
                    -0.5 * along(k).powi(2) / condition.powf(k as f64 / (dim as f64 - 1.0).max(1.0))
                })
                .sum()
        }),
    )
}

/// Uniform on [0, 1] times a half-normal.
fn bounded() -> Known {
    let half = 2.0 / std::f64::consts::PI;
    Known::new(
        "bounded",
        vec![0.5, half.sqrt()],
        vec![(1.0f64 / 12.0).sqrt(), (1.0 - half).sqrt()],
        Box::new(|k, p| Some(if k == 0 { p } else { probit(0.5 + 0.5 * p) })),
        Box::new(|x| {
            if (0.0..=1.0).contains(&x[0]) && x[1] >= 0.0 {
                -0.5 * x[1] * x[1]
            } else {
                f64::NEG_INFINITY
            }
        }),
    )
}

/// 0.3 N((-3, 0), I) + 0.7 N((3, 0), I).
fn bimodal() -> Known {
    let cdf = |x: f64| {
        let normal = Normal::standard();
        0.3 * normal.cdf(x + 3.0) + 0.7 * normal.cdf(x - 3.0)
    };
    let invert = move |p: f64| {
        let (mut low, mut high) = (-12.0, 12.0);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if cdf(middle) < p {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    };
    Known::new(
        "bimodal",
        vec![1.2, 0.0],
        vec![(1.0f64 + 9.0 - 1.44).sqrt(), 1.0],
        Box::new(move |k, p| Some(if k == 0 { invert(p) } else { probit(p) })),
        Box::new(|x| {
            let low = 0.3f64.ln() - 0.5 * (x[0] + 3.0).powi(2);
            let high = 0.7f64.ln() - 0.5 * (x[0] - 3.0).powi(2);
            let top = low.max(high);
            top + ((low - top).exp() + (high - top).exp()).ln() - 0.5 * x[1] * x[1]
        }),
    )
}

/// Student-t of `dof` degrees of freedom and unit shape.
pub fn student(dim: usize, dof: f64) -> Known {
    let sd = (dof / (dof - 2.0)).sqrt();
    Known::new(
        "Student-t",
        vec![0.0; dim],
        vec![sd; dim],
        Box::new(move |_, p| StudentsT::new(0.0, 1.0, dof).ok().map(|t| t.inverse_cdf(p))),
        Box::new(move |x| {
            let norm2: f64 = x.iter().map(|v| v * v).sum();
            -0.5 * (dof + dim as f64) * (norm2 / dof).ln_1p()
        }),
    )
}

/// x0 normal, x1 normal about 0.5 (x0^2 - 1).
pub fn banana() -> Known {
    Known::new(
        "banana",
        vec![0.0, 0.0],
        vec![1.0, (0.25f64 + 0.5).sqrt()],
        Box::new(|k, p| (k == 0).then(|| probit(p))),
        Box::new(|x| {
            let r = (x[1] - 0.5 * (x[0] * x[0] - 1.0)) / 0.5;
            -0.5 * (x[0] * x[0] + r * r)
        }),
    )
}

/// Neal's funnel: v ~ N(0, 3^2), nine x ~ N(0, exp(v)). Known to be hard: it must be flagged.
pub fn funnel() -> Known {
    Known::new(
        "funnel",
        vec![0.0; 10],
        vec![3.0; 10],
        Box::new(|_, _| None),
        Box::new(|x| {
            let sum: f64 = x[1..].iter().map(|v| v * v).sum();
            -x[0] * x[0] / 18.0 - 0.5 * sum * (-x[0]).exp() - 0.5 * (x.len() as f64 - 1.0) * x[0]
        }),
    )
}

/// Any density, without answers.
pub fn custom(dim: usize, density: impl Fn(&[f64]) -> f64 + Sync + 'static) -> Known {
    Known::new(
        "custom",
        vec![0.0; dim],
        vec![1.0; dim],
        Box::new(|_, _| None),
        Box::new(density),
    )
}

/// x0 normal, x1 normal with this sd about x0^2 - 1: the thinner, the harder.
pub fn bent(sd: f64) -> Known {
    Known::new(
        "bent",
        vec![0.0, 0.0],
        vec![1.0, (2.0 + sd * sd).sqrt()],
        Box::new(|k, p| (k == 0).then(|| probit(p))),
        Box::new(move |x| {
            let r = (x[1] - (x[0] * x[0] - 1.0)) / sd;
            -0.5 * (x[0] * x[0] + r * r)
        }),
    )
}

/// A ring: the distance from the origin is normal, times itself for the circumference.
pub fn ring(radius: f64, sd: f64) -> Known {
    // E r^3 / E r of a normal
    let second = 0.5 * (radius * radius + 3.0 * sd * sd);
    Known::new(
        "ring",
        vec![0.0; 2],
        vec![second.sqrt(); 2],
        Box::new(|_, _| None),
        Box::new(move |x| -0.5 * ((x[0].hypot(x[1]) - radius) / sd).powi(2)),
    )
}

/// 0.3 N(-a, I) + 0.7 N(a, I), a along the first axis.
pub fn far_apart(dim: usize, a: f64) -> Known {
    let mut mean = vec![0.0; dim];
    let mut sd = vec![1.0; dim];
    (mean[0], sd[0]) = (0.4 * a, (1.0 + 0.84 * a * a).sqrt());
    Known::new(
        "far apart",
        mean,
        sd,
        Box::new(|_, _| None),
        Box::new(move |x| {
            let low = 0.3f64.ln() - 0.5 * (x[0] + a).powi(2);
            let high = 0.7f64.ln() - 0.5 * (x[0] - a).powi(2);
            let top = low.max(high);
            let rest: f64 = x[1..].iter().map(|v| v * v).sum();
            top + ((low - top).exp() + (high - top).exp()).ln() - 0.5 * rest
        }),
    )
}
