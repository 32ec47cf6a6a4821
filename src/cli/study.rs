//! `identify` and `loop` of several experiments, and of those of which none is a field.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::console::Console;
use super::running::{RunPlan, written_to};
use super::{field_run, print, results};
use crate::chain::{Draws, read_zarr};
use crate::diagnose::Verdict;
use crate::error::Result;
use crate::files;
use crate::identify::{Identification, Options};
use crate::infer::{ConstantsLikelihood, Model, Moments};
use crate::progress::{Progress, StageCost};
use crate::report::manifest::{KnownTruth, Manifest};
use crate::report::study::{StudyReport, page};
use crate::report::together::TogetherReport;
use crate::report::{Page, gather};
use crate::sample::Ensemble;
use crate::section::terminal;
use crate::study::{
    self, Alone, ClosedStudy, Disagreement, Observed, SampledStudy, Study, StudyStage, alone,
    sections,
};

/// Where the chains of experiments without the others are kept.
const ALONE: &str = "alone";

/// The experiments by themselves, kept in a folder of the run.
fn each_alone(plan: &RunPlan, console: &Console) -> Result<Vec<Alone>> {
    let place = |name: &str| plan.folder.path().join(ALONE).join(name);
    let options = |name: &str| plan.doubting(&place(name));
    let found = alone(&plan.study, &options, console)?;
    for one in &found {
        plan.table(one.draws()?, &place(&one.name))?;
        let Some(sampled) = &one.sampled else {
            continue;
        };
        let report = StudyReport::new(&plan.study, sampled, None);
        write_study(&place(&one.name), &report, &sampled.draws, &plan.study)?;
    }
    Ok(found)
}

/// `identify` of a study that is not one field alone.
pub fn identify(plan: RunPlan, console: &Console) -> Result<()> {
    let options = plan.options(plan.folder.path());
    let study = &plan.study;
    let shared = study.shared();
    if let [experiment] = &study.experiments[..] {
        let observed = experiment
            .observed(&shared, &options, console)
            .map_err(|e| e.within(study.path.display()))?;
        let found = study::sampled(&[&*observed], None, (&shared, &options), console)?;
        let report = StudyReport::new(study, &found, None);
        return finish(plan, (&report, &found), console);
    }
    let each = each_alone(&plan, console)?;
    let priors = shared.priors();
    let said: Vec<&ConstantsLikelihood> = each.iter().map(|a| &a.said).collect();
    let moments = each.iter().map(|a| (a.name.clone(), a.moments.clone()));
    let together = Disagreement::new(moments.collect(), &said, (&priors, &shared.moduli()));
    let about = study::others(&said, None).and_then(|known| known.moments());
    let observed: Vec<&dyn Observed> = each.iter().map(|a| &*a.observed).collect();
    let found = study::sampled(&observed, about.as_ref(), (&shared, &options), console)?;
    let together = together.with_sections(&found);
    let summary = TogetherReport::new(&together, shared.material.constants());
    if study.fields().next().is_none() {
        let report = StudyReport::new(study, &found, Some(summary));
        return finish(plan, (&report, &found), console);
    }
    let rounds = study::identified(study, each, &found, (&options, console))?;
    let pages = written(&plan, rounds, summary)?;
    for (_, page) in &pages {
        field_run::show(page, plan.verbose)?;
    }
    let manifest = manifest(&plan, Vec::new())?;
    end((plan, manifest), pages, [&found.verdict], console)
}

/// Write the reports of fields, the first in the run's own folder, each other in one of its name.
fn written(
    plan: &RunPlan,
    rounds: Vec<(usize, Identification)>,
    summary: TogetherReport,
) -> Result<Vec<(PathBuf, Page)>> {
    let seed = plan.seed();
    let mut summary = Some(summary);
    let mut pages = Vec::new();
    for (k, round) in rounds {
        let experiment = &plan.study.experiments[k];
        let Some(model) = experiment.field() else {
            continue;
        };
        let place = field_run::folder_of(plan.folder.path(), &plan.study, k);
        files::make_folder(&place)?;
        let rounds = [round];
        let mut report = gather::identified(model, &rounds, seed);
        report.together = summary.take();
        let files = rounds[0].files().to_vec();
        plan.table(&rounds[0].draws, &place)?;
        files::write_json(&place.join("report.json"), &report)?;
        let manifest = plan
            .folder
            .manifest(Some(&model.path), &files, seed, Vec::new())?;
        let page = Page::gather(&rounds, report, manifest, field_run::truth(&files)?);
        pages.push((place, page));
    }
    plan.folder
        .write_json("model.json", &plan.study.json(true)?)?;
    Ok(pages)
}

/// The manifest over all files of all experiments.
fn manifest(plan: &RunPlan, costs: Vec<StageCost>) -> Result<Manifest> {
    let files = plan.study.files()?;
    plan.folder
        .manifest(Some(&plan.study.path), &files, plan.seed(), costs)
}

fn end<'a>(
    (plan, manifest): (RunPlan, Manifest),
    pages: Vec<(PathBuf, Page)>,
    verdicts: impl IntoIterator<Item = &'a Verdict>,
    console: &Console,
) -> Result<()> {
    console.begin("report and figures", None);
    for (place, page) in &pages {
        if place != plan.folder.path() {
            files::write_json(&place.join("run.json"), &page.manifest)?;
        }
        page.write(place)?;
    }
    console.end();
    for (place, _) in &pages {
        written_to(place)?;
    }
    plan.complete(&manifest, verdicts)
}

