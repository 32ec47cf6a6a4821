//! What a calibration gave: parts of `validation.json`, and text.

use serde_json::{Value, json};

use crate::files::Keyed;
use crate::infer::Model;
use crate::section::{Piece, Section, Table, TableCell, row};
use crate::validate::coverage::{CalibrationSummary, LEVELS, ParameterCoverage};
use crate::validate::drawn::noise_nm;
use crate::validate::plan::CalibrationPlan;

/// What was counted, in words, by the keys of the counts.
const COUNTED: [(&str, &str); 11] = [
    ("held", "95 % intervals that contain the constant"),
    ("named_in_nulls", "no effect acts: an effect is named"),
    (
        "unexplained_nulls",
        "no effect acts: the verdict is \"not explained\"",
    ),
    ("exact", "effects act: all are named, and no other"),
    (
        "recalled",
        "effects that act and are named, alone or as \"A or B\"",
    ),
    (
        "recalled_of_shown",
        "the same, of those that this measurement would show",
    ),
    ("recalled_alone", "effects that act and are named alone"),
    (
        "right_groups",
        "names, alone or as \"A or B\", of something that acts",
    ),
    ("right_alone", "names that stand alone and act"),
    (
        "sure_and_wrong",
        "explained, with a name for which nothing acts",
    ),
    ("flagged", "intervals that span several explanations"),
];

/// Ranks, coverage, widths and names of a calibration.
pub fn calibration_section(
    model: &Model,
    plan: &CalibrationPlan,
    summary: &CalibrationSummary,
) -> Section {
    let fields = match &model.experiment().steps {
        Some(steps) => format!("series of {} steps", steps.len()),
        None => "fields".into(),
    };
    let ([low, high], grid) = (noise_nm(model), plan.grid);
    let mut title = format!(
        "calibration{}: {} replicates ({} converged). Simulated: {fields} of {grid} x {grid} points, with ",
        if plan.closes_loop { " of the loop" } else { "" },
        summary.replicates,
        summary.converged,
    );
    title += &match plan.correlation_mm {
        0.0 => format!("white noise of {low} to {high} nm"),
        mm => format!("noise of {low} to {high} nm correlated over {mm} mm"),
    };
    title += &match plan.effects {
        Some(most) => format!(" and up to {most} effects"),
        None => String::new(),
    };
    title += match plan.withheld {
        true => ", one that acts withheld from the dictionary.",
        false => ".",
    };
    Section::new(title)
        .with(parameters_table(&summary.parameters))
        .with(counts_table(summary))
        .with(Piece::list(remarks(summary)))
}

/// Ranks, coverage and widths of parameters.
fn parameters_table(parameters: &Keyed<ParameterCoverage>) -> Table {
    let levels = LEVELS.map(|l| format!("in {:.0} %", 100.0 * l));
    let header = ["", "KS p", "ranks p"].map(String::from).into_iter();
    let header = header.chain(levels);
    let header = header.chain(["mean z", "rms z", "mean sd", "ranks"].map(String::from));
    let rows = parameters.iter().map(|(name, p)| {
        let count = p.ranks_in_ten_bins.iter().sum::<usize>().max(1) as f64;
        let covered = p
            .covered
            .map(|n| TableCell::fixed(100.0 * n as f64 / count, 1));
        let probabilities = [p.p_kolmogorov_smirnov, p.p_chi2_of_ranks];
        let z = [
            TableCell::signed(p.mean_z, 2),
            TableCell::fixed(p.rms_z, 2),
            TableCell::three(p.mean_sd),
        ];
        let bins = p.ranks_in_ten_bins.map(|b| b.to_string()).join(" ");
        let cells = probabilities.map(TableCell::Probability).into_iter();
        row(name, cells.chain(covered).chain(z).chain([bins.into()]))
    });
    Table::new("", header, rows)
}

/// Right and wrong intervals, names and verdicts. What nothing was asked of has no rate.
fn counts_table(summary: &CalibrationSummary) -> Table {
    let counted = COUNTED.iter();
    let counted = counted.filter_map(|(key, what)| Some((what, summary.counts.get(*key)?)));
    let rows = counted
        .filter(|(_, count)| count.of > 0)
        .map(|(what, count)| {
            let [low, high] = count.interval();
            let cells = [
                TableCell::count(count.found),
                TableCell::count(count.of),
                TableCell::fixed(100.0 * count.share(), 1),
                TableCell::text(format!("{:.1} to {:.1}", 100.0 * low, 100.0 * high)),
            ];
            row(*what, cells)
        });
    Table::new("", ["", "found", "of", "%", "95 % interval"], rows)
}

/// What there is to say beside the tables.
fn remarks(summary: &CalibrationSummary) -> Vec<String> {
    let n = summary.replicates;
    let percent = |count: usize| 100.0 * count as f64 / n.max(1) as f64;
    let bands = summary.bands_of_coverage.iter();
    let bands: Vec<String> = bands
        .map(|[a, b]| format!("{:.1} to {:.1}", percent(*a), percent(*b)))
        .collect();
    let mut said = vec![format!(
        "99 % binomial bands of the coverage: {}",
        bands.join(", ")
    )];
    let statuses = summary.status.iter();
    said.extend(statuses.map(|(status, count)| format!("{count} of {n}: {status}")));
    if summary.f1.is_finite() {
        said.push(format!(
            "F1 of the names: {:.2}, and {:.2} where \"A or B\" counts as no name",
            summary.f1, summary.f1_alone
        ));
    }
    said
}

/// The same as numbers.
pub fn calibration_numbers(
    model: &Model,
    plan: &CalibrationPlan,
    summary: &CalibrationSummary,
) -> Value {
    let mut all = json!(summary);
    all["plan"] = json!(plan);
    all["noise_nm"] = json!(noise_nm(model));
    all["levels"] = json!(LEVELS);
    all
}
