//! The vibrating specimen: what its stiffness and inertia depend on, with derivatives.

use nalgebra::{Matrix2, Matrix3};

use super::theory::{EdgeLayers, PAIRS, TWISTING, strain_scale};
use crate::error::{Error, Result};
use crate::laminate::{Constant, PlateStiffness, Ply, stacked, stiffness_slope, transverse};

/// Number of stiffness terms: the six of D and the three of S, in the order of `PAIRS`.
pub const STIFFNESSES: usize = PAIRS.len();

/// Number of inertia terms: translation, rotation in x and in y, air, point mass.
pub const INERTIAS: usize = 5;

/// omega^2 (1/s^2) of 1 Hz.
pub const HZ_LAMBDA: f64 = 4.0 * std::f64::consts::PI * std::f64::consts::PI;

/// Factors of the stored matrices: K = sum of `stiffness` times stiffness matrices, M alike. Consistent units of N, mm, t, s.
#[derive(Debug, Clone, Copy)]
pub struct PlateCoefficients {
    pub stiffness: [f64; STIFFNESSES],
    pub inertia: [f64; INERTIAS],
}

/// The plate's weight, as it is known.
#[derive(Debug, Clone, Copy)]
pub enum Weight {
    /// Weighed: mass, t. Frequencies then do not depend on the thickness but through the stiffness.
    Mass(f64),
    /// Density, t/mm^3 (1600 kg/m^3 = 1.6e-9).
    Density(f64),
}

/// Transverse shear moduli of a ply, MPa, where they are known.
#[derive(Debug, Clone, Copy, Default)]
pub struct TransverseShear {
    /// Without it G13 = G12, as in any transversely isotropic ply.
    pub g13: Option<f64>,
    /// Without it G23 = E2 / (2 (1 + nu23)).
    pub g23: Option<f64>,
    /// Without it nu23 = nu12, which makes G23 the shear modulus of an isotropic ply.
    pub nu23: Option<f64>,
}

/// A rectangular laminate of equal plies; lengths in mm, moduli in MPa, angles in rad from the direction of `length`.
#[derive(Debug, Clone)]
pub struct VibratingPlate {
    pub length: f64,
    pub width: f64,
    pub thickness: f64,
    pub weight: Weight,
    pub ply: Ply,
    pub transverse: TransverseShear,
    pub angles: Vec<f64>,
    /// Density of the surrounding air, t/mm^3 (1.2 kg/m^3 = 1.2e-12); 0 leaves the air out.
    pub air_density: f64,
    /// Mass of a body at the point that the model declares, t; 0 without one.
    pub point_mass: f64,
}

/// What a frequency depends on; units as in [`VibratingPlate`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlateParameter {
    E1,
    E2,
    Nu12,
    G12,
    G13,
    G23,
    Thickness,
    Length,
    Width,
    /// Mass or density, whichever the plate declares.
    Weight,
    AirDensity,
    PointMass,
    /// Young's modulus of an isotropic material: E1, E2 and G12 at once.
    E,
    /// Poisson's ratio of an isotropic material: nu12 and G12 at once.
    Nu,
}

