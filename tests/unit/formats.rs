//! Chain stores and exports: round trips here, and other people's readers where Python has them.

use std::path::{Path, PathBuf};

use crate::common::python;
use plychain::chain::{
    Draws, Layout, Store, StoreReader, read_csv, read_getdist, read_zarr, write_csv, write_getdist,
    write_npz, write_stan, write_zarr,
};

/// Four chains of 90 draws that differ in every number.
fn draws() -> Draws {
    let value = |k: usize| ((k * 7919) % 1009) as f64 / 1009.0 + 1e-3 * (k as f64).sin();
    let values = (0..4 * 90 * 3).map(value).collect();
    let lp = (0..4 * 90).map(|k| -0.5 * value(k)).collect();
    let names = ["E1_GPa", "nu12", "hole_offset.dx_mm"].map(String::from);
    Draws::new(names.to_vec(), vec![0, 0, 1, 1], values, lp).unwrap()
}

fn layout(draws: &Draws) -> Layout {
    Layout {
        names: draws.names().to_vec(),
        walkers: 2,
        ensembles: 2,
        observed: vec![("alpha_mm".into(), vec![1.0, 2.0])],
    }
}

/// Writes draws into a store in uneven pieces with a flush after each.
fn store(draws: &Draws, path: &Path) {
    let mut store = Store::create(path, layout(draws), serde_json::json!({})).unwrap();
    append(draws, &[1, 30, 7, 52], &mut store);
    store.finalize(&[0.5; 4]).unwrap();
}

fn append(draws: &Draws, counts: &[usize], store: &mut Store) {
    let mut first = store.draws();
    for &count in counts {
        let part = |ensemble: usize| {
            let (mut x, mut lp) = (Vec::new(), Vec::new());
            for draw in first..first + count {
                let chains = 2 * ensemble..2 * ensemble + 2;
                for k in 0..draws.dim() {
                    x.extend(chains.clone().map(|c| draws.point(c, draw)[k]));
                }
                lp.extend(chains.map(|c| draws.lp()[c * draws.draws() + draw]));
            }
            (x, lp)
        };
        let parts = [part(0), part(1)];
        let blocks: Vec<(&[f64], &[f64])> = parts.iter().map(|(x, lp)| (&**x, &**lp)).collect();
        store.record(&blocks).unwrap();
        store.flush(&[0.5; 4]).unwrap();
        first += count;
    }
}

/// Every file below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let below = |path: PathBuf| match path.is_dir() {
        true => files(&path),
        false => vec![path],
    };
    entries.flat_map(|e| below(e.unwrap().path())).collect()
}

fn same(a: &Draws, b: &Draws) {
    assert_eq!(a.values(), b.values());
    assert_eq!(a.lp(), b.lp());
    assert_eq!(a.chains(), b.chains());
}

#[test]
fn every_format_reads_back() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let draws = draws();
    store(&draws, &at("chain.zarr"));
    let stored = read_zarr(&at("chain.zarr"), None).unwrap();
    same(&draws, &stored);
    assert_eq!(
        (draws.names(), draws.ensemble()),
        (stored.names(), stored.ensemble())
    );
    assert_eq!(read_zarr(&at("chain.zarr"), Some(31)).unwrap().draws(), 31);
    write_csv(&draws, &at("chain.csv")).unwrap();
    same(&draws, &read_csv(&[&at("chain.csv")]).unwrap());
    write_stan(&draws, &at("stan")).unwrap();
    // one file an ensemble, its walkers one after the other
    let ensembles = draws.ensembles();
    let files: Vec<_> = (1..=ensembles)
        .map(|k| at(&format!("stan_{k}.csv")))
        .collect();
    let files: Vec<&Path> = files.iter().map(|f| f.as_path()).collect();
    let back = read_csv(&files).unwrap();
    assert_eq!((draws.values(), draws.lp()), (back.values(), back.lp()));
    assert_eq!(back.chains(), ensembles);
    write_getdist(&draws, &at("getdist")).unwrap();
    let back = read_getdist(&at("getdist")).unwrap();
    assert_eq!((draws.values(), draws.lp()), (back.values(), back.lp()));
    assert_eq!((draws.names(), back.chains()), (back.names(), ensembles));
}

