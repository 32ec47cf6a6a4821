//! Plates that several tests use.
#![allow(dead_code)]

use plychain::error::Result;
use plychain::experiment::frequencies::{
    PlateEdge, PlateSupports, Ritz, Settings, Theory, TransverseShear, VibratingPlate, Weight,
};
use plychain::laminate::Ply;

pub const FREE: PlateEdge = PlateEdge::Free;
pub const HELD: PlateEdge = PlateEdge::SimplySupported;
pub const CLAMPED: PlateEdge = PlateEdge::Clamped;

pub trait Lowest {
    /// The `count` lowest frequencies of a plate, Hz.
    fn frequencies_hz(&self, plate: &VibratingPlate, count: usize) -> Result<Vec<f64>>;
}

impl Lowest for Ritz {
    fn frequencies_hz(&self, plate: &VibratingPlate, count: usize) -> Result<Vec<f64>> {
        plate.validate()?;
        let modes = self.modes(&plate.coefficients(), count)?;
        Ok(modes.iter().map(|mode| mode.frequency_hz()).collect())
    }
}

pub fn thin(order: usize, supports: PlateSupports) -> Ritz {
    let settings = Settings {
        supports,
        order,
        rotary_inertia: false,
        ..Settings::free(Theory::Thin)
    };
    Ritz::new(&settings).unwrap()
}

pub fn isotropic(thickness: f64) -> VibratingPlate {
    VibratingPlate {
        length: 1000.0,
        width: 1000.0,
        thickness,
        weight: Weight::Density(7.85e-9),
        ply: Ply::isotropic(210e3, 0.3),
        transverse: TransverseShear::default(),
        angles: vec![0.0],
        air_density: 0.0,
        point_mass: 0.0,
    }
}

pub fn carbon(layup_deg: &[f64]) -> VibratingPlate {
    VibratingPlate {
        length: 200.0,
        width: 200.0,
        thickness: 2.0,
        weight: Weight::Density(1.6e-9),
        ply: Ply {
            e1: 150e3,
            e2: 10e3,
            nu12: 0.3,
            g12: 5e3,
        },
        angles: layup_deg.iter().map(|a| a.to_radians()).collect(),
        ..isotropic(2.0)
    }
}

/// omega a^2 sqrt(rho h / D) of an isotropic plate's modes.
pub fn factors(ritz: &Ritz, plate: &VibratingPlate, count: usize) -> Vec<f64> {
    let d = plate.ply.e1 * plate.thickness.powi(3) / (12.0 * (1.0 - plate.ply.nu12.powi(2)));
    let scale = plate.length.powi(2) * (plate.mass_per_area() / d).sqrt();
    let hz = ritz.frequencies_hz(plate, count).unwrap();
    hz.iter()
        .map(|f| f * std::f64::consts::TAU * scale)
        .collect()
}

#[track_caller]
pub fn assert_close(found: &[f64], expected: &[f64], relative: f64) {
    for (f, e) in found.iter().zip(expected) {
        assert!(
            (f / e - 1.0).abs() < relative,
            "{found:?} beside {expected:?}"
        );
    }
}
