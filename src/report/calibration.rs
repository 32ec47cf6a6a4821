//! What the article's setting and a calibration gave: parts of `validation.json`, and text.

use serde_json::{Map, Value, json};

use crate::section::{Digits, Piece, Section, Table, TableCell, row};
use crate::validate::article;
use crate::validate::calibration::{LEVELS, NOISE_NM, ParameterRanks, RANK_DRAWS, Summary};
use crate::validate::quadrature::GridMoments;
use crate::validate::verdicts::{HowOften, VerdictSummary};
use crate::validate::whole_loop::LoopSummary;

/// The article's setting beside its published Tables 6 and 7.
pub fn article_section(moments: &GridMoments) -> Section {
    let (mean, sd) = (&moments.mean, &moments.sd);
    let constants = (0..4).map(|k| {
        let cells = [
            TableCell::number(mean[k], Digits::Sd(sd[k])),
            TableCell::number(article::MEAN[k], Digits::Whole),
            TableCell::fixed(100.0 * sd[k] / mean[k], 1),
            TableCell::fixed(article::COV_PERCENT[k], 1),
        ];
        row(&moments.names[k], cells)
    });
    let header = [
        "Table 6",
        "mean here",
        "published",
        "COV % here",
        "published",
    ];
    let constants = Table::new("", header, constants);
    let correlations = (0..4).map(|i| {
        let cell = |j: usize| match j <= i {
            true => TableCell::Blank,
            false => TableCell::text(format!(
                "{:+.2} ({:+.2})",
                moments.correlation[i][j],
                article::CORRELATION[i][j]
            )),
        };
        row(&moments.names[i], (0..4).map(cell))
    });
    let names = moments.names[..4].iter().map(String::as_str);
    let header = std::iter::once("Table 7: here (published)").chain(names);
    Section::new(
        "the article's setting on a simulated twin of its specimen (truth: means of Table 6)",
    )
    .with(constants)
    .with(Table::new("", header, correlations))
    .with(Piece::list(article::caveats()))
}

/// The same as numbers.
pub fn article_numbers(moments: &GridMoments) -> Value {
    let rows = (0..4).map(|k| {
        let row = json!({
            "mean": moments.mean[k], "published_mean": article::MEAN[k],
            "cov_percent": 100.0 * moments.sd[k] / moments.mean[k], "published_cov_percent": article::COV_PERCENT[k],
        });
        (moments.names[k].clone(), row)
    });
    json!({
        "table_6": rows.collect::<Map<_, _>>(),
        "table_7": { "here": moments.correlation, "published": article::CORRELATION },
        "not_comparable": article::caveats(),
    })
}

/// Ranks and coverage of a calibration.
pub fn calibration_section(summary: &Summary) -> Section {
    let plan = &summary.plan;
    let noise = match plan.correlation_mm {
        0.0 => "white noise".into(),
        mm => format!("noise correlated over {mm} mm"),
    };
    let share = |n: usize| 100.0 * n as f64 / summary.done[0].max(1) as f64;
    let bands = summary.bands.iter();
    let bands: Vec<String> = bands
        .map(|[a, b]| format!("{:.1} to {:.1}", share(*a), share(*b)))
        .collect();
    Section::new(format!(
        "calibration: {} replicates ({} converged). Fields are by the finite elements, with {noise} of {} to {} nm, {} x {} points.",
        summary.done[0], summary.done[1], NOISE_NM[0], NOISE_NM[1], plan.grid, plan.grid
    ))
    .with(parameters_table(&summary.parameters))
    .with(Piece::list([format!(
        "99 % binomial bands of the coverage: {}",
        bands.join(", ")
    )]))
}

/// Ranks and coverage of parameters.
fn parameters_table(parameters: &[ParameterRanks]) -> Table {
    let levels = LEVELS.map(|l| format!("in {:.0} %", 100.0 * l));
    let header = ["", "KS p", "ranks p"].map(String::from).into_iter();
    let header = header.chain(levels);
    let header = header.chain(["mean z", "rms z", "ranks"].map(String::from));
    let rows = parameters.iter().map(|p| {
        let count = p.bins.iter().sum::<usize>().max(1) as f64;
        let covered = p
            .covered
            .map(|n| TableCell::fixed(100.0 * n as f64 / count, 1));
        let cells = [p.p_ks, p.p_ranks].map(TableCell::Probability).into_iter();
        let z = [TableCell::signed(p.z[0], 2), TableCell::fixed(p.z[1], 2)];
        let bins = p.bins.map(|b| b.to_string()).join(" ");
        row(&p.name, cells.chain(covered).chain(z).chain([bins.into()]))
    });
    Table::new("", header, rows)
}

