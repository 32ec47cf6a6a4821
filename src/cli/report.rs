//! `plychain report`: the report of a finished run made again, or several runs side by side.

use std::path::{Path, PathBuf};

use clap::Args;

use super::print;
use crate::chain::check_stores;
use crate::error::{Error, Result};
use crate::files;
use crate::report::run::comparison;
use crate::report::study::StudyReport;
use crate::report::{Page, html};
use crate::section::terminal;

/// Arguments of `report`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain report runs/openhole
  plychain report runs/openhole runs/openhole-2")]
pub struct ReportArguments {
    /// Run folders; one is reported again, several are compared
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Where a comparison goes (default: comparison.html in the first run's folder)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn run(arguments: &ReportArguments) -> Result<()> {
    for folder in &arguments.runs {
        check_stores(folder)?;
    }
    if let [folder] = arguments.runs.as_slice() {
        if arguments.out.is_some() {
            return Err(Error::input("--out", "several runs to compare")
                .found("one run")
                .hint("the report of one run goes to its own folder"));
        }
        match StudyReport::is_in(folder) {
            true => super::study::report_again(folder)?,
            false => Page::load(folder)?.write(folder)?,
        }
        return print(&format!("written to {}/report.html\n", folder.display()));
    }
    let pages = arguments
        .runs
        .iter()
        .map(|folder| Ok((name(folder), Page::load(folder)?)))
        .collect::<Result<Vec<_>>>()?;
    let beside = || arguments.runs[0].join("comparison.html");
    let out = arguments.out.clone().unwrap_or_else(beside);
    let compared = comparison(&pages);
    files::replace(&out, html(&compared, &[]))?;
    print(&terminal(&compared.sections[..2]))?;
    print(&format!("written to {}\n", out.display()))
}

fn name(folder: &Path) -> String {
    folder.file_name().map_or_else(
        || folder.display().to_string(),
        |n| n.to_string_lossy().into_owned(),
    )
}