/// Write and print what a study without a field says.
fn finish(
    plan: RunPlan,
    (report, found): (&StudyReport, &SampledStudy),
    console: &Console,
) -> Result<()> {
    console.begin("report and figures", None);
    let place = plan.folder.path();
    write_study(place, report, &found.draws, &plan.study)?;
    plan.table(&found.draws, place)?;
    let manifest =
        (plan.folder).manifest(Some(&plan.study.path), &[], plan.seed(), console.costs())?;
    console.end();
    results(report)?;
    print(&terminal(&report.sections()))?;
    written_to(place)?;
    plan.complete(&manifest, [&found.verdict])
}

fn write_study(place: &Path, report: &StudyReport, draws: &Draws, study: &Study) -> Result<()> {
    files::write_json(&place.join("model.json"), &study.json(true)?)?;
    files::write_json(&place.join("report.json"), report)?;
    let truth = field_run::truth(std::slice::from_ref(&study.path))?;
    files::replace(&place.join("report.html"), page(report, draws, &truth)?)
}

/// `report` of a finished run without a field.
pub fn report_again(folder: &Path) -> Result<()> {
    let mut report = StudyReport::load(folder)?;
    let study = Study::load(&folder.join("model.json"))?;
    let draws = read_zarr(&folder.join("chain.zarr"), None)?;
    let sampler = Ensemble::default();
    report.sections = sections(&study, &draws, &Options::new(&sampler))?;
    let truth = KnownTruth::load(folder)?;
    files::replace(&folder.join("report.html"), page(&report, &draws, &truth)?)
}

/// `loop` of a study that is not one field alone.
pub fn close(plan: RunPlan, most: usize, console: &Console) -> Result<()> {
    console.expect_loops(plan.study.fields().count());
    let each = each_alone(&plan, console)?;
    let run = plan.folder.path().to_path_buf();
    let place = |name: &str, stage: StudyStage| {
        let mut experiments = plan.study.experiments.iter();
        let k = experiments.position(|e| e.name() == name).unwrap_or(0);
        match stage {
            StudyStage::Ordering => run.join(ALONE).join(format!("{name}.traced")),
            StudyStage::Extended => run.join(ALONE).join(format!("{name}.extended")),
            StudyStage::Field(stage) => {
                field_run::stage_folder(&field_run::folder_of(&run, &plan.study, k), stage)
            }
        }
    };
    let options = |name: &str, stage: StudyStage| plan.options(&place(name, stage));
    let closed = study::close(&plan.study, each, (most, &options), console)?;
    if closed.fields.is_empty() {
        return close_without_fields(plan, closed, console);
    }
    let names = closed.study.shared().material.constants();
    let mut summary = Some(TogetherReport::closed(&closed, names));
    let mut pages = Vec::new();
    for field in &closed.fields {
        let folder = field_run::folder_of(&run, &plan.study, field.place);
        let whole = |model: &Model| plan.study.with_field(field.place, model.clone()).json(true);
        let page = field_run::write_closed(
            (&plan, &folder, console),
            &whole,
            (&field.closed, summary.take()),
        )?;
        field_run::say((&field.closed, &page), &plan, console)?;
        pages.push((folder, page));
    }
    plan.folder
        .write_json("model.extended.json", &closed.study.json(true)?)?;
    let manifest = manifest(&plan, console.costs())?;
    let rounds = closed.fields.iter().flat_map(|f| &f.closed.rounds);
    let verdicts = rounds.map(|r| &r.identification.verdict);
    end((plan, manifest), pages, verdicts, console)
}

/// The posterior of the experiments with what was declared on the way.
fn close_without_fields(plan: RunPlan, closed: ClosedStudy, console: &Console) -> Result<()> {
    let options: Options<'_> = plan.options(plan.folder.path());
    let shared = closed.study.shared();
    let observed = closed.study.experiments.iter();
    let observed = observed.map(|e| e.observed(&shared, &options, console));
    let observed = observed.collect::<Result<Vec<_>>>()?;
    let each: Vec<&dyn Observed> = observed.iter().map(|o| &**o).collect();
    let found = study::sampled(&each, None, (&shared, &options), console)?;
    let summary = TogetherReport::closed(&closed, shared.material.constants());
    let report = StudyReport::new(&closed.study, &found, Some(summary));
    plan.folder
        .write_json("model.extended.json", &closed.study.json(true)?)?;
    finish(plan, (&report, &found), console)
}

/// Let the model of a finished run's field know what the other experiments said in it.
///
/// # Errors
/// Of the input: a folder without their chains.
pub fn know(run: &Path, study: &Study, model: &mut Model) -> Result<()> {
    let priors = study.shared().priors();
    let mut said = Vec::new();
    for experiment in &study.experiments {
        if experiment.name() == model.experiment().name {
            continue;
        }
        let place = run.join(ALONE).join(experiment.name());
        let draws = read_zarr(&place.join("chain.zarr"), None)?;
        let moments = Moments::of(draws.points(), priors.len());
        said.push(study::likelihood_beyond_prior(&moments, &priors)?);
    }
    let all: Vec<&ConstantsLikelihood> = said.iter().collect();
    model.known = study::others(&all, None).map(Arc::new);
    Ok(())
}
