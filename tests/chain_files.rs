//! Chain files: what is written reads back to the same bits, and what is wrong is named.

use std::fs;

use plychain::chain::{Draws, read_csv, write_csv};

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
            "line 3: found 3 columns",
        ),
        (
            "chain,draw,lp__,a\n0,0,-1,2\n0,1,-1,2\n1,0,-1,2\n",
            "as many draws in chain",
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
