//! Chains of other programs: groups in Zarr, archives of NumPy; and the figures of `diagnose` against ArviZ on the same files.

use std::fs;
use std::path::Path;

use plychain::chain::{Draws, ScalarDraws, read_groups, read_npz, write_npz};
use plychain::diagnose::{Rule, diagnose};
use serde_json::{Value, json};

use crate::common::{fresh, plychain, python};

/// An array as nuts-rs writes it: chunks of one chain and some draws, raw. The last chunk may lack.
fn array(
    place: &Path,
    (kind, shape): (&str, &[usize]),
    rows: usize,
    bytes: &dyn Fn(usize, usize) -> Vec<u8>,
) {
    fs::create_dir_all(place).unwrap();
    let mut chunk = shape.to_vec();
    (chunk[0], chunk[1]) = (1, rows);
    let dimensions: Vec<String> = (0..shape.len())
        .map(|k| ["chain", "draw", "school"][k].to_string())
        .collect();
    let meta = json!({ "zarr_format": 3, "node_type": "array", "shape": shape, "data_type": kind, "fill_value": "NaN",
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "codecs": [ { "name": "bytes", "configuration": { "endian": "little" } } ], "dimension_names": dimensions });
    fs::write(place.join("zarr.json"), meta.to_string()).unwrap();
    for chain in 0..shape[0] {
        for k in 0..shape[1].div_ceil(rows) {
            let mut name = place.join("c").join(chain.to_string());
            (0..shape.len() - 1)
                .for_each(|axis| name.push(if axis == 0 { k.to_string() } else { "0".into() }));
            fs::create_dir_all(name.parent().unwrap()).unwrap();
            let all: Vec<u8> = (k * rows..(k + 1) * rows)
                .flat_map(|draw| bytes(chain, draw))
                .collect();
            fs::write(name, all).unwrap();
        }
    }
}

#[test]
fn groups_of_nuts_rs_are_read() {
    let store = fresh("trace.zarr");
    let group = json!({ "zarr_format": 3, "node_type": "group", "attributes": {} }).to_string();
    for name in ["posterior", "sample_stats", "warmup_posterior"] {
        fs::create_dir_all(store.join(name)).unwrap();
        fs::write(store.join(name).join("zarr.json"), &group).unwrap();
    }
    let value = |chain: usize, draw: usize| (100 * chain + draw) as f64;
    let posterior = store.join("posterior");
    array(&posterior.join("mu"), ("float64", &[2, 5]), 2, &|c, d| {
        value(c, d).to_le_bytes().to_vec()
    });
    array(
        &posterior.join("theta"),
        ("float32", &[2, 5, 3]),
        2,
        &|c, d| {
            (0..3)
                .flat_map(|k| ((value(c, d) + 0.25 * k as f64) as f32).to_le_bytes())
                .collect()
        },
    );
    array(&posterior.join("count"), ("int64", &[2, 5]), 2, &|c, _| {
        (-(c as i64)).to_le_bytes().to_vec()
    });
    array(
        &store.join("sample_stats/logp"),
        ("float64", &[2, 5]),
        5,
        &|_, d| (-(d as f64)).to_le_bytes().to_vec(),
    );
    array(
        &store.join("sample_stats/diverging"),
        ("bool", &[2, 5]),
        5,
        &|_, d| vec![u8::from(d == 4)],
    );
    // a coordinate has no draws
    let coordinate = posterior.join("draw");
    fs::create_dir_all(&coordinate).unwrap();
    fs::write(coordinate.join("zarr.json"), json!({ "node_type": "array", "data_type": "int64", "shape": [5], "dimension_names": ["draw"] }).to_string()).unwrap();
    let draws = read_groups(&store).unwrap();
    assert_eq!(
        draws.names(),
        ["count", "mu", "theta[0]", "theta[1]", "theta[2]"]
    );
    assert_eq!(
        (draws.chains(), draws.ensembles(), draws.draws()),
        (2, 2, 5)
    );
    assert_eq!(draws.point(1, 4), [-1.0, 104.0, 104.0, 104.25, 104.5]);
    assert_eq!(draws.lp()[..5], [0.0, -1.0, -2.0, -3.0, -4.0]);
    assert!(draws.info.remarks[0].contains("warm-up"));
    assert_eq!(draws.info.columns[0].0, "divergent__");
    assert_eq!(draws.info.columns[0].1[..5], [0.0, 0.0, 0.0, 0.0, 1.0]);
    // packed numbers are unpacked; draws that stand before chains are not left out
    let meta = posterior.join("mu/zarr.json");
    let plain = fs::read_to_string(&meta).unwrap();
    let mut packed: Value = serde_json::from_str(&plain).unwrap();
    packed["attributes"] = json!({"scale_factor": 0.5, "add_offset": 7, "_FillValue": 103});
    fs::write(&meta, packed.to_string()).unwrap();
    let mu = |draw: usize| read_groups(&store).unwrap().point(1, draw)[1];
    assert_eq!(mu(4), 59.0);
    assert!(mu(3).is_nan());
    packed["dimension_names"] = json!(["draw", "chain"]);
    fs::write(&meta, packed.to_string()).unwrap();
    let error = read_groups(&store).unwrap_err().to_string();
    assert!(
        error.contains("mu") && error.contains("draw x chain"),
        "{error}"
    );
    fs::write(&meta, plain).unwrap();
    fs::remove_file(posterior.join("mu/c/0/2")).unwrap();
    assert!(read_groups(&store).unwrap().point(0, 4)[1].is_nan());
    fs::write(posterior.join("mu/c/0/1"), [0; 9]).unwrap();
    let error = read_groups(&store).unwrap_err();
    assert!(error.to_string().contains("mu/c/0/1"), "{error}");
}

