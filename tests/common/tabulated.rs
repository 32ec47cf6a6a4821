//! A posterior given by numbers alone: response surfaces, measured coefficients and their variances, in one JSON file.
//! Samplers are compared on it without a finite-element model.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use plychain::infer::{Likelihood, Marginal, Posterior, Statistics};
use plychain::laminate::Material;
use plychain::reduce::{Choice, CrossValidation, Quality, ReducedModel, Surface};
use serde::Deserialize;
use serde_json::json;

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

/// Names of the parameters.
const NAMES: [&str; 4] = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];

impl Tabulated {
    /// The article's plate.
    pub fn load() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(root.join("tests/bench/openhole_posterior.json"));
        serde_json::from_str(&text.unwrap()).unwrap()
    }

    /// What [`Tabulated::posterior`] leaves out of the log density.
    pub fn constant(&self) -> f64 {
        let tau = std::f64::consts::TAU;
        -0.5 * self.variance.iter().map(|v| (tau * v).ln()).sum::<f64>()
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

    fn surface(&self) -> Surface {
        // The surface's fifth variable is the ply's thickness, the likelihood's the laminate's.
        let middles = self.mid.iter().zip(&self.half);
        let mut scaling: Vec<[f64; 2]> = middles.map(|(m, h)| [*m, *h]).collect();
        scaling[4] = scaling[4].map(|v| v * self.h0 / self.t0);
        let variables = json!({
            "choice": Choice::Plain,
            "material": Material::Ply,
            "constants": 4,
            "thickness": 4,
            "scaling": scaling,
            "reference": 1.0,
            "nominal_thickness": self.h0,
        });
        let (exponents, coefficients) = self.complete();
        let of = |k: usize| coefficients.iter().map(|c| c[k]).collect();
        // all of the error is the surface's own
        let quality = self.variance.iter().map(|v| Quality {
            mean: 0.0,
            mean_abs: 0.0,
            sd: 0.0,
            r2: 1.0,
            rms: 0.0,
            press: v.sqrt(),
        });
        Surface {
            variables: serde_json::from_value(variables).unwrap(),
            exponents,
            coefficients: (0..self.alpha_measured.len()).map(of).collect(),
            quality: quality.collect(),
        }
    }

    /// The posterior, its likelihood without the factor that does not depend on the parameters.
    pub fn posterior(&self) -> Posterior {
        /// Precision of the measured coefficients over that of the surface: the noise adds nothing.
        const EXACT: f64 = 1e20;
        let precision = DVector::from_vec(self.variance.iter().map(|v| EXACT / v).collect());
        let measured = DVector::from_column_slice(&self.alpha_measured);
        let statistics = Statistics {
            weighted: precision.component_mul(&measured),
            precision: DMatrix::from_diagonal(&precision),
            effect_offset: DVector::zeros(0),
            effect_slope: DMatrix::zeros(0, measured.len()),
            effect_covariance: DMatrix::zeros(0, 0),
            residual: 0.0,
            count: 0,
            freedom: 0.0,
        };
        let surface = self.surface();
        let none = CrossValidation {
            mm: Vec::new(),
            percent: Vec::new(),
        };
        let reduced = ReducedModel {
            dimensions: Vec::new(),
            modes: Default::default(),
            plain: surface.clone(),
            surface,
            truncation: Default::default(),
            cross_validation: [none.clone(), none],
            snapshots: 0,
            mesh_size: [0; 2],
        };
        let thickness = (self.h0, self.sigma_h);
        let likelihood = Likelihood::new(&statistics, &reduced, 0.0, thickness).unwrap();
        let prior = self.prior.mean.iter().zip(&self.prior.sd);
        let marginals = prior.map(|(&mean, &sd)| Marginal {
            mean,
            sd,
            truncate: None,
        });
        Posterior::new(
            NAMES.map(String::from).to_vec(),
            Material::Ply,
            marginals.collect(),
            likelihood,
            1.0,
            Some(1.0),
        )
    }
}
