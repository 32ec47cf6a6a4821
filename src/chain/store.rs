//! `chain.zarr`: the draws of a run as ArviZ reads them (groups `posterior`, `sample_stats`, `observed_data`; dimensions
//! `chain`, `draw`; coordinate `ensemble` on `chain`), appended while the run goes. Three calls: record, flush, finalize.
//!
//! A chunk holds all chains over a stretch of draws. What a reader may see is fixed by the root's metadata, which is
//! replaced last; draws beyond the stored shape are not there yet.

use std::path::{Path, PathBuf};

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use serde_json::{Value, json};

use super::digest::Digest;
use super::draws::Draws;
use super::reader::StoreReader;
use super::zarr::{self, ArrayKind, CHUNK, FORMAT, arrays};
use crate::error::{Error, Result};

/// What the draws of a run are called.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Walkers of an ensemble.
    pub walkers: usize,
    pub ensembles: usize,
    /// Measured numbers that the posterior depends on, by name.
    pub observed: Vec<(String, Vec<f64>)>,
}

impl Layout {
    pub fn chains(&self) -> usize {
        self.walkers * self.ensembles
    }

    /// The arrays of draws: the parameters', last that of the log density.
    fn arrays(&self) -> impl Iterator<Item = String> {
        arrays(&self.names)
    }

    /// Draws of a chunk where it is not known how many there will be.
    fn chunk(&self) -> usize {
        (CHUNK / self.chains().max(1))
            .clamp(1, 1 << 14)
            .next_power_of_two()
    }
}

/// Write draws that are complete as a new store.
///
/// # Errors
/// The input's fault if the place exists or cannot be written.
pub fn write_zarr(draws: &Draws, path: &Path) -> Result<()> {
    let walkers = draws.chains() / draws.ensembles().max(1);
    let layout = Layout {
        names: draws.names().to_vec(),
        walkers,
        ensembles: draws.ensembles(),
        observed: Vec::new(),
    };
    let chunk = layout.chunk().min(draws.draws().max(1));
    let mut store = Store::made(path, (layout, chunk), json!({}))?;
    let (count, dim) = (draws.draws(), draws.dim());
    let of = |ensemble: usize| {
        let (mut x, mut lp) = (Vec::new(), Vec::new());
        for draw in 0..count {
            let at = |walker: usize| (ensemble * walkers + walker) * count + draw;
            for k in 0..dim {
                x.extend((0..walkers).map(|w| draws.values()[at(w) * dim + k]));
            }
            lp.extend((0..walkers).map(|w| draws.lp()[at(w)]));
        }
        (x, lp)
    };
    let blocks: Vec<(Vec<f64>, Vec<f64>)> = (0..draws.ensembles()).map(of).collect();
    let blocks: Vec<(&[f64], &[f64])> = blocks.iter().map(|(x, lp)| (&x[..], &lp[..])).collect();
    store.record(&blocks)?;
    store.finalize(&draws.info.acceptance)
}

/// Takes an ensemble's index, its positions (parameter x walker) and log densities of one draw.
pub type Replay<'a> = &'a mut dyn FnMut(usize, &[f64], &[f64]);

/// A store that is being written.
pub struct Store {
    path: PathBuf,
    layout: Layout,
    chunk: usize,
    /// The last chunk of each array (parameters, then lp), chain x draw.
    last: Vec<Vec<f64>>,
    /// Draws recorded of each chain.
    draws: usize,
    /// First draw that is not on disk yet.
    written: usize,
    digests: Vec<Digest>,
    acceptance: Vec<f64>,
    attributes: Value,
}

impl Store {
    /// Makes the store, which must not exist.
    ///
    /// # Errors
    /// The input's fault if the place exists or cannot be written.
    pub fn create(path: &Path, layout: Layout, attributes: Value) -> Result<Self> {
        let chunk = layout.chunk();
        Self::made(path, (layout, chunk), attributes)
    }

    fn made(path: &Path, layout: (Layout, usize), attributes: Value) -> Result<Self> {
        if path.exists() {
            return Err(
                Error::input(path.display(), "a place for a new chain store").found("an old one"),
            );
        }
        let mut store = Self::empty(path, layout, attributes);
        store.flush(&[])?;
        Ok(store)
    }

    fn empty(path: &Path, (layout, chunk): (Layout, usize), attributes: Value) -> Self {
        let arrays = layout.names.len() + 1;
        Self {
            path: path.to_path_buf(),
            chunk,
            last: vec![vec![f64::NAN; chunk * layout.chains()]; arrays],
            draws: 0,
            written: 0,
            digests: vec![Digest::default(); arrays],
            acceptance: Vec::new(),
            attributes,
            layout,
        }
    }

