//! NumPy `.npz`, as emcee users keep chains: `chain` (draw x walker x parameter), `log_prob` (draw x walker), `names`,
//! `ensemble`. A zip archive without compression.

use std::io::{Seek, Write};
use std::path::Path;

use npyz::{AutoSerialize, DType, WriteOptions, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::draws::Chains;
use crate::error::{Error, Result};

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
    let shape = [draws, count, dim].map(|n| n as u64);
    let write = || -> std::io::Result<()> {
        let mut zip = ZipWriter::new(std::io::BufWriter::new(std::fs::File::create(path)?));
        member(&mut zip, "chain", &shape, &chain)?;
        member(&mut zip, "log_prob", &shape[..2], &lp)?;
        begin(&mut zip, "names")?;
        names(&mut zip, chains.names())?;
        member(&mut zip, "ensemble", &shape[1..2], &ensemble)?;
        zip.finish()?.flush()
    };
    write().map_err(|e| Error::input(path.display(), "a writable file").found(e))
}

fn begin<W: Write + Seek>(zip: &mut ZipWriter<W>, name: &str) -> std::io::Result<()> {
    let stored = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .large_file(true);
    Ok(zip.start_file(format!("{name}.npy"), stored)?)
}

fn member<W: Write + Seek, T: AutoSerialize + Copy>(
    zip: &mut ZipWriter<W>,
    name: &str,
    shape: &[u64],
    values: &[T],
) -> std::io::Result<()> {
    begin(zip, name)?;
    let options = WriteOptions::<T>::new().default_dtype().shape(shape);
    let mut array = options.writer(zip).begin_nd()?;
    array.extend(values.iter().copied())?;
    array.finish()
}

/// An array of text, `<U` with the longest name's length.
fn names<W: Write>(to: &mut W, names: &[String]) -> std::io::Result<()> {
    let longest = names.iter().map(|n| n.chars().count()).max().unwrap_or(1);
    let kind = format!("<U{longest}");
    let kind = kind.parse().map_err(std::io::Error::other)?;
    let shape = [names.len() as u64];
    let options = WriteOptions::<str>::new().dtype(DType::new_scalar(kind));
    let mut array = options.shape(&shape).writer(to).begin_nd()?;
    for name in names {
        array.push(name)?;
    }
    array.finish()
}
