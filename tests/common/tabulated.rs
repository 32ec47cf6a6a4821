//! A posterior given by numbers alone: response surfaces, measured coefficients and their variances, in one JSON file.
//! Samplers are compared on it without a finite-element model.

use std::path::Path;

use plychain::sample::{DensityError, LogDensity};
use serde::Deserialize;

/// Response surfaces alpha_k = sum over j of `coefficients[j][k]` times the monomials of the scaled (E1, E2, nu12, G12, t),
/// with independent errors, and the laminate's thickness h = plies x t marginalised to first order.
#[derive(Deserialize)]
pub struct Tabulated {
    /// Middle of each variable.
    pub mid: Vec<f64>,
    /// Half-width of each variable.
    pub half: Vec<f64>,
    /// Exponents of each monomial.
    pub exponents: Vec<Vec<u8>>,
    /// Coefficients, monomial x POD coefficient, mm.
    pub coefficients: Vec<Vec<f64>>,
    /// Measured POD coefficients, mm.
    pub alpha_measured: Vec<f64>,
    /// Their variances, mm^2.
    #[serde(rename = "D_diag_var")]
    pub variance: Vec<f64>,
    /// Laminate thickness, mm.
    pub h0: f64,
    /// Ply thickness, mm.
    pub t0: f64,
    /// Sd of the laminate thickness, mm.
    pub sigma_h: f64,
    /// Of the four constants, independent and normal.
    pub prior: Moments,
    /// Points and their log posterior.
    pub test_points: Vec<TestPoint>,
    /// Known moments.
    pub reference: Moments,
}

#[derive(Deserialize)]
pub struct Moments {
    pub mean: Vec<f64>,
    pub sd: Vec<f64>,
}

/// A point and its log posterior.
#[derive(Deserialize)]
pub struct TestPoint {
    /// E1, E2, nu12, G12 in GPa.
    pub p: Vec<f64>,
    /// Log posterior, normalised prior and likelihood.
    pub logp: f64,
}

impl Tabulated {
    /// The article's plate.
    pub fn load() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(root.join("tests/bench/openhole_posterior.json"));
        serde_json::from_str(&text.unwrap()).unwrap()
    }

    /// The posterior, its likelihood without the factor that does not depend on the parameters.
    pub fn posterior(self) -> TabulatedPosterior {
        TabulatedPosterior {
            names: ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"]
                .map(String::from)
                .to_vec(),
            table: self,
        }
    }
}

/// The density of a table, by the formula as it stands.
pub struct TabulatedPosterior {
    names: Vec<String>,
    pub table: Tabulated,
}

impl TabulatedPosterior {
    /// What it leaves out of the log density.
    pub fn constant(&self) -> f64 {
        let tau = std::f64::consts::TAU;
        let variances = self.table.variance.iter();
        -0.5 * variances.map(|v| (tau * v).ln()).sum::<f64>()
    }

    /// Prior means, to start from, and sds.
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let prior = &self.table.prior;
        (prior.mean.clone(), prior.sd.clone())
    }

    /// Residuals over their sds, and the response to the thickness for one sd of it, alike.
    fn scaled(&self, x: &[f64]) -> Vec<[f64; 2]> {
        let t = &self.table;
        let point = [x[0], x[1], x[2], x[3], t.t0];
        let z: Vec<f64> = (0..5).map(|i| (point[i] - t.mid[i]) / t.half[i]).collect();
        let per_h = t.t0 / t.h0 / t.half[4];
        let mut all: Vec<[f64; 2]> = t.alpha_measured.iter().map(|a| [*a, 0.0]).collect();
        for (e, c) in t.exponents.iter().zip(&t.coefficients) {
            let power = |i: usize, e: u8| z[i].powi(i32::from(e));
            let others: f64 = (0..4).map(|i| power(i, e[i])).product();
            let slope = match e[4] {
                0 => 0.0,
                n => f64::from(n) * power(4, n - 1) * per_h,
            };
            for (sum, c) in all.iter_mut().zip(c) {
                sum[0] -= others * power(4, e[4]) * c;
                sum[1] += others * slope * c * t.sigma_h;
            }
        }
        let scaled = all.iter().zip(&t.variance);
        scaled.map(|(r, v)| r.map(|r| r / v.sqrt())).collect()
    }
}

impl LogDensity for TabulatedPosterior {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> Result<f64, DensityError> {
        let is_ply = x[0] > 0.0 && x[1] > 0.0 && x[3] > 0.0 && x[2] * x[2] < x[0] / x[1];
        if !is_ply {
            return Err(DensityError::Outside);
        }
        let scaled = self.scaled(x);
        let of = |a: usize, b: usize| scaled.iter().map(|r| r[a] * r[b]).sum::<f64>();
        let precision = 1.0 + of(1, 1);
        let likelihood = -0.5 * (of(0, 0) - of(0, 1).powi(2) / precision + precision.ln());
        let prior = x
            .iter()
            .zip(self.table.prior.mean.iter().zip(&self.table.prior.sd));
        let log = |(x, (mean, sd)): (&f64, (&f64, &f64))| {
            -0.5 * (((x - mean) / sd).powi(2) + std::f64::consts::TAU.ln()) - sd.ln()
        };
        Ok(likelihood + prior.map(log).sum::<f64>())
    }
}
