//! Reading a chain store piece by piece: a chunk of all chains, or one chain at all times. A store of any length is read
//! in little memory.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::draws::{Chains, Draws, groups};
use super::zarr;
use super::zarr::FORMAT;
use crate::error::{Error, Result};

/// Takes the first draw of a chunk, its number of draws, and its arrays (the parameters, then the log density; each
/// chain x chunk length).
pub type TakeChunk<'a> = &'a mut dyn FnMut(usize, usize, &[Vec<f64>]) -> Result<()>;

/// A store opened for reading.
#[derive(Debug, Clone)]
pub struct Reader {
    path: PathBuf,
    names: Vec<String>,
    ensemble: Vec<usize>,
    draws: usize,
    chunk: usize,
}

impl Reader {
    /// Opens a store.
    ///
    /// # Errors
    /// The input's fault: no store, another format, missing files.
    pub fn open(path: &Path) -> Result<Self> {
        let place = path.display();
        let root = zarr::read_metadata(path)?;
        if root["attributes"]["format"] != FORMAT {
            return Err(
                Error::input(place, format!("a chain store of format {FORMAT}"))
                    .found(&root["attributes"]["format"]),
            );
        }
        let metadata = root["consolidated_metadata"]["metadata"]
            .as_object()
            .ok_or_else(|| Error::input(path.display(), "consolidated metadata"))?;
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
        let names =
            serde_json::from_value(root["attributes"]["parameters"].clone()).map_err(|e| {
                Error::input(path.display(), "an attribute parameters of names").found(e)
            })?;
        let ensemble = zarr::read_chunk(&path.join("posterior/ensemble/c/0"), chains)?;
        Ok(Self {
            path: path.to_path_buf(),
            names,
            ensemble: ensemble.iter().map(|v| v.to_bits() as usize).collect(),
            draws,
            chunk,
        })
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
        self.draws = draws;
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

    /// Draws of each chain.
    pub fn draws(&self) -> usize {
        self.draws
    }

    /// Draws of each chain in a chunk.
    pub fn chunk(&self) -> usize {
        self.chunk
    }

    fn arrays(&self) -> impl Iterator<Item = PathBuf> {
        let names = self.names.iter().map(|n| format!("posterior/{n}"));
        let names = names.chain(["sample_stats/lp".to_string()]);
        names.map(|name| self.path.join(name).join("c/0"))
    }

    /// Goes through all chunks.
    ///
    /// # Errors
    /// The input's fault if one is missing or cut, and what `take` returns.
    pub fn each_chunk(&self, take: TakeChunk<'_>) -> Result<()> {
        for index in 0..self.draws.div_ceil(self.chunk) {
            let read = |array: PathBuf| {
                zarr::read_chunk(
                    &array.join(index.to_string()),
                    self.ensemble.len() * self.chunk,
                )
            };
            let arrays = self.arrays().map(read).collect::<Result<Vec<_>>>()?;
            let first = index * self.chunk;
            take(first, self.chunk.min(self.draws - first), &arrays)?;
        }
        Ok(())
    }

    /// One chain of one array: a stretch of each of its files.
    fn row(&self, array: &Path, chain: usize) -> Result<Vec<f64>> {
        let mut row = Vec::with_capacity(self.draws);
        let mut bytes = vec![0; 8 * self.chunk];
        for index in 0..self.draws.div_ceil(self.chunk) {
            let path = array.join(index.to_string());
            let at = SeekFrom::Start((8 * chain * self.chunk) as u64);
            let mut fill = || {
                let mut file = File::open(&path)?;
                file.seek(at)?;
                file.read_exact(&mut bytes)
            };
            fill()
                .map_err(|e| Error::input(path.display(), "a chunk of the chain store").found(e))?;
            let (words, _) = bytes.as_chunks::<8>();
            let left = self.chunk.min(self.draws - row.len());
            row.extend(words[..left].iter().map(|w| f64::from_le_bytes(*w)));
        }
        Ok(row)
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

impl Chains for Reader {
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
        let dim = self.names.len();
        let (mut values, mut lp) = (vec![0.0; self.draws * dim], Vec::new());
        for (k, array) in self.arrays().enumerate() {
            let column = self.row(&array, chain)?;
            if k == dim {
                lp = column;
            } else {
                let points = values.chunks_exact_mut(dim);
                points.zip(column).for_each(|(point, v)| point[k] = v);
            }
        }
        Draws::new(self.names.clone(), vec![self.ensemble[chain]], values, lp)
    }
}

/// Reads a store: all its draws, or the first `draws` of them.
///
/// # Errors
/// The input's fault: no store, another format, missing or cut files.
pub fn read(path: &Path, draws: Option<usize>) -> Result<Draws> {
    let reader = Reader::open(path)?;
    match draws {
        Some(draws) => reader.first(draws)?.thinned(usize::MAX),
        None => reader.thinned(usize::MAX),
    }
}