#[test]
fn archives_are_read_as_they_were_written() {
    let values: Vec<f64> = (0..48).map(|k| (k as f64).sqrt()).collect();
    let lp = (0..24).map(|k| -0.1 * f64::from(k)).collect();
    let names = vec!["a".to_string(), "b_mm".to_string()];
    let draws = Draws::new(names, vec![0, 0, 1, 1], values, lp).unwrap();
    let place = fresh("chain.npz");
    write_npz(&draws, &place).unwrap();
    assert_eq!(read_npz(&place).unwrap(), draws);
    fs::write(&place, "no archive").unwrap();
    assert!(
        read_npz(&place)
            .unwrap_err()
            .to_string()
            .contains("chain.npz")
    );
}

/// What `diagnose` says of files beside each other, as JSON; or its error.
fn diagnosed(files: &[(&str, &str)], named: &[&str]) -> Result<Value, String> {
    let place = fresh("chains");
    fs::create_dir(&place).unwrap();
    for (name, text) in files {
        fs::write(place.join(name), text).unwrap();
    }
    let paths: Vec<String> = named
        .iter()
        .map(|n| place.join(n).display().to_string())
        .collect();
    let mut arguments = vec!["diagnose"];
    arguments.extend(paths.iter().map(String::as_str));
    arguments.push("--json");
    let end = plychain(&arguments);
    match end.status.success() {
        true => Ok(serde_json::from_slice(&end.stdout).unwrap()),
        false => Err(String::from_utf8(end.stderr).unwrap()),
    }
}

/// Two chains of ten draws of `a` and `b`.
fn value(chain: usize, draw: usize) -> [f64; 2] {
    let a = ((7 * draw + 3 * chain) % 10) as f64;
    [a, 10.0 * a + chain as f64]
}

fn assert_both_chains(found: Result<Value, String>, what: &str) {
    let found = found.unwrap_or_else(|e| panic!("{what}: {e}"));
    let mean = |name: &str| found["parameters"][name]["mean"].as_f64();
    assert_eq!(mean("a"), Some(4.5), "{what}: {found}");
    assert_eq!(mean("b"), Some(45.5), "{what}: {found}");
    assert_eq!(
        found["parameters"].as_object().unwrap().len(),
        2,
        "{what}: {found}"
    );
    // both chains count: one of twenty draws would have another R-hat
    let halves = |k: usize| {
        let half = |c: usize, h: usize| (0..5).map(move |d| value(c, 5 * h + d)[k]);
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(c, h)| half(c, h).collect::<Vec<f64>>())
    };
    let series = ScalarDraws::of_chains(halves(1).concat(), 10);
    assert_eq!(
        found["parameters"]["b"]["rhat"].as_f64(),
        Some(plychain::diagnose::rhat(&series)),
        "{what}"
    );
}

