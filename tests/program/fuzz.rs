//! Readers on broken input: a hundred thousand mutated files end in a field, in draws, or in an error that names its
//! place; never in a panic, never in a reader that hangs or asks for memory without bound.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use plychain::chain::{
    Draws, Layout, Store, read_csv, read_getdist, read_zarr, write_csv, write_getdist, write_stan,
};
use plychain::error::{Error, Result};
use plychain::field::{Axis, ColumnMap, Columns, Frame, Units, matrices, table};
use plychain::infer::Model;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Dxsm;

/// Processor time that all readers may take on all files, s: several times what they need, but no reader that hangs ends.
const PROCESSOR: u64 = 1800;

/// Environment variable: the share of the mutated files that are read.
const SHARE: &str = "PLYCHAIN_FUZZ_SHARE";

/// Memory that the readers may have, KiB.
const MEMORY: u64 = 1 << 20;

/// This share of a number of mutated files.
fn share_of(count: usize) -> usize {
    let share = std::env::var(SHARE).ok().and_then(|s| s.parse().ok());
    (share.unwrap_or(1.0_f64) * count as f64).ceil() as usize
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn mutated_files_never_panic_hang_or_take_memory_without_bound() {
    readers_stand("0.2");
}

#[test]
#[ignore = "length: 4 minutes"]
fn five_times_as_many_mutated_files_never_panic_hang_or_take_memory_without_bound() {
    readers_stand("1");
}

/// All readers on a share of the mutated files.
fn readers_stand(share: &str) {
    // in a process of its own, whose memory and processor time are limited: a reader that asks for more ends it
    let own = std::env::current_exe().unwrap();
    let script = format!(
        "ulimit -d {MEMORY} && ulimit -t {PROCESSOR} && exec \"$0\" fuzz::all_readers --exact --ignored --nocapture"
    );
    let output = Command::new("sh")
        .args(["-c", &script])
        .arg(&own)
        .env("RAYON_NUM_THREADS", "2")
        .env(SHARE, share)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && said.contains("1 passed"),
        "{said}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
#[ignore = "run by the tests above in a process of limited memory, 1 minute"]
fn all_readers() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    models();
    csv_fields(&at("field.csv"));
    matrix_fields(&at("matrices"));
    chain_csv(&at("chain.csv"));
    stan(&at("stan"));
    getdist(&at("root"));
    zarr(&at("chain.zarr"));
    reports(&at("run"));
}

/// Text that numbers and structure are replaced by.
const TOKENS: &[&str] = &[
    "NaN",
    "inf",
    "-inf",
    "1e999",
    "-1e999",
    "1e308",
    "1e-320",
    "0",
    "-0",
    "-1",
    "18446744073709551616",
    "99999999999999999999999",
    "4294967296",
    "1000000000000",
    "null",
    "true",
    "\"\"",
    "[]",
    "{}",
    "[",
    "]",
    "{",
    "}",
    ",",
    ";",
    "\t",
    "\n",
    "\r",
    "\"",
    "'",
    "#",
    " ",
    "\u{0}",
    "\u{feff}",
    "\u{b5}",
    "\u{1f980}",
    "--",
    "..",
    "e",
    "0x10",
    "1.2.3",
];

/// A mutated copy: bytes flipped, pieces cut, doubled, moved, tokens put in, numbers replaced.
fn mutate(bytes: &[u8], rng: &mut Pcg64Dxsm) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..rng.random_range(1..4) {
        if out.is_empty() {
            out.extend(b"0");
        }
        let at = rng.random_range(0..out.len());
        let end = (at + rng.random_range(1..40)).min(out.len());
        let token = TOKENS[rng.random_range(0..TOKENS.len())]
            .as_bytes()
            .to_vec();
        match rng.random_range(0..8) {
            0 => out[at] ^= 1 << rng.random_range(0..8),
            1 => drop(out.drain(at..end)),
            2 => {
                let piece = out[at..end].to_vec();
                out.splice(at..at, piece);
            }
            3 => out.truncate(at),
            4 => drop(out.splice(at..at, token)),
            5 => {
                let other = rng.random_range(0..out.len());
                out.swap(at, other);
            }
            _ => {
                // the number at or after this place becomes something else
                let numeric = |b: &u8| b.is_ascii_digit() || b".-+eE".contains(b);
                let Some(start) = out[at..].iter().position(u8::is_ascii_digit) else {
                    continue;
                };
                let start = at + start;
                let length = out[start..].iter().take_while(|b| numeric(b)).count();
                out.splice(start..start + length, token);
            }
        }
    }
    out
}