/// A complete store takes no more place than its numbers; one that grows has room for 16,384 draws in its last chunk, which takes little.
#[test]
fn a_store_is_as_large_as_its_draws() {
    let place = tempfile::tempdir().unwrap();
    let size = |path: &Path| {
        let lengths = files(path).into_iter();
        lengths.map(|f| f.metadata().unwrap().len()).sum::<u64>()
    };
    let numbers = 8 * 4 * 90 * 4;
    for (name, write, room) in [
        ("grown", store as fn(&Draws, &Path), 100_000),
        ("complete", |d, p| write_zarr(d, p).unwrap(), 3000),
    ] {
        let path = place.path().join(name);
        write(&draws(), &path);
        same(&draws(), &read_zarr(&path, None).unwrap());
        let metadata: u64 = files(&path)
            .iter()
            .filter(|f| f.ends_with("zarr.json"))
            .map(|f| f.metadata().unwrap().len())
            .sum();
        let taken = size(&path) - metadata;
        // coordinates and the headers of files
        assert!(taken < numbers + room, "{name}: {taken} bytes");
    }
}

#[test]
fn a_store_is_never_overwritten() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("chain.zarr");
    store(&draws(), &path);
    let layout = Layout {
        names: vec!["a".into()],
        walkers: 1,
        ensembles: 1,
        observed: Vec::new(),
    };
    assert!(Store::create(&path, layout, serde_json::json!({})).is_err());
}

const SCRIPT: &str = r#"
import sys, numpy as np, pandas as pd, xarray as xr
from getdist import loadMCSamples
tree = xr.open_datatree("chain.zarr", engine="zarr")
x = tree.posterior["E1_GPa"].values
assert tree.posterior["E1_GPa"].dims == ("chain", "draw") and x.shape == (4, 90)
assert tree.posterior.ensemble.values.tolist() == [0, 0, 1, 1]
assert tree.sample_stats["lp"].shape == (4, 90) and tree.sample_stats["acceptance_rate"].values[0] == 0.5
assert tree.observed_data["alpha_mm"].values.tolist() == [1.0, 2.0]
table = pd.read_csv("chain.csv")
assert np.array_equal(table["E1_GPa"].to_numpy().reshape(4, 90), x)
emcee = np.load("chain.npz")
assert np.array_equal(emcee["chain"][:, :, 0].T, x) and emcee["names"][1] == "nu12"
assert np.array_equal(emcee["log_prob"].T, tree.sample_stats["lp"].values)
samples = loadMCSamples("./getdist", settings={"ignore_rows": 0})
assert np.allclose(samples.mean("E1_GPa"), x.mean())
"#;

#[test]
#[ignore = "needs Python"]
fn other_programs_read_the_files() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let draws = draws();
    store(&draws, &at("chain.zarr"));
    write_csv(&draws, &at("chain.csv")).unwrap();
    write_npz(&draws, &at("chain.npz")).unwrap();
    write_getdist(&draws, &at("getdist")).unwrap();
    let output = python()
        .args(["-c", SCRIPT])
        .current_dir(place.path())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// The Python of runs/README.md, word for word, on a run of the usual shape.
#[test]
#[ignore = "needs Python"]
fn the_scripts_of_the_readme_run() {
    let readme = std::fs::read_to_string("runs/README.md").unwrap();
    let script = readme.split("```python\n").nth(1).unwrap();
    let script = script.split("```").next().unwrap();
    let getdist = readme
        .split('`')
        .find(|t| t.starts_with("getdist.loadMCSamples("))
        .unwrap();
    let place = tempfile::tempdir().unwrap();
    let run = place.path().join("runs/openhole");
    let store = run.join("averaged/chain.zarr");
    std::fs::create_dir_all(run.join("averaged")).unwrap();
    let layout = Layout {
        names: ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"]
            .map(String::from)
            .to_vec(),
        walkers: 24,
        ensembles: 4,
        observed: Vec::new(),
    };
    let mut chains = Store::create(&store, layout, serde_json::json!({})).unwrap();
    let mut rng = plychain::sample::Stream::at(
        plychain::sample::Key {
            seed: 1,
            ensemble: 0,
        },
        0,
        0,
    );
    let mut block = |count: usize| (0..count).map(|_| rng.normal()).collect::<Vec<f64>>();
    let blocks: Vec<_> = (0..4)
        .map(|_| (block(200 * 4 * 24), block(200 * 24)))
        .collect();
    let blocks: Vec<(&[f64], &[f64])> = blocks.iter().map(|(x, lp)| (&**x, &**lp)).collect();
    chains.record(&blocks).unwrap();
    chains.finalize(&[0.5; 96]).unwrap();
    write_getdist(&StoreReader::open(&store).unwrap(), &run.join("export")).unwrap();
    for script in [script.to_string(), format!("import getdist\n{getdist}")] {
        let output = python()
            .args(["-c", &script])
            .env("MPLBACKEND", "Agg")
            .current_dir(place.path())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{script}\n{text}");
    }
    for figure in ["corner.png", "trace.png", "rank.png"] {
        assert!(place.path().join(figure).is_file(), "{figure}");
    }
}