/// Calibration of the whole loop.
pub fn loop_section(summary: &LoopSummary) -> Section {
    let withheld = match summary.withheld {
        true => ", what acts withheld from the dictionary",
        false => "",
    };
    let what = match summary.steps {
        0 => "fields".into(),
        n => format!("series of {n} steps"),
    };
    let ([held, of], [acted, named]) = (summary.held, summary.acted);
    let share = 100.0 * held as f64 / of.max(1) as f64;
    let counts = format!(
        "The quoted 95 % intervals hold {held} of {of} constants ({share:.1} %). Of {acted} effects that acted {named} are named. {} replicates have a name of another, {} are flagged.",
        summary.wrong, summary.flagged
    );
    let statuses = summary.statuses.iter();
    let statuses = statuses.map(|(status, n)| format!("{n} of {}: {status}", summary.replicates));
    Section::new(format!(
        "calibration of the loop: {} replicates. The {what} are by finite elements, with noise of {} to {} nm correlated over {} mm, {} x {} points{withheld}.",
        summary.replicates,
        summary.noise_nm[0],
        summary.noise_nm[1],
        summary.plan.correlation_mm,
        summary.plan.grid,
        summary.plan.grid
    ))
    .with(parameters_table(&summary.constants))
    .with(parameters_table(&summary.amplitudes))
    .with(Piece::list(std::iter::once(counts).chain(statuses)))
}

/// The same as numbers.
pub fn loop_numbers(summary: &LoopSummary) -> Value {
    json!({
        "plan": summary.plan, "withheld": summary.withheld, "replicates": summary.replicates, "noise_nm": summary.noise_nm, "steps": summary.steps,
        "held": summary.held[0], "of": summary.held[1], "flagged": summary.flagged, "with_another_name": summary.wrong,
        "acted": summary.acted[0], "named": summary.acted[1], "status": summary.statuses,
        "constants": parameters_numbers(&summary.constants), "amplitudes": parameters_numbers(&summary.amplitudes),
    })
}

fn parameters_numbers(parameters: &[ParameterRanks]) -> Map<String, Value> {
    let one = |p: &ParameterRanks| {
        let row = json!({
            "p_kolmogorov_smirnov": p.p_ks, "p_chi2_of_ranks": p.p_ranks, "ranks_in_ten_bins": p.bins,
            "covered": p.covered, "mean_z": p.z[0], "rms_z": p.z[1],
        });
        (p.name.clone(), row)
    };
    parameters.iter().map(one).collect()
}

/// The same as numbers.
pub fn calibration_numbers(summary: &Summary) -> Value {
    json!({
        "plan": summary.plan, "replicates": summary.done[0], "converged": summary.done[1],
        "rank_draws": RANK_DRAWS, "levels": LEVELS, "bands_of_coverage": summary.bands,
        "parameters": parameters_numbers(&summary.parameters),
    })
}

/// What the verdicts of a loop say, over what acted.
fn verdict_rows(summary: &VerdictSummary) -> [(&'static str, HowOften); 10] {
    [
        ("no effect acts: an effect is named", summary.named_in_nulls),
        (
            "no effect acts: the verdict is \"not explained\"",
            summary.unexplained_nulls,
        ),
        ("effects act: all are named, and no other", summary.exact),
        (
            "effects that act and are named, alone or as \"A or B\"",
            summary.recalled,
        ),
        (
            "the same, of those that this measurement would show",
            summary.recalled_of_shown,
        ),
        (
            "effects that act and are named alone",
            summary.recalled_alone,
        ),
        (
            "names, alone or as \"A or B\", of something that acts",
            summary.right_groups,
        ),
        ("names that stand alone and act", summary.right_alone),
        (
            "explained, with a name for which nothing acts",
            summary.sure_and_wrong,
        ),
        ("95 % intervals that contain the constant", summary.held),
    ]
}

/// Right and wrong verdicts.
pub fn verdicts_section(summary: &VerdictSummary) -> Section {
    // what nothing was asked of has no rate
    let asked = verdict_rows(summary)
        .into_iter()
        .filter(|(_, count)| count.of > 0);
    let rows = asked.map(|(what, count)| {
        let percent = |share: f64| TableCell::fixed(100.0 * share, 1);
        let [low, high] = count.interval();
        let cells = [
            TableCell::count(count.found),
            TableCell::count(count.of),
            percent(count.share()),
            TableCell::text(format!("{:.1} to {:.1}", 100.0 * low, 100.0 * high)),
        ];
        row(what, cells)
    });
    let quoted = match summary.asked.whole {
        true => "sampled",
        false => "in closed form",
    };
    let plan = &summary.plan;
    Section::new(format!(
        "verdicts on {} simulated measurements: up to {} effects, intervals {quoted}, noise correlated over {} mm, {} x {} points.",
        summary.replicates, summary.asked.effects, plan.correlation_mm, plan.grid, plan.grid
    ))
    .with(Table::new("", ["", "found", "of", "%", "95 % interval"], rows))
    .with(Piece::list(of_names(summary)))
}

/// What is said of the names and of the constants beside those with all true effects declared, where effects acted.
fn of_names(summary: &VerdictSummary) -> Vec<String> {
    let [named, alone] = summary.f1();
    let names = named.is_finite().then(|| {
        format!("F1 of the names: {named:.2}, and {alone:.2} where \"A or B\" counts as no name")
    });
    let left = summary.bias_left;
    let of = summary.biased;
    let left = left.is_finite().then(|| format!("In {of} explained measurements the constants lay more than one sd from those of a loop that is told what acts. Closing left {left:.3} of this distance (median)"));
    names.into_iter().chain(left).collect()
}

/// The same as numbers.
pub fn verdicts_numbers(summary: &VerdictSummary) -> Value {
    let mut all = json!(summary);
    let [named, alone] = summary.f1();
    (all["f1"], all["f1_alone"]) = (json!(named), json!(alone));
    all
}
