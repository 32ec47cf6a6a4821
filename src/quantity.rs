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

/// Units of length by the names that a model file has for them, with their mm and the words of other files, in the singular.
pub const LENGTHS: [(&str, f64, &[&str]); 5] = [
    ("m", 1e3, &["m", "metre", "meter"]),
    ("mm", 1.0, &["mm", "millimetre", "millimeter"]),
    (
        "um",
        1e-3,
        &[
            "um",
            "\u{b5}m",
            "\u{3bc}m",
            "micron",
            "micrometre",
            "micrometer",
        ],
    ),
    ("nm", 1e-6, &["nm", "nanometre", "nanometer"]),
    ("in", 25.4, &["in", "inch", "inche"]),
];

/// How many mm one of a declared unit of length is; `place` names the key for the error.
///
/// # Errors
/// The input's fault: no such unit.
pub fn length_in_mm(place: &str, name: &str) -> Result<f64> {
    let found = LENGTHS.iter().find(|(known, ..)| *known == name);
    found.map(|(_, mm, _)| *mm).ok_or_else(|| {
        let known = LENGTHS.map(|(known, ..)| known).join(", ");
        Error::input(place, format!("a unit of length: {known}")).found(name)
    })
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
