//! Units at the border. Inside the program lengths are mm, forces N, stresses MPa, angles rad.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// MPa in one GPa.
pub const MPA_PER_GPA: f64 = 1e3;
/// Micrometres in one mm.
pub const UM_PER_MM: f64 = 1e3;
/// Nanometres in one mm.
pub const NM_PER_MM: f64 = 1e6;
/// Microradians in one rad.
pub const URAD_PER_RAD: f64 = 1e6;

/// A unit of length that a data file may declare.
#[derive(Debug, Clone, Copy)]
pub enum Length {
    Metre,
    Millimetre,
    Micrometre,
    Nanometre,
    Inch,
}

impl Length {
    /// Names as they are written in files, with the unit each stands for.
    const NAMES: [(&'static str, Length); 5] = [
        ("m", Length::Metre),
        ("mm", Length::Millimetre),
        ("um", Length::Micrometre),
        ("nm", Length::Nanometre),
        ("in", Length::Inch),
    ];

    /// Parse a declared unit; `place` names the key for the error.
    pub fn parse(place: &str, name: &str) -> Result<Self> {
        Self::NAMES
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, unit)| *unit)
            .ok_or_else(|| {
                let known: Vec<_> = Self::NAMES.iter().map(|(known, _)| *known).collect();
                Error::input(place, format!("a unit of length: {}", known.join(", "))).found(name)
            })
    }

    /// How many mm one of this unit is.
    pub fn in_mm(self) -> f64 {
        match self {
            Length::Metre => 1e3,
            Length::Millimetre => 1.0,
            Length::Micrometre => 1e-3,
            Length::Nanometre => 1e-6,
            Length::Inch => 25.4,
        }
    }
}

/// Mean and sd, in the unit of what they are of.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct MeanAndSd {
    pub mean: f64,
    pub sd: f64,
}

impl From<(f64, f64)> for MeanAndSd {
    fn from((mean, sd): (f64, f64)) -> Self {
        Self { mean, sd }
    }
}

impl From<[f64; 2]> for MeanAndSd {
    fn from([mean, sd]: [f64; 2]) -> Self {
        Self { mean, sd }
    }
}

/// A number with as many decimals as its standard deviation's second significant digit asks for.
pub fn significant(value: f64, sd: f64) -> String {
    if !(value.is_finite() && sd.is_finite() && sd > 0.0) {
        return format!("{value}");
    }
    let decimals = (1 - sd.log10().floor() as i32).clamp(0, 12) as usize;
    format!("{value:.decimals$}")
}

/// `mean +- sd`, with a common power of ten where the decimals would begin with zeros only; the value alone where it has no sd.
pub fn plus_minus(mean: f64, sd: f64) -> String {
    let size = mean.abs().max(sd);
    if sd == 0.0 {
        return significant(mean, sd);
    }
    let both = |unit: f64| {
        let (mean, sd) = (mean / unit, sd / unit);
        format!("{} +- {}", significant(mean, sd), significant(sd, sd))
    };
    if size < 1e-3 {
        let power = size.log10().floor() as i32;
        return format!("({})e{power}", both(10_f64.powi(power)));
    }
    both(1.0)
}

/// A probability of chance in words; one that is too small for a number is said to be.
pub fn chance(p: f64) -> String {
    match p {
        p if p < 1e-300 => "p < 1e-300".into(),
        p if p < 0.01 => format!("p = {p:.0e}"),
        p => format!("p = {p:.2}"),
    }
}
