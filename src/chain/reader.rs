//! Reading a chain store piece by piece: a chunk of all chains, or one chain at all times. A store of any length is read
//! in little memory.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::digest::Digest;
use super::draws::{Chains, Draws, groups};
use super::zarr::{self, FORMAT, arrays, most_of_a_chunk};
use crate::error::{Error, Result};

/// Takes the first draw of a chunk, its number of draws, and its arrays (the parameters, then the log density; each
/// chain x chunk length).
pub type TakeChunk<'a> = &'a mut dyn FnMut(usize, usize, &[Vec<f64>]) -> Result<()>;

/// Most numbers of the chains that are kept from one pass over a store, 32 MiB.
const HELD: usize = 1 << 22;

/// A store opened for reading.
#[derive(Debug)]
pub struct StoreReader {
    path: PathBuf,
    names: Vec<String>,
    ensemble: Vec<usize>,
    pub draws: usize,
    chunk: usize,
    /// Digests of the arrays as they were written, where the store has them.
    digests: Vec<Digest>,
    /// Whether all draws were found to be those of the digests.
    checked: Cell<bool>,
    /// Chains that follow each other, and the first one's number: files are unpacked whole, so one is not read alone.
    held: RefCell<(usize, Vec<Draws>)>,
}

impl StoreReader {
    /// Opens a store, whose arrays must have the size that it says. Of what they hold, whatever goes through all draws compares the digests.
    ///
    /// # Errors
    /// The input's fault: no store, another format, missing files, arrays of different sizes.
    pub fn open(path: &Path) -> Result<Self> {
        let place = path.display();
        let root = zarr::read_metadata(path)?;
        let attributes = &root["attributes"];
        if attributes["format"] != FORMAT {
            return Err(
                Error::input(place, format!("a chain store of format {FORMAT}"))
                    .found(&attributes["format"]),
            );
        }
        let metadata = root["consolidated_metadata"]["metadata"]
            .as_object()
            .ok_or_else(|| Error::input(path.display(), "consolidated metadata"))?;
        let names: Vec<String> =
            serde_json::from_value(attributes["parameters"].clone()).map_err(|e| {
                Error::input(path.display(), "an attribute parameters of names").found(e)
            })?;
        let lp = &metadata.get("sample_stats/lp").cloned().unwrap_or_default();
        let number =
            |value: &serde_json::Value| value.as_u64().and_then(|v| usize::try_from(v).ok());
        let shape = [&lp["shape"][0], &lp["shape"][1]].map(number);
        let chunk = number(&lp["chunk_grid"]["configuration"]["chunk_shape"][1]);
        let ([Some(chains @ 1..), Some(draws)], Some(chunk @ 1..)) = (shape, chunk) else {
            return Err(Error::input(
                path.display(),
                "an array sample_stats/lp of chain x draw",
            ));
        };
        if chunk.saturating_mul(chains) > most_of_a_chunk(chains) {
            let found = format!("{chunk} draws of {chains} chains");
            return Err(Error::input(place, "chunks of about 1 MiB").found(found));
        }
        let digests = digests(&attributes["digests"], &names).ok_or_else(|| {
            Error::input(
                path.display(),
                "an attribute digests with one of every array",
            )
            .found(&attributes["digests"])
            .hint("the chain store is damaged")
        })?;
        let ensemble = zarr::read_chunk(&path.join("posterior/ensemble/c/0"), chains)?;
        let reader = Self {
            path: path.to_path_buf(),
            names,
            ensemble: ensemble.iter().map(|v| v.to_bits() as usize).collect(),
            draws,
            chunk,
            checked: Cell::new(false),
            digests,
            held: RefCell::default(),
        };
        reader.check_sizes(metadata, lp)?;
        Ok(reader)
    }

