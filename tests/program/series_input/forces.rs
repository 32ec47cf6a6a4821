//! `init --forces`: each step's force from the testing machine's file.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::common::plychain_in;

const HEADER: &str = "coor.X [mm];coor.Y [mm];disp.Horizontal Displacement U [mm];disp.Vertical Displacement V [mm]\n";

/// Fields of a strip that stretches along x with the force, by the names of their files.
fn fields(folder: &Path, names: &[(&str, f64)]) {
    for (name, strain) in names {
        let mut text = String::from(HEADER);
        for k in 0..400 {
            let (x, y) = (f64::from(k % 20), f64::from(k / 20) * 0.5);
            writeln!(text, "{x};{y};{};{}", strain * x, -0.3 * strain * y).unwrap();
        }
        fs::write(folder.join(name), text).unwrap();
    }
}

/// The forces that `init` writes, or what it says.
fn forces(folder: &Path, table: &str, more: &[&str]) -> Result<(Vec<f64>, String), String> {
    fs::write(folder.join("machine.txt"), table).unwrap();
    let _ = fs::remove_file(folder.join("coupon.json"));
    let mut arguments = vec![
        "init",
        "coupon",
        "--csv",
        "s-*.csv",
        "--forces",
        "machine.txt",
    ];
    arguments.extend(more);
    let end = plychain_in(folder, &arguments);
    let said = String::from_utf8([end.stdout, end.stderr].concat()).unwrap();
    if !end.status.success() {
        return Err(said);
    }
    let text = fs::read_to_string(folder.join("coupon.json")).unwrap();
    let model: Value = serde_json::from_str(&text).unwrap();
    let experiment = &model["experiments"][0];
    let of_steps = experiment["steps"].as_array();
    let steps = of_steps.map(|s| s.iter().map(|s| s["force_N"].as_f64().unwrap()).collect());
    Ok((
        steps.unwrap_or_else(|| vec![experiment["load"]["force_N"].as_f64().unwrap()]),
        said,
    ))
}

fn series() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fields(
        folder.path(),
        &[
            ("s-02_0.csv", 1e-3),
            ("s-10_0.csv", 2e-3),
            ("s-11_0.csv", 2e-3),
        ],
    );
    folder
}

