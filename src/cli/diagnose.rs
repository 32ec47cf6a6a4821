//! `plychain diagnose` and `plychain export`: what chains are worth, and other programs' formats.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::folder::{AVERAGED, say_round};
use super::print;
use crate::chain::{
    Chains, Draws, Reader, read_csv, read_getdist, read_zarr, write_csv, write_getdist, write_npz,
    write_stan,
};
use crate::diagnose::{Rule, diagnose};
use crate::error::{Error, Result};
use crate::report::chains;
use crate::report::section::terminal;
use crate::trace::quoted_rule;

/// Arguments of `diagnose`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain diagnose runs/openhole
  plychain diagnose chain_1.csv chain_2.csv chain_3.csv chain_4.csv --strict")]
pub struct DiagnoseArguments {
    /// A run folder, chain.zarr, chain.csv, Stan CSV files (one a chain), or a GetDist root (or one of its files)
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Exit with an error if the chains have not converged
    #[arg(long)]
    strict: bool,
    /// Walkers of an ensemble, where a file does not say it: walkers of one ensemble are not independent chains
    #[arg(long, value_name = "N")]
    walkers: Option<usize>,
}

pub fn run(arguments: &DiagnoseArguments) -> Result<()> {
    if let [folder] = &arguments.files[..] {
        say_round(folder);
    }
    let mut draws = read(&arguments.files, MOST)?;
    if let Some(walkers) = arguments.walkers {
        draws = draws.with_walkers(walkers)?;
    }
    let verdict = diagnose(&draws, &rule_of(&arguments.files));
    if draws.info.thin > 1 {
        print(&format!(
            "a long run: of {} stored draws of a chain one is diagnosed\n",
            draws.info.thin
        ))?;
    }
    print(&terminal(&[chains::section(&verdict)]))?;
    if draws.ensembles() > MANY && arguments.walkers.is_none() {
        print("if these are walkers of ensembles, not chains of their own, say so: --walkers N\n")?;
    }
    if arguments.strict && !verdict.converged {
        return Err(Error::input("--strict", "converged chains").found(verdict.line()));
    }
    Ok(())
}

/// More chains than anybody runs independently.
const MANY: usize = 16;

/// Most draws that are diagnosed, over all chains of a store, as many as a run holds in memory; so that a store of any
/// length is diagnosed in little memory.
const MOST: usize = 1 << 19;

/// The rule that a file's draws are judged by: those of the posterior to quote by that which ended their sampling.
fn rule_of(files: &[PathBuf]) -> Rule {
    let store = files.first().and_then(|path| store(path));
    let folder = store.as_deref().and_then(Path::parent);
    if folder.is_some_and(|f| f.ends_with(AVERAGED)) {
        quoted_rule(&Rule::default())
    } else {
        Rule::default()
    }
}

/// The chain store that `path` is or holds.
fn store(path: &Path) -> Option<PathBuf> {
    // of a loop the posterior to quote
    let inside = [path.join(AVERAGED), path.to_path_buf()].map(|p| p.join("chain.zarr"));
    if let Some(inside) = inside.into_iter().find(|place| place.is_dir()) {
        return Some(inside);
    }
    path.join("zarr.json").is_file().then(|| path.to_path_buf())
}

/// Read chains in whichever format they are; of a store about `most` draws.
fn read(files: &[PathBuf], most: usize) -> Result<Draws> {
    let [path] = files else {
        let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
        return read_csv(&paths);
    };
    if let Some(store) = store(path) {
        return Reader::open(&store)?.thinned(most);
    }
    if let Some(root) = getdist_root(path) {
        return read_getdist(&root);
    }
    // Our own chain.csv does not say which walkers belong together; the store beside it does.
    let store = path.with_file_name("chain.zarr");
    let draws = read_csv(&[path])?;
    if path.ends_with("chain.csv")
        && let Ok(stored) = read_zarr(&store, Some(0))
        && stored.chains() == draws.chains()
    {
        return draws.with_walkers(stored.chains() / stored.ensembles().max(1));
    }
    Ok(draws)
}

/// The root of GetDist files if `path` is one of them or the root itself.
fn getdist_root(path: &Path) -> Option<PathBuf> {
    let text = path.to_str()?;
    let mut roots = vec![text];
    roots.extend(text.strip_suffix(".paramnames"));
    roots.extend(
        text.strip_suffix(".txt")
            .and_then(|t| t.rsplit_once('_'))
            .map(|(root, _)| root),
    );
    let found = roots
        .into_iter()
        .find(|root| Path::new(&format!("{root}.paramnames")).is_file());
    found.map(PathBuf::from)
}

/// Formats of `export`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// One CSV file a chain, as Stan writes them
    StanCsv,
    /// ROOT_N.txt, ROOT.paramnames, ROOT.ranges
    Getdist,
    /// NumPy arrays chain (draw x walker x parameter) and log_prob, as emcee has them
    Npz,
    /// One table of all chains
    Csv,
}

/// Arguments of `export`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain export runs/openhole --format getdist")]
pub struct ExportArguments {
    /// A run folder, or any chain file
    run: PathBuf,
    /// What to write
    #[arg(long)]
    format: Format,
    /// File, or the stem of several files (default: `export` in the run folder)
    #[arg(long)]
    out: Option<PathBuf>,
}

pub fn export(arguments: &ExportArguments) -> Result<()> {
    say_round(&arguments.run);
    let folder = if arguments.run.join("chain.zarr").is_dir() {
        arguments.run.clone()
    } else {
        PathBuf::new()
    };
    let name = match arguments.format {
        Format::StanCsv | Format::Getdist => "export",
        Format::Npz => "export.npz",
        Format::Csv => "export.csv",
    };
    let out = arguments.out.clone().unwrap_or_else(|| folder.join(name));
    // A store is copied chain by chain.
    let chains: Box<dyn Chains> = match store(&arguments.run) {
        Some(store) => Box::new(Reader::open(&store)?),
        None => Box::new(read(std::slice::from_ref(&arguments.run), usize::MAX)?),
    };
    match arguments.format {
        Format::StanCsv => write_stan(&*chains, &out)?,
        Format::Getdist => write_getdist(&*chains, &out)?,
        Format::Npz => write_npz(&*chains, &out)?,
        Format::Csv => write_csv(&*chains, &out)?,
    }
    print(&format!(
        "{} chains written to {}\n",
        chains.count(),
        out.display()
    ))?;
    Ok(())
}
