//! What `identify` and `loop` write of a field, and print.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::console::Console;
use super::folder::{AVERAGED, Folder};
use super::running::RunPlan;
use super::{print, results};
use crate::chain::write_zarr;
use crate::error::Result;
use crate::field::level::WORTH_A_WORD_DEG;
use crate::files;
use crate::identify::Identification;
use crate::infer::Model;
use crate::progress::Progress;
use crate::report::manifest::KnownTruth;
use crate::report::together::TogetherReport;
use crate::report::{Page, gather, run as sections_of};
use crate::section::terminal;
use crate::study::Study;
use crate::trace::{Closed, LoopStage, ToQuote};

/// The folder of a field: the run's own of the first, one of its name within that of another.
pub fn folder_of(run: &Path, study: &Study, k: usize) -> PathBuf {
    match study.fields().next() {
        Some((first, _)) if first == k => run.to_path_buf(),
        _ => run.join(study.experiments[k].name()),
    }
}

/// Print what a loop found: a screen, or with `--verbose` everything.
pub fn say((closed, page): (&Closed, &Page), run: &RunPlan, console: &Console) -> Result<()> {
    if let ToQuote::ClosedForm(why) = &closed.to_quote {
        // the verdict stands
        console.warn(&format!(
            "The intervals to quote are those of the closed form: {why}"
        ));
    }
    show(page, run.verbose)?;
    let first = closed.rounds.first();
    let observed = first.map(|r| &r.identification.inverse.prepared.observation.field);
    let tilt = observed.and_then(|field| field.levelled_deg);
    tilt.filter(|deg| *deg > WORTH_A_WORD_DEG)
        .map_or(Ok(()), |deg| print(&levelled(deg)))
}

/// What levelling a stereo measurement did.
fn levelled(deg: f64) -> String {
    let shorter = 100.0 * (1.0 - deg.to_radians().cos());
    format!(
        "The points lie in a plane that is tilted by {deg:.2} degrees in the table. Places and displacements are taken along its axes. In the table's axes lengths would be up to {shorter:.1} % too short, and shear strains would be wrong.\n"
    )
}

/// Print what a page says: a screen, or with `verbose` everything.
pub fn show(page: &Page, verbose: bool) -> Result<()> {
    let report = &page.report;
    results(report)?;
    let mut sections = match report.last() {
        Some(last) if verbose => vec![sections_of::identification(report, last)],
        _ => vec![sections_of::brief(page)],
    };
    if let Some(closing) = report.closing.as_ref().filter(|_| verbose) {
        sections.extend(sections_of::closed(page, closing));
    }
    sections.extend(report.together_section());
    print(&terminal(&sections))
}

/// Where the chains of a stage are kept: those of the first round in the folder itself.
pub fn stage_folder(folder: &Path, stage: LoopStage) -> PathBuf {
    match stage {
        LoopStage::Attempt(0) => folder.to_path_buf(),
        LoopStage::Attempt(attempt) => folder.join(format!("round-{attempt}")),
        LoopStage::Answer(supposing) => folder.join(AVERAGED).join(supposing.key()),
    }
}

/// Write what a loop over a field leaves behind beside its chain stores into a folder of the run, and return the page that shows it, which
/// is still to be written; `whole` is the model file with a model of the field.
pub fn write_closed(
    (run, folder, console): (&RunPlan, &Path, &Console),
    whole: &dyn Fn(&Model) -> Result<Value>,
    (closed, together): (&Closed, Option<TogetherReport>),
) -> Result<Page> {
    for round in &closed.rounds {
        let place = stage_folder(folder, LoopStage::Attempt(round.attempt));
        run.table(&round.identification.draws, &place)?;
        files::write_json(&place.join("model.json"), &whole(&round.model)?)?;
    }
    if let ToQuote::Sampled(sampled) = &closed.to_quote {
        let place = folder.join(AVERAGED);
        // an interrupted run may have left one
        files::replace_folder(&place.join("chain.zarr"), |store| {
            write_zarr(&sampled.draws, store)
        })?;
        run.table(&sampled.draws, &place)?;
    }
    let last = &closed.rounds[closed.rounds.len() - 1];
    files::write_json(&folder.join("model.extended.json"), &whole(&last.model)?)?;
    let mut report = gather::closed(closed, run.seed());
    report.together = together;
    files::write_json(&folder.join("report.json"), &report)?;
    let files = closed.rounds[0].identification.files();
    let (path, seed) = (&last.model.path, run.seed());
    let manifest = run
        .folder
        .manifest(Some(path), files, seed, console.costs())?;
    Ok(Page::closed(closed, report, manifest, truth(files)?))
}

/// Write what a run leaves behind beside its chain store, and return the page that shows it, which is still to be written.
pub fn write_identified(
    model: &Model,
    rounds: &[Identification],
    folder: &Folder,
    seed: u64,
) -> Result<Page> {
    folder.write_json("model.json", &model.resolved()?)?;
    let report = gather::identified(model, rounds, seed);
    folder.write_json("report.json", &report)?;
    let files = rounds.last().map(Identification::files).unwrap_or_default();
    let manifest = folder.manifest(Some(&model.path), files, seed, Vec::new())?;
    Ok(Page::gather(rounds, report, manifest, truth(files)?))
}

/// What `truth.json` beside simulated data says; nothing of measured data.
///
/// # Errors
/// The input's fault if the file is there and is no JSON.
pub fn truth(files: &[PathBuf]) -> Result<KnownTruth> {
    let beside = files.first().and_then(|f| f.parent());
    beside.map_or_else(|| Ok(KnownTruth::default()), KnownTruth::load)
}
