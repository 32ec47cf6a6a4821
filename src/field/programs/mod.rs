//! The programs whose tables are known: each is data in a file of its own, and a line of [`PROGRAMS`].

mod comsol;
mod crackpy;
mod davis;
mod dice;
mod gom;
mod istra4d;
mod matchid;
mod ncorr;
mod opencorr;
mod plain;
mod program;
mod pyaldic;
mod pyvale;
mod sundic;
mod units;
mod vic2d;
mod vic3d;

pub use program::{ExportColumns, Habit, Program};
pub use units::{FORCE_UNITS, in_name, newtons, seconds, split, unit_of};

use super::reader::PIXEL;

/// All programs. Of two that fit alike the first is taken.
pub const PROGRAMS: &[&Program] = &[
    &gom::PROGRAM,
    &vic2d::PROGRAM,
    &vic3d::PROGRAM,
    &matchid::PROGRAM,
    &dice::PROGRAM,
    &istra4d::PROGRAM,
    &opencorr::PROGRAM,
    &pyaldic::PROGRAM,
    &sundic::PROGRAM,
    &pyvale::PROGRAM,
    &davis::PROGRAM,
    &ncorr::PROGRAM,
    &crackpy::PROGRAM,
    &comsol::PROGRAM,
    &plain::PROGRAM,
];

/// The unit of both coordinates or of both displacements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FoundUnit {
    /// The file states it.
    Stated(&'static str),
    /// The program writes it where the file states none.
    Usual(&'static str),
    /// To be asked for.
    Unknown,
}

impl FoundUnit {
    fn rank(self) -> usize {
        match self {
            Self::Stated(PIXEL) | Self::Usual(PIXEL) => 1,
            Self::Stated(_) => 3,
            Self::Usual(_) => 2,
            Self::Unknown => 0,
        }
    }
}

/// Columns of a header that hold a field.
#[derive(Debug)]
pub struct MatchedColumns {
    pub program: &'static Program,
    /// The program, as it is named to people.
    pub label: &'static str,
    /// x, y, ux, uy in the header's own spelling.
    pub columns: [String; 4],
    /// Units of the coordinates and of the displacements.
    pub units: [FoundUnit; 2],
    /// The coordinate and the displacement out of the plane, if the table has them in the unit of the others.
    pub out_of_plane: [Option<String>; 2],
    /// Whether the program gives places in the deformed state.
    pub deformed: bool,
}

/// The columns of a header, with the row of units below it and the lines before it, that hold a field: in a unit of length rather than in
/// pixels, stated rather than usual, of the program with the most columns of its own.
pub fn matching(
    header: &[String],
    row: Option<&[Option<&'static str>]>,
    preamble: &str,
) -> Option<MatchedColumns> {
    let named: Vec<NamedColumn> = header
        .iter()
        .enumerate()
        .map(|(k, name)| {
            let (stem, unit) = split(name);
            let below = row.and_then(|units| units.get(k).copied().flatten());
            NamedColumn {
                name,
                stem,
                unit: unit.or(below),
            }
        })
        .collect();
    let no_unit_known = row.is_some_and(|units| units.iter().all(Option::is_none));
    let stated = units::before(preamble).or(no_unit_known.then_some(None));
    let mut best: Option<([usize; 5], MatchedColumns)> = None;
    let lower = preamble.to_lowercase();
    for program in PROGRAMS {
        let marked = program.mark.is_some_and(|mark| lower.contains(mark));
        for export in program.exports {
            let among = export.among(&named, program, stated);
            let marked = among.map(|(mut rank, found)| {
                rank[1] += 10 * usize::from(marked);
                (rank, found)
            });
            if let Some((rank, found)) = marked
                && best.as_ref().is_none_or(|(other, _)| rank > *other)
            {
                best = Some((rank, found));
            }
        }
    }
    best.map(|(_, found)| found)
}

/// A column of a header.
struct NamedColumn<'a> {
    name: &'a String,
    stem: &'a str,
    unit: Option<&'static str>,
}

impl ExportColumns {
    /// These columns among others; the larger the rank, the better they fit. `stated` is the unit of the lines about the header,
    /// which may be one that is not known: then no habit holds.
    fn among(
        &self,
        header: &[NamedColumn],
        program: &'static Program,
        stated: Option<Option<&'static str>>,
    ) -> Option<([usize; 5], MatchedColumns)> {
        let has = |name: &&str| header.iter().any(|c| c.stem.eq_ignore_ascii_case(name));
        // beside vx and vy they are gradients
        let gradients = self.names.contains(&"ux") && has(&"vx") && has(&"vy");
        if gradients || !self.also.iter().all(has) {
            return None;
        }
        let column = |name: &&'static str| {
            let of = header.iter().filter(|c| c.stem.eq_ignore_ascii_case(name));
            of.max_by_key(|c| {
                let unit = c.unit.map_or(1, |u| if u == PIXEL { 0 } else { 2 });
                (c.stem == *name, unit)
            })
        };
        let found: Vec<&NamedColumn> = self.names.iter().map_while(column).collect();
        let [x, y, ux, uy] = <[_; 4]>::try_from(found).ok()?;
        let as_spelled = [x, y, ux, uy]
            .iter()
            .zip(self.names)
            .all(|(c, name)| c.stem == name);
        let unit = |a: &NamedColumn, b: &NamedColumn| match (a.unit, b.unit, stated, self.unit) {
            (Some(a), Some(b), _, _) if a == b => Some(FoundUnit::Stated(a)),
            (None, None, Some(Some(unit)), _) => Some(FoundUnit::Stated(unit)),
            (None, None, None, Habit::Of(unit)) => Some(FoundUnit::Usual(unit)),
            (None, None, _, _) => Some(FoundUnit::Unknown),
            // two units side by side
            _ => None,
        };
        let mut units = [unit(x, y)?, unit(ux, uy)?];
        // who states one length states both: a habit fills no half
        for k in 0..2 {
            if let (FoundUnit::Usual(usual), FoundUnit::Stated(_)) = (units[k], units[1 - k])
                && usual != PIXEL
            {
                units[k] = FoundUnit::Unknown;
            }
        }
        let is_stated = units.iter().all(|u| matches!(u, FoundUnit::Stated(_)));
        if self.capitals_matter && !as_spelled && !is_stated {
            return None;
        }
        let rank = units[0].rank().min(units[1].rank());
        let third = |k: usize| {
            let name = &self.out_of_plane[k];
            let found = column(name).filter(|_| !name.is_empty())?;
            (found.unit == [x, ux][k].unit).then(|| found.name.clone())
        };
        let out_of_plane = [third(0), third(1)];
        let thirds = out_of_plane.iter().flatten().count();
        let found = MatchedColumns {
            program,
            label: self.label,
            columns: [x, y, ux, uy].map(|c| c.name.clone()),
            units,
            out_of_plane,
            deformed: self.deformed,
        };
        Some((
            [
                rank,
                self.also.len(),
                usize::from(as_spelled),
                units[0].rank() + units[1].rank(),
                thirds,
            ],
            found,
        ))
    }
}

