//! What the article's setting and a calibration gave: parts of `validation.json`, and text.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::terminal::table;
use crate::quantity::significant;
use crate::validate::article;
use crate::validate::calibration::{LEVELS, NOISE_NM, Parameter, RANK_DRAWS, Summary};
use crate::validate::quadrature::Moments;
use crate::validate::whole_loop::LoopSummary;

/// The article's setting beside its published Tables 6 and 7.
pub fn article_text(moments: &Moments) -> String {
    let mut text = String::from(
        "\nthe article's setting on a simulated twin of its specimen (truth: means of Table 6)\n\n",
    );
    let rows = (0..4).map(|k| {
        let (mean, sd) = (moments.mean[k], moments.sd[k]);
        vec![
            moments.names[k].clone(),
            significant(mean, sd),
            format!("{}", article::MEAN[k]),
            format!("{:.1}", 100.0 * sd / mean),
            format!("{:.1}", article::COV_PERCENT[k]),
        ]
    });
    text += &table(
        &[
            "Table 6",
            "mean here",
            "published",
            "COV % here",
            "published",
        ],
        rows,
    );
    text.push('\n');
    let rows = (0..4).map(|i| {
        let mut row = vec![moments.names[i].clone()];
        row.extend((0..4).map(|j| {
            if j <= i {
                String::new()
            } else {
                format!(
                    "{:+.2} ({:+.2})",
                    moments.correlation[i][j],
                    article::CORRELATION[i][j]
                )
            }
        }));
        row
    });
    let mut header = vec!["Table 7: here (published)"];
    header.extend(moments.names[..4].iter().map(String::as_str));
    text += &table(&header, rows);
    text.push('\n');
    for caveat in article::caveats() {
        let _ = writeln!(text, "  {caveat}");
    }
    text
}

/// The same as numbers.
pub fn article_numbers(moments: &Moments) -> Value {
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

/// Calibration on the terminal.
pub fn calibration_text(summary: &Summary) -> String {
    let plan = &summary.plan;
    let noise = if plan.correlation_mm == 0.0 {
        "white noise".into()
    } else {
        format!("noise correlated over {} mm", plan.correlation_mm)
    };
    let fields = if plan.reduced {
        "reduced model"
    } else {
        "finite elements"
    };
    let mut text = format!(
        "\ncalibration: {} replicates ({} converged), fields by the {fields}, {noise} of {} to {} nm, {} x {} points\n\n",
        summary.done[0], summary.done[1], NOISE_NM[0], NOISE_NM[1], plan.grid, plan.grid
    );
    let share = |n: usize| 100.0 * n as f64 / summary.done[0].max(1) as f64;
    text += &parameters_text(&summary.parameters);
    let bands: Vec<String> = summary
        .bands
        .iter()
        .map(|[a, b]| format!("{:.1} to {:.1}", share(*a), share(*b)))
        .collect();
    let _ = writeln!(
        text,
        "  99 % binomial bands of the coverage: {}",
        bands.join(", ")
    );
    text
}

/// Ranks and coverage of parameters.
fn parameters_text(parameters: &[Parameter]) -> String {
    let mut header = vec!["".to_string(), "KS p".into(), "ranks p".into()];
    header.extend(LEVELS.map(|l| format!("in {:.0} %", 100.0 * l)));
    header.extend(["mean z", "rms z", "ranks"].map(String::from));
    let rows = parameters.iter().map(|p| {
        let count = p.bins.iter().sum::<usize>().max(1) as f64;
        let mut row = vec![
            p.name.clone(),
            format!("{:.3}", p.p_ks),
            format!("{:.3}", p.p_ranks),
        ];
        row.extend(
            p.covered
                .map(|n| format!("{:.1}", 100.0 * n as f64 / count)),
        );
        row.extend([format!("{:+.2}", p.z[0]), format!("{:.2}", p.z[1])]);
        row.push(p.bins.map(|b| b.to_string()).join(" "));
        row
    });
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    table(&header, rows)
}

/// Calibration of the whole loop on the terminal.
pub fn loop_text(summary: &LoopSummary) -> String {
    let withheld = if summary.withheld {
        ", what acts withheld from the dictionary"
    } else {
        ""
    };
    let what = match summary.steps {
        0 => "fields".into(),
        n => format!("series of {n} steps"),
    };
    let mut text = format!(
        "\ncalibration of the loop: {} replicates, {what} by finite elements, noise of {} to {} nm correlated over {} mm, {} x {} points{withheld}\n\n",
        summary.replicates,
        summary.noise_nm[0],
        summary.noise_nm[1],
        summary.plan.correlation_mm,
        summary.plan.grid,
        summary.plan.grid
    );
    text += &parameters_text(&summary.constants);
    text += &parameters_text(&summary.amplitudes);
    let ([held, of], [acted, named]) = (summary.held, summary.acted);
    let share = 100.0 * held as f64 / of.max(1) as f64;
    // writing to a String cannot fail
    let _ = writeln!(
        text,
        "  quoted 95 % intervals hold {held} of {of} constants ({share:.1} %); of {acted} effects that acted {named} named, {} replicates with a name of another, {} flagged",
        summary.wrong, summary.flagged
    );
    for (status, n) in &summary.statuses {
        let _ = writeln!(text, "  {n} of {}: {status}", summary.replicates);
    }
    text
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

fn parameters_numbers(parameters: &[Parameter]) -> Map<String, Value> {
    let one = |p: &Parameter| {
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