/// Tables as R, pandas and their libraries write chains.
#[test]
fn tables_of_r_and_pandas_are_read() {
    let table = |head: &str, row: &dyn Fn(usize, usize, [f64; 2]) -> String| {
        let rows: String = (0..20)
            .map(|k| row(k / 10, k % 10, value(k / 10, k % 10)) + "\n")
            .collect();
        format!("{head}\n{rows}")
    };
    let forms = [
        (
            "as.data.frame of posterior",
            table("a,b,.chain,.iteration,.draw", &|c, d, [a, b]| {
                format!("{a},{b},{},{},{}", c + 1, d + 1, 10 * c + d + 1)
            }),
        ),
        (
            "write.csv of R",
            table("\"\",\"chain\",\"a\",\"b\"", &|c, d, [a, b]| {
                format!("\"{}\",{c},{a},{b}", 10 * c + d + 1)
            }),
        ),
        (
            "write.table of R",
            table("\"CHAIN\" \"ITER\" \"a\" \"b\"", &|c, d, [a, b]| {
                format!("\"{}\" {c} {d} {a} {b}", 10 * c + d + 1)
            }),
        ),
        (
            "to_csv of pandas",
            table(",chain,draw,a,b", &|c, d, [a, b]| {
                format!("{},{c},{d},{a},{b}", 10 * c + d)
            }),
        ),
        (
            "semicolons",
            table("chain;draw;a;b", &|c, d, [a, b]| format!("{c};{d};{a};{b}")),
        ),
        (
            "tabs, rows in another order",
            table("chain\tdraw\ta\tb", &|c, d, _| {
                let d = (3 * d + 4) % 10;
                let [a, b] = value(c, d);
                format!("{c}\t{d}\t{a}\t{b}")
            }),
        ),
    ];
    for (what, text) in forms {
        assert_both_chains(diagnosed(&[("c.csv", &text[..])], &["c.csv"]), what);
    }
    // a comma within a name
    let text = table("chain,\"theta[1,1]\",b", &|c, _, [a, b]| {
        format!("{c},{a},{b}")
    });
    let found = diagnosed(&[("c.csv", &text[..])], &["c.csv"]).unwrap();
    assert_eq!(
        found["parameters"]["theta[1,1]"]["mean"].as_f64(),
        Some(4.5)
    );
}

/// CODA files of JAGS: an index, and a file a chain with one variable after the other.
#[test]
fn coda_files_of_jags_are_read() {
    let chain = |c: usize| -> String {
        (0..2)
            .flat_map(|k| (0..10).map(move |d| format!("{} {}\n", 1001 + 5 * d, value(c, d)[k])))
            .collect()
    };
    let index = "a 1 10\nb 11 20\n";
    let [one, two] = [0, 1].map(chain);
    let files = [
        ("CODAindex.txt", index),
        ("CODAchain1.txt", &one[..]),
        ("CODAchain2.txt", &two[..]),
    ];
    for named in ["CODAindex.txt", "CODAchain1.txt", "CODAchain2.txt"] {
        assert_both_chains(diagnosed(&files, &[named]), named);
    }
    let cut = &two[..two.len() / 2];
    let error = diagnosed(
        &[files[0], files[1], ("CODAchain2.txt", cut)],
        &["CODAindex.txt"],
    );
    assert!(error.unwrap_err().contains("CODAchain2.txt"));
    let error = diagnosed(&files[..1], &["CODAindex.txt"]).unwrap_err();
    assert!(error.contains("CODAchain1.txt"), "{error}");
}

/// Cobaya writes its names into the first line and no `.paramnames`; weights are repetitions.
#[test]
fn chains_of_cobaya_are_read_by_their_first_line() {
    let chain = |c: usize| -> String {
        let row = |d: usize| {
            let [a, b] = value(c, d);
            format!("  1  0.5 {a} {b}\n")
        };
        let rows: String = (0..10).map(row).collect();
        format!("# weight minuslogpost a b\n{rows}")
    };
    let [one, two] = [0, 1].map(chain);
    let files = [("run.1.txt", &one[..]), ("run.2.txt", &two[..])];
    for named in ["run", "run.1.txt"] {
        assert_both_chains(diagnosed(&files, &[named]), named);
    }
}