/// Read `count` mutated versions of `original`; an error must name one of `names`. Some must be refused, or nothing was tested.
fn feed(
    what: &str,
    original: &[u8],
    count: usize,
    names: &[&str],
    read: &mut dyn FnMut(&[u8]) -> Result<()>,
) {
    let mut rng = Pcg64Dxsm::seed_from_u64(what.bytes().map(u64::from).sum());
    let (mut refused, count) = (0, share_of(count));
    read(original).unwrap_or_else(|e| panic!("{what}: the original is refused: {e}"));
    for _ in 0..count {
        let mutated = mutate(original, &mut rng);
        let outcome = read(&mutated);
        if let Err(error) = outcome {
            refused += 1;
            named(what, &error, names, &mutated);
        }
    }
    assert!(
        20 * refused > count,
        "{what}: only {refused} of {count} were refused"
    );
}

fn named(what: &str, error: &Error, names: &[&str], mutated: &[u8]) {
    let text = error.to_string();
    assert!(
        names.iter().any(|name| text.contains(name)) && text.contains("expected"),
        "{what}: \"{text}\" names none of {names:?} for {:?}",
        String::from_utf8_lossy(mutated)
    );
}

fn shipped(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("models")
        .join(name);
    fs::read(path).unwrap()
}

fn models() {
    for name in ["openhole.json", "steel-s235.json"] {
        let path = Path::new("models").join(name);
        feed(name, &shipped(name), 20_000, &[name], &mut |bytes| {
            let text = String::from_utf8_lossy(bytes);
            let model = Model::parse(&text, &path)?;
            // what is accepted can be used
            let _ = (model.scene(), model.marginals());
            Ok(())
        });
    }
}

fn frame() -> Frame {
    Frame {
        loading_axis: Axis::X,
        hole_center_mm: [0.0, 0.0],
    }
}

fn csv_fields(path: &Path) {
    let mut text = String::from("# a comment\nx_mm,y_mm,ux_mm,uy_mm,sigma\n");
    for k in 0..40 {
        let (x, y) = (f64::from(k % 8), f64::from(k / 8));
        text += &format!("{x:.3},{y:.3},{:.6},{:.6},0.01\n", 1e-3 * x, -3e-4 * y);
    }
    let [x, y, ux, uy] = ["x_mm", "y_mm", "ux_mm", "uy_mm"].map(String::from);
    let columns = Columns::new([x, y, ux, uy]);
    let units = Units::new("mm", "mm");
    let map = ColumnMap { columns, units };
    feed(
        "table",
        text.as_bytes(),
        20_000,
        &["field.csv"],
        &mut |bytes| {
            fs::write(path, bytes).unwrap();
            table::read(path, &map, frame()).map(drop)
        },
    );
}

fn matrix_fields(dir: &Path) {
    fs::create_dir_all(dir).unwrap();
    let matrix = |f: &dyn Fn(f64, f64) -> f64| -> String {
        let row = |i: i32| -> String {
            let cells = (0..7).map(|j| format!("{:.5}", f(f64::from(j), f64::from(i))));
            cells.collect::<Vec<_>>().join(" ")
        };
        (0..7).map(row).collect::<Vec<_>>().join("\n") + "\n"
    };
    let files = [
        ("X.txt", matrix(&|x, _| x)),
        ("Y.txt", matrix(&|_, y| y)),
        ("U.txt", matrix(&|_, y| 0.7 * y)),
        ("V.txt", matrix(&|x, _| -0.2 * x)),
    ];
    let write = |name: &str, bytes: &[u8]| fs::write(dir.join(name), bytes).unwrap();
    files
        .iter()
        .for_each(|(name, text)| write(name, text.as_bytes()));
    for (name, text) in &files {
        feed(
            name,
            text.as_bytes(),
            3_000,
            &["X.txt", "Y.txt", "U.txt", "V.txt", "matrices"],
            &mut |bytes| {
                write(name, bytes);
                matrices::read(dir, frame()).map(drop)
            },
        );
        write(name, text.as_bytes());
    }
}

fn draws() -> Draws {
    let values = (0..4 * 10 * 2)
        .map(|k| 1.0 + 0.37 * f64::from(k % 11))
        .collect();
    let lp = (0..40).map(|k| -0.5 * f64::from(k % 7)).collect();
    let names = vec!["E1_GPa".to_string(), "nu12".to_string()];
    Draws::new(names, vec![0, 0, 1, 1], values, lp).unwrap()
}

fn chain_csv(path: &Path) {
    write_csv(&draws(), path).unwrap();
    let original = fs::read(path).unwrap();
    feed("chain", &original, 12_000, &["chain.csv"], &mut |bytes| {
        fs::write(path, bytes).unwrap();
        read_csv(&[path]).map(drop)
    });
}

fn stan(stem: &Path) {
    write_stan(&draws(), stem).unwrap();
    let path = |k: usize| PathBuf::from(format!("{}_{k}.csv", stem.display()));
    let paths: Vec<PathBuf> = (1..=draws().ensembles()).map(path).collect();
    let all: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
    let original = fs::read(all[1]).unwrap();
    feed("stan", &original, 6_000, &["stan_"], &mut |bytes| {
        fs::write(all[1], bytes).unwrap();
        read_csv(&all).map(drop)
    });
}