    /// Opens a store to append after its first `draws` draws, whose digest must be `digest`; `replay` gets the rows
    /// (parameter x walker, then walker) of every ensemble in turn.
    ///
    /// # Errors
    /// The input's fault if the store is damaged or of another layout.
    pub fn reopen(
        path: &Path,
        layout: Layout,
        attributes: Value,
        (draws, digest): (usize, u64),
        replay: Replay<'_>,
    ) -> Result<Self> {
        let reader = StoreReader::open(path)?.first(draws)?;
        let chunk = layout.chunk();
        let mut store = Self::empty(path, (layout, chunk), attributes);
        let damaged = |found: String| {
            Error::input(path.display(), "the draws that the checkpoint tells of")
                .found(found)
                .hint("the store is damaged or was changed: it is left as it is; start a new run in another folder")
        };
        let same = reader.names() == store.layout.names && reader.chunk() == chunk;
        if !same || reader.ensemble().len() != store.layout.chains() {
            return Err(damaged(format!(
                "{} chains of {}, in pieces of {}",
                reader.ensemble().len(),
                reader.names().join(", "),
                reader.chunk()
            )));
        }
        let (walkers, dim) = (store.layout.walkers, store.layout.names.len());
        let (mut x, mut lp) = (vec![0.0; walkers * dim], vec![0.0; walkers]);
        reader.each_chunk(&mut |first, count, arrays| {
            for column in 0..count {
                for ensemble in 0..store.layout.ensembles {
                    let rows = x
                        .chunks_exact_mut(walkers)
                        .chain(std::iter::once(&mut lp[..]));
                    for (row, array) in rows.zip(arrays) {
                        let chains = array.chunks_exact(reader.chunk()).skip(ensemble * walkers);
                        row.iter_mut().zip(chains).for_each(|(v, c)| *v = c[column]);
                    }
                    store.put(ensemble, first + column, &x, &lp);
                    replay(ensemble, &x, &lp);
                }
                store.draws = first + column + 1;
                if store.draws.is_multiple_of(store.chunk) {
                    store.clear();
                }
            }
            Ok(())
        })?;
        store.written = draws;
        if store.digest() != digest {
            return Err(damaged("draws of another digest".into()));
        }
        Ok(store)
    }

    /// Draws recorded of each chain.
    pub fn draws(&self) -> usize {
        self.draws
    }

    /// A digest of every draw recorded.
    pub fn digest(&self) -> u64 {
        self.digests
            .iter()
            .fold(0, |all, d| Digest(all).with(d.0).0)
    }

    /// Records draws: for each ensemble its positions (draw x parameter x walker) and log densities (draw x walker).
    ///
    /// # Errors
    /// The input's fault if a full chunk cannot be written.
    pub fn record(&mut self, blocks: &[(&[f64], &[f64])]) -> Result<()> {
        let (walkers, dim) = (self.layout.walkers, self.layout.names.len());
        let count = blocks.first().map_or(0, |(_, lp)| lp.len() / walkers);
        for draw in 0..count {
            for (ensemble, (x, lp)) in blocks.iter().enumerate() {
                let rows = draw * walkers..(draw + 1) * walkers;
                self.put(
                    ensemble,
                    self.draws,
                    &x[rows.start * dim..rows.end * dim],
                    &lp[rows],
                );
            }
            self.draws += 1;
            if self.draws.is_multiple_of(self.chunk) {
                self.write_chunk(self.draws / self.chunk - 1)?;
                self.clear();
            }
        }
        Ok(())
    }

    /// Puts one draw of an ensemble into the last chunk.
    fn put(&mut self, ensemble: usize, draw: usize, x: &[f64], lp: &[f64]) {
        let (walkers, column) = (self.layout.walkers, draw % self.chunk);
        let arrays = self.last.iter_mut().zip(&mut self.digests);
        let rows = x.chunks_exact(walkers).chain(std::iter::once(lp));
        for ((last, digest), row) in arrays.zip(rows) {
            let chains = last.chunks_exact_mut(self.chunk).skip(ensemble * walkers);
            for (chain, value) in chains.zip(row) {
                chain[column] = *value;
                *digest = digest.with(value.to_bits());
            }
        }
    }

    fn clear(&mut self) {
        self.last.iter_mut().for_each(|last| last.fill(f64::NAN));
    }

    /// Writes one chunk's file.
    fn replace(&self, path: &str, bytes: Vec<u8>) -> Result<()> {
        zarr::replace(&self.path.join(path), &zarr::packed(&bytes))
    }

