//! NumPy `.npz`, as emcee users keep chains: `chain` (draw x walker x parameter), `log_prob` (draw x walker), `names`,
//! `ensemble`. A zip archive without compression. Or, as ArviZ has variables, an array of chain x draw x ... for each.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Seek, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::arviz::element_name;
use super::draws::{Chains, Draws};
use super::npy::{self, NpyArray};
use crate::error::{Error, Result};
use crate::files;

/// Writes the file. Its arrays are draw by draw, so all draws are in memory at once.
///
/// # Errors
/// The input's fault (with the path) if it cannot be written.
pub fn write_npz(chains: &dyn Chains, path: &Path) -> Result<()> {
    let (count, dim) = (chains.count(), chains.names().len());
    let (mut chain, mut lp, mut ensemble) = (Vec::new(), Vec::new(), Vec::new());
    let mut draws = 0;
    for c in 0..count {
        let one = chains.chain(c)?;
        draws = one.draws();
        chain.resize(draws * count * dim, 0.0);
        lp.resize(draws * count, 0.0);
        let rows = chain.chunks_exact_mut(dim).skip(c).step_by(count);
        for (row, point) in rows.zip(one.points()) {
            row.copy_from_slice(point);
        }
        let places = lp.iter_mut().skip(c).step_by(count);
        places.zip(one.lp()).for_each(|(to, value)| *to = *value);
        ensemble.push(one.ensemble()[0] as i64);
    }
    let shape = [draws, count, dim];
    files::replace_by(path, |beside| {
        let mut zip = ZipWriter::new(std::io::BufWriter::new(std::fs::File::create(beside)?));
        member(
            &mut zip,
            "chain",
            ("<f8", &shape),
            chain.iter().map(|v| v.to_le_bytes()),
        )?;
        member(
            &mut zip,
            "log_prob",
            ("<f8", &shape[..2]),
            lp.iter().map(|v| v.to_le_bytes()),
        )?;
        names(&mut zip, chains.names())?;
        member(
            &mut zip,
            "ensemble",
            ("<i8", &shape[1..2]),
            ensemble.iter().map(|v| v.to_le_bytes()),
        )?;
        zip.finish()?.flush()
    })
}

/// An array of NumPy's type and a shape.
fn member<const N: usize>(
    zip: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    (kind, shape): (&str, &[usize]),
    mut elements: impl Iterator<Item = [u8; N]>,
) -> std::io::Result<()> {
    let stored = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .large_file(true);
    zip.start_file(format!("{name}.npy"), stored)?;
    npy::begin(zip, kind, shape)?;
    elements.try_for_each(|bytes| zip.write_all(&bytes))
}

/// An array of text, `<U` with the longest name's length.
fn names(zip: &mut ZipWriter<impl Write + Seek>, names: &[String]) -> std::io::Result<()> {
    let longest = names.iter().map(|n| n.chars().count()).max().unwrap_or(1);
    let padded = |name: &String| -> Vec<[u8; 4]> {
        let characters = name.chars().map(u32::from);
        let all = characters.chain(std::iter::repeat(0)).take(longest);
        all.map(u32::to_le_bytes).collect()
    };
    let kind = format!("<U{longest}");
    let characters = names.iter().flat_map(padded);
    member(zip, "names", (&kind, &[names.len()]), characters)
}

/// Most numbers of an array.
const MOST: u64 = 1 << 30;

/// Reads the draws of a file that [`write_npz`] or a user of emcee or of ArviZ wrote. Without `ensemble` every chain counts as independent.
///
/// # Errors
/// The input's fault, with the path and the array: no arrays of draws, other types or shapes.
pub fn read_npz(path: &Path) -> Result<Draws> {
    let file =
        File::open(path).map_err(|e| Error::input(path.display(), "a readable file").found(e))?;
    let wrong = |found: &dyn std::fmt::Display| {
        Error::input(path.display(), "arrays of NumPy (numpy.savez)").found(found)
    };
    let mut archive = ZipArchive::new(file).map_err(|e| wrong(&e))?;
    let mut arrays = BTreeMap::new();
    for k in 0..archive.len() {
        let mut member = archive.by_index(k).map_err(|e| wrong(&e))?;
        let name = member.name().trim_end_matches(".npy").to_string();
        let array = NpyArray::read(&mut member, MOST);
        arrays.insert(name.clone(), array.map_err(|e| wrong(&e).within(&name))?);
    }
    match arrays.remove("chain") {
        Some(chain) => of_walkers(&chain, &arrays),
        None => of_variables(&arrays),
    }
    .map_err(|e| e.within(path.display()))
}

