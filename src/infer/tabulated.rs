//! A posterior given by numbers alone: response surfaces, measured coefficients and their variances, in one JSON file.
//! Samplers are compared on it without a finite-element model.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use super::likelihood::Likelihood;
use super::posterior::Posterior;
use super::prior::Marginal;
use crate::error::{Error, Result};
use crate::laminate::{Material, Ply, abd};
use crate::reduce::{Surface, Variables, exponents, monomial};

/// Response surfaces alpha_k = sum over j of `coefficients[j][k]` times the monomials of the scaled (E1, E2, nu12, G12, t),
/// with independent errors, and the laminate's thickness h = plies x t marginalised to first order.
#[derive(Debug, Clone, Deserialize)]
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
    /// Priors of the four constants.
    pub prior: Priors,
    /// Points and their log posterior.
    #[serde(default)]
    pub test_points: Vec<TestPoint>,
    /// Known moments.
    #[serde(default)]
    pub reference: Option<Moments>,
}

/// Independent normal priors.
#[derive(Debug, Clone, Deserialize)]
pub struct Priors {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub sd: Vec<f64>,
}

/// A point and its log posterior.
#[derive(Debug, Clone, Deserialize)]
pub struct TestPoint {
    /// E1, E2, nu12, G12 in GPa.
    pub p: Vec<f64>,
    /// Log posterior, normalised prior and likelihood.
    pub logp: f64,
}

/// Moments of the posterior.
#[derive(Debug, Clone, Deserialize)]
pub struct Moments {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub sd: Vec<f64>,
}

/// Names of the parameters.
const NAMES: [&str; 4] = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];

impl Tabulated {
    /// Read a file.
    pub fn load(path: &Path) -> Result<Self> {
        let place = path.display();
        let text = std::fs::read_to_string(path)
            .map_err(|e| Error::input(place, "a readable file").found(e))?;
        let place = path.display();
        let table: Self = serde_json::from_str(&text)
            .map_err(|e| Error::input(place, "a tabulated posterior in JSON").found(e))?;
        table.check().map_err(|e| e.within(path.display()))?;
        Ok(table)
    }

    /// A small one without a file: compliances of a [45,-45,0]s laminate about other constants, fitted by cubics.
    ///
    /// # Errors
    /// The program's fault if the fit fails.
    pub fn synthetic() -> Result<Self> {
        let (mid, half) = (
            [162.0, 7.58, 0.34, 4.41, 0.13],
            [48.0, 2.25, 0.09, 1.5, 0.02],
        );
        let scaling: Vec<[f64; 2]> = mid.iter().zip(half).map(|(m, h)| [*m, h]).collect();
        let variables = Variables::plain(Material::Ply, scaling, Some(4), 0.13);
        // An additive-recurrence (Kronecker) design: even, and without random numbers.
        let points: Vec<Vec<f64>> = (0..250)
            .map(|i| {
                let at = |k: usize| {
                    let step = 1.134_724_138_401_519_5_f64.powi(-(k as i32 + 1));
                    2.0 * (0.5 + step * f64::from(i)).fract() - 1.0
                };
                (0..5).map(|k| mid[k] + half[k] * at(k)).collect()
            })
            .collect();
        let fields: Vec<Vec<f64>> = points.iter().map(|p| compliances(p)).collect();
        let values: Vec<Vec<f64>> = (0..8)
            .map(|k| fields.iter().map(|f| f[k]).collect())
            .collect();
        let surface = Surface::fit(variables, 3, &points, &values)?;
        let exponents = exponents(5, 3);
        let coefficients = (0..exponents.len())
            .map(|m| surface.coefficients.iter().map(|c| c[m]).collect())
            .collect();
        let truth = compliances(&[140.0, 7.48, 0.33, 5.02, 0.13]);
        let size: Vec<f64> = truth.iter().map(|a| a.abs()).collect();
        Ok(Self {
            mid: mid.to_vec(),
            half: half.to_vec(),
            exponents,
            coefficients,
            alpha_measured: truth,
            variance: size.iter().map(|a| (0.004 * a).powi(2) + 6.25e-8).collect(),
            h0: 0.78,
            t0: 0.13,
            sigma_h: 0.005,
            prior: Priors {
                mean: vec![162.0, 7.58, 0.34, 4.41],
                sd: vec![16.0, 0.75, 0.03, 0.5],
            },
            test_points: Vec::new(),
            reference: None,
        })
    }

    fn check(&self) -> Result<()> {
        let (m, k) = (self.exponents.len(), self.alpha_measured.len());
        let positive = [
            &self.half[..],
            &self.variance,
            &self.prior.sd,
            &[self.h0, self.t0],
        ];
        let sound = k > 0
            && m > 0
            && self.sigma_h >= 0.0
            && positive
                .iter()
                .all(|values| values.iter().all(|v| *v >= f64::MIN_POSITIVE))
            && self
                .reference
                .as_ref()
                .is_none_or(|r| r.mean.len() == 4 && r.sd.len() == 4)
            && self.mid.len() == 5
            && self.half.len() == 5
            && self.exponents.iter().all(|e| e.len() == 5)
            && self.coefficients.len() == m
            && self.coefficients.iter().all(|c| c.len() == k)
            && self.variance.len() == k
            && self.prior.mean.len() == 4
            && self.prior.sd.len() == 4
            && self.test_points.iter().all(|t| t.p.len() == 4);
        if sound {
            return Ok(());
        }
        Err(Error::input(
            "shapes",
            "five variables, four priors, as many coefficients a monomial as measured, and half-widths, thicknesses, variances and sds above 0",
        ))
    }

