//! What the width of each quoted interval comes from: how much of a constant's variance over the draws goes with each thing that is not known.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::json::Keyed;
use crate::chain::Draws;
use crate::dense::gram;
use crate::parameter::{Parameter, ParameterKind};
use crate::section::{Piece, Table, TableCell, row};

/// Something that is not known, and what that costs.
#[derive(Debug, Serialize, Deserialize)]
pub struct WidthSource {
    /// An effect, `thickness_mm`, `forces`, `answer`; `rest`: the noise of the measurement, and all that goes with no variable.
    pub source: String,
    /// Share of each constant's variance that would go if this were known: the squared multiple correlation, corrected for its degrees of
    /// freedom. Shares of sources that trade against each other do not add up to 1.
    pub of_variance: Keyed<f64>,
}

/// The errors of all forces, declared or not.
const FORCES: &str = "forces";
const REST: &str = "rest";

/// Smallest share, of any constant, that is kept.
const LEAST: f64 = 0.02;

/// Fewest draws for each variable: of fewer a share says nothing.
const DRAWS_EACH: usize = 4;

/// The sources of the constants' variances, the largest first, the rest last; none of draws that are too few.
pub fn sources(draws: &Draws, constants: &[&String]) -> Vec<WidthSource> {
    let mut groups: Vec<(String, Vec<DVector<f64>>)> = Vec::new();
    for name in draws.names() {
        let Some(label) = label(name, constants) else {
            continue;
        };
        let columns = columns(draws, name);
        match groups.iter_mut().find(|g| g.0 == label) {
            Some((_, own)) => own.extend(columns),
            None => groups.push((label, columns)),
        }
    }
    groups.retain(|(_, columns)| !columns.is_empty());
    let all: Vec<&DVector<f64>> = groups.iter().flat_map(|(_, columns)| columns).collect();
    if groups.is_empty() || draws.len() < DRAWS_EACH * (all.len() + 1) {
        return Vec::new();
    }
    let wanted: Vec<(&String, DVector<f64>)> = constants
        .iter()
        .filter_map(|name| Some((*name, standardised(values(draws, name))?)))
        .collect();
    let source = |name: &str, columns: &[&DVector<f64>], of: &dyn Fn(f64) -> f64| {
        let shares = Shares::of(columns);
        let one = |(name, y): &(&String, DVector<f64>)| ((*name).clone(), of(shares.share(y)));
        WidthSource {
            source: name.into(),
            of_variance: wanted.iter().map(one).collect(),
        }
    };
    let largest = |s: &WidthSource| s.of_variance.values().copied().fold(0.0, f64::max);
    let mut found: Vec<WidthSource> = groups
        .iter()
        .map(|(name, columns)| source(name, &columns.iter().collect::<Vec<_>>(), &|r| r))
        .filter(|s| largest(s) >= LEAST)
        .collect();
    found.sort_by(|a, b| largest(b).total_cmp(&largest(a)));
    found.push(source(REST, &all, &|r| 1.0 - r));
    found
}

/// What a variable belongs to; none of a constant, of what describes the noise, and of which effects act.
fn label(name: &String, constants: &[&String]) -> Option<String> {
    if constants.contains(&name) {
        return None;
    }
    let parameter = Parameter::read(name);
    match parameter.kind {
        ParameterKind::Amplitude => parameter.effect,
        ParameterKind::Thickness | ParameterKind::Motion => Some(name.clone()),
        ParameterKind::Load | ParameterKind::LoadError => Some(FORCES.into()),
        ParameterKind::Choice if parameter == Parameter::answer() => Some(name.clone()),
        _ => None,
    }
}

fn values(draws: &Draws, name: &str) -> Option<DVector<f64>> {
    let k = draws.index(name)?;
    Some(DVector::from_iterator(
        draws.len(),
        draws.points().map(|x| x[k]),
    ))
}

/// A variable as columns that vary: itself, or where it names one of several answers, whether it is each of them but the first.
fn columns(draws: &Draws, name: &str) -> Vec<DVector<f64>> {
    let Some(values) = values(draws, name) else {
        return Vec::new();
    };
    if !Parameter::read(name).is(ParameterKind::Choice) {
        return standardised(Some(values)).into_iter().collect();
    }
    let mut kinds: Vec<f64> = Vec::new();
    for v in values.iter() {
        if !kinds.contains(v) {
            kinds.push(*v);
        }
    }
    let is = |kind: &f64| values.map(|v| f64::from(v == *kind));
    let own = kinds.iter().skip(1).map(is);
    own.filter_map(|v| standardised(Some(v))).collect()
}

/// Less its mean, over its length; none of what does not vary.
fn standardised(values: Option<DVector<f64>>) -> Option<DVector<f64>> {
    let values = values?;
    let centred = values.add_scalar(-values.mean());
    let length = centred.norm();
    let varies =
        length.is_finite() && length > 1e-12 * values.amax() * (values.len() as f64).sqrt();
    varies.then(|| centred / length)
}

/// The share of a variable that columns explain, by least squares.
struct Shares {
    columns: DMatrix<f64>,
    /// Of the normal equations, with what keeps two columns that are one from being divided by zero.
    normal: Option<nalgebra::Cholesky<f64, nalgebra::Dyn>>,
}

impl Shares {
    const RIDGE: f64 = 1e-9;

    fn of(columns: &[&DVector<f64>]) -> Self {
        let owned: Vec<DVector<f64>> = columns.iter().map(|c| (*c).clone()).collect();
        let columns = DMatrix::from_columns(&owned);
        let mut normal = gram(&columns);
        for k in 0..normal.nrows() {
            normal[(k, k)] += Self::RIDGE;
        }
        Self {
            normal: normal.cholesky(),
            columns,
        }
    }

    /// The squared multiple correlation, less what so many columns explain by chance (adjusted R^2: Ezekiel 1930).
    fn share(&self, y: &DVector<f64>) -> f64 {
        let Some(normal) = &self.normal else {
            return 0.0;
        };
        let right = self.columns.tr_mul(y);
        let explained = right.dot(&normal.solve(&right));
        let (n, p) = (self.columns.nrows() as f64, self.columns.ncols() as f64);
        (1.0 - (1.0 - explained) * (n - 1.0) / (n - p - 1.0)).clamp(0.0, 1.0)
    }
}

/// The table: a row a source, a column a constant.
pub fn pieces(sources: &[WidthSource]) -> Vec<Piece> {
    let Some(first) = sources.first() else {
        return Vec::new();
    };
    let header = std::iter::once("").chain(first.of_variance.keys().map(String::as_str));
    let rows = sources.iter().map(|s| {
        let percent = |share: &f64| TableCell::fixed(100.0 * share, 0);
        let name = match s.source.as_str() {
            REST => "noise of the measurement, and the rest",
            source => source,
        };
        row(name, s.of_variance.values().map(percent))
    });
    vec![
        Piece::Heading("what the widths of these intervals come from, % of the variance".into()),
        Table::new("", header, rows).into(),
        Piece::Note(
            "A source's share would go if it were known exactly. Shares of two that trade against each other do not add up to 100.".into(),
        ),
    ]
}
