//! The variables of a response surface: the parameters themselves, or ratios in which the physics is simple.

use serde::{Deserialize, Serialize};

use super::design::THICKNESS;
use super::problem::Problem;
use crate::experiment::load_response;
use crate::laminate::Material;

/// Which variables a surface is a polynomial of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// Every parameter as it is, the thickness among them (the article's).
    Plain,
    /// A force-driven field is 1 / (h E1) times a function of the ratios E2/E1, G12/E1 and of nu12: exact in the
    /// thickness and in a common factor of the moduli.
    Ratios,
}

/// Map from parameters (border units) to the surface's scaled variables and its common factor.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Variables {
    pub choice: Choice,
    material: Material,
    constants: usize,
    thickness: Option<usize>,
    /// Middle and half-width of each variable over the design.
    scaling: Vec<[f64; 2]>,
    /// Reference E h that makes the factor dimensionless.
    reference: f64,
    nominal_thickness: f64,
}

impl Variables {
    /// Variables of a problem, scaled to [-1, 1] over the design `points`.
    pub fn new(choice: Choice, problem: &Problem, points: &[Vec<f64>]) -> Self {
        let mut variables = Self {
            choice,
            material: problem.material(),
            constants: problem.constants(),
            thickness: problem.dimensions.iter().position(|d| d.name == THICKNESS),
            scaling: Vec::new(),
            reference: 1.0,
            nominal_thickness: problem.thickness_mm(),
        };
        let raw: Vec<Vec<f64>> = points.iter().map(|p| variables.raw(p)).collect();
        let count = raw.first().map_or(0, Vec::len);
        variables.scaling = (0..count)
            .map(|k| {
                let (low, high) = raw
                    .iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
                        (a.min(z[k]), b.max(z[k]))
                    });
                [
                    0.5 * (low + high),
                    (0.5 * (high - low)).max(f64::MIN_POSITIVE),
                ]
            })
            .collect();
        if choice == Choice::Ratios {
            let total: f64 = points
                .iter()
                .map(|p| variables.thickness_of(p) * p[0])
                .sum();
            variables.reference = total / points.len().max(1) as f64;
        }
        variables
    }

    /// Number of variables.
    pub fn count(&self) -> usize {
        self.scaling.len()
    }

    /// Scaled variables at a point.
    pub fn scaled(&self, point: &[f64]) -> Vec<f64> {
        let mut z = self.raw(point);
        for (z, [mid, half]) in z.iter_mut().zip(&self.scaling) {
            *z = (*z - mid) / half;
        }
        z
    }

    /// The factor that multiplies the polynomial.
    pub fn factor(&self, point: &[f64]) -> f64 {
        match self.choice {
            Choice::Plain => 1.0,
            Choice::Ratios => self.reference * load_response(point[0], self.thickness_of(point)),
        }
    }

    fn thickness_of(&self, point: &[f64]) -> f64 {
        self.thickness.map_or(self.nominal_thickness, |k| point[k])
    }

    fn raw(&self, point: &[f64]) -> Vec<f64> {
        let mut z = match (self.choice, self.material) {
            (Choice::Plain, _) => return point.to_vec(),
            (Choice::Ratios, Material::Ply) => {
                vec![point[1] / point[0], point[2], point[3] / point[0]]
            }
            (Choice::Ratios, Material::Isotropic) => vec![point[1]],
        };
        // the thickness stands last, and is in the factor
        let amplitudes = self.constants..self.thickness.unwrap_or(point.len());
        z.extend_from_slice(&point[amplitudes]);
        z
    }
}