    fn plies(&self) -> f64 {
        self.h0 / self.t0
    }

    /// Exponents, and the coefficients of each, with the monomials that only the derivative by the thickness has.
    fn complete(&self) -> (Vec<Vec<u8>>, Vec<Vec<f64>>) {
        let (mut exponents, mut coefficients) = (self.exponents.clone(), self.coefficients.clone());
        let mut next = 0;
        while next < exponents.len() {
            let mut lower = exponents[next].clone();
            next += 1;
            lower[4] = lower[4].saturating_sub(1);
            if !exponents.contains(&lower) {
                exponents.push(lower);
                coefficients.push(vec![0.0; self.alpha_measured.len()]);
            }
        }
        (exponents, coefficients)
    }

    /// The posterior, normalised as the formula says.
    pub fn posterior(&self) -> Posterior {
        let plies = self.plies();
        // The surface's fifth variable is the ply's thickness, the likelihood's the laminate's.
        let mut scaling: Vec<[f64; 2]> = self
            .mid
            .iter()
            .zip(&self.half)
            .map(|(m, h)| [*m, *h])
            .collect();
        scaling[4] = scaling[4].map(|v| v * plies);
        let k = self.alpha_measured.len();
        let (exponents, coefficients) = self.complete();
        let surface = Surface {
            variables: Variables::plain(Material::Ply, scaling, Some(4), self.h0),
            exponents,
            coefficients: (0..k)
                .map(|k| coefficients.iter().map(|c| c[k]).collect())
                .collect(),
            quality: Vec::new(),
        };
        let likelihood = Likelihood::with_variance(
            surface,
            &self.alpha_measured,
            &self.variance,
            (self.h0, self.sigma_h),
        );
        let prior = self.prior.mean.iter().zip(&self.prior.sd);
        let marginals = prior.map(|(&mean, &sd)| Marginal {
            mean,
            sd,
            truncate: None,
        });
        let logs: f64 = self.variance.iter().map(|v| v.ln()).sum();
        let tau = 2.0 * std::f64::consts::PI;
        Posterior::new(
            NAMES.map(String::from).to_vec(),
            Material::Ply,
            marginals.collect(),
            likelihood,
            1.0,
            Some(1.0),
        )
        .shifted(-0.5 * (logs + k as f64 * tau.ln()))
    }

    /// The log posterior by the formula as it stands: all monomials, a dense covariance, its Cholesky factor.
    pub fn dense(&self, x: &[f64]) -> f64 {
        let point = [x[0], x[1], x[2], x[3], self.t0];
        let z: Vec<f64> = (0..5)
            .map(|i| (point[i] - self.mid[i]) / self.half[i])
            .collect();
        let k = self.alpha_measured.len();
        let (mut r, mut slope) = (
            DVector::from_column_slice(&self.alpha_measured),
            DVector::zeros(k),
        );
        for (e, c) in self.exponents.iter().zip(&self.coefficients) {
            let c = DVector::from_column_slice(c);
            r -= monomial(e, &z) * &c;
            if e[4] > 0 {
                let mut lower = e.clone();
                lower[4] -= 1;
                slope += f64::from(e[4]) * monomial(&lower, &z) / self.half[4] / self.plies() * c;
            }
        }
        let covariance = DMatrix::from_diagonal(&DVector::from_column_slice(&self.variance))
            + self.sigma_h.powi(2) * &slope * slope.transpose();
        let Some(cholesky) = covariance.cholesky() else {
            return f64::NAN;
        };
        let whitened = cholesky.solve(&r).dot(&r);
        let prior: f64 = (0..4)
            .map(|i| {
                let marginal = Marginal {
                    mean: self.prior.mean[i],
                    sd: self.prior.sd[i],
                    truncate: None,
                };
                marginal.log_density(x[i])
            })
            .sum();
        let tau = 2.0 * std::f64::consts::PI;
        prior - 0.5 * (whitened + cholesky.ln_determinant() + k as f64 * tau.ln())
    }
}

/// Eight numbers in mm that a force-driven laminate of constants (GPa) and ply thickness (mm) could show.
fn compliances(point: &[f64]) -> Vec<f64> {
    let ply = Ply {
        e1: 1e3 * point[0],
        e2: 1e3 * point[1],
        nu12: point[2],
        g12: 1e3 * point[3],
    };
    let angles = [45.0, -45.0, 0.0, 0.0, -45.0, 45.0_f64].map(f64::to_radians);
    let a = abd(&ply, &angles, 6.0 * point[4]).a;
    let c = a.try_inverse().unwrap_or_default();
    let unit = 2e4;
    vec![
        unit * c[(0, 0)],
        0.1 * unit * (c[(2, 2)] - 2.0 * c[(0, 0)]),
        0.1 * unit * c[(1, 1)],
        0.03 * unit * (c[(0, 0)] * c[(2, 2)]).sqrt(),
        unit * c[(0, 1)],
        0.1 * unit * (c[(0, 0)] * c[(1, 1)]).sqrt(),
        0.03 * unit * c[(2, 2)],
        0.02 * unit * (c[(2, 2)] + c[(0, 1)]),
    ]
}
