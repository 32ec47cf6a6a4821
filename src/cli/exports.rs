//! The files that `init` is given: patterns, their natural order, and what their names and comments say of the force.

use std::path::{Path, PathBuf};

use glob::Pattern;

use crate::error::{Error, Result};
use crate::field::{StepSpec, programs, table};
use crate::files::natural;

/// The files of `--csv`: patterns are looked up, and several files are put in the order of the numbers in their names.
///
/// # Errors
/// The input's fault: a pattern that no file matches, a folder that cannot be read.
pub fn expand(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = Vec::new();
    for path in given {
        if is_pattern(path) {
            files.extend(matching(path)?);
        } else {
            files.push(path.clone());
        }
    }
    let name = |path: &PathBuf| {
        // what is behind the last point is an ending, unless it is a number
        let number = path
            .extension()
            .is_some_and(|e| e.to_string_lossy().bytes().all(|b| b.is_ascii_digit()));
        let stem = if number {
            path.clone()
        } else {
            path.with_extension("")
        };
        stem.to_string_lossy().into_owned()
    };
    files.sort_by(|a, b| natural(&name(a), &name(b)).then_with(|| a.cmp(b)));
    files.dedup();
    Ok(files)
}

/// Whether a path is no file but may stand for some.
pub fn is_pattern(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy());
    name.is_some_and(|name| name.contains(['*', '?'])) && !path.exists()
}

fn matching(pattern: &Path) -> Result<Vec<PathBuf>> {
    let place = format!("--csv {}", pattern.display());
    let folder = pattern.parent().filter(|p| !p.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new(".")))
        .map_err(|e| Error::input(&place, "a folder that can be read").found(e))?;
    let name = pattern.file_name().unwrap_or_default().to_string_lossy();
    // sets of characters are no part of the patterns, and two stars are one
    let mut name = name.replace('[', "[[]");
    while name.contains("**") {
        name = name.replace("**", "*");
    }
    let wanted = Pattern::new(&name).map_err(|e| Error::input(&place, "a pattern").found(e))?;
    let mut files = Vec::new();
    for entry in entries {
        let entry =
            entry.map_err(|e| Error::input(&place, "a folder that can be read").found(e))?;
        let name = entry.file_name();
        if wanted.matches(&name.to_string_lossy()) && entry.path().is_file() {
            let path = folder.map(|folder| folder.join(&name));
            files.push(path.unwrap_or_else(|| name.into()));
        }
    }
    if files.is_empty() {
        return Err(Error::input(place, "files of this pattern").found("none"));
    }
    Ok(files)
}

/// A step for each file, with the force that it states, or none by its name, and what is said of it. Where all forces are known
/// the steps are put in their order.
///
/// # Errors
/// The input's fault: a file that cannot be read.
pub fn steps(files: &[PathBuf]) -> Result<(Vec<StepSpec>, String)> {
    let mut steps = Vec::with_capacity(files.len());
    for file in files {
        let stated = table::stated_force(file)?;
        let (force_n, reason) = match (stated, force_in_name(file)) {
            (Some(force), _) => (Some(force), "stated in the file; N if it says no unit"),
            (None, Some(0.0)) => (Some(0.0), "no load, by the file's name"),
            (None, Some(force)) => (Some(force), "by the file's name"),
            (None, None) => (None, "not known"),
        };
        let file = file.clone();
        steps.push((StepSpec { file, force_n }, reason));
    }
    let known = steps.iter().all(|(s, _)| s.force_n.is_some());
    if known {
        let size = |s: &StepSpec| s.force_n.map_or(0.0, f64::abs);
        steps.sort_by(|(a, _), (b, _)| size(a).total_cmp(&size(b)));
    }
    let by = if known {
        "by their forces"
    } else {
        "by the numbers in their names, without any by the names"
    };
    let mut said = format!("  steps, in the order taken ({by}; it matters for what drifts):\n");
    for (StepSpec { file, force_n }, reason) in &steps {
        let force = force_n.map_or_else(|| "null".to_string(), |f| f.to_string());
        said += &format!("    {}: force_N {force} ({reason})\n", file.display());
    }
    if !known {
        said += "  put the testing machine's forces in place of null where they are known: without any, only ratios of constants can be identified\n";
    }
    Ok((steps.into_iter().map(|(s, _)| s).collect(), said))
}

/// The force that a file's name states, N: `0.5 kN`, or a word for none.
pub fn force_in_name(file: &Path) -> Option<f64> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    // a small n counts
    let size = |unit: &str| {
        programs::newtons(unit)
            .filter(|_| unit != "n")
            .map(|(_, n)| n)
    };
    programs::in_name(&name, size).or_else(|| {
        let name = name.to_lowercase();
        let unloaded = ["unloaded", "zero"].iter().any(|word| name.contains(word));
        unloaded.then_some(0.0)
    })
}