/// Analog data as VIC writes them: a row of groups, names in quotation marks with the unit in one, the reference picture's row first.
#[test]
fn analog_data_by_picture_number_less_the_reference_picture_s() {
    let folder = series();
    let mut table = String::from(
        "\"Average\",,\"Analog\",,\n\"Index [1]\",\"exx [1] - Lagrange\",\"Time_0\",\"stroke_(mm)\",\"Charge_(KN)\"\n",
    );
    for k in 0..12 {
        writeln!(
            table,
            "{k},{:e},{}.5,{},{}",
            1e-4 * f64::from(k),
            k,
            k,
            0.03 + 0.25 * f64::from(k)
        )
        .unwrap();
    }
    let (found, said) = forces(folder.path(), &table, &[]).unwrap();
    assert_eq!(found, [500.0, 2500.0, 2750.0]);
    for words in ["in kN", "30 N are subtracted", "line 5", "offset 0"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let (found, _) = forces(folder.path(), &table, &["--force-offset", "-1"]).unwrap();
    assert_eq!(found, [250.0, 2250.0, 2500.0]);
    let error = forces(folder.path(), &table, &["--force-offset", "5"]).unwrap_err();
    assert!(
        error.contains("picture 15") && error.contains("0 to 11"),
        "{error}"
    );
}

/// By the names of pictures, with decimal commas and several readings a picture.
#[test]
fn daq_rows_by_picture_name_are_averaged() {
    let folder = series();
    let table = "File;Time [s];Force [N]\r\nC:\\test\\s-02_0.tif;0,1;99,5\r\nC:\\test\\s-02_0.tif;0,2;100,5\r\nC:\\test\\s-10_0.tif;0,3;200,0\r\nC:\\test\\s-11_0.tif;0,4;200,5\r\n";
    let (found, said) = forces(folder.path(), table, &[]).unwrap();
    assert_eq!(found, [100.0, 200.0, 200.5]);
    for words in [
        "pictures' names",
        "the mean of 2 rows",
        "decimal commas",
        "kept, as repeats",
        "no row belongs to the reference",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn a_row_of_units_and_sixteen_bits() {
    let folder = series();
    let table = "Picture;Force\n-;kN\n0;0\n2;1.5\n10;3\n11;3.5\n";
    assert_eq!(
        forces(folder.path(), table, &[]).unwrap().0,
        [1500.0, 3000.0, 3500.0]
    );
    fields(folder.path(), &[("alone-2.csv", 1e-3)]);
    let wide: Vec<u8> = std::iter::once(0xfeff)
        .chain(table.encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    fs::write(folder.path().join("wide.csv"), wide).unwrap();
    let end = plychain_in(
        folder.path(),
        &[
            "init",
            "alone",
            "--csv",
            "alone-2.csv",
            "--forces",
            "wide.csv",
        ],
    );
    assert!(end.status.success(), "{end:?}");
    let text = fs::read_to_string(folder.path().join("alone.json")).unwrap();
    let model: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(model["experiments"][0]["load"]["force_N"], 1500.0);
}

#[test]
fn what_the_file_does_not_say_is_asked_for() {
    let folder = series();
    let folder = folder.path();
    let table = "index,load,displacement\n1,0,0\n2,1,1\n10,2,2\n11,2.5,3\n";
    let error = forces(folder, table, &[]).unwrap_err();
    assert!(
        error.contains("the unit of the column load") && error.contains("--force-unit"),
        "{error}"
    );
    assert_eq!(
        forces(folder, table, &["--force-unit", "kN"]).unwrap().0,
        [1000.0, 2000.0, 2500.0]
    );
    let error = forces(folder, table, &["--force-unit", "stone"]).unwrap_err();
    assert!(error.contains("stone") && error.contains("lbf"), "{error}");
    let stated = table.replace("load", "load [N]");
    let error = forces(folder, &stated, &["--force-unit", "kN"]).unwrap_err();
    assert!(error.contains("as the column says"), "{error}");
    let two = table.replace("displacement", "Force [kN]");
    let error = forces(folder, &two, &[]).unwrap_err();
    assert!(
        error.contains("load, Force [kN]") && error.contains("--force-column"),
        "{error}"
    );
    assert_eq!(
        forces(folder, &two, &["--force-column", "force [kn]"])
            .unwrap()
            .0,
        [1000.0, 2000.0, 3000.0]
    );
    for other in [
        "Force per width [N/mm]",
        "Force rate [kN/s]",
        "Load [N/mm^2]",
    ] {
        let error = forces(folder, &table.replace("load", other), &[]).unwrap_err();
        assert!(error.contains("a column of forces"), "{error}");
    }
    let none = table.replace("load", "stress");
    let error = forces(folder, &none, &["--force-unit", "N"]).unwrap_err();
    assert!(
        error.contains("a column of forces") && error.contains("stress"),
        "{error}"
    );
    let times = "time [s];force [N]\n0.1;1\n0.2;2\n0.3;3\n0.4;4\n0.5;5\n";
    let error = forces(folder, times, &[]).unwrap_err();
    assert!(error.contains("5 rows for 3 steps"), "{error}");
    let order = "time [s];force [N]\n0.1;1\n0.2;11\n0.3;21\n0.4;31\n";
    assert_eq!(forces(folder, order, &[]).unwrap().0, [10.0, 20.0, 30.0]);
    let gap = "index;force [N]\n0;0\n2;n/a\n10;2\n11;3\n";
    let error = forces(folder, gap, &[]).unwrap_err();
    assert!(error.contains("s-02_0.csv"), "{error}");
}