/// All chains of a root are read, and no other's; a chain alone may have no number.
#[test]
fn chains_of_getdist_are_those_of_their_root() {
    let rows = |c: usize, by: f64| -> String {
        let row = |d: usize| {
            let [a, b] = value(c, d);
            format!("1 0.5 {} {b}\n", a + by)
        };
        (0..10).map(row).collect()
    };
    let [one, two, far] = [(0, 0.0), (1, 0.0), (0, 100.0)].map(|(c, by)| rows(c, by));
    let names = "a\nb\n";
    let files = [
        ("run.paramnames", names),
        ("run_1.txt", &one[..]),
        ("run_3.txt", &two[..]),
        ("run_far.paramnames", names),
        ("run_far.txt", &far[..]),
    ];
    for named in ["run", "run_1.txt", "run.paramnames"] {
        assert_both_chains(diagnosed(&files, &[named]), named);
    }
    let own = diagnosed(&files, &["run_far.txt"]).unwrap();
    assert_eq!(own["parameters"]["a"]["mean"].as_f64(), Some(104.5));
    let several = diagnosed(&files, &["run_1.txt", "run_3.txt"]).unwrap_err();
    assert!(
        several.contains("give ") && several.contains("run"),
        "{several}"
    );
    let copied = diagnosed(
        &[
            ("c.paramnames", names),
            ("c_1.txt", &one),
            ("c_2.txt", &one),
        ],
        &["c"],
    );
    let copied = copied.unwrap_err();
    assert!(
        copied.contains("chain 2") && copied.contains("chain 1"),
        "{copied}"
    );
    let place = fresh("latin");
    fs::create_dir(&place).unwrap();
    fs::write(place.join("c.paramnames"), names).unwrap();
    fs::write(place.join("c_1.txt"), &one).unwrap();
    fs::write(place.join("c_2.txt"), b"1 0.5 3 \xb5\n").unwrap();
    let end = plychain(&["diagnose", place.join("c").to_str().unwrap()]);
    let error = String::from_utf8(end.stderr).unwrap();
    assert!(
        !end.status.success() && error.contains("c_2.txt"),
        "{error}"
    );
}

/// Columns that count draws are no parameters, weights are no draws, and a divergent transition is said.
#[test]
fn columns_of_samplers_are_no_parameters() {
    let table = |head: &str, row: &dyn Fn(usize, usize) -> String| {
        let rows = (0..2).flat_map(|c| (0..10).map(move |d| (c, d)));
        head.to_string() + &rows.map(|(c, d)| row(c, d)).collect::<String>()
    };
    let of = |c: usize, d: usize| {
        let [a, b] = value(c, d);
        format!("{a},{b}")
    };
    let counted = table("iter,chain_id,a,b\n", &|c, d| {
        format!("{d},{},{}\n", c + 1, of(c, d))
    });
    assert_both_chains(diagnosed(&[("c.csv", &counted)], &["c.csv"]), "iter");
    let beast = |c: usize| {
        let row = |d: usize| format!("{}\t{}\n", 1000 * d, of(c, d).replace(',', "\t"));
        String::from("state\ta\tb\n") + &(0..10).map(row).collect::<String>()
    };
    let [one, two] = [0, 1].map(beast);
    let files = [("a.log", &one[..]), ("b.log", &two[..])];
    assert_both_chains(diagnosed(&files, &["a.log", "b.log"]), "state");
    let weighted = table("weight,chain,a,b\n", &|c, d| {
        format!("{},{c},{}\n", 1 + d % 3, of(c, d))
    });
    let error = diagnosed(&[("c.csv", &weighted)], &["c.csv"]).unwrap_err();
    assert!(error.contains("equal weight"), "{error}");
    let stan = table("chain,lp__,divergent__,a,b\n", &|c, d| {
        format!("{c},-1,{},{}\n", d % 2, of(c, d))
    });
    let found = diagnosed(&[("c.csv", &stan)], &["c.csv"]).unwrap();
    assert!(
        found["remarks"].to_string().contains("10 of 20 draws"),
        "{found}"
    );
    // RStan's own words for the warm-up
    let rstan = |c: usize| {
        let early = "9e9,9e9\n".repeat(5);
        let row = |d: usize| of(c, d) + "\n";
        format!("# warmup=5\n# save_warmup=1\n# thin=1\na,b\n{early}")
            + &(0..10).map(row).collect::<String>()
    };
    let [one, two] = [0, 1].map(rstan);
    let files = [("r_1.csv", &one[..]), ("r_2.csv", &two[..])];
    assert_both_chains(diagnosed(&files, &["r_1.csv", "r_2.csv"]), "rstan");
}

