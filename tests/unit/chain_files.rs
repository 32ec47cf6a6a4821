//! Chain files: what is written reads back to the same bits, and what is wrong is named.

use std::fs;

use plychain::chain::{Draws, read_csv, read_getdist, write_csv, write_getdist};

fn draws() -> Draws {
    let values = vec![
        0.1,
        1e300,
        1.0 / 3.0,
        -2.2250738585072014e-308,
        5e-324,
        0.30000000000000004,
        -0.0,
        7.0,
        123456789.12345679,
        1e-7,
        f64::MAX,
        1.0,
    ];
    let lp = vec![-1.5, -1e-17, 2.0, f64::NEG_INFINITY, -3.0, 0.25];
    let names = vec!["E1_GPa".to_string(), "nu12".to_string()];
    Draws::new(names, vec![0, 1], values, lp).unwrap()
}

#[test]
fn floats_round_trip() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("chain.csv");
    write_csv(&draws(), &path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert!(
        text.starts_with("chain,draw,lp__,E1_GPa,nu12\n0,0,-1.5,0.1,1e300\n"),
        "{text}"
    );
    let back = read_csv(&[&path]).unwrap();
    assert_eq!(back, draws());
    let bits = |d: &Draws| d.values().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&back), bits(&draws()));
    assert!(back.clone().with_walkers(3).is_err());
    assert_eq!(back.with_walkers(2).unwrap().ensembles(), 1);
}

#[test]
fn stan_csv_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let text = "# stan_version_major = 2\nlp__,accept_stat__,stepsize__,mu,theta.1\n# Adaptation terminated\n\
                -7.1,0.99,0.5,1.5,2.5\n-6.9,1,0.5,1.25,nan\n# Elapsed Time: 0.1\n";
    let (a, b) = (dir.path().join("a.csv"), dir.path().join("b.csv"));
    fs::write(&a, text).unwrap();
    fs::write(&b, text.replace("1.5", "-1.5").replace('\n', "\r\n")).unwrap();
    let draws = read_csv(&[&a, &b]).unwrap();
    assert_eq!(draws.names(), ["mu", "theta.1"]);
    assert_eq!((draws.chains(), draws.draws()), (2, 2));
    assert_eq!(draws.point(1, 0), [-1.5, 2.5]);
    assert_eq!(draws.lp(), [-7.1, -6.9, -7.1, -6.9]);
    assert_eq!(
        draws.info.columns[0],
        ("accept_stat__".to_string(), vec![0.99, 1.0, 0.99, 1.0])
    );
    assert!(draws.point(0, 1)[1].is_nan());
}

#[test]
fn errors_name_file_line_and_column() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("chain.csv");
    for (text, expected) in [
        ("", "header"),
        ("lp__\n-1\n", "at least one parameter"),
        ("chain,draw,lp__,a\n", "at least one draw"),
        ("1.0,2.0\n3.0,4.0\n", "name of a column"),
        ("a,a\n1,2\n", "each name once"),
        (
            "chain,draw,lp__,a\n0,0,-1,2\n0,1,-1,x7\n",
            "line 3, column a: found x7",
        ),
        (
            "chain,draw,lp__,a\n0,0,-1,2\n0,1,-1\n",
            "line 3: row: found 3 columns, expected 4",
        ),
        (
            "chain,draw,lp__,a\n0,0,-1,2\n0,1,-1,2\n1,0,-1,2\n",
            "as many draws as in chain 0",
        ),
    ] {
        fs::write(&path, text).unwrap();
        let error = read_csv(&[&path]).unwrap_err();
        assert!(error.to_string().contains(expected), "{text:?}: {error}");
        assert!(error.to_string().contains("chain.csv"), "{error}");
    }
    assert!(
        read_csv(&[&dir.path().join("none.csv")])
            .unwrap_err()
            .to_string()
            .contains("none.csv")
    );
}