fn getdist(root: &Path) {
    write_getdist(&draws(), root).unwrap();
    for (end, count) in [
        ("_2.txt", 4_000),
        (".paramnames", 2_000),
        (".ranges", 2_000),
    ] {
        let path = PathBuf::from(format!("{}{end}", root.display()));
        if !path.is_file() {
            continue;
        }
        let original = fs::read(&path).unwrap();
        let mut read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            read_getdist(root).map(drop)
        };
        if end == ".ranges" {
            // not read: draws are within whatever ranges they are within
            read(b"E1_GPa N N").unwrap();
        } else {
            feed(end, &original, count, &["root"], &mut read);
        }
        fs::write(&path, original).unwrap();
    }
}

fn zarr(path: &Path) {
    let draws = draws();
    let layout = Layout {
        names: draws.names().to_vec(),
        walkers: 2,
        ensembles: 2,
        observed: vec![("alpha_mm".into(), vec![1.0, 2.0])],
    };
    let mut store = Store::create(path, layout, serde_json::json!({})).unwrap();
    for draw in 0..draws.draws() {
        let block = |e: usize| {
            let of = |c: usize| draws.point(2 * e + c, draw).to_vec();
            let lp = [0, 1].map(|c| draws.lp()[(2 * e + c) * draws.draws() + draw]);
            ([of(0), of(1)].concat(), lp)
        };
        let blocks = [block(0), block(1)];
        let blocks: Vec<(&[f64], &[f64])> =
            blocks.iter().map(|(x, lp)| (&x[..], &lp[..])).collect();
        store.record(&blocks).unwrap();
    }
    store.finalize(&[0.3; 4]).unwrap();
    let mut files = Vec::new();
    below(path, &mut files);
    let each = share_of(8_000 / files.len());
    for file in files {
        let original = fs::read(&file).unwrap();
        let mut rng = Pcg64Dxsm::seed_from_u64(files_seed(&file));
        for _ in 0..each {
            let mutated = mutate(&original, &mut rng);
            fs::write(&file, &mutated).unwrap();
            if let Err(error) = read_zarr(path, None) {
                named("zarr", &error, &["chain.zarr"], &mutated);
            }
        }
        fs::write(&file, original).unwrap();
    }
    assert!(read_zarr(path, None).is_ok());
}

fn files_seed(path: &Path) -> u64 {
    path.file_name().map_or(0, |n| n.len() as u64)
}

fn below(dir: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            below(&path, found);
        } else {
            found.push(path);
        }
    }
}

/// A finished run's report and figures.
fn reports(folder: &Path) {
    fs::create_dir_all(folder.join("figures")).unwrap();
    let report = include_str!("fuzz/report.json");
    let maps = r#"{"maps": {"x_mm": [0, 1, 0, 1], "y_mm": [0, 0, 1, 1], "u1_measured_um": [1, 1, 1, null],
        "u1_predicted_um": [1, 2, 1, null], "u1_residual_nm": [0, 0, 0, null], "u2_measured_um": [1, 1, 1, null],
        "u2_predicted_um": [1, 2, 1, null], "u2_residual_nm": [0, 0, 0, null]}}"#;
    let corner = r#"{"parameters": {"parameter": ["E1_GPa"], "mean": [140], "sd": [1], "q2.5": [138], "median": [140], "q97.5": [142],
        "prior_mean": [162], "prior_sd": [16], "cut_low": [null], "cut_high": [null], "truth": [null]},
        "marginals": {"parameter": ["E1_GPa", "E1_GPa", "E1_GPa"], "value": [138, 140, 142], "density": [0.1, 0.4, 0.1]}}"#;
    let trace = r#"{"trace": {"parameter": ["E1_GPa", "E1_GPa"], "ensemble": [1, 1], "draw": [0, 1], "value": [140, 141]}}"#;
    let files = [
        ("report.json", report),
        (
            "run.json",
            r#"{"program": "plychain", "version": "0", "command": ["identify"], "seed": 1, "inputs_sha256": {"a": "b"}, "seconds": 1.0}"#,
        ),
        ("figures/maps-0.json", maps),
        ("figures/corner-0.json", corner),
        ("figures/trace-0.json", trace),
    ];
    let write = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    files
        .iter()
        .for_each(|(name, text)| write(name, text.as_bytes()));
    for (name, text) in files {
        let mut rng = Pcg64Dxsm::seed_from_u64(name.len() as u64);
        for _ in 0..share_of(400) {
            let mutated = mutate(text.as_bytes(), &mut rng);
            write(name, &mutated);
            let made = plychain::report::Page::load(folder).and_then(|page| page.write(folder));
            if let Err(error) = made {
                named(name, &error, &["run", "figure"], &mutated);
            }
        }
        // what the page itself writes is put right again
        files
            .iter()
            .for_each(|(name, text)| write(name, text.as_bytes()));
    }
}
