//! Files that were cut, permuted, saved in another encoding or with other signs: what is read is right, or there is an error that names the
//! file; never a panic, never another number.

use std::collections::HashSet;
use std::fs;
use std::path::Path;

use plychain::error::Blame;
use plychain::field::{Axis, ColumnMap, Columns, Field, Frame, Grid, Units, matrices, table};

use super::{decimals, lines, strip};

/// A generator of numbers that are the same everywhere (splitmix64).
struct Draws(u64);

impl Draws {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

const FRAME: Frame = Frame {
    loading_axis: Axis::X,
    hole_center_mm: [0.0; 2],
};

/// A table and its columns.
struct Original {
    text: String,
    columns: [&'static str; 4],
}

/// The columns in another order.
fn permuted(rows: &[super::FieldRow]) -> String {
    let line =
        |(k, [x, y, u, v]): (usize, &super::FieldRow)| format!("{v:.6};{k};{x:.6};{u:.6};{y:.6}\n");
    rows.iter().enumerate().map(line).collect()
}

fn originals() -> Vec<Original> {
    let rows: Vec<_> = strip().into_iter().step_by(12).collect();
    let rows = &rows[..];
    let of = |head: &str, body: String, columns| Original {
        text: format!("{head}\n{body}"),
        columns,
    };
    let exponents = |_: usize, v: f64| format!("{v:.9E}");
    vec![
        of(
            "X [mm];Y [mm];U [mm];V [mm]",
            lines(rows, ";", decimals),
            ["X [mm]", "Y [mm]", "U [mm]", "V [mm]"],
        ),
        of(
            " \"X\", \"Y\", \"U\", \"V\"",
            lines(rows, ",", decimals),
            ["X", "Y", "U", "V"],
        ),
        of(
            "# a\nstage;index\n\"Stufe 1\";1\nx;y;displacement_x;displacement_y",
            lines(rows, ";", decimals),
            ["x", "y", "displacement_x", "displacement_y"],
        ),
        of(
            "TITLE = \"a\"\nVARIABLES = \"X\", \"Y\", \"U\", \"V\"\nZONE I=4, F=POINT",
            lines(rows, " ", decimals),
            ["X", "Y", "U", "V"],
        ),
        of("V;id;X;U;Y", permuted(rows), ["X", "Y", "U", "V"]),
        of(
            "X\tY\tU\tV",
            lines(rows, "\t", exponents),
            ["X", "Y", "U", "V"],
        ),
        of(
            "% Model,a.mph\n% X,Y,u (mm),v (mm)",
            lines(rows, ",", exponents),
            ["X", "Y", "u (mm)", "v (mm)"],
        ),
    ]
}

/// Points and displacements by their bits.
fn read(path: &Path, columns: [&str; 4]) -> Result<Vec<[u64; 4]>, plychain::error::Error> {
    let map = ColumnMap {
        columns: Columns::new(columns.map(String::from)),
        units: Units::new("mm", "mm"),
    };
    let field = table::read(path, &map, FRAME)?;
    let both = field.points.iter().zip(&field.displacement);
    Ok(both
        .map(|(p, u)| [p[0], p[1], u[0], u[1]].map(|v| (v + 0.0).to_bits()))
        .collect())
}

fn encoded(text: &str, how: usize) -> Vec<u8> {
    let utf16 = |big: bool| -> Vec<u8> {
        let units = std::iter::once(0xfeff).chain(text.encode_utf16());
        units
            .flat_map(|u: u16| {
                if big {
                    u.to_be_bytes()
                } else {
                    u.to_le_bytes()
                }
            })
            .collect()
    };
    match how {
        0 => text.as_bytes().to_vec(),
        1 => format!("\u{feff}{text}").into_bytes(),
        2 => utf16(false),
        3 => utf16(true),
        // a byte of Windows-1252 in a comment
        _ => [b"# 90 mm\xb3\n", text.as_bytes()].concat(),
    }
}

/// What stands between the cells of a line.
fn sign_of(line: &str) -> char {
    let signs = [';', '\t', ' ', ','];
    let found = signs.into_iter().find(|s| line.contains(*s));
    found.unwrap_or(';')
}

/// Change the cells of every line from one on.
fn each_row(lines: &mut [String], first: usize, change: &dyn Fn(&mut Vec<String>)) {
    let sign = lines.last().map_or(';', |line| sign_of(line));
    for line in lines.iter_mut().skip(first) {
        let mut cells: Vec<String> = line.split(sign).map(|c| c.trim().to_string()).collect();
        change(&mut cells);
        *line = cells.join(&sign.to_string());
    }
}

/// Another form of the same numbers, or damage.
fn mangled(original: &Original, draws: &mut Draws) -> Vec<u8> {
    let mut lines: Vec<String> = original.text.lines().map(String::from).collect();
    let first = lines
        .iter()
        .position(|l| l.starts_with(|c: char| c.is_ascii_digit() || c == '-'))
        .unwrap();
    for _ in 0..=draws.below(2) {
        match draws.below(11) {
            9 => each_row(&mut lines, first, &|cells| {
                cells.iter_mut().for_each(|c| *c = format!("\"{c}\""));
            }),
            10 => {
                // two columns change places, header and all
                let k = draws.below(4);
                let swap = |cells: &mut Vec<String>| {
                    let n = cells.len();
                    cells.swap(k % n, (k + 1) % n);
                };
                let sign = sign_of(&lines[first]);
                let count = |line: &str| line.split(sign).count();
                if count(&lines[first - 1]) == count(&lines[first]) && sign != ' ' {
                    each_row(&mut lines, first - 1, &swap);
                }
            }
            0 => {
                let count = lines.len() - first;
                for k in (1..count).rev() {
                    lines.swap(first + k, first + draws.below(k + 1));
                }
            }
            1 => lines
                .iter_mut()
                .skip(first)
                .for_each(|l| *l = l.replace('.', ",")),
            2 => lines
                .iter_mut()
                .skip(first)
                .for_each(|l| *l = l.replace('-', "\u{2212}")),
            3 => {
                let k = first + draws.below(lines.len() - first);
                let line = lines.remove(k);
                lines.insert(draws.below(lines.len()), line);
            }
            4 => {
                let k = draws.below(lines.len());
                lines.insert(
                    k,
                    ["", "# remark", "Mean;1.0", "end", "-nan(ind);1;1;1"][draws.below(5)].into(),
                );
            }
            5 => {
                // one cell of one row
                let k = first + draws.below(lines.len() - first);
                let word = ["NaN", "#N/A", "", "1.#QNAN", "x"][draws.below(5)];
                let sign = sign_of(&lines[k]);
                let mut cells: Vec<&str> = lines[k].split(sign).collect();
                let cell = draws.below(cells.len());
                cells[cell] = word;
                lines[k] = cells.join(&sign.to_string());
            }
            6 => lines.iter_mut().skip(first).for_each(|l| l.push(';')),
            7 => lines.iter_mut().for_each(|l| l.push('\r')),
            _ => {
                let k = draws.below(lines.len());
                let copy = lines[k].clone();
                lines.push(copy);
            }
        }
    }
    let mut bytes = encoded(&(lines.join("\n") + "\n"), draws.below(5));
    if draws.below(3) == 0 {
        bytes.truncate(draws.below(bytes.len() + 1));
    }
    bytes
}

/// `count` variants; every point that is read stands in its original.
fn judge(count: usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    let mut draws = Draws(41);
    let originals = originals();
    let known: Vec<HashSet<[u64; 4]>> = originals
        .iter()
        .map(|o| {
            fs::write(&path, &o.text).unwrap();
            read(&path, o.columns).unwrap().into_iter().collect()
        })
        .collect();
    let mut right = 0;
    for variant in 0..count {
        let k = draws.below(originals.len());
        let bytes = mangled(&originals[k], &mut draws);
        fs::write(&path, &bytes).unwrap();
        match read(&path, originals[k].columns) {
            // as every measurement with so few
            Ok(points) if points.len() < Field::FEWEST => {}
            Ok(points) => {
                right += 1;
                for p in points {
                    assert!(
                        known[k].contains(&p),
                        "variant {variant}: {:?} is in no line of the original:\n{}",
                        p.map(f64::from_bits),
                        String::from_utf8_lossy(&bytes)
                    );
                }
            }
            Err(error) => {
                assert_eq!(error.blame(), Blame::Input, "variant {variant}: {error}");
                assert!(
                    error.to_string().contains("t.csv"),
                    "variant {variant}: {error}"
                );
            }
        }
    }
    assert!(3 * right > count, "{right} of {count} were read");
}

#[test]
fn mangled_tables_are_right_or_refused() {
    judge(5_000);
}

#[test]
#[ignore = "exhaustive: minutes"]
fn two_hundred_thousand_mangled_tables_are_right_or_refused() {
    judge(200_000);
}

/// Four matrices of which one was cut, saved in another form or changed in some bytes: numbers of the original, or an error with its file.
#[test]
fn mangled_matrices_are_right_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut grid = Grid::regular([[-6.0, -5.0], [6.0, 5.0]], 11, 13);
    for (p, u) in grid.points.iter().zip(&mut grid.displacement) {
        *u = [1e-3 * p[0] + 1e-5 * p[1] * p[1], -3e-4 * p[1]];
    }
    matrices::write_matrices(folder.path(), &grid, None).unwrap();
    let read = || -> Result<HashSet<[u64; 4]>, plychain::error::Error> {
        let field = matrices::read(folder.path(), FRAME)?;
        let both = field.points.iter().zip(&field.displacement);
        let bits = |(p, u): (&[f64; 2], &[f64; 2])| [p[0], p[1], u[0], u[1]].map(f64::to_bits);
        Ok(both.map(bits).collect())
    };
    let known = read().unwrap();
    let mut draws = Draws(43);
    let mut right = 0;
    for variant in 0..1_000 {
        let name = ["X.txt", "Y.txt", "U.txt", "V.txt"][draws.below(4)];
        let path = folder.path().join(name);
        let whole = fs::read_to_string(&path).unwrap();
        let text = match draws.below(6) {
            0 => whole.replace('.', ","),
            1 => whole.replace('-', "\u{2212}"),
            2 => whole.replace('\n', "\r\n"),
            3 => whole.replace(' ', "\t"),
            4 => whole.replacen(char::is_numeric, "NaN", 1),
            _ => whole.clone(),
        };
        let mut bytes = encoded(&text, draws.below(5));
        if draws.below(2) == 0 {
            bytes.truncate(draws.below(bytes.len() + 1));
        }
        fs::write(&path, &bytes).unwrap();
        match read() {
            Ok(points) => {
                right += 1;
                let other = points.difference(&known).count();
                assert_eq!(other, 0, "variant {variant} of {name}: {text}");
            }
            Err(error) => {
                assert_eq!(error.blame(), Blame::Input, "variant {variant}: {error}");
                assert!(error.to_string().contains(".txt"), "{variant}: {error}");
            }
        }
        fs::write(&path, whole).unwrap();
    }
    assert!(right > 50, "{right} were read");
}

/// Any bytes changed in files of MATLAB: an error or numbers, no panic.
#[test]
fn mangled_arrays_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mat");
    let whole = super::forms::matlab_4(["x", "y", "u", "v"]);
    let mut draws = Draws(42);
    for _ in 0..500 {
        let mut bytes = whole.clone();
        for _ in 0..=draws.below(4) {
            let reach = [40, bytes.len()][draws.below(2)];
            let at = draws.below(reach);
            bytes[at] = draws.below(256) as u8;
        }
        let cut = draws.below(2) * draws.below(bytes.len());
        bytes.truncate(bytes.len() - cut);
        fs::write(&path, &bytes).unwrap();
        if let Err(error) = read(&path, ["x", "y", "u", "v"]) {
            assert_eq!(error.blame(), Blame::Input);
        }
    }
}
