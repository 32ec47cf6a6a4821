//! Units as they are written in files.

use crate::field::reader::PIXEL;

/// Units of length and the pixel, as they are written, by their names in a model file.
const UNITS: &[(&str, &[&str])] = &[
    ("m", &["m", "metre", "meter", "metres", "meters"]),
    (
        "mm",
        &[
            "mm",
            "millimetre",
            "millimeter",
            "millimetres",
            "millimeters",
        ],
    ),
    (
        "um",
        &[
            "um",
            "\u{b5}m",
            "\u{3bc}m",
            "micron",
            "microns",
            "micrometre",
            "micrometer",
        ],
    ),
    ("nm", &["nm", "nanometre", "nanometer"]),
    ("in", &["in", "inch", "inches"]),
    (PIXEL, &["px", "pix", "pixel", "pixels"]),
];

/// The name in a model file of a unit as it is written.
pub fn unit_of(written: &str) -> Option<&'static str> {
    let written = written.trim().to_lowercase();
    let known = UNITS
        .iter()
        .find(|(_, words)| words.contains(&written.as_str()));
    known.map(|(name, _)| *name)
}

/// A column's name and the unit behind it: in brackets, after a stroke, an underscore or a blank.
pub fn split(name: &str) -> (&str, Option<&'static str>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((stem, unit)) = name.strip_suffix(close).and_then(|n| n.rsplit_once(open)) {
            let none = ["", "-", "1"].contains(&unit.trim());
            let known = unit_of(unit);
            if none || known.is_some() {
                return (stem.trim_end(), known);
            }
        }
    }
    for sign in ['/', '_', ' '] {
        if let Some((stem, unit)) = name
            .rsplit_once(sign)
            .and_then(|(stem, unit)| Some((stem, unit_of(unit)?)))
        {
            return (stem.trim_end_matches([',', ' ']), Some(unit));
        }
    }
    (name, None)
}