    fn write_chunk(&mut self, index: usize) -> Result<()> {
        let arrays: Vec<_> = self.layout.arrays().zip(&self.last).collect();
        arrays.into_par_iter().try_for_each(|(array, values)| {
            self.replace(&format!("{array}/c/0/{index}"), zarr::floats(values))
        })?;
        for group in GROUPS {
            let first = (index * self.chunk) as i64;
            let values = zarr::integers(first..first + self.chunk as i64);
            self.replace(&format!("{group}/draw/c/{index}"), values)?;
        }
        self.written = self.draws;
        Ok(())
    }

    /// Brings everything recorded to disk, `acceptance` of each chain (may be empty) with it.
    ///
    /// # Errors
    /// The input's fault if a file cannot be written.
    pub fn flush(&mut self, acceptance: &[f64]) -> Result<()> {
        if !self.draws.is_multiple_of(self.chunk) && self.written < self.draws {
            self.write_chunk(self.draws / self.chunk)?;
        }
        let chains = self.layout.chains();
        self.acceptance = acceptance.to_vec();
        self.acceptance.resize(chains, f64::NAN);
        let rates = zarr::floats(&self.acceptance);
        self.replace("sample_stats/acceptance_rate/c/0", rates)?;
        if !self.path.join("zarr.json").exists() {
            self.write_constants()?;
        }
        let nodes = self.nodes();
        for (node, metadata) in &nodes {
            zarr::replace_metadata(&self.path.join(node), metadata)?;
        }
        let root = zarr::group(&self.attributes());
        zarr::replace_metadata(&self.path, &zarr::consolidated(&root, &nodes))
    }

    /// The last flush.
    ///
    /// # Errors
    /// The input's fault if a file cannot be written.
    pub fn finalize(mut self, acceptance: &[f64]) -> Result<()> {
        self.flush(acceptance)
    }

    fn attributes(&self) -> Value {
        let mut attributes = self.attributes.clone();
        attributes["format"] = json!(FORMAT);
        attributes["parameters"] = json!(self.layout.names);
        attributes["inference_library"] = json!("plychain");
        let arrays = self.layout.arrays().zip(&self.digests);
        let digests = arrays.map(|(array, digest)| (array, json!(digest.hex())));
        attributes["digests"] = Value::Object(digests.collect());
        attributes
    }

    fn write_constants(&self) -> Result<()> {
        let chains = self.layout.chains() as i64;
        let walkers = self.layout.walkers as i64;
        for group in GROUPS {
            self.replace(&format!("{group}/chain/c/0"), zarr::integers(0..chains))?;
            let ensembles = zarr::integers((0..chains).map(|c| c / walkers));
            self.replace(&format!("{group}/ensemble/c/0"), ensembles)?;
        }
        for (name, values) in &self.layout.observed {
            self.replace(&format!("observed_data/{name}/c/0"), zarr::floats(values))?;
        }
        Ok(())
    }

    /// Every group and array with its metadata.
    fn nodes(&self) -> Vec<(String, Value)> {
        let (chains, draws, chunk) = (self.layout.chains(), self.draws, self.chunk);
        let [float, integer] = [ArrayKind::Float, ArrayKind::Integer];
        let both =
            |shape: [usize; 2]| zarr::array(float, &shape, &[chains, chunk], &["chain", "draw"]);
        let mut nodes = Vec::new();
        for group in GROUPS {
            // xarray takes as coordinates what the attribute names.
            nodes.push((
                group.into(),
                zarr::group(&json!({ "coordinates": "ensemble" })),
            ));
            let draw = zarr::array(integer, &[draws], &[chunk], &["draw"]);
            nodes.push((format!("{group}/draw"), draw));
            for name in ["chain", "ensemble"] {
                let array = zarr::array(integer, &[chains], &[chains], &["chain"]);
                nodes.push((format!("{group}/{name}"), array));
            }
        }
        for name in &self.layout.names {
            nodes.push((format!("posterior/{name}"), both([chains, draws])));
        }
        nodes.push(("sample_stats/lp".into(), both([chains, draws])));
        let rates = zarr::array(float, &[chains], &[chains], &["chain"]);
        nodes.push(("sample_stats/acceptance_rate".into(), rates));
        nodes.push(("observed_data".into(), zarr::group(&json!({}))));
        for (name, values) in &self.layout.observed {
            let count = [values.len()];
            let dimension = format!("{name}_dim_0");
            let array = zarr::array(float, &count, &count, &[&dimension]);
            nodes.push((format!("observed_data/{name}"), array));
        }
        // Readers of consolidated metadata want the members of a group together.
        nodes.sort_by(|a, b| a.0.split('/').cmp(b.0.split('/')));
        nodes
    }
}

/// Groups with chains and draws.
const GROUPS: [&str; 2] = ["posterior", "sample_stats"];