/// What other programs write beside their draws is honoured.
#[test]
fn chains_of_other_programs_are_read_as_they_are_meant() {
    let dir = tempfile::tempdir().unwrap();
    let place = |name: &str| dir.path().join(name);
    let table = |first: u32, count: u32| -> String {
        let row = |k: u32| format!("-1,{}.5,{}\n", first + k, k * k);
        (0..count).map(row).collect()
    };
    // CmdStan with its warm-up, and a byte order mark
    let stan = |warmup: &str, rows: &str| {
        format!(
            "\u{feff}# num_samples = 4\n#   num_warmup = 5\n# save_warmup = {warmup}\n# thin = 2 (Default)\nlp__,a,b\n{rows}"
        )
    };
    fs::write(place("c_1.csv"), stan("1", &table(0, 7))).unwrap();
    fs::write(place("c_2.csv"), stan("true", &table(100, 7))).unwrap();
    let [one, two] = ["c_1.csv", "c_2.csv"].map(place);
    let draws = read_csv(&[&one, &two]).unwrap();
    assert_eq!((draws.chains(), draws.draws()), (2, 4));
    assert_eq!(draws.point(0, 0), [3.5, 9.0]);
    assert_eq!(draws.info.remarks.len(), 2);
    fs::write(place("c_1.csv"), stan("0", &table(0, 7))).unwrap();
    assert_eq!(read_csv(&[&one]).unwrap().draws(), 7);
    // a copy is no second chain, and a chain that was cut is named
    fs::write(place("c_2.csv"), stan("0", &table(0, 7))).unwrap();
    let error = read_csv(&[&one, &two]).unwrap_err().to_string();
    assert!(
        error.contains("c_2.csv") && error.contains("draws of its own"),
        "{error}"
    );
    fs::write(place("c_2.csv"), stan("0", &table(50, 3))).unwrap();
    let error = read_csv(&[&one, &two]).unwrap_err().to_string();
    assert!(error.contains("c_2.csv: found 3"), "{error}");
    // rows in any order, each draw once
    let path = place("chain.csv");
    fs::write(
        &path,
        "chain,draw,lp__,a\n0,1,-1,11\n0,0,-1,10\n0,2,-1,12\n",
    )
    .unwrap();
    let draws = read_csv(&[&path]).unwrap();
    assert_eq!([0, 1, 2].map(|k| draws.point(0, k)[0]), [10.0, 11.0, 12.0]);
    fs::write(&path, "chain,draw,lp__,a\n0,1,-1,11\n0,1,-1,10\n").unwrap();
    let error = read_csv(&[&path]).unwrap_err().to_string();
    assert!(error.contains("draw 1 twice"), "{error}");
}

/// Cobaya's files, chains of unequal length, and names that GetDist cannot read.
#[test]
fn roots_of_cobaya_are_read_and_any_name_is_exported() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("root");
    fs::write(dir.path().join("root.paramnames"), "a\tA\nb*\tB\n").unwrap();
    fs::write(
        dir.path().join("root.1.txt"),
        "# weight minuslogpost a b\n1 0.5 1 2\n2 0.5 3 4\n",
    )
    .unwrap();
    fs::write(dir.path().join("root.2.txt"), "1 0.5 5 6\n1 0.5 7 8\n").unwrap();
    let draws = read_getdist(&root).unwrap();
    assert_eq!((draws.chains(), draws.draws()), (2, 2));
    assert_eq!(
        draws.point(0, 0),
        [3.0, 4.0],
        "the last draws of the longer chain"
    );
    assert_eq!(draws.point(1, 1), [7.0, 8.0]);
    assert_eq!(draws.info.remarks.len(), 1);
    fs::write(dir.path().join("root.2.txt"), "0.5 0.5 5 6\n").unwrap();
    let error = read_getdist(&root).unwrap_err();
    assert!(error.hint_text().unwrap().contains("reweighted"), "{error}");
    let names = ["E1 [GPa]", "E1_[GPa]", "sigma*"]
        .map(String::from)
        .to_vec();
    let draws = Draws::new(
        names,
        vec![0],
        vec![1.0, 2.0, 3.0, 1.5, 2.5, 3.5],
        vec![-1.0; 2],
    )
    .unwrap();
    let out = dir.path().join("out");
    write_getdist(&draws, &out).unwrap();
    let text = fs::read_to_string(dir.path().join("out.paramnames")).unwrap();
    let plain: Vec<&str> = text
        .lines()
        .map(|l| l.split('\t').next().unwrap())
        .collect();
    assert_eq!(plain, ["E1_[GPa]", "E1_[GPa]_", "sigma_"]);
    assert_eq!(read_getdist(&out).unwrap().draws(), 2);
}
