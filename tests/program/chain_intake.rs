//! Chains as samplers leave them: all files of a run, names behind a comment sign, columns that are no parameters, transitions that failed.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::common::plychain_in;

/// Independent draws of `a` and `b` about 5 and -2.
fn draw(chain: usize, k: usize) -> [f64; 2] {
    let uniform = |salt: u64| {
        let mut x = (chain as u64 + 1) * 0x9e37_79b9 + k as u64 * 0x85eb_ca6b + salt;
        for _ in 0..3 {
            x ^= x >> 16;
            x = x.wrapping_mul(0x45d9_f3b3_335b_369d);
            x ^= x >> 29;
        }
        (x >> 11) as f64 / (1u64 << 53) as f64
    };
    [
        5.0 + uniform(1) + uniform(2),
        -2.0 + uniform(3) + uniform(4),
    ]
}

fn rows(chain: usize, sign: &str, more: impl Fn(usize) -> String) -> String {
    (0..400).fold(String::new(), |mut text, k| {
        let [a, b] = draw(chain, k);
        writeln!(text, "{a}{sign}{b}{}", more(k)).unwrap();
        text
    })
}

/// What `diagnose` says of all files of a folder: whether it was content, JSON or an error.
fn diagnosed(files: &[(&str, String)], named: &[&str], more: &[&str]) -> (bool, Value, String) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    in_folder(folder.path(), named, more)
}

fn in_folder(folder: &Path, named: &[&str], more: &[&str]) -> (bool, Value, String) {
    let end = plychain_in(folder, &[&["diagnose"], named, more, &["--json"]].concat());
    let value = serde_json::from_slice(&end.stdout).unwrap_or_default();
    let said = String::from_utf8_lossy(&end.stderr).into_owned();
    (end.status.success(), value, said)
}

fn mean(of: &Value, name: &str) -> f64 {
    of["parameters"][name]["mean"].as_f64().unwrap_or(f64::NAN)
}

fn names(of: &Value) -> Vec<&String> {
    of["parameters"]
        .as_object()
        .map_or(Vec::new(), |p| p.keys().collect())
}

/// A shell's pattern gives all files of a CODA run, in WinBUGS' names too.
#[test]
fn coda_files_side_by_side_are_one_run() {
    let chain = |c: usize| -> String {
        let values = (0..2).flat_map(|v| (0..400).map(move |k| (k, draw(c, k)[v])));
        values.map(|(k, x)| format!("{}\t{x}\n", k + 1)).collect()
    };
    let index = "a 1 400\nb 401 800\n".to_string();
    for all in [
        [
            "CODAindex.txt",
            "CODAchain1.txt",
            "CODAchain2.txt",
            "CODAchain3.txt",
        ],
        ["codaIndex.txt", "coda1.txt", "coda2.txt", "coda3.txt"],
    ] {
        let files: Vec<(&str, String)> = all
            .iter()
            .copied()
            .zip([index.clone(), chain(0), chain(1), chain(2)])
            .collect();
        for named in [&all[1..], &all[..], &all[..1], &all[1..2]] {
            let (done, found, said) = diagnosed(&files, named, &["--strict"]);
            assert!(done, "{named:?}: {said}");
            assert_eq!(names(&found), ["a", "b"], "{named:?}");
            let ess = found["parameters"]["a"]["ess_bulk"].as_f64().unwrap();
            assert!(ess > 800.0, "{named:?}: {ess}");
        }
    }
}