    /// Every array has the metadata of the log density's, and its last chunk.
    fn check_sizes(
        &self,
        metadata: &serde_json::Map<String, serde_json::Value>,
        lp: &serde_json::Value,
    ) -> Result<()> {
        for array in arrays(&self.names) {
            let place = || self.path.join(&array).display().to_string();
            let own = metadata.get(&array);
            if own != Some(lp) {
                let size = |of: &serde_json::Value| {
                    format!(
                        "{} in chunks of {}",
                        of["shape"], of["chunk_grid"]["configuration"]["chunk_shape"]
                    )
                };
                return Err(Error::input(place(), format!("an array of {}", size(lp)))
                    .found(own.map_or("none".into(), size))
                    .hint("the chain store is damaged"));
            }
            let last = self.draws.div_ceil(self.chunk).checked_sub(1);
            let chunk = last.map(|last| self.path.join(&array).join(format!("c/0/{last}")));
            if let Some(chunk) = chunk.filter(|chunk| !chunk.is_file()) {
                return Err(Error::input(chunk.display(), "the last chunk of the array")
                    .found(format!(
                        "no file, of {} draws that the store says it has",
                        self.draws
                    ))
                    .hint("the chain store is damaged"));
            }
        }
        Ok(())
    }

    /// Go through all draws, and compare them with their digests.
    ///
    /// # Errors
    /// The input's fault: a chunk that is missing or cut, draws that were changed.
    pub fn check(&self) -> Result<()> {
        self.each_chunk(&mut |_, _, _| Ok(()))
    }

    /// The same without what lies behind the first `draws` draws.
    ///
    /// # Errors
    /// The input's fault if there are fewer.
    pub fn first(mut self, draws: usize) -> Result<Self> {
        if draws > self.draws {
            let place = self.path.display();
            return Err(Error::input(place, format!("at least {draws} draws")).found(self.draws));
        }
        if draws < self.draws {
            // of a part, the digests say nothing
            self.checked.set(true);
        }
        self.draws = draws;
        self.held.take();
        Ok(self)
    }

    /// Names of the parameters.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Ensemble of each chain.
    pub fn ensemble(&self) -> &[usize] {
        &self.ensemble
    }

    /// Draws of each chain in a chunk.
    pub fn chunk(&self) -> usize {
        self.chunk
    }

    /// Goes through all chunks.
    ///
    /// # Errors
    /// The input's fault if one is missing or cut, or draws were changed, and what `take` returns.
    pub fn each_chunk(&self, take: TakeChunk<'_>) -> Result<()> {
        let places: Vec<PathBuf> = arrays(&self.names).map(|a| self.path.join(a)).collect();
        let mut found = vec![Digest::default(); self.digests.len()];
        for index in 0..self.draws.div_ceil(self.chunk) {
            let read = |array: &PathBuf| {
                let size = self.ensemble.len() * self.chunk;
                zarr::read_chunk(&array.join(format!("c/0/{index}")), size)
            };
            let arrays = places.iter().map(read).collect::<Result<Vec<_>>>()?;
            let first = index * self.chunk;
            let count = self.chunk.min(self.draws - first);
            if !self.checked.get() {
                let (chains, chunk) = (self.ensemble.len(), self.chunk);
                let pairs = found.par_iter_mut().zip(&arrays);
                pairs.for_each(|(digest, array)| {
                    let draws = (0..count).flat_map(|c| (0..chains).map(move |k| k * chunk + c));
                    *digest = draws.fold(*digest, |d, at| d.with(array[at].to_bits()));
                });
            }
            take(first, count, &arrays)?;
        }
        if self.checked.get() {
            return Ok(());
        }
        let mut pairs = places.iter().zip(found.iter().zip(&self.digests));
        if let Some((array, _)) = pairs.find(|(_, (found, wanted))| found != wanted) {
            return Err(Error::input(array.display(), "the draws that were written")
                .found("others")
                .hint("the chain store was changed or is damaged: run again in another folder"));
        }
        self.checked.set(true);
        Ok(())
    }