/// What holds no draws of a Markov chain, and what is no text, is an error that says what to do.
#[test]
fn files_without_chains_are_refused_with_what_to_do() {
    let error = diagnosed(
        &[("c.csv", "# method = variational\nlp__,a\n0,1\n")],
        &["c.csv"],
    );
    let error = error.unwrap_err();
    assert!(
        error.contains("variational") && error.contains("c.csv, line 1"),
        "{error}"
    );
    for (start, word) in [
        ("CDF\u{1}", "to_zarr"),
        ("PAR1", "Parquet"),
        ("PK\u{3}\u{4}", "unpack"),
        ("a;b\n1,5;2,5\n", "decimal point"),
    ] {
        let error = diagnosed(&[("c.csv", start)], &["c.csv"]).unwrap_err();
        assert!(error.contains(word) && error.contains("c.csv"), "{error}");
    }
    let place = fresh("h5.nc");
    fs::write(&place, b"\x89HDF\r\n").unwrap();
    let end = plychain(&["diagnose", place.to_str().unwrap()]);
    let error = String::from_utf8(end.stderr).unwrap();
    assert!(
        error.contains("get_chain") && error.contains("h5.nc"),
        "{error}"
    );
    let error = diagnosed(&[], &[""]).unwrap_err();
    assert!(error.contains("one a chain"), "{error}");
}

/// A draw of log density -inf is no draw; a column that never changes is named and excuses nothing else.
#[test]
fn impossible_draws_and_constants_are_said() {
    let place = fresh("c.csv");
    let row = |chain: u64, k: u64| {
        let x = (chain * 7919 + k * 104_729) % 1009;
        let lp = if k == 17 { "-inf" } else { "-1.5" };
        // no sum of 3.7 is exact
        format!("{chain},{k},{lp},{},3.7\n", x as f64 / 1009.0)
    };
    let rows: String = (0..4)
        .flat_map(|c| (0..500).map(move |k| row(c, k)))
        .collect();
    fs::write(&place, format!("chain,draw,lp__,a,fixed\n{rows}")).unwrap();
    let said = String::from_utf8(plychain(&["diagnose", place.to_str().unwrap()]).stdout).unwrap();
    assert!(said.contains("4 draws have the log density -inf"), "{said}");
    assert!(said.contains("the same in all draws: fixed"), "{said}");
    let json: Value =
        serde_json::from_slice(&plychain(&["diagnose", place.to_str().unwrap(), "--json"]).stdout)
            .unwrap();
    assert_eq!(json["parameters"]["fixed"]["rhat"], Value::Null);
    assert_eq!(json["converged"], false);
    let csv = String::from_utf8(plychain(&["diagnose", place.to_str().unwrap(), "--csv"]).stdout)
        .unwrap();
    assert!(
        csv.starts_with("parameter,mean,sd,q2.5,median,q97.5,mcse_mean,"),
        "{csv}"
    );
    let mean: f64 = csv
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .nth(1)
        .unwrap()
        .parse()
        .unwrap();
    assert_eq!(Some(mean), json["parameters"]["a"]["mean"].as_f64());
}

/// Writes the same draws as CSV, as Zarr of both versions and as an archive, and ArviZ's figures.
const WRITE: &str = r#"
import json, sys
import numpy as np, arviz as az, xarray as xr
place = sys.argv[1]
rng = np.random.default_rng(5)
chains, draws = 4, 1501
noise = rng.normal(size=(chains, draws, 3))
x = np.zeros((chains, draws, 3))
for t in range(1, draws):
    x[:, t] = 0.7 * x[:, t - 1] + noise[:, t]