/// `numpy.savetxt` puts a comment sign before the names that it is given; lines above them are words.
#[test]
fn names_behind_a_comment_sign_are_the_header() {
    for (head, sign) in [
        ("# a b\n", " "),
        ("# a,b\n", ","),
        ("#a\tb\n", "\t"),
        ("% a;b\n", ";"),
        ("# a run of last Monday, at noon\n# a, b\n", " "),
    ] {
        let (done, found, said) = diagnosed(
            &[(
                "c.txt",
                head.to_string() + &rows(0, sign, |_| String::new()),
            )],
            &["c.txt"],
            &[],
        );
        assert!(done, "{head:?}: {said}");
        assert_eq!(names(&found), ["a", "b"], "{head:?}");
        assert!((mean(&found, "a") - 6.0).abs() < 0.1, "{found}");
    }
    let (done, _, said) = diagnosed(
        &[("c.txt", "# three words here\n1 2\n3 4\n".into())],
        &["c.txt"],
        &[],
    );
    assert!(
        !done && said.contains("name of a column") && said.contains("first line"),
        "{said}"
    );
}

/// What a shell of Windows writes to a file has two bytes a letter.
#[test]
fn chains_in_sixteen_bits_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("\u{feff}a,b\r\n{}", rows(0, ",", |_| String::new()));
    let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    fs::write(folder.path().join("c.csv"), bytes).unwrap();
    let (done, found, said) = in_folder(folder.path(), &["c.csv"], &[]);
    assert!(done && names(&found) == ["a", "b"], "{said}");
}

/// Chains of CmdStan with energies and depths of trees.
fn stan(chain: usize, model: &str, depth: usize, energy: impl Fn(usize) -> f64) -> String {
    let head = format!(
        "# model = {model}\n# method = sample (Default)\n#     num_samples = 400\n#         max_depth = 8\n"
    );
    let columns = "a,b,lp__,treedepth__,divergent__,energy__\n";
    head + columns + &rows(chain, ",", |k| format!(",-1,{depth},0,{}", energy(k)))
}

#[test]
fn transitions_are_judged_as_cmdstan_does() {
    let all = |depth: usize, energy: fn(usize) -> f64| -> Vec<(&str, String)> {
        let names = ["c_1.csv", "c_2.csv"];
        names
            .into_iter()
            .enumerate()
            .map(|(c, name)| (name, stan(c, "plate", depth, energy)))
            .collect()
    };
    let lively = |k: usize| draw(7, k)[0];
    let named = ["c_1.csv", "c_2.csv"];
    let (done, _, said) = diagnosed(&all(5, lively), &named, &["--strict"]);
    assert!(done, "{said}");
    let (done, found, said) = diagnosed(&all(8, lively), &named, &["--strict"]);
    assert!(
        !done && said.contains("800 of 800 draws hit max_depth 8"),
        "{said}"
    );
    assert!(
        found["remarks"].to_string().contains("larger max_depth"),
        "{found}"
    );
    let slow = |k: usize| (k as f64 / 60.0).sin();
    let (done, _, said) = diagnosed(&all(5, slow), &named, &["--strict"]);
    assert!(
        !done && said.contains("E-BFMI is below 0.3 in 2 of 2 chains"),
        "{said}"
    );
}

#[test]
fn chains_of_different_models_are_refused() {
    let of = |c: usize, model| stan(c, model, 5, |k| draw(7, k)[0]);
    let files = [("c_1.csv", of(0, "plate")), ("c_2.csv", of(1, "beam"))];
    let (done, _, said) = diagnosed(&files, &["c_1.csv", "c_2.csv"], &[]);
    assert!(
        !done && said.contains("c_2.csv: found model = beam"),
        "{said}"
    );
}

/// True and False in whatever letters are 1 and 0, and count where the column says that a transition diverged.
#[test]
fn words_for_true_and_false_are_numbers() {
    for [yes, no] in [
        ["True", "False"],
        ["TRUE", "FALSE"],
        ["true", "false"],
        ["1.0", "0"],
    ] {
        let text = String::from("a,b,diverging,outer\n")
            + &rows(0, ",", |k| {
                format!(
                    ",{},{}",
                    if k % 40 == 0 { yes } else { no },
                    if k % 2 == 0 { yes } else { no }
                )
            });
        let (done, found, said) = diagnosed(&[("c.csv", text)], &["c.csv"], &[]);
        assert!(done, "{said}");
        assert_eq!(names(&found), ["a", "b", "outer"], "{yes}");
        assert!((mean(&found, "outer") - 0.5).abs() < 1e-9);
        let remarks = found["remarks"].to_string();
        assert!(
            remarks.contains("10 of 400 draws ended in a divergent"),
            "{remarks}"
        );
    }
    let (done, _, said) = diagnosed(&[("c.csv", "a,b\n1,Truth\n".into())], &["c.csv"], &[]);
    assert!(!done && said.contains("column b: found Truth"), "{said}");
}