impl VibratingPlate {
    /// Refuse dimensions, masses and constants that no plate has, and stacks that couple bending with stretching.
    ///
    /// # Errors
    /// The input's fault; the place is the key of the model file.
    pub fn validate(&self) -> Result<()> {
        let weight = match self.weight {
            Weight::Mass(m) => ("specimen.mass_g", m),
            Weight::Density(rho) => ("specimen.density_kg_m3", rho),
        };
        let dimensions = [
            ("specimen.length_mm", self.length),
            ("specimen.width_mm", self.width),
            ("specimen.thickness_mm", self.thickness),
            weight,
            ("material.G13_GPa", self.g13()),
            ("material.G23_GPa", self.g23()),
        ];
        for (place, value) in dimensions {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::input(place, "a number above 0").found(value));
            }
        }
        for (place, value) in [
            ("air density", self.air_density),
            ("point mass", self.point_mass),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::input(place, "a number of at least 0").found(value));
            }
        }
        self.ply.admissible("material")?;
        self.validate_symmetry()
    }

    fn validate_symmetry(&self) -> Result<()> {
        const PLACE: &str = "specimen.layup_deg";
        /// Share of sqrt(|A| |D|) up to which a coupling is rounding.
        const ROUNDING: f64 = 1e-9;
        if self.angles.is_empty() {
            return Err(Error::input(PLACE, "at least one ply angle").found("[]"));
        }
        let abd = stacked(&self.ply.stiffness(), &self.angles, self.thickness);
        if abd.b.norm() <= ROUNDING * (abd.a.norm() * abd.d.norm()).sqrt() {
            return Ok(());
        }
        let degrees: Vec<f64> = self.angles.iter().map(|a| a.to_degrees()).collect();
        Err(Error::input(PLACE, "a symmetric stack")
            .found(format!("{degrees:?}"))
            .hint("a stack that couples bending with stretching has other frequencies than its D says"))
    }

    /// Transverse shear modulus G13 in force, MPa.
    pub fn g13(&self) -> f64 {
        self.transverse.g13.unwrap_or(self.ply.g12)
    }

    /// Transverse shear modulus G23 in force, MPa.
    pub fn g23(&self) -> f64 {
        let isotropic = self.ply.e2 / (2.0 * (1.0 + self.nu23()));
        self.transverse.g23.unwrap_or(isotropic)
    }

    fn nu23(&self) -> f64 {
        self.transverse.nu23.unwrap_or(self.ply.nu12)
    }

    /// Mass per area, t/mm^2.
    pub fn mass_per_area(&self) -> f64 {
        match self.weight {
            Weight::Mass(m) => m / (self.length * self.width),
            Weight::Density(rho) => rho * self.thickness,
        }
    }

    /// The layers at free edges. Where the other rotation and the other shear force adapt, D66* theta_yy = S11* (w_x + theta) at an edge
    /// across y: decay length sqrt(D66* / S11*), h / sqrt(10) of an isotropic plate (E. Reissner, J. Appl. Mech. 12 (1945) A69).
    pub fn edge_layers(&self) -> EdgeLayers {
        let d = stacked(&self.ply.stiffness(), &self.angles, self.thickness).d;
        let s = transverse(self.g13(), self.g23(), &self.angles, self.thickness);
        let side = [self.length, self.width];
        let lengths = std::array::from_fn(|axis| {
            let along = 1 - axis;
            let twist = d[(2, 2)] - d[(axis, 2)].powi(2) / d[(axis, axis)];
            let shear = s[(along, along)] - s[(0, 1)].powi(2) / s[(axis, axis)];
            2.0 * (twist / shear).sqrt() / side[axis]
        });
        EdgeLayers {
            lengths,
            coupled: is_twisting(&self.coefficients()),
        }
    }

    /// The value of a parameter.
    pub fn get(&self, parameter: PlateParameter) -> f64 {
        match parameter {
            PlateParameter::E1 => self.ply.e1,
            PlateParameter::E2 => self.ply.e2,
            PlateParameter::Nu12 => self.ply.nu12,
            PlateParameter::G12 => self.ply.g12,
            PlateParameter::G13 => self.g13(),
            PlateParameter::G23 => self.g23(),
            PlateParameter::Thickness => self.thickness,
            PlateParameter::Length => self.length,
            PlateParameter::Width => self.width,
            PlateParameter::Weight => match self.weight {
                Weight::Mass(value) | Weight::Density(value) => value,
            },
            PlateParameter::AirDensity => self.air_density,
            PlateParameter::PointMass => self.point_mass,
            PlateParameter::E => self.ply.e1,
            PlateParameter::Nu => self.ply.nu12,
        }
    }

    /// The plate with another value of a parameter; a transverse modulus is declared from then on.
    #[must_use]
    pub fn with(mut self, parameter: PlateParameter, value: f64) -> Self {
        let place = match parameter {
            PlateParameter::E1 => &mut self.ply.e1,
            PlateParameter::E2 => &mut self.ply.e2,
            PlateParameter::Nu12 => &mut self.ply.nu12,
            PlateParameter::G12 => &mut self.ply.g12,
            PlateParameter::G13 => self.transverse.g13.insert(value),
            PlateParameter::G23 => self.transverse.g23.insert(value),
            PlateParameter::Thickness => &mut self.thickness,
            PlateParameter::Length => &mut self.length,
            PlateParameter::Width => &mut self.width,
            PlateParameter::Weight => match &mut self.weight {
                Weight::Mass(place) | Weight::Density(place) => place,
            },
            PlateParameter::AirDensity => &mut self.air_density,
            PlateParameter::PointMass => &mut self.point_mass,
            PlateParameter::E | PlateParameter::Nu => {
                let [e, nu] = match parameter {
                    PlateParameter::E => [value, self.ply.nu12],
                    _ => [self.ply.e1, value],
                };
                self.ply = Ply::isotropic(e, nu);
                return self;
            }
        };
        *place = value;
        self
    }

    pub fn stiffness(&self) -> PlateStiffness {
        PlateStiffness {
            bending: stacked(&self.ply.stiffness(), &self.angles, self.thickness).d,
            shear: transverse(self.g13(), self.g23(), &self.angles, self.thickness),
        }
    }

    /// Factors of the stored matrices.
    pub fn coefficients(&self) -> PlateCoefficients {
        let PlateStiffness { bending, shear } = self.stiffness();
        self.assembled(&bending, &shear)
    }

    /// With bending stiffness `d` (N mm) and transverse shear stiffness `s` (N/mm).
    fn assembled(&self, d: &Matrix3<f64>, s: &Matrix2<f64>) -> PlateCoefficients {
        let (a, b) = (self.length, self.width);
        let quarter = 0.25 * a * b;
        let scale = strain_scale(a, b);
        let translation = quarter * self.mass_per_area();
        let rotation = translation * self.thickness * self.thickness / 12.0;
        PlateCoefficients {
            stiffness: PAIRS.map(|[i, j]| {
                let law = if i < 3 { d[(i, j)] } else { s[(i - 3, j - 3)] };
                law * scale[i] * scale[j] * quarter
            }),
            inertia: [
                translation,
                rotation * 4.0 / (a * a),
                rotation * 4.0 / (b * b),
                self.air_density * quarter * (a * b).sqrt(),
                self.point_mass,
            ],
        }
    }

    /// Derivative of [`VibratingPlate::coefficients`] by a parameter. Of the air, whose matrix knows one ratio of the sides only, lengths change the
    /// scale alone.
    pub fn slope(&self, parameter: PlateParameter) -> PlateCoefficients {
        let constant = |which| self.constant_slope(which);
        let zero = PlateCoefficients {
            stiffness: [0.0; STIFFNESSES],
            inertia: [0.0; INERTIAS],
        };
        match parameter {
            PlateParameter::E1 => constant(Constant::E1),
            PlateParameter::E2 => constant(Constant::E2),
            PlateParameter::Nu12 => constant(Constant::Nu12),
            PlateParameter::G12 => constant(Constant::G12),
            PlateParameter::G13 => self.stiffness_only(&Matrix3::zeros(), [1.0, 0.0]),
            PlateParameter::G23 => self.stiffness_only(&Matrix3::zeros(), [0.0, 1.0]),
            PlateParameter::Thickness
            | PlateParameter::Length
            | PlateParameter::Width
            | PlateParameter::Weight => self.power_slope(parameter),
            PlateParameter::AirDensity => {
                let quarter = 0.25 * self.length * self.width;
                let air = quarter * (self.length * self.width).sqrt();
                PlateCoefficients {
                    inertia: [0.0, 0.0, 0.0, air, 0.0],
                    ..zero
                }
            }
            PlateParameter::PointMass => PlateCoefficients {
                inertia: [0.0, 0.0, 0.0, 0.0, 1.0],
                ..zero
            },
            PlateParameter::E => sum(&[
                (1.0, constant(Constant::E1)),
                (1.0, constant(Constant::E2)),
                (self.ply.g12 / self.ply.e1, constant(Constant::G12)),
            ]),
            PlateParameter::Nu => sum(&[
                (1.0, constant(Constant::Nu12)),
                (
                    -self.ply.g12 / (1.0 + self.ply.nu12),
                    constant(Constant::G12),
                ),
            ]),
        }
    }

    /// By an elastic constant, through Q and through the transverse moduli that follow from it.
    fn constant_slope(&self, constant: Constant) -> PlateCoefficients {
        let q = stiffness_slope(&self.ply, constant);
        let g13 = match (constant, self.transverse.g13) {
            (Constant::G12, None) => 1.0,
            _ => 0.0,
        };
        let g23 = match (constant, self.transverse.g23) {
            (Constant::E2, None) => self.g23() / self.ply.e2,
            (Constant::Nu12, None) if self.transverse.nu23.is_none() => {
                -self.g23() / (1.0 + self.ply.nu12)
            }
            _ => 0.0,
        };
        let d = stacked(&q, &self.angles, self.thickness).d;
        self.stiffness_only(&d, [g13, g23])
    }

    fn stiffness_only(&self, d: &Matrix3<f64>, [g13, g23]: [f64; 2]) -> PlateCoefficients {
        let s = transverse(g13, g23, &self.angles, self.thickness);
        PlateCoefficients {
            inertia: [0.0; INERTIAS],
            ..self.assembled(d, &s)
        }
    }

    /// By a parameter of which every coefficient is a power: the exponents over the value.
    fn power_slope(&self, parameter: PlateParameter) -> PlateCoefficients {
        let weighed = matches!(self.weight, Weight::Mass(_));
        // exponents of a strain's scale are -orders, of the quarter 1
        let orders = [[2.0, 0.0], [0.0, 2.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        let along = |axis: usize| {
            let stiffness = PAIRS.map(|[i, j]: [usize; 2]| 1.0 - orders[i][axis] - orders[j][axis]);
            let mass = if weighed { 0.0 } else { 1.0 };
            let rotation = [0, 1].map(|i| if i == axis { mass - 2.0 } else { mass });
            (stiffness, [mass, rotation[0], rotation[1], 1.5, 0.0])
        };
        let (stiffness, inertia) = match parameter {
            PlateParameter::Length => along(0),
            PlateParameter::Width => along(1),
            PlateParameter::Thickness => {
                let mass = if weighed { 0.0 } else { 1.0 };
                let stiffness = PAIRS.map(|[i, _]| if i < 3 { 3.0 } else { 1.0 });
                (stiffness, [mass, mass + 2.0, mass + 2.0, 0.0, 0.0])
            }
            _ => ([0.0; STIFFNESSES], [1.0, 1.0, 1.0, 0.0, 0.0]),
        };
        let (value, all) = (self.get(parameter), self.coefficients());
        PlateCoefficients {
            stiffness: std::array::from_fn(|k| all.stiffness[k] * stiffness[k] / value),
            inertia: std::array::from_fn(|k| all.inertia[k] * inertia[k] / value),
        }
    }
}

fn sum(terms: &[(f64, PlateCoefficients)]) -> PlateCoefficients {
    PlateCoefficients {
        stiffness: std::array::from_fn(|k| terms.iter().map(|(w, c)| w * c.stiffness[k]).sum()),
        inertia: std::array::from_fn(|k| terms.iter().map(|(w, c)| w * c.inertia[k]).sum()),
    }
}

/// Whether bending and twisting couple: beyond rounding, which rotating a ply by 90 degrees leaves.
pub fn is_twisting(of: &PlateCoefficients) -> bool {
    /// Effects on a frequency are of second order in it.
    const ROUNDING: f64 = 1e-11;
    let largest = of.stiffness.iter().fold(0.0_f64, |l, v| l.max(v.abs()));
    let bending = of.stiffness[..6]
        .iter()
        .fold(0.0_f64, |l, v| l.max(v.abs()));
    TWISTING.iter().any(|&k| {
        let scale = if k < 6 { bending } else { largest };
        of.stiffness[k].abs() > ROUNDING * scale
    })
}
