//! What may act in a vibration test that its model lacks: by how much it moves each frequency, to first order (Rayleigh's quotient).

use super::ritz::{Ritz, VibrationMode};

/// Something that may act.
pub struct Disturbance {
    pub name: &'static str,
    /// Name of its amplitude, with the unit.
    pub parameter: &'static str,
    pub size: Size,
    /// A frequency moves as this power of the amplitude, which cannot be negative.
    pub power: i32,
    /// The experiment that would confirm it.
    pub confirm: &'static str,
    kind: DisturbanceKind,
}

/// A plausible amplitude: sd of its normal prior.
#[derive(Debug, Clone, Copy)]
pub enum Size {
    /// In the unit of its parameter.
    Fixed(f64),
    /// That times the lowest frequency.
    OfLowest(f64),
}

#[derive(Debug, Clone, Copy)]
enum DisturbanceKind {
    /// A percent of the plate's mass at places, as shares of length and width.
    Mass(&'static [[f64; 2]]),
    /// Soft springs all over the plate, by the frequency at which it bounces on them.
    Springs,
    /// A loss factor of all modes, percent of critical damping.
    Damping,
}

/// All that is weighed. A density or a thickness that changes linearly along or across a plate moves no frequency to first order, because
/// every deflection of a symmetric plate is even or odd about its middle, and its square even.
pub static DISTURBANCES: [Disturbance; 4] = [
    Disturbance {
        name: "added_mass_at_the_middle",
        parameter: "percent_of_mass",
        size: Size::Fixed(3.0),
        power: 1,
        confirm: "Weigh the accelerometer with its wax, or take the peaks with a laser or a microphone; move the body, and see whether the peaks follow. Declare it as specimen.added_mass.",
        kind: DisturbanceKind::Mass(&[[0.5, 0.5]]),
    },
    Disturbance {
        name: "added_mass_at_a_corner",
        parameter: "percent_of_mass",
        size: Size::Fixed(3.0),
        power: 1,
        confirm: "Weigh the accelerometer with its wax, or take the peaks with a laser or a microphone; move the body, and see whether the peaks follow. Declare it as specimen.added_mass.",
        kind: DisturbanceKind::Mass(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]),
    },
    Disturbance {
        name: "suspension",
        parameter: "bounce_Hz",
        size: Size::OfLowest(0.1),
        power: 2,
        confirm: "Look for the bounce of the whole plate, below its modes; hang it by longer threads at nodes of the lowest mode, and see whether that falls.",
        kind: DisturbanceKind::Springs,
    },
    Disturbance {
        name: "damping",
        parameter: "percent_of_critical",
        size: Size::Fixed(1.0),
        power: 2,
        confirm: "Measure the width of the peaks at half power, or the decay: 1 % of critical damping lowers a frequency by 0.005 %.",
        kind: DisturbanceKind::Damping,
    },
];

impl Disturbance {
    /// The plausible amplitude of a plate of this lowest frequency.
    pub fn plausible(&self, lowest_hz: f64) -> f64 {
        match self.size {
            Size::Fixed(size) => size,
            Size::OfLowest(share) => share * lowest_hz,
        }
    }

    /// Relative change of a mode's frequency by an amplitude, on a plate of mass `mass_t`.
    pub fn shift(&self, ritz: &Ritz, mode: &VibrationMode, mass_t: f64, amplitude: f64) -> f64 {
        match self.kind {
            DisturbanceKind::Mass(places) => {
                // the deflection has unit modal mass, 1 t
                let square: f64 = ritz.deflection(mode, places).iter().map(|w| w * w).sum();
                -0.5 * 0.01 * amplitude * mass_t * square / places.len() as f64
            }
            DisturbanceKind::Springs => 0.5 * (amplitude / mode.frequency_hz()).powi(2),
            DisturbanceKind::Damping => -0.5 * (0.01 * amplitude).powi(2),
        }
    }
}
