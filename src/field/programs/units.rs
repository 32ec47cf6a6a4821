//! Units as they are written in files.

use crate::field::reader::PIXEL;
use crate::quantity::LENGTHS;

/// Units of force and their newtons (NIST SP 811, appendix B.8). Without mN: few machines write millinewtons, and a meganewton would be
/// taken for one.
pub const FORCE_UNITS: [(&str, f64); 8] = [
    ("N", 1.0),
    ("kN", 1e3),
    ("daN", 10.0),
    ("kgf", 9.806_65),
    ("lbf", 4.448_221_615_260_5),
    ("lb", 4.448_221_615_260_5),
    ("kip", 4_448.221_615_260_5),
    ("klbf", 4_448.221_615_260_5),
];

/// A unit of force by its name in upper or lower case, and its newtons.
pub fn newtons(written: &str) -> Option<(&'static str, f64)> {
    FORCE_UNITS
        .into_iter()
        .find(|(unit, _)| unit.eq_ignore_ascii_case(written))
}

/// Seconds of a unit of time.
pub fn seconds(written: &str) -> Option<f64> {
    match written.to_lowercase().as_str() {
        "s" | "sec" | "secs" | "second" | "seconds" => Some(1.0),
        "ms" | "msec" => Some(1e-3),
        "min" | "minutes" => Some(60.0),
        _ => None,
    }
}

/// The first number in the name of a file with a unit behind it, in that unit's size: `part_2.250 s`, `step 0,5kN`.
pub fn in_name(name: &str, size: impl Fn(&str) -> Option<f64>) -> Option<f64> {
    let digit = |c: char| c.is_ascii_digit();
    let mut rest = name;
    while let Some(at) = rest.find(digit) {
        // a stroke behind a letter or a digit is no sign
        let before = rest[..at].strip_suffix('-');
        let is_negative = before.is_some_and(|b| b.is_empty() || b.ends_with(['_', ' ', '=']));
        rest = &rest[at..];
        let decimal = |(k, c): (usize, char)| {
            let inside = ".,".contains(c) && rest[k + 1..].starts_with(digit);
            !(digit(c) || inside)
        };
        let end = rest.char_indices().find(|&both| decimal(both));
        let (number, after) = rest.split_at(end.map_or(rest.len(), |(k, _)| k));
        let unit = after.trim_start_matches([' ', '_']);
        let unit = unit.split(|c: char| !c.is_alphanumeric()).next();
        let value = number.replace(',', ".").parse::<f64>().ok();
        let of_unit = unit.filter(|u| !u.is_empty()).and_then(&size);
        if let Some((value, size)) = value.zip(of_unit) {
            return Some(if is_negative { -value } else { value } * size);
        }
        rest = after;
    }
    None
}

/// The name in a model file of a unit of length as it is written.
pub fn unit_of(written: &str) -> Option<&'static str> {
    let written = written.trim().to_lowercase();
    // ms are no metres
    let plural = written.strip_suffix('s').filter(|one| one.len() > 3);
    let written = plural.unwrap_or(&written);
    if ["px", "pix", "pixel"].contains(&written) {
        return Some(PIXEL);
    }
    let known = LENGTHS.iter().find(|(.., words)| words.contains(&written));
    known.map(|(name, ..)| *name)
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

/// The unit of length that a line before a table states (`# Units: length:mm angle:deg`, `% Length unit: mm`, `# unit: px`), if one
/// does. `None` inside: the unit is not known, or two units are stated (tables say in many ways which is whose).
pub fn before(preamble: &str) -> Option<Option<&'static str>> {
    const OTHERS: [&str; 6] = ["force", "load", "strain", "stress", "time", "angle"];
    let stated = preamble.lines().filter_map(|line| {
        let line = line.to_lowercase();
        let words = line.split(|c: char| !c.is_alphanumeric());
        let words: Vec<&str> = words.filter(|w| !w.is_empty()).collect();
        let at = words.iter().position(|w| ["unit", "units"].contains(w))?;
        let (first, after) = (words[..at].last(), &words[at + 1..]);
        if let Some(k) = after.iter().position(|w| *w == "length") {
            return Some(after.get(k + 1).and_then(|w| unit_of(w)));
        }
        if after.is_empty() || OTHERS.iter().any(|o| first == Some(o) || after.contains(o)) {
            return None;
        }
        // "units in mm" are no inches
        let mut known: Vec<&'static str> = after.iter().filter_map(|w| unit_of(w)).collect();
        if known.len() > 1 {
            known.retain(|u| *u != "in");
        }
        Some(
            known
                .first()
                .copied()
                .filter(|unit| known.iter().all(|u| u == unit)),
        )
    });
    let stated: Vec<Option<&'static str>> = stated.collect();
    let first = *stated.first()?;
    Some(first.filter(|_| stated.iter().all(|unit| *unit == first)))
}
