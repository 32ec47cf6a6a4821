//! `plychain diagnose` and `plychain export`: what chains are worth, and other programs' formats.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::folder::{AVERAGED, say_round};
use super::{Global, print, results};
use crate::chain::{
    Chains, Draws, StoreReader, coda_index, is_getdist, is_groups, read_coda, read_csv,
    read_getdist, read_groups, read_npz, read_zarr, write_csv, write_getdist, write_npz,
    write_stan,
};
use crate::diagnose::{Rule, diagnose, joined, transitions};
use crate::error::{Error, Result};
use crate::report::json::load;
use crate::report::{QuotedReport, chains};
use crate::section::terminal;
use crate::trace::quoted_rule;

/// Arguments of `diagnose`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain diagnose runs/openhole
  plychain diagnose chain_1.csv chain_2.csv chain_3.csv chain_4.csv --strict")]
pub struct DiagnoseArguments {
    /// A run folder, chain.zarr, chain.csv, or chains of another program: Stan CSV files, one a chain; a GetDist root; npz; a Zarr store of
    /// ArviZ, PyMC or nuts-rs
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Exit with an error if the chains have not converged
    #[arg(long)]
    strict: bool,
    /// Print all figures as CSV, a row a parameter, with all digits
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Number of walkers in an ensemble, if the file does not state it. Walkers of one ensemble are not independent chains
    #[arg(long, value_name = "N")]
    walkers: Option<usize>,
    /// Leave out the first N draws of each chain, or (auto) those before all chains have joined each other
    #[arg(long, value_name = "N|auto", value_parser = burn_in)]
    burn_in: Option<BurnIn>,
    /// Of a loop's folder, show the effects too and not the constants alone
    #[arg(long)]
    all: bool,
}

pub fn run(arguments: &DiagnoseArguments, global: &Global) -> Result<()> {
    if let ([folder], false) = (&arguments.files[..], global.quiet) {
        say_round(folder);
    }
    let mut draws = read(&arguments.files, MOST)?;
    draws.refuse_copies(&|k| format!("chain {}", k + 1))?;
    if let Some(walkers) = arguments.walkers {
        draws = draws.with_walkers(walkers)?;
    }
    if let Some(burn_in) = arguments.burn_in {
        draws = burn_in.cut(&draws)?;
    }
    let own = match &arguments.files[..] {
        [folder] => loop_verdict(folder),
        _ => None,
    };
    if let (Some((constants, ..)), false) = (&own, arguments.all) {
        draws = draws.only(constants)?;
        let remark = "These are the constants; --all shows all that was sampled.";
        draws.info.remarks.push(remark.into());
    }
    let mut verdict = diagnose(&draws, &rule_of(&arguments.files));
    if let Some((_, reasons, answers)) = own {
        if answers > 1 {
            let remark = "Several explanations fit, and these draws pool them. The intervals to quote span all of them and are wider: they are in the report.";
            draws.info.remarks.push(remark.into());
        }
        let remark = "The verdict is the loop's own, of all draws that it made. Those that are stored are fewer.";
        draws.info.remarks.push(remark.into());
        verdict.converged = reasons.is_empty();
        verdict.reasons = reasons;
    }
    remark(&mut draws, arguments.walkers.is_some());
    results(&chains::json(&verdict, &draws.info.remarks))?;
    if arguments.csv {
        print(&chains::csv(&verdict))?;
    } else {
        for remark in &draws.info.remarks {
            print(&format!("{remark}\n"))?;
        }
        print(&terminal(&[chains::section(&verdict)]))?;
    }
    if arguments.strict && !verdict.converged {
        return Err(Error::input("--strict", "converged chains").found(verdict.line()));
    }
    Ok(())
}

/// Add what is odd about draws to their remarks.
fn remark(draws: &mut Draws, has_walkers: bool) {
    for fault in transitions(draws) {
        let remark = format!("{}: {}", fault.figure, fault.meaning);
        draws.info.remarks.push(remark);
    }
    if draws.info.thin > 1 {
        draws.info.remarks.push(format!(
            "a long run: of {} stored draws of a chain one is diagnosed",
            draws.info.thin
        ));
    }
    if draws.ensembles() > draws.draws() {
        let remark = "There are more chains than draws. Is it the other way round, or were the chains joined?";
        draws.info.remarks.push(remark.into());
    } else if draws.ensembles() > MANY && !has_walkers {
        let remark =
            "if these are walkers of ensembles, not chains of their own, say so: --walkers N";
        draws.info.remarks.push(remark.into());
    }
}

/// Draws that a chain begins with and that are left out.
#[derive(Debug, Clone, Copy)]
enum BurnIn {
    Draws(usize),
    /// Up to where all chains have joined.
    Auto,
}

