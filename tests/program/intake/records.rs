//! Records of testing machines over time and by number, and forces in the names of files.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::exports::said;

/// A field of a strip that stretches along x with the force.
fn field(folder: &Path, name: &str, before: &str, force: f64) {
    let mut text = format!("{before}X [mm];Y [mm];U [mm];V [mm]\n");
    for k in 0..400 {
        let (x, y, e) = (f64::from(k % 20), f64::from(k / 20) * 0.5, 1e-6 * force);
        writeln!(text, "{x};{y};{};{}", e * x, -0.3 * e * y).unwrap();
    }
    fs::write(folder.join(name), text).unwrap();
}

/// The forces that `init` gives to the steps, and what it said.
fn forces(
    folder: &Path,
    record: Option<&[u8]>,
    more: &[&str],
) -> Result<(Vec<f64>, String), String> {
    let _ = fs::remove_file(folder.join("a.json"));
    let mut arguments = vec!["init", "a", "--csv", "p*.csv"];
    if let Some(record) = record {
        fs::write(folder.join("machine.txt"), record).unwrap();
        arguments.extend(["--forces", "machine.txt"]);
    }
    let (done, text) = said(folder, &[&arguments[..], more].concat());
    if !done {
        return Err(text);
    }
    let model = fs::read_to_string(folder.join("a.json")).unwrap();
    let model: Value = serde_json::from_str(&model).unwrap();
    let steps = model["experiments"][0]["steps"].as_array().unwrap();
    Ok((
        steps
            .iter()
            .map(|s| s["force_N"].as_f64().unwrap())
            .collect(),
        text,
    ))
}

/// 300 N a second, twice a second.
fn record(head: &str, sign: &str, per_second: f64, kilo: f64) -> Vec<u8> {
    let row = |k: u32| {
        let t = 0.5 * f64::from(k);
        format!("{:.3}{sign}{:.6}\n", t * per_second, 300.0 * t / kilo)
    };
    (head.to_string() + &(0..20).map(row).collect::<String>()).into_bytes()
}

#[test]
fn forces_are_interpolated_at_the_times_of_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["p_2.250 s.csv", "p_4.3s.csv", "p_6,75 s.csv"];
    for (name, force) in names.iter().zip([675.0, 1290.0, 2025.0]) {
        field(folder.path(), name, "", force);
    }
    for table in [
        record("time_s;force_N\n", ";", 1.0, 1.0),
        record("Time [ms]\tLoad [kN]\n", "\t", 1e3, 1e3),
        record("#Zeit_s Kraft_kN\n", " ", 1.0, 1e3),
    ] {
        let (found, text) = forces(folder.path(), Some(&table), &[]).unwrap();
        assert_eq!(found, [675.0, 1290.0, 2025.0], "{text}");
        assert!(text.contains("interpolated over time"), "{text}");
    }
    let short = b"time_s;force_N\n0;0\n1;300\n2;600\n";
    let error = forces(folder.path(), Some(short), &[]).unwrap_err();
    assert!(
        error.contains("the force at 2.25 s") && error.contains("times 0 to 2 s"),
        "{error}"
    );
    let back = b"time_s;force_N\n0;0\n9;300\n8;600\n";
    let error = forces(folder.path(), Some(back), &[]).unwrap_err();
    assert!(
        error.contains("go on from row to row") && error.contains("machine.txt:4"),
        "{error}"
    );
}

/// The time stands before the table, or in a column of it.
#[test]
fn times_of_pictures_stand_in_their_files() {
    let folder = tempfile::tempdir().unwrap();
    field(folder.path(), "p1.csv", "# time : 2.25 s\n", 675.0);
    field(folder.path(), "p2.csv", "# time [s] : 4.25\n", 1275.0);
    let text = fs::read_to_string(folder.path().join("p2.csv")).unwrap();
    let third = text
        .replace("# time [s] : 4.25\n", "")
        .replace("V [mm]", "V [mm];relative_time");
    let row = |line: &str| {
        if line.starts_with('X') {
            format!("{line}\n")
        } else {
            format!("{line};6.25\n")
        }
    };
    fs::write(
        folder.path().join("p3.csv"),
        third.lines().map(row).collect::<String>(),
    )
    .unwrap();
    let table = record("time_s;force_N\n", ";", 1.0, 1.0);
    let (found, text) = forces(folder.path(), Some(&table), &[]).unwrap();
    assert_eq!(found, [675.0, 1275.0, 1875.0], "{text}");
}

/// Blanks between the columns, names behind a comment sign, a page of Windows, decimal commas, UTF-16.
#[test]
fn text_of_a_machine_is_read_as_tables_are() {
    let folder = tempfile::tempdir().unwrap();
    for k in 1..4 {
        field(
            folder.path(),
            &format!("p-{k}.csv"),
            "",
            650.0 * f64::from(k),
        );
    }
    let rows = "0 0.000 0.000000\n1 650.000 0.012000\n2 1300.000 0.024000\n3 1950.000 0.036000\n";
    let latin = [
        &b"#Bild Kraft_N L\xe4ngen\xe4nderung_mm\n"[..],
        rows.as_bytes(),
    ]
    .concat();
    let apart = format!("# Bild Kraft_N Weg_mm\n{rows}").into_bytes();
    let commas = format!("Bild Kraft_N Weg_mm\n{}", rows.replace('.', ",")).into_bytes();
    let wide = format!("\u{feff}Bild\tKraft_N\tWeg_mm\n{}", rows.replace(' ', "\t"));
    let wide: Vec<u8> = wide.encode_utf16().flat_map(u16::to_le_bytes).collect();
    for table in [latin, apart, commas, wide] {
        let found = forces(folder.path(), Some(&table), &[]);
        let (found, text) =
            found.unwrap_or_else(|e| panic!("{}: {e}", String::from_utf8_lossy(&table)));
        assert_eq!(found, [650.0, 1300.0, 1950.0], "{text}");
    }
}

#[test]
fn a_force_in_a_files_name_is_one() {
    for (names, expected) in [
        (
            ["p_0.5 kN.csv", "p_1 kN.csv", "p_1.5 kN.csv"],
            [500.0, 1000.0, 1500.0],
        ),
        (
            ["p-250N.csv", "p-500N.csv", "p-750N.csv"],
            [250.0, 500.0, 750.0],
        ),
        (
            ["p_0,5kN.csv", "p_1,0kN.csv", "p_unloaded.csv"],
            [0.0, 500.0, 1000.0],
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            field(folder.path(), name, "", 500.0);
        }
        let (found, text) = forces(folder.path(), None, &[]).unwrap();
        assert_eq!(found, expected, "{text}");
        assert!(text.contains("by the file's name"), "{text}");
    }
}