/// The first of the columns whose name is one of `words`, which are in small letters and without units.
pub fn named<'a>(header: &'a [String], words: &[&str]) -> Option<&'a String> {
    let stem = |name: &String| split(name).0.to_lowercase();
    words
        .iter()
        .find_map(|word| header.iter().find(|h| stem(h) == *word))
}

/// Words of all programs: what one writes another may have learned.
pub fn all_words(of: fn(&Program) -> &'static [&'static str]) -> Vec<&'static str> {
    PROGRAMS.iter().flat_map(|p| of(p)).copied().collect()
}

/// Names of displacements out of the plane, of all programs.
pub fn out_of_plane() -> Vec<String> {
    let exports = PROGRAMS.iter().flat_map(|p| p.exports);
    let names = exports.map(|e| e.out_of_plane[1].to_lowercase());
    names.filter(|name| !name.is_empty()).collect()
}

/// How to get tables of text out of programs that also write files of bytes.
pub fn as_text() -> String {
    let known: Vec<&str> = PROGRAMS.iter().filter_map(|p| p.as_text).collect();
    known.join("; ")
}

/// What a line before a table says after some words: `# Subset size: 27`.
pub fn stated<'a>(preamble: &'a str, words: &str) -> Option<&'a str> {
    let rest = preamble.lines().find_map(|line| {
        let at = line.to_ascii_lowercase().find(words)?;
        line.get(at + words.len()..)
    })?;
    Some(
        rest.trim_start_matches([' ', ':', '=', ',', ';', '\t'])
            .trim(),
    )
}

/// The first number that a line before a table says after some words.
pub fn stated_number(preamble: &str, words: &str) -> Option<f64> {
    let rest = stated(preamble, words)?;
    let mut parts = rest.split(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c)));
    parts
        .find_map(|part| part.parse::<f64>().ok())
        .filter(|v| v.is_finite() && *v > 0.0)
}
