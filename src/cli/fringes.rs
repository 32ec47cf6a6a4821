//! `plychain fringes`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::folder::Folder;
use super::{print, results};
use crate::error::Result;
use crate::field::fringes::Fringes;
use crate::field::matrices::write_matrices;
use crate::files;
use crate::progress::Progress;
use crate::report::fringes::{FringeReport, page};
use crate::section::terminal;

/// Arguments of `fringes`. clap makes a new line of `{n}`, but not where a sequence without effect stands in it.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain fringes fringes.json --out measured

The file:
  { \"schema\": \"plychain-fringes/1\", \"images\": \"{component}_{state}_{\u{1b}[0mn}.png\", \"frames\": 4, \"step_deg\": 90, \"steps\": \"auto\",
    \"fringe_frequency_per_mm\": 2400, \"pixel_mm\": 0.06075, \"first_row\": \"low_y\", \"U_along\": \"y\" }
  component: U or V; state: initial or final; n: 1 to frames. steps: nominal, estimated, or auto (as the images say)")]
pub struct FringesArguments {
    /// The file that says where the images are and what they are
    file: PathBuf,
    /// Folder for X, Y, U, V, SU, SV.txt, fringes.json and report.html, which must not exist (default: the first free of
    /// runs/NAME-fringes, ...)
    #[arg(long)]
    out: Option<PathBuf>,
}

pub fn run(arguments: &FringesArguments, console: &Console) -> Result<()> {
    let stem = arguments.file.file_stem();
    let name = stem.map_or_else(|| "fringes".into(), |s| s.to_string_lossy().into_owned());
    let folder = Folder::create(arguments.out.as_deref(), &format!("{name}-fringes"))?;
    let fringes = Fringes::measure(&arguments.file, console)?;
    console.begin("writing", None);
    let (grid, sd) = fringes.grid();
    write_matrices(folder.path(), &grid, Some(&sd))?;
    let report = FringeReport::new(&fringes);
    folder.write_json("fringes.json", &report)?;
    let page = page(&arguments.file.display().to_string(), &fringes, &report)?;
    files::replace(&folder.path().join("report.html"), page)?;
    console.end();
    results(&report)?;
    print(&terminal(&[report.section()]))?;
    print(&format!("written to {}\n", folder.path().display()))?;
    folder.keep();
    Ok(())
}
