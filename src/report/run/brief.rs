//! What a person reads first of a run: a screen of a terminal, and the head of the page.

use crate::effect;
use crate::parameter::Parameter;
use crate::quantity::significant;
use crate::report::document::Report;
use crate::report::learned::{self, Learned, not_measured};
use crate::report::page::Page;
use crate::report::round::{MeanAndSd, RoundReport};
use crate::section::{Digits, Piece, Section, Table, TableCell, row};
use crate::trace::{BlindSpot, Conclusion, FORCE_UNSEEN, Status};

/// Warnings that are shown.
const SHOWN: usize = 3;

/// The verdict, the constants, the effects found and what to check before use.
pub fn brief(page: &Page) -> Section {
    let report = &page.report;
    let Some(last) = report.last() else {
        return Section::default();
    };
    let section = Section::default()
        .with(verdict(page, last))
        .with(constants(page))
        .with(found(report, last));
    section.with(checks(report, last, SHOWN))
}

/// The verdict in few words.
pub fn verdict(page: &Page, last: &RoundReport) -> Piece {
    let report = &page.report;
    let said = report.closing.as_ref().map(|c| &c.verdict);
    let residual = residual(page, last);
    let why = said.map(why).unwrap_or_default();
    let text = [Some(residual), Some(why), not_measured(&report.learned)];
    let text: Vec<String> = text
        .into_iter()
        .flatten()
        .filter(|t| !t.is_empty())
        .collect();
    Piece::Verdict {
        word: said.map_or_else(
            || "identified, causes not looked for".into(),
            Conclusion::words,
        ),
        text: text.join(" "),
        open: said.is_some_and(|v| v.status == Status::Unexplained),
    }
}

/// Noise over what is left of the data, at least, where the fit takes up smooth noise.
const WELL_ABOVE: f64 = 1.2;

/// What is left of the data, before and after.
fn residual(page: &Page, last: &RoundReport) -> String {
    let nm = |r: &RoundReport| Digits::Three.write(r.residual.rms_nm.all);
    let noise = &last.residual.noise_nm;
    let noise = (0.5 * (noise.u1.powi(2) + noise.u2.powi(2))).sqrt();
    let smooth = match noise > WELL_ABOVE * last.residual.rms_nm.all {
        true => ", and so smooth that the fit takes up a part of it",
        false => "",
    };
    let left = match &page.report.rounds[..] {
        [first, .., last] => format!("{} nm before, {} nm after", nm(first), nm(last)),
        _ => format!("{} nm", nm(last)),
    };
    format!(
        "Residual: {left}; the noise is {} nm{smooth}.",
        Digits::Three.write(noise)
    )
}

/// Why a verdict is open.
fn why(verdict: &Conclusion) -> String {
    let mut said = Vec::new();
    if let Some(veto) = verdict.vetoes.first() {
        let more = match verdict.vetoes.len() {
            1 => String::new(),
            n => format!(" ({} more in the report)", n - 1),
        };
        said.push(format!("A check failed: {veto}{more}."));
    }
    if verdict.suspect.is_some() {
        let reasons = verdict.suspect.iter().flat_map(|s| s.reasons.first());
        let reason = reasons.filter(|_| verdict.vetoes.is_empty());
        let reason: String = reason.map(|r| format!(": {r}")).collect();
        said.push(format!("Several explanations fit{reason}."));
        said.push("The intervals contain all of them.".into());
    } else if verdict.status == Status::Unexplained && verdict.vetoes.is_empty() {
        said.push("Structure remains. Look at the map of the residual.".into());
    } else if verdict.status != Status::Unexplained {
        said.push(FORCE_UNSEEN.into());
    }
    said.join(" ")
}

/// The constants to use, with 95 % interval, prior and what the data added.
pub fn constants(page: &Page) -> Table {
    let report = &page.report;
    let rows = page.constants().into_iter().filter_map(|name| {
        let [mean, sd, low, high] = page.to_quote(name)?;
        let [low, high] = [low, high].map(|end| significant(end, sd));
        let learned = report
            .learned
            .get(name)
            .map(|l| l.of(MeanAndSd { mean, sd }));
        let [prior, data] = Learned::cells(learned.as_ref());
        let truth = page.truth_cell(name);
        let interval = TableCell::from(format!("{low} to {high}"));
        let result = TableCell::mean_sd(Some((mean, sd)));
        let published = report.last().and_then(|r| r.posterior.get(name)?.published);
        let published = TableCell::published(published);
        Some(row(name, [result, interval, prior, data, published, truth]))
    });
    let [prior, data] = learned::HEADERS;
    Table::new(
        "",
        ["", "result", "95 %", prior, data, "published", "truth"],
        rows,
    )
}