mu, theta = x[..., 0], np.round(x[..., 1:] * 4) ** 3
lp = -0.5 * mu**2
posterior = xr.Dataset({"mu": (["chain", "draw"], mu), "theta": (["chain", "draw", "school"], theta), "n": (["chain", "draw"], np.round(mu * 3).astype("int32"))})
stats = xr.Dataset({"lp": (["chain", "draw"], lp)})
for version in (2, 3):
    for group, data in (("posterior", posterior), ("sample_stats", stats)):
        data.to_zarr(f"{place}/v{version}.zarr", group=group, mode="a", zarr_format=version, consolidated=False,
            encoding={name: {"chunks": (3, 700, 1)[: data[name].ndim]} for name in data})
from numcodecs import Blosc, Zlib
for k, codec in enumerate([Blosc("zstd", 3, Blosc.SHUFFLE), Blosc("lz4", 5, Blosc.NOSHUFFLE), Blosc("zlib", 5, Blosc.SHUFFLE), Zlib(3), None]):
    posterior.to_zarr(f"{place}/codec{k}.zarr", group="posterior", mode="a", zarr_format=2, consolidated=False,
        encoding={name: {"compressors": codec} for name in posterior})
np.savez(f"{place}/variables.npz", mu=mu, theta=theta, n=np.round(mu * 3).astype("int32"), lp=lp)
with open(f"{place}/c.csv", "w") as out:
    out.write("chain,draw,lp__,mu,n,theta.1,theta.2\n")
    for c in range(chains):
        for d in range(draws):
            out.write(",".join([str(c), str(d)] + [repr(float(v)) for v in (lp[c, d], mu[c, d], np.round(mu[c, d] * 3), theta[c, d, 0], theta[c, d, 1])]) + "\n")
out = {}
for name, v in {"mu": mu, "n": np.round(mu * 3), "theta[0]": theta[..., 0], "theta[1]": theta[..., 1]}.items():
    out[name] = {"rhat": float(az.rhat(v)), "ess_bulk": float(az.ess(v)), "ess_tail": float(az.ess(v, method="tail", prob=(0.05, 0.95))), "mcse_mean": float(az.mcse(v)),
        "mcse_sd": float(az.mcse(v, method="sd")), "mcse_q2.5": float(az.mcse(v, method="quantile", prob=0.025)), "mean": float(v.mean()), "sd": float(v.std(ddof=1))}
print(json.dumps(out))
"#;

#[test]
#[ignore = "needs Python"]
fn figures_are_those_of_arviz_on_the_same_files() {
    let place = fresh("files");
    fs::create_dir(&place).unwrap();
    let end = python()
        .args(["-c", WRITE, place.to_str().unwrap()])
        .output()
        .unwrap();
    assert!(
        end.status.success(),
        "{}",
        String::from_utf8_lossy(&end.stderr)
    );
    let theirs: Value = serde_json::from_slice(&end.stdout).unwrap();
    let files = [
        "c.csv",
        "v2.zarr",
        "v3.zarr",
        "variables.npz",
        "codec0.zarr",
        "codec1.zarr",
        "codec2.zarr",
        "codec3.zarr",
        "codec4.zarr",
    ];
    for file in files {
        let end = plychain(&["diagnose", place.join(file).to_str().unwrap(), "--json"]);
        assert!(end.status.success(), "{file}: {end:?}");
        let ours: Value = serde_json::from_slice(&end.stdout).unwrap();
        for (name, figures) in theirs.as_object().unwrap() {
            let own = match (file, &**name) {
                ("c.csv", "theta[0]") => "theta.1",
                ("c.csv", "theta[1]") => "theta.2",
                (_, name) => name,
            };
            for (figure, exact) in figures.as_object().unwrap() {
                let (found, exact) = (
                    ours["parameters"][own][figure].as_f64().unwrap(),
                    exact.as_f64().unwrap(),
                );
                let error = (found - exact).abs() / exact.abs().max(1e-3);
                let allowed = if figure.starts_with("mcse_q") {
                    1e-6
                } else {
                    1e-9
                };
                assert!(
                    error <= allowed,
                    "{file}: {name}, {figure}: {found} for {exact}"
                );
            }
        }
    }
}