/// Of an array of draw x walker x parameter.
fn of_walkers(chain: &NpyArray, beside: &BTreeMap<String, NpyArray>) -> Result<Draws> {
    let &[draws, walkers, dim] = &chain.shape[..] else {
        return Err(Error::input("chain", "draws x walkers x parameters")
            .found(format!("{:?}", chain.shape)));
    };
    let names = beside.get("names").map(|n| n.texts.clone());
    let names = names.unwrap_or_else(|| (0..dim).map(|k| format!("x{k}")).collect());
    if names.len() != dim {
        return Err(Error::input("names", format!("{dim} names")).found(names.len()));
    }
    let own = |name: &str, shape: &[usize]| {
        let found = beside.get(name).filter(|a| a.shape == shape);
        found.map(|a| &a.numbers[..])
    };
    let lp = own("log_prob", &[draws, walkers]);
    let ensemble = own("ensemble", &[walkers]);
    let (mut values, mut densities) = (Vec::new(), Vec::new());
    for at in (0..walkers).flat_map(|w| (0..draws).map(move |d| d * walkers + w)) {
        values.extend_from_slice(&chain.numbers[at * dim..(at + 1) * dim]);
        densities.push(lp.map_or(f64::NAN, |lp| lp[at]));
    }
    let ensemble = match ensemble {
        Some(of) => of.iter().map(|e| *e as usize).collect(),
        None => (0..walkers).collect(),
    };
    Draws::new(names, ensemble, values, densities)
}

/// Of an array of chain x draw x ... for each variable.
fn of_variables(arrays: &BTreeMap<String, NpyArray>) -> Result<Draws> {
    let drawn = arrays
        .iter()
        .filter(|(_, a)| a.shape.len() >= 2 && !a.numbers.is_empty());
    let drawn: Vec<_> = drawn.collect();
    let expected = "an array chain of draw x walker x parameter, or arrays of chain x draw";
    let (_, first) = drawn
        .first()
        .ok_or_else(|| Error::input("arrays", expected).found("none"))?;
    let shape = [first.shape[0], first.shape[1]];
    let flat = arrays.iter().find(|(_, a)| a.shape == shape[..1]);
    if let Some((name, _)) = flat.filter(|_| shape[0] > shape[1]) {
        return Err(Error::input(name, "chain x draw")
            .found(format!("{} numbers", shape[0]))
            .hint("the chains were joined: in NumPyro get_samples(group_by_chain=True)"));
    }
    let count = shape[0] * shape[1];
    let mut lp = vec![f64::NAN; count];
    let (mut names, mut columns) = (Vec::new(), Vec::new());
    for (name, array) in drawn {
        if array.shape[..2] != shape {
            let expected = format!("{} chains x {} draws", shape[0], shape[1]);
            return Err(Error::input(name, expected).found(format!("{:?}", array.shape)));
        }
        if name == "lp" || name == "lp__" {
            lp.copy_from_slice(&array.numbers[..count]);
            continue;
        }
        let elements: usize = array.shape[2..].iter().product();
        for element in 0..elements {
            names.push(element_name(name, &array.shape[2..], element));
            columns.push(array.numbers.iter().skip(element).step_by(elements));
        }
    }
    let columns: Vec<Vec<f64>> = columns.into_iter().map(|c| c.copied().collect()).collect();
    let values = (0..count).flat_map(|at| columns.iter().map(move |c| c[at]));
    Draws::new(names, (0..shape[0]).collect(), values.collect(), lp)
}
