//! A posterior given by numbers alone: response surfaces, measured coefficients and their variances, in one JSON file.
//! Samplers are compared on it without a finite-element model.

use std::path::Path;

use serde::Deserialize;

use super::likelihood::Likelihood;
use super::posterior::Posterior;
use super::prior::Marginal;
use crate::error::{Error, Result};
use crate::laminate::Material;
use crate::reduce::{Surface, Variables};

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
    /// Of the four constants, independent and normal.
    pub prior: Priors,
    /// Points and their log posterior.
    #[serde(default)]
    pub test_points: Vec<TestPoint>,
    /// Known moments.
    #[serde(default)]
    pub reference: Option<TabulatedMoments>,
}

#[derive(Debug, Clone, Deserialize)]
pub struct Priors {
    pub mean: Vec<f64>,
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

/// Known moments of a tabulated posterior.
#[derive(Debug, Clone, Deserialize)]
pub struct TabulatedMoments {
    pub mean: Vec<f64>,
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
}
