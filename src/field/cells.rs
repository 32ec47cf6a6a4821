//! The cells of a line of text and the numbers in them, as programs write them.

/// Words for "no value", in small letters, with who writes them.
const NO_VALUE: &[(&str, &[&str])] = &[
    ("C, Python, MATLAB", &["nan", "+nan", "-nan"]),
    (
        "Microsoft C since 2015",
        &[
            "nan(ind)",
            "-nan(ind)",
            "+nan(ind)",
            "nan(snan)",
            "-nan(snan)",
        ],
    ),
    (
        "Microsoft C before 2015",
        &["1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan", "1.#snan"],
    ),
    (
        "Excel and LibreOffice, in English and German",
        &[
            "#n/a", "#na", "#nv", "#num!", "#zahl!", "#value!", "#wert!", "#div/0!", "#ref!",
            "#null!",
        ],
    ),
    (
        ".NET in Italian, German, French, Spanish",
        &[
            "non un numero reale",
            "n. def.",
            "non num\u{e9}rique",
            "neun",
        ],
    ),
    ("R, pandas, Origin", &["na", "n/a", "n.a.", "<na>", "--"]),
    ("JSON, databases", &["null", "none", "nil"]),
    (
        "GOM, ARAMIS, LabVIEW",
        &["-", "---", "?", "undefined", "undef", "invalid", "missing"],
    ),
];

/// What separates the cells of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Delimiter {
    Sign(char),
    /// Any number of blanks and tabs.
    Blanks,
}

impl Delimiter {
    /// In the order in which they are tried: a sign that numbers have goes last.
    pub const ALL: [Self; 5] = [
        Self::Sign(';'),
        Self::Sign('\t'),
        Self::Sign('|'),
        Self::Sign(','),
        Self::Blanks,
    ];

    /// The cells of a line, trimmed and without quotation marks.
    pub fn split<'a>(self, line: &'a str, cells: &mut Vec<&'a str>) {
        cells.clear();
        let (mut quoted, mut start) = (false, 0);
        for (at, c) in line.char_indices() {
            quoted ^= is_quote(c);
            let ends = match self {
                Self::Sign(sign) => c == sign,
                Self::Blanks => c.is_whitespace(),
            };
            if ends && !quoted {
                cells.push(&line[start..at]);
                start = at + c.len_utf8();
            }
        }
        cells.push(&line[start..]);
        if self == Self::Blanks {
            cells.retain(|cell| !cell.trim().is_empty());
        }
        for cell in cells {
            *cell = bare(cell);
        }
    }
}

fn is_quote(c: char) -> bool {
    matches!(c, '"' | '\u{201c}' | '\u{201d}' | '\u{201e}')
}

/// A cell without the blanks and quotation marks about it.
pub(super) fn bare(cell: &str) -> &str {
    let blank = |c: char| c.is_whitespace() || c == '\u{feff}';
    let cell = cell.trim_matches(blank);
    let inner = cell
        .strip_prefix(is_quote)
        .and_then(|c| c.strip_suffix(is_quote));
    inner.unwrap_or(cell).trim_matches(blank)
}

/// A column's name in a cell of a header. The sign of a comment, `VARIABLES =` (Tecplot) and words before a quoted name (DaVis) go.
pub(super) fn column_name(cell: &str) -> &str {
    let cell = bare(cell).trim_start_matches(['#', '%', '*', '!']).trim();
    let begins = cell
        .get(..9)
        .is_some_and(|w| w.eq_ignore_ascii_case("variables"));
    let cell = match cell.split_once('=') {
        Some((_, first)) if begins => bare(first),
        _ => cell,
    };
    match cell.strip_suffix(is_quote) {
        Some(open) => open.rsplit_once(is_quote).map_or(cell, |(_, name)| name),
        None => cell,
    }
}

/// A cell that says that there is no value.
pub(super) fn is_no_value(cell: &str) -> bool {
    let cell = cell.to_lowercase();
    let mut words = NO_VALUE.iter().flat_map(|(_, words)| *words);
    cell.is_empty() || words.any(|word| *word == cell)
}

/// The number in a cell, NaN for no value; an infinity is none. `comma` says that the decimal sign is a comma.
pub(crate) fn number(cell: &str, comma: bool) -> Option<f64> {
    let finite = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite());
    if cell.starts_with(|c: char| c.is_ascii_alphabetic()) || cell.is_empty() {
        return is_no_value(cell).then_some(f64::NAN);
    }
    if let Some(value) = finite(cell).filter(|_| !comma) {
        return Some(value);
    }
    if is_no_value(cell) {
        return Some(f64::NAN);
    }
    let mut text: String = cell
        .chars()
        .map(|c| match c {
            '\u{2212}' | '\u{2013}' | '\u{fe63}' | '\u{ff0d}' => '-',
            'D' | 'd' => 'e',
            c => c,
        })
        .collect();
    if comma {
        if text.contains('.') || text.matches(',').count() > 1 {
            return None;
        }
        text = text.replace(',', ".");
    }
    if !text.contains(['e', 'E']) {
        // Fortran leaves the letter out where the exponent has three digits: 1.5-101
        let sign = text.rfind(['+', '-']).filter(|at| *at > 0);
        if let Some(at) = sign.filter(|at| text.len() == at + 4 && text[..*at].contains('.')) {
            text.insert(at, 'e');
        }
    }
    let digit = text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    finite(&text).filter(|_| digit && text.contains(|c: char| c.is_ascii_digit()))
}

/// Whether a cell is a number with a comma in it, and whether that can only be its decimal sign: `1,234` may be either.
pub(crate) fn comma_in(cell: &str) -> Option<bool> {
    let (whole, rest) = cell.split_once(',')?;
    number(cell, true)?;
    let whole = whole.trim_start_matches(|c: char| !c.is_ascii_digit());
    let digits = rest.len() == 3 && rest.bytes().all(|b| b.is_ascii_digit());
    let thousands = digits && (1..=3).contains(&whole.len()) && !whole.starts_with('0');
    Some(!thousands)
}