/// What Turing and LALInference write beside their parameters is theirs; the same words alone are parameters.
#[test]
fn columns_of_other_samplers_are_no_parameters() {
    let turing =
        "a,b,iteration,chain,lp,n_steps,step_size,tree_depth,numerical_error,hamiltonian_energy\n";
    let of_turing = rows(0, ",", |k| {
        format!(
            ",{k},1,-3,7,0.25,3,{},{}",
            usize::from(k < 3),
            draw(7, k)[0]
        )
    });
    let gravity = "a b cycle logl logprior logpost deltalogl\n";
    let of_gravity = rows(0, " ", |k| format!(" {k} -3 -1 -4 {k}"));
    let alone = "a,b,energy,lp\n";
    let of_nobody = rows(0, ",", |k| format!(",{},{}", draw(8, k)[0], draw(9, k)[1]));
    for (head, text, expected) in [
        (turing, &of_turing, vec!["a", "b"]),
        (gravity, &of_gravity, vec!["a", "b", "cycle"]),
        (alone, &of_nobody, vec!["a", "b", "energy", "lp"]),
    ] {
        let (done, found, said) = diagnosed(&[("c.csv", head.to_string() + text)], &["c.csv"], &[]);
        assert!(done, "{said}");
        let mut found_names = names(&found);
        found_names.sort();
        assert_eq!(found_names, expected, "{head}");
        let diverged = found["remarks"]
            .to_string()
            .contains("3 of 400 draws ended");
        assert_eq!(diverged, head == turing, "{found}");
    }
}

/// A setting that differs between chains has no R-hat of 1e15.
#[test]
fn a_constant_of_each_chain_is_called_one() {
    let files = [0, 1].map(|c| {
        format!(
            "a,b,step\n{}",
            rows(c, ",", |_| format!(",{}", 0.1 + 0.2 * c as f64))
        )
    });
    let [one, two] = files;
    let files = [("c_1.csv", one), ("c_2.csv", two)];
    let (done, found, said) = diagnosed(&files, &["c_1.csv", "c_2.csv"], &["--strict"]);
    assert!(
        !done && said.contains("step: constant in every chain, and different between chains"),
        "{said}"
    );
    assert!(found["parameters"]["step"]["rhat"].is_null(), "{found}");
}

/// The way of a chain to the others is left out, by number or by where they join.
#[test]
fn what_comes_before_the_chains_join_is_left_out() {
    let files = [0, 1, 2].map(|c| {
        let text = (0..400).fold(String::from("a,b\n"), |mut text, k| {
            let [a, b] = draw(c, k);
            let far = if c == 1 && k < 60 { 20.0 } else { 0.0 };
            writeln!(text, "{},{b}", a + far).unwrap();
            text
        });
        (["c_1.csv", "c_2.csv", "c_3.csv"][c], text)
    });
    let named = ["c_1.csv", "c_2.csv", "c_3.csv"];
    let (done, _, _) = diagnosed(&files, &named, &["--strict"]);
    assert!(!done);
    for burn_in in ["auto", "60"] {
        let (done, found, said) = diagnosed(&files, &named, &["--strict", "--burn-in", burn_in]);
        assert!(done, "{burn_in}: {said}");
        let remarks = found["remarks"].to_string();
        assert!(
            remarks.contains("join each other at draw 0, 60, 0")
                && remarks.contains("first 60 draws"),
            "{remarks}"
        );
    }
    let (done, _, said) = diagnosed(&files, &named, &["--burn-in", "400"]);
    assert!(!done && said.contains("--burn-in"), "{said}");
}