/// Stationary chains of two variables, each an autoregression of unit variance, of which every `thin`th draw is kept.
fn autoregressions(seed: u64, lag: f64, [chains, draws, thin]: [usize; 3]) -> Draws {
    let mut values = Vec::new();
    for chain in 0..chains as u64 {
        let mut rng =
            plychain::sample::Stream::at(plychain::sample::Key { seed, ensemble: 1 }, chain, 0);
        let mut x = [rng.normal(), rng.normal()];
        for t in 0..draws * thin {
            x = x.map(|x| lag * x + (1.0 - lag * lag).sqrt() * rng.normal());
            if t % thin == 0 {
                values.extend(x);
            }
        }
    }
    let names = vec!["a".into(), "b".into()];
    let lp = vec![f64::NAN; chains * draws];
    Draws::new(names, (0..chains).collect(), values, lp).unwrap()
}

/// The last chain with every draw made another one by its own value, its place from 0 to 1 in the chain, and its chain's first draw.
fn mutilated(draws: &Draws, change: &dyn Fn(f64, f64, f64) -> f64) -> Draws {
    let (last, count) = (draws.chains() - 1, draws.draws());
    let first = draws.point(last, count / 2).to_vec();
    let points = draws.points().enumerate();
    let values = points.flat_map(|(k, x)| {
        let at = (k % count) as f64 / count as f64;
        let is_last = k / count == last;
        let changed = |(x, first): (&f64, &f64)| if is_last { change(*x, at, *first) } else { *x };
        x.iter().zip(&first).map(changed).collect::<Vec<f64>>()
    });
    let ensemble = draws.ensemble().to_vec();
    Draws::new(
        draws.names().to_vec(),
        ensemble,
        values.collect(),
        draws.lp().to_vec(),
    )
    .unwrap()
}

/// Good chains are converged, and chains of which one is stuck, stands elsewhere or is too narrow are not: at most one in twenty wrong of
/// every kind. The first draws of each kind are as many as anybody would call a short run.
#[test]
#[ignore = "slow: run by .ci/run"]
fn verdicts_are_right_nineteen_times_of_twenty() {
    const TIMES: u64 = 60;
    let most = TIMES as usize / 20;
    let converged = |draws: &Draws| diagnose(draws, &Rule::default()).converged;
    let good: [(&str, f64, [usize; 3]); 6] = [
        ("independent", 0.0, [4, 1000, 1]),
        ("independent, short", 0.0, [10, 200, 1]),
        ("autocorrelated", 0.5, [4, 1000, 1]),
        ("autocorrelated, long", 0.9, [4, 4000, 1]),
        ("thinned", 0.5, [4, 1000, 5]),
        ("antithetic", -0.5, [4, 500, 1]),
    ];
    for (what, lag, shape) in good {
        let wrong = |seed: &u64| !converged(&autoregressions(*seed, lag, shape));
        let wrong = (0..TIMES).filter(wrong).count();
        println!("{what} {shape:?}: {wrong} of {TIMES} not converged");
        assert!(wrong <= most, "{what}: {wrong}");
    }
    type Change = fn(f64, f64, f64) -> f64;
    let bad: [(&str, Change); 5] = [
        ("stuck", |_, _, first| first),
        (
            "stuck from the middle",
            |x, at, first| if at < 0.5 { x } else { first },
        ),
        ("shifted by 1 sd", |x, _, _| x + 1.0),
        ("shifted by 3 sd", |x, _, _| x + 3.0),
        ("half as wide", |x, _, _| 0.5 * x),
    ];
    for (what, change) in bad {
        for shape in [[4, 1000, 1], [10, 200, 1]] {
            let missed = |seed: &u64| {
                let draws = autoregressions(*seed, 0.0, shape);
                converged(&mutilated(&draws, &change))
            };
            let missed = (0..TIMES).filter(missed).count();
            println!("{what} {shape:?}: {missed} of {TIMES} converged");
            assert!(missed <= most, "{what} {shape:?}: {missed}");
        }
    }
}
