//! One cell of a table, typed: the renderers decide how it is written.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::quantity::{MeanAndSd, plus_minus, significant};

/// How a number is written.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Digits {
    /// So many decimals.
    Fixed(usize),
    /// So many decimals, always with a sign.
    Signed(usize),
    /// Three significant digits.
    Three,
    /// A mantissa of so many decimals and a power of ten.
    Science(usize),
    /// As many decimals as this sd asks for.
    Sd(f64),
    /// As short as the number can be read back.
    Whole,
    /// Two decimals and a sign; beyond so much in size, that it is beyond.
    Limited(f64),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum TableCell {
    /// Nothing is asked here. A column of nothing else is left out.
    Blank,
    /// There is no such number.
    Missing,
    Text(String),
    Number {
        value: f64,
        digits: Digits,
        unit: Cow<'static, str>,
    },
    MeanSd {
        mean: f64,
        sd: f64,
        unit: String,
    },
    /// Mean, sd and ends of the 95 % interval.
    Interval {
        mean: f64,
        sd: f64,
        ends: [f64; 2],
    },
    Probability(f64),
    /// Yes or no; a no that matters stands out.
    Mark {
        yes: bool,
        matters: bool,
    },
    /// Cells in one.
    Several(Vec<TableCell>),
}

impl TableCell {
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A number; missing where there is none or where it is not finite.
    pub fn number(value: impl Into<Option<f64>>, digits: Digits) -> Self {
        Self::with_unit(value, digits, "")
    }

    /// A number that its unit follows.
    pub fn with_unit(value: impl Into<Option<f64>>, digits: Digits, unit: &'static str) -> Self {
        match value.into().filter(|v| v.is_finite()) {
            None => Self::Missing,
            Some(value) => Self::Number {
                value,
                digits,
                unit: unit.into(),
            },
        }
    }

    pub fn fixed(value: impl Into<Option<f64>>, decimals: usize) -> Self {
        Self::number(value, Digits::Fixed(decimals))
    }

    pub fn signed(value: impl Into<Option<f64>>, decimals: usize) -> Self {
        Self::number(value, Digits::Signed(decimals))
    }

    pub fn three(value: impl Into<Option<f64>>) -> Self {
        Self::number(value, Digits::Three)
    }

    pub fn science(value: impl Into<Option<f64>>, decimals: usize) -> Self {
        Self::number(value, Digits::Science(decimals))
    }

    pub fn count(value: usize) -> Self {
        Self::number(value as f64, Digits::Fixed(0))
    }

    /// Numbers about one parameter with as many decimals as its sd asks for.
    pub fn as_precise_as<const N: usize>(sd: f64, values: [f64; N]) -> [Self; N] {
        values.map(|v| Self::number(v, Digits::Sd(sd)))
    }

    /// The smallest amplitude that would be seen; there may be none.
    pub fn or_never(amplitude: f64) -> Self {
        match amplitude.is_finite() {
            true => Self::three(amplitude),
            false => "never".into(),
        }
    }

    pub fn mean_sd(moments: Option<impl Into<MeanAndSd>>) -> Self {
        let Some(MeanAndSd { mean, sd }) = moments.map(Into::into) else {
            return Self::Missing;
        };
        let unit = String::new();
        Self::MeanSd { mean, sd, unit }
    }

    /// What others found, where anything is known.
    pub fn published(moments: Option<MeanAndSd>) -> Self {
        moments.map_or(Self::Blank, |_| Self::mean_sd(moments))
    }

    pub fn interval([mean, sd, low, high]: [f64; 4]) -> Self {
        Self::Interval {
            mean,
            sd,
            ends: [low, high],
        }
    }

    pub fn yes(yes: bool) -> Self {
        Self::Mark {
            yes,
            matters: false,
        }
    }

    /// The cell with a remark after it.
    pub fn and(self, remark: impl Into<String>) -> Self {
        Self::Several(vec![self, Self::Text(remark.into())])
    }

    pub fn is_blank(&self) -> bool {
        *self == Self::Blank
    }

    /// In ASCII.
    pub fn plain(&self) -> String {
        match self {
            Self::Blank => String::new(),
            Self::Missing => "-".into(),
            Self::Text(text) => text.clone(),
            Self::Number {
                value,
                digits,
                unit,
            } => format!("{} {unit}", digits.write(*value)).trim_end().into(),
            Self::MeanSd { mean, sd, unit } => format!("{} {unit}", plus_minus(*mean, *sd))
                .trim_end()
                .into(),
            Self::Interval { mean, sd, ends } => {
                let [mean, width, low, high] =
                    [*mean, *sd, ends[0], ends[1]].map(|v| significant(v, *sd));
                format!("{mean} +- {width} [{low}, {high}]")
            }
            Self::Probability(p) => format!("{p:.3}"),
            Self::Mark { yes: true, .. } => "yes".into(),
            Self::Mark { matters: true, .. } => "NO".into(),
            Self::Mark { .. } => "no".into(),
            Self::Several(cells) => {
                let cells: Vec<String> = cells.iter().map(Self::plain).collect();
                cells.join(", ")
            }
        }
    }

    /// With the signs that print has: a minus, plus or minus, a dash. Text keeps its hyphens.
    pub fn typeset(&self) -> String {
        match self {
            Self::Missing => "\u{2013}".into(),
            Self::Text(text) => typeset(text),
            Self::Several(cells) => {
                let cells: Vec<String> = cells.iter().map(Self::typeset).collect();
                cells.join(", ")
            }
            number => typeset(&number.plain()).replace('-', "\u{2212}"),
        }
    }
}

/// A sentence with the signs that print has.
pub fn typeset(text: &str) -> String {
    text.replace("+-", "\u{b1}")
        .replace("chi^2", "\u{3c7}\u{b2}")
}

impl Digits {
    pub fn write(self, value: f64) -> String {
        match self {
            Self::Fixed(decimals) => format!("{value:.decimals$}"),
            Self::Signed(decimals) => format!("{value:+.decimals$}"),
            Self::Science(decimals) => format!("{value:.decimals$e}"),
            Self::Sd(sd) => significant(value, sd),
            Self::Whole => value.to_string(),
            Self::Limited(most) if value > most => format!("> +{most}"),
            Self::Limited(most) if value < -most => format!("< -{most}"),
            Self::Limited(_) if value.abs() < 0.005 => "0".into(),
            Self::Limited(_) => format!("{value:+.2}"),
            Self::Three if value == 0.0 => "0".into(),
            Self::Three => match 2 - value.abs().log10().floor() as i32 {
                digits @ 0..=6 => format!("{value:.*}", digits as usize),
                -2..0 => format!("{value:.0}"),
                _ => format!("{value:.2e}"),
            },
        }
    }
}

impl From<&str> for TableCell {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

impl From<&String> for TableCell {
    fn from(text: &String) -> Self {
        Self::Text(text.clone())
    }
}

impl From<String> for TableCell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}