/// The effects that were found, each with its size and the test that settles it.
pub fn found(report: &Report, last: &RoundReport) -> Piece {
    let Some(verdict) = report.closing.as_ref().map(|c| &c.verdict) else {
        return Piece::List(Vec::new());
    };
    let item = |effect: &String| {
        let amplitudes = last.effect_amplitudes.iter();
        // what was solved for beside them, as unknown places, has no size to read
        let known = effect::find("verdict", effect).map_or(&[][..], |e| e.parameters());
        let own = amplitudes.filter(|(name, _)| {
            let read = Parameter::read(name);
            let is_own = known.iter().any(|p| p.name == read.own);
            read.effect.as_deref() == Some(effect) && is_own
        });
        let sizes: Vec<String> = own.map(|(name, a)| size(name, a)).collect();
        let means = verdict.meanings.get(effect);
        let means = means.cloned().unwrap_or_default();
        let tests = verdict.confirm.iter().flat_map(|group| &group.tests);
        let test = tests.clone().find(|t| t.effect == *effect);
        let test = test.map_or_else(String::new, |t| format!("Test: {}", t.test));
        let sizes = match sizes.is_empty() {
            true => String::new(),
            false => format!("{}, if no other effect acts", sizes.join(", ")),
        };
        let said = [sizes, means, test].into_iter().filter(|s| !s.is_empty());
        let said: Vec<String> = said.collect();
        (verdict.name(effect), said.join(". "))
    };
    let mut items: Vec<(String, String)> = verdict.effects.iter().map(item).collect();
    if !verdict.undecided.is_empty() {
        let names: Vec<String> = verdict.undecided.iter().map(|g| g.join(" or ")).collect();
        items.push(("undecided".into(), names.join("; ")));
    }
    Piece::List(items)
}

fn size(name: &str, amplitude: &MeanAndSd) -> String {
    let parameter = Parameter::read(name);
    let value = TableCell::mean_sd(Some(*amplitude)).plain();
    format!("{} = {value}", parameter.own)
}

/// An effect at this share of what would be found is not found.
const UNSEEN: f64 = 0.5;

/// Shifts beyond so many sds are not in an interval.
const OUTSIDE: f64 = 3.0;

/// The error of the making that would not show and take a constant farthest out of its interval, with what to declare.
fn unseen(report: &Report) -> Option<String> {
    let both = report.both();
    let of_the_making = |spot: &&BlindSpot| {
        effect::find("blind_spots", &spot.effect).is_ok_and(|e| e.is_manufacturing())
    };
    let spots = report.blind_spots().iter().filter(of_the_making);
    let shifts = spots.flat_map(|spot| {
        let size = match spot.detectable.is_finite() {
            true => (UNSEEN * spot.detectable).min(spot.plausible),
            false => 0.0,
        };
        let both = &both;
        let shifted = spot
            .shift_in_percent
            .iter()
            .filter_map(move |(name, percent)| {
                let found = both.get(name)?;
                let percent = percent.unwrap_or(0.0) * size / spot.plausible;
                let sds = (0.01 * percent * found.mean / found.sd).abs();
                Some((sds, size, percent.abs(), name))
            });
        shifted.map(move |shift| (spot, shift))
    });
    let (spot, (_, size, percent, name)) = shifts
        .filter(|(_, (sds, ..))| *sds > OUTSIDE)
        .max_by(|(_, a), (_, b)| a.0.total_cmp(&b.0))?;
    let BlindSpot {
        effect,
        parameter,
        unit,
        ..
    } = spot;
    let [size, percent] = [size, percent].map(|x| significant(x, 0.5 * x));
    Some(format!(
        "{effect} of {size} {unit} would not show, and it moves {} by {percent} %. The intervals do not reach so far. If your specimen may have it, declare its sd in plausible: \"{effect}.{parameter}\".",
        Parameter::read(name).symbol()
    ))
}

/// What to check before the numbers are used, at most so many; the others are in the report.
pub fn checks(report: &Report, last: &RoundReport, most: usize) -> Piece {
    let doubts = report.rounds.first().into_iter().flat_map(|r| &r.doubts);
    let mut all: Vec<String> = doubts.chain(&last.warnings).cloned().collect();
    all.extend(unseen(report));
    all.extend(
        report
            .closing
            .as_ref()
            .and_then(|c| c.quoted.as_ref()?.doubt()),
    );
    if !last.convergence.converged {
        all.insert(
            0,
            "The chains have not converged. Run longer: --min-ess.".into(),
        );
    }
    let more = all.len().saturating_sub(most);
    all.truncate(most);
    if more > 0 {
        all.push(format!("{more} more in the report"));
    }
    Piece::Warnings(all)
}