    /// The chains from `first` on that fit into memory: as many as [`HELD`] numbers, at least one.
    fn span(&self, first: usize) -> Result<Vec<Draws>> {
        let dim = self.names.len();
        let most = HELD / ((dim + 1) * self.draws).max(1);
        let last = self.ensemble.len().min(first + most.max(1));
        let count = last - first;
        let mut values = vec![vec![0.0; self.draws * dim]; count];
        let mut lp = vec![vec![0.0; self.draws]; count];
        self.each_chunk(&mut |begin, length, arrays| {
            for (k, array) in arrays.iter().enumerate() {
                let rows = array.chunks_exact(self.chunk).skip(first).take(count);
                for ((row, values), lp) in rows.zip(&mut values).zip(&mut lp) {
                    if k == dim {
                        lp[begin..begin + length].copy_from_slice(&row[..length]);
                    } else {
                        let points = values[begin * dim..].chunks_exact_mut(dim);
                        points.zip(&row[..length]).for_each(|(p, v)| p[k] = *v);
                    }
                }
            }
            Ok(())
        })?;
        let chains = values.into_iter().zip(lp).zip(&self.ensemble[first..last]);
        chains
            .map(|((values, lp), e)| Draws::new(self.names.clone(), vec![*e], values, lp))
            .collect()
    }

    /// All chains, of more than `most` draws only every second, fourth, ... of each chain (`info.thin` tells), as a run
    /// holds them in memory.
    ///
    /// # Errors
    /// The input's fault if a chunk is missing or cut.
    pub fn thinned(&self, most: usize) -> Result<Draws> {
        let (chains, dim) = (self.ensemble.len(), self.names.len());
        let mut stride = 1;
        while chains * (self.draws / stride) > most && self.draws / stride > 1 {
            stride *= 2;
        }
        let count = self.draws / stride;
        let (mut values, mut lp) = (vec![0.0; chains * count * dim], vec![0.0; chains * count]);
        self.each_chunk(&mut |first, length, arrays| {
            for (k, array) in arrays.iter().enumerate() {
                for (chain, row) in array.chunks_exact(self.chunk).enumerate() {
                    for (column, value) in row[..length].iter().enumerate() {
                        // The draws that a run of that length holds: the last of every stride.
                        let draw = first + column + 1;
                        if draw.is_multiple_of(stride) {
                            let at = chain * count + draw / stride - 1;
                            if k == dim {
                                lp[at] = *value;
                            } else {
                                values[at * dim + k] = *value;
                            }
                        }
                    }
                }
            }
            Ok(())
        })?;
        let mut draws = Draws::new(self.names.clone(), self.ensemble.clone(), values, lp)?;
        draws.info.thin = stride;
        Ok(draws)
    }
}

/// The digests of a store's arrays; nothing where some are missing.
fn digests(written: &serde_json::Value, names: &[String]) -> Option<Vec<Digest>> {
    let of = |array: String| u64::from_str_radix(written[array].as_str()?, 16).ok();
    arrays(names).map(|array| of(array).map(Digest)).collect()
}

impl Chains for StoreReader {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn count(&self) -> usize {
        self.ensemble.len()
    }

    fn groups(&self) -> Vec<Vec<usize>> {
        groups(&self.ensemble)
    }

    fn chain(&self, chain: usize) -> Result<Draws> {
        let mut held = self.held.borrow_mut();
        if !(held.0..held.0 + held.1.len()).contains(&chain) {
            *held = (chain, self.span(chain)?);
        }
        Ok(held.1[chain - held.0].clone())
    }
}

/// Reads a store: all its draws, or the first `draws` of them.
///
/// # Errors
/// The input's fault: no store, another format, missing or cut files.
pub fn read(path: &Path, draws: Option<usize>) -> Result<Draws> {
    let reader = StoreReader::open(path)?;
    match draws {
        Some(draws) => reader.first(draws)?.thinned(usize::MAX),
        None => reader.thinned(usize::MAX),
    }
}

/// Compare all draws of a run's folder, those of a loop's rounds and those to quote too, with their digests.
///
/// # Errors
/// The input's fault: a store that is cut or was changed.
pub fn check_stores(folder: &Path) -> Result<()> {
    let below = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut places: Vec<PathBuf> = below.map(|entry| entry.path()).collect();
    places.push(folder.to_path_buf());
    places.sort();
    for store in places.iter().map(|place| place.join("chain.zarr")) {
        if store.is_dir() {
            StoreReader::open(&store)?.check()?;
        }
    }
    Ok(())
}