fn burn_in(text: &str) -> std::result::Result<BurnIn, String> {
    match text {
        "auto" => Ok(BurnIn::Auto),
        _ => text
            .parse()
            .map(BurnIn::Draws)
            .map_err(|_| "expected a number of draws, or auto".into()),
    }
}

impl BurnIn {
    /// The draws that are left, with what that changes as a remark.
    fn cut(self, draws: &Draws) -> Result<Draws> {
        let joins = joined(draws);
        let first = match self {
            Self::Draws(count) => count,
            Self::Auto => joins.iter().copied().max().unwrap_or(0),
        };
        let mut cut = draws.after(first)?;
        if first == 0 {
            let remark = "All chains are together from their first draws on: none is left out.";
            cut.info.remarks.push(remark.into());
            return Ok(cut);
        }
        let [before, after] = [draws, &cut].map(|d| diagnose(d, &Rule::default()));
        let moved = before.rows.iter().zip(&after.rows);
        let moved = moved.map(|(a, b)| ((a.mean - b.mean).abs() / b.sd, &b.name));
        let moved = moved.filter(|(sds, _)| !sds.is_nan());
        let most = moved.max_by(|a, b| a.0.total_cmp(&b.0));
        let joins: Vec<String> = joins.iter().map(usize::to_string).collect();
        let of_mean = most.map_or(String::new(), |(sds, name)| {
            format!(" The mean of {name} moves by {sds:.2} sd, the others by less.")
        });
        cut.info.remarks.push(format!(
            "The chains join each other at draw {}. The first {first} draws of each are left out: the largest R-hat is {:.3} with them and {:.3} without.{of_mean}",
            joins.join(", "),
            before.rhat_max(),
            after.rhat_max()
        ));
        Ok(cut)
    }
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

/// The names of a loop's constants, what has not converged of each answer, and the number of answers, by the report in its folder; none of
/// anything else. Draws that were weighed stand there again and again, and few of those that were sampled: their autocorrelation is another.
fn loop_verdict(folder: &Path) -> Option<(Vec<String>, Vec<String>, usize)> {
    folder.join(AVERAGED).is_dir().then_some(())?;
    let report: serde_json::Value = load(folder, "report.json").ok()?;
    let quoted: QuotedReport = serde_json::from_value(report["quoted"].clone()).ok()?;
    let constants = quoted.answers.first()?.constants.keys().cloned().collect();
    let open = quoted.answers.iter().filter(|a| !a.converged);
    let said = open.map(|a| format!("answer {}: {}", a.name, a.convergence));
    Some((constants, said.collect(), quoted.answers.len()))
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
        let index = files.first().and_then(|path| coda_index(path));
        if let Some(index) =
            index.filter(|i| files.iter().all(|f| coda_index(f).as_ref() == Some(i)))
        {
            let chains: Vec<PathBuf> = files.iter().filter(|f| **f != index).cloned().collect();
            return read_coda(&index, &chains);
        }
        if let Some(root) = files.first().and_then(|path| getdist_root(path)) {
            return Err(
                Error::input("chain files", "the root of GetDist files alone")
                    .found(format!("{} of them", files.len()))
                    .hint(format!("give {}", root.display())),
            );
        }
        let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
        return read_csv(&paths);
    };
    if is_groups(path) {
        return read_groups(path);
    }
    if let Some(store) = store(path) {
        return StoreReader::open(&store)?.thinned(most);
    }
    if path.extension().is_some_and(|e| e == "npz") {
        return read_npz(path);
    }
    if let Some(root) = getdist_root(path) {
        return read_getdist(&root);
    }
    if let Some(index) = coda_index(path) {
        return read_coda(&index, &[]);
    }
    if path.is_dir() {
        return Err(
            Error::input(path.display(), "a run's folder or a Zarr store")
                .found("a folder without either")
                .hint("name the chain files in it, one a chain"),
        );
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
    if let Some(stem) = text.strip_suffix(".txt") {
        let numbered = stem.rsplit_once(['_', '.']);
        let numbered = numbered.filter(|(_, k)| k.parse::<usize>().is_ok());
        // a root of its own may end in a number too
        roots.push(stem);
        roots.extend(numbered.map(|(root, _)| root));
    }
    roots
        .into_iter()
        .map(PathBuf::from)
        .find(|root| is_getdist(root))
}

/// Formats of `export`.
#[derive(Debug, Clone, Copy, ValueEnum)]
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
    /// Format to write
    #[arg(long)]
    format: Format,
    /// File, or the stem of several files (default: `export` in the run folder)
    #[arg(long)]
    out: Option<PathBuf>,
}

pub fn export(arguments: &ExportArguments, global: &Global) -> Result<()> {
    if !global.quiet {
        say_round(&arguments.run);
    }
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
    let own = store(&arguments.run).filter(|_| !is_groups(&arguments.run));
    let chains: Box<dyn Chains> = match own {
        Some(store) => Box::new(StoreReader::open(&store)?),
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
    ))
}
