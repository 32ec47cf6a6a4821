//! Rounds side by side: residual, held-out error and constants before and after; steps; maps.

use indexmap::IndexSet;

use crate::report::page::Page;
use crate::report::round::{MeanAndSd, RoundReport};
use crate::report::steps;
use crate::report::words::contradiction;
use crate::section::{Digits, Piece, Section, Table, TableCell, row};

/// Names of the rounds: what each added to the model.
pub fn names(page: &Page) -> Vec<String> {
    let mut before: &[String] = &[];
    let rounds = page.report.rounds.iter().enumerate();
    let name = |(k, round): (usize, &'_ RoundReport)| {
        let declared = round.effects_declared.iter();
        let added: Vec<_> = declared.filter(|e| !before.contains(e)).cloned().collect();
        before = &page.report.rounds[k].effects_declared;
        match (k, added.is_empty()) {
            (0, _) => "round 0, as declared".to_string(),
            (_, true) => format!("round {k}"),
            (_, false) => format!("round {k}, with {}", added.join(", ")),
        }
    };
    rounds.map(name).collect()
}

/// A number of a round under its name.
pub type NumberOfRound = (&'static str, fn(&RoundReport) -> f64);

/// What of a round's residual is shown.
pub const RESIDUAL: [NumberOfRound; 9] = [
    ("residual RMS u1 (along the load), nm", |r| {
        r.residual.rms_nm.u1
    }),
    ("residual RMS u2 (across), nm", |r| r.residual.rms_nm.u2),
    ("noise u1, nm", |r| r.residual.noise_nm.u1),
    ("noise u2, nm", |r| r.residual.noise_nm.u2),
    ("residual over noise, u1", |r| {
        r.residual.rms_nm.u1 / r.residual.noise_nm.u1
    }),
    ("residual over noise, u2", |r| {
        r.residual.rms_nm.u2 / r.residual.noise_nm.u2
    }),
    ("reduced chi^2 of the block averages", |r| {
        r.residual.chi2_reduced
    }),
    ("held-out RMS, nm", |r| {
        r.residual.holdout_rms_nm.unwrap_or(f64::NAN)
    }),
    ("structured share of the variance", |r| {
        r.residual.structured_fraction
    }),
];

/// The residual of rounds against the noise.
pub fn residual(rounds: &[RoundReport], names: &[String]) -> Table {
    let rows = RESIDUAL.iter().filter_map(|(what, number)| {
        let numbers: Vec<f64> = rounds.iter().map(number).collect();
        let any = numbers.iter().any(|n| n.is_finite());
        any.then(|| row(*what, numbers.into_iter().map(TableCell::three)))
    });
    Table::new("residual against the noise", header(names), rows)
}

fn header(names: &[String]) -> Vec<String> {
    let rounds = names.iter().cloned();
    std::iter::once(String::new()).chain(rounds).collect()
}

/// How many points there are, and which were dropped.
pub fn points(round: &RoundReport) -> String {
    let (r, dropped) = (&round.residual, round.noise.points_dropped);
    format!(
        "{} values of {} points count as {:.0} independent ones. Points dropped: {} not measured, not correlated or repeated, {} outliers, {} off the plate, {} outside the window, {} masked.",
        2 * r.n,
        r.n,
        r.n_eff,
        dropped.missing + dropped.uncorrelated + dropped.repeated + dropped.unmatched,
        dropped.outliers,
        dropped.outside_plate,
        dropped.outside_window,
        dropped.masked,
    )
}

/// The constants and the residual of the last round in a sentence.
pub fn sentence(page: &Page, last: &RoundReport) -> String {
    let said = |moments: &dyn Fn(&str) -> Option<MeanAndSd>| {
        let one = |name: &&str| {
            let (symbol, unit) = name.split_once('_').unwrap_or((name, ""));
            let value = TableCell::mean_sd(Some(moments(name)?)).typeset();
            let text = format!("{symbol} = {value} {unit}");
            Some(text.trim_end().replace(' ', "\u{a0}"))
        };
        let constants: Vec<String> = page.constants().iter().filter_map(one).collect();
        constants.join(", ")
    };
    let alone = said(&|name| last.moments(name));
    let constants = match &page.report.closing {
        Some(_) => format!(
            "Averaged over effects that may act unseen: {}. The last round's model alone: {alone}",
            said(&|name| averaged(page, name))
        ),
        None => alone,
    };
    let r = &last.residual;
    let not = match last.convergence.converged {
        true => "",
        false => "NOT ",
    };
    format!(
        "{constants}. The residual is {:.2} times the noise in u1 and {:.2} times in u2; reduced chi^2 {}. The chains have {not}converged.",
        r.rms_nm.u1 / r.noise_nm.u1,
        r.rms_nm.u2 / r.noise_nm.u2,
        Digits::Three.write(r.chi2_reduced)
    )
}

/// Residual and constants of every round.
pub fn before_and_after(page: &Page) -> Section {
    let names = names(page);
    let declared = page
        .report
        .rounds
        .first()
        .map(|r| r.effects_declared.join(", "));
    let declared = declared.filter(|list| !list.is_empty());
    Section::new("Before and after")
        .with(residual(&page.report.rounds, &names))
        .say(declared.map_or_else(String::new, |list| format!("Round 0 declares {list}.")))
        .with(constants(page, &names))
}

/// Mean and sd of a constant in every round, and averaged.
fn moments(page: &Page, name: &str) -> Vec<Option<MeanAndSd>> {
    let rounds = page.report.rounds.iter().map(|r| r.moments(name));
    let closing = page.report.closing.iter();
    rounds
        .chain(closing.map(|_| averaged(page, name)))
        .collect()
}

fn averaged(page: &Page, name: &str) -> Option<MeanAndSd> {
    let averaged = page.report.averaged(name);
    averaged.map(|a| (a.mean, a.sd).into())
}

/// What columns of constants are called.
fn columns(page: &Page, names: &[String]) -> Vec<String> {
    let closing = page.report.closing.as_ref();
    let quoted = closing.map(|c| match &c.verdict.suspect {
        Some(_) => "to quote: spans the answers below".to_string(),
        None => "averaged over unseen effects".into(),
    });
    header(names).into_iter().chain(quoted).collect()
}

/// Constants of every round and averaged, with what contradicts its prior.
fn constants(page: &Page, names: &[String]) -> Table {
    let rows = page.constants().into_iter().map(|name| {
        let cells = moments(page, name).into_iter().enumerate().map(|(k, m)| {
            let cell = TableCell::mean_sd(m);
            match page.from_prior(k, name).and_then(contradiction) {
                Some(said) => cell.and(said),
                None => cell,
            }
        });
        row(name, cells.chain([page.truth_cell(name)]))
    });
    let header = columns(page, names).into_iter().chain(["truth".into()]);
    Table::new("constants: posterior mean +- sd", header, rows)
}

/// Errors against the truth where it is known, and amplitudes of the declared effects.
pub fn only_on_page(page: &Page) -> Vec<Piece> {
    let names = names(page);
    let errors = page.constants().into_iter().filter_map(|name| {
        let truth = page.true_value(name)?;
        let error = |m: Option<MeanAndSd>| {
            m.map_or(TableCell::Missing, |MeanAndSd { mean, sd }| {
                let percent =
                    TableCell::with_unit(100.0 * (mean - truth) / truth, Digits::Signed(2), "%");
                let sds = TableCell::with_unit((mean - truth) / sd, Digits::Signed(1), "sd");
                TableCell::Several(vec![percent, sds])
            })
        };
        Some(row(name, moments(page, name).into_iter().map(error)))
    });
    let errors = Table::new(
        "error of the mean against the truth of the simulation, and in posterior sd",
        columns(page, &names),
        errors,
    );
    vec![errors.into(), amplitudes(page, &names).into()]
}

/// Amplitudes of the declared effects in every round.
fn amplitudes(page: &Page, names: &[String]) -> Table {
    let rounds = &page.report.rounds;
    let effects = rounds.iter().flat_map(|r| r.effect_amplitudes.keys());
    let effects: IndexSet<&String> = effects.collect();
    let rows = effects.into_iter().map(|name| {
        let found = rounds.iter().map(|r| r.effect_amplitudes.get(name));
        let found = found.map(|a| TableCell::mean_sd(a.copied()));
        row(name, found.chain([page.truth_cell(name)]))
    });
    let header = header(names).into_iter().chain(["truth".into()]);
    Table::new("amplitudes of declared effects: mean +- sd", header, rows)
}

/// The steps of a series: what is left of each, how the others predict it, and whether it is linear in the load.
pub fn steps(page: &Page) -> Option<Section> {
    let (first, last) = (page.report.rounds.first()?, page.report.last()?);
    let table = steps::table(&first.steps, &last.steps);
    let not_linear = last.linearity.as_ref().and_then(|test| test.words());
    (!table.is_empty()).then(|| {
        Section::new("Steps")
            .with(table)
            .say(not_linear.unwrap_or_default())
            .with(Piece::figure("steps"))
            .with(Piece::figure("stiffness"))
    })
}

/// The last residual on a scale of its own, which is on the first screen.
pub fn closer(page: &Page) -> Vec<String> {
    let last = page.report.rounds.len().saturating_sub(1);
    [1, 2]
        .map(|c| format!("map-{last}-u{c}-residual-closer"))
        .to_vec()
}

/// Maps of every round.
pub fn maps(page: &Page) -> Section {
    let names = names(page);
    let mut section = Section::new("Maps");
    for (k, name) in names.iter().enumerate() {
        let [first, second] = [1, 2].map(|c| {
            ["measured", "predicted", "residual"].map(|what| format!("map-{k}-u{c}-{what}"))
        });
        section.push(Piece::Gallery {
            heading: name.clone(),
            names: first.into_iter().chain(second).collect(),
        });
    }
    if page.figures.iter().any(|f| !f.maps.is_empty()) {
        section.push(Piece::Note("Cells are means of the points in them; grey where nothing was measured. Measured and predicted share a scale; residuals share one over components and rounds, white at zero, which covers 99.5 % of them. Point at a map for the value of a cell.".into()));
    }
    section
}
