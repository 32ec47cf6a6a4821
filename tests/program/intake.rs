//! Tables of programs and records of machines, each kind in a form of its own: what `init` makes of them.

use std::fmt::Write;
use std::fs;

use serde_json::Value;

use crate::exports::{FieldRow, decimals, lines, measurement, proposed, strip};

mod records;
mod stereo;

/// The strip in pixels of 0.05 mm.
fn pixels() -> Vec<FieldRow> {
    strip().iter().map(|row| row.map(|v| v / 0.05)).collect()
}

fn read(head: &str, rows: &[FieldRow], sign: &str, more: &[&str]) -> (Value, String) {
    let text = format!("{head}\n{}", lines(rows, sign, decimals));
    proposed(text.as_bytes(), "t.csv", more).unwrap_or_else(|e| panic!("{head}: {e}"))
}

#[test]
fn older_tables_of_matchid_are_read() {
    let plain = "Image X[Pixel],Image Y[Pixel],Horizontal Displacement U[Pixel],Vertical Displacement V[Pixel]";
    let short = "Image X[Pixel],Image Y[Pixel],Horizontal: u[Pixel],Vertical: v[Pixel]";
    for head in [plain, short] {
        let (model, text) = read(head, &pixels(), ",", &["--mm-per-pixel", "0.05"]);
        assert!(text.contains("columns of MatchID"), "{text}");
        assert_eq!(measurement(&model)["units"]["coordinates"], "px");
    }
    // matrices of correlation and sigma behind them, a comma at the end of the header
    let rows = lines(&pixels(), ",", decimals).replace('\n', ",0.99998,0.00012\n");
    let table = format!("{plain},Correlation Coefficient: R,Sigma,\n{rows}");
    let (model, _) = proposed(table.as_bytes(), "t.csv", &["--mm-per-pixel", "0.05"]).unwrap();
    let columns = &measurement(&model)["columns"];
    assert_eq!(columns["correlation"], "Correlation Coefficient: R");
    assert_eq!(columns["sigma"], "Sigma");
    // stereo, in mm beside the picture's pixels, with decimal commas
    let head = "X[mm];Y[mm];Horizontal Displacement U[mm];Vertical Displacement V[mm];Image X[Pixel];Image Y[Pixel]";
    let rows = lines(&strip(), ";", decimals)
        .replace('.', ",")
        .replace('\n', ";100;200\n");
    let (model, text) = proposed(format!("{head}\n{rows}").as_bytes(), "t.csv", &[]).unwrap();
    assert!(text.contains("columns of MatchID"), "{text}");
    assert_eq!(measurement(&model)["columns"]["x"], "X[mm]");
}

#[test]
fn small_letters_are_istra4d_and_capitals_dice() {
    let head = "coordinate_x,coordinate_y,displacement_x,displacement_y";
    let (model, text) = read(head, &strip(), ",", &[]);
    assert!(text.contains("Istra4D"), "{text}");
    assert_eq!(measurement(&model)["units"]["coordinates"], "mm");
    let rows = lines(&strip(), ",", decimals).replace('\n', ",1\n");
    let table = format!("{head},mask\n{rows}");
    let (_, text) = proposed(table.as_bytes(), "t.csv", &[]).unwrap();
    assert!(text.contains("column \"mask\" is not used"), "{text}");
    let (_, text) = read(
        &head.to_uppercase(),
        &pixels(),
        ",",
        &["--mm-per-pixel", "0.05"],
    );
    assert!(text.contains("columns of DICe"), "{text}");
}

/// A sigma of 0 is one that was rounded where the coefficient of the correlation is good, and a failed point where nothing says so.
#[test]
fn a_sigma_of_zero_is_judged_by_the_correlation() {
    let table = |with_correlation: bool| {
        let rows = lines(&strip(), ",", decimals);
        let row = |(k, line): (usize, &str)| {
            let sigma = if k % 5 == 0 { "0.000000" } else { "0.000004" };
            let correlation = if with_correlation { ",0.9999" } else { "" };
            format!("{line},{sigma}{correlation}\n")
        };
        let correlation = if with_correlation { ",correlation" } else { "" };
        let rows: String = rows.lines().enumerate().map(row).collect();
        format!("x_mm,y_mm,ux_mm,uy_mm,sigma{correlation}\n{rows}")
    };
    let count = strip().len();
    let zeros = count.div_ceil(5);
    let (_, text) = proposed(table(true).as_bytes(), "t.csv", &[]).unwrap();
    let kept = format!("{zeros} points with sigma 0 and a good correlation are kept");
    assert!(
        text.contains(&format!("{count} points")) && text.contains(&kept),
        "{text}"
    );
    let (_, text) = proposed(table(false).as_bytes(), "t.csv", &[]).unwrap();
    let dropped = format!("{zeros} points with sigma 0 are taken for not correlated");
    assert!(text.contains(&dropped), "{text}");
}

/// Rows of two areas that overlap become one; the two faces of a crack do not, and two steps in one file are refused.
#[test]
fn what_stands_at_one_place_twice_is_one_point() {
    let table = |again: &[FieldRow]| {
        let rows = lines(&strip(), ",", decimals) + &lines(again, ",", decimals);
        format!("x_mm,y_mm,ux_mm,uy_mm\n{rows}")
    };
    let moved = |count: usize, by: f64| -> Vec<FieldRow> {
        let some = strip().into_iter().take(count);
        some.map(|[x, y, u, v]| [x, y, u + by, v]).collect()
    };
    let (_, text) = proposed(table(&moved(40, 2e-4)).as_bytes(), "t.csv", &[]).unwrap();
    assert!(
        text.contains("40 rows at places that stand in the file already are merged"),
        "{text}"
    );
    assert!(text.contains("40 that stand in the file again"), "{text}");
    let (_, text) = proposed(table(&moved(10, 0.2)).as_bytes(), "t.csv", &[]).unwrap();
    assert!(text.contains("20 rows are left out"), "{text}");
    let error = proposed(table(&moved(strip().len(), 0.01)).as_bytes(), "t.csv", &[]).unwrap_err();
    assert!(
        error.contains("one displacement of every point") && error.contains("two steps"),
        "{error}"
    );
}

/// An array of MATLAB 4.
fn array(name: &str, values: &[f64]) -> Vec<u8> {
    let head = [0, values.len() as i32, 1, 0, name.len() as i32 + 1].map(i32::to_le_bytes);
    let values = values.iter().flat_map(|v| v.to_le_bytes());
    head.concat()
        .into_iter()
        .chain(name.bytes())
        .chain([0])
        .chain(values)
        .collect()
}

#[test]
fn arrays_without_places_are_asked_for_them() {
    let columns = [2, 3].map(|k| strip().iter().map(|row| row[k]).collect::<Vec<f64>>());
    let file = [array("u", &columns[0]), array("v", &columns[1])].concat();
    let error = proposed(&file, "uv.mat", &[]).unwrap_err();
    assert!(
        error.contains("found u, v, expected four arrays"),
        "{error}"
    );
    assert!(
        error.contains("meshgrid") && error.contains("x and y"),
        "{error}"
    );
}

/// The hint for a file of bytes speaks of what a field is saved as, that for chains of chains.
#[test]
fn binary_files_of_fields_say_how_to_export_them() {
    for (name, bytes) in [
        ("step_1.hdf5", &b"\x89HDF\r\n\x1a\n"[..]),
        ("solution.e", b"CDF\x01"),
    ] {
        let error = proposed(bytes, name, &[]).unwrap_err();
        assert!(
            error.contains("Istra4D") && error.contains("DICe_solution_N.txt"),
            "{error}"
        );
        assert!(!error.contains("ArviZ"), "{error}");
    }
}

#[test]
fn y_that_counts_downwards_is_said_and_turned() {
    let head = "Image X[Pixel],Image Y[Pixel],Horizontal Displacement U[Pixel],Vertical Displacement V[Pixel]";
    let scale = ["--mm-per-pixel", "0.05"];
    let (_, text) = read(head, &pixels(), ",", &scale);
    assert!(text.contains("--y-down"), "{text}");
    let (model, _) = read(head, &pixels(), ",", &[&scale[..], &["--y-down"]].concat());
    let columns = &measurement(&model)["columns"];
    assert_eq!(columns["y"], "-Image Y[Pixel]");
    assert_eq!(columns["uy"], "-Vertical Displacement V[Pixel]");
}

/// The size of a pixel that is known stands where effects look for it, and gives subsets in pixels their side.
#[test]
fn the_size_of_a_pixel_is_used_everywhere() {
    let head = "Image X[Pixel],Image Y[Pixel],Horizontal Displacement U[Pixel],Vertical Displacement V[Pixel]";
    for (option, side) in [(["--subset-px", "21"], 1.05), (["--subset-mm", "1.2"], 1.2)] {
        let (model, _) = read(
            head,
            &pixels(),
            ",",
            &[&["--mm-per-pixel", "0.05"][..], &option].concat(),
        );
        let images = &measurement(&model)["image_correlation"];
        assert_eq!(images["subset_mm"], side);
        assert_eq!(images["pixel_mm"], 0.05);
    }
    let table = format!("x_mm,y_mm,ux_mm,uy_mm\n{}", lines(&strip(), ",", decimals));
    let error = proposed(table.as_bytes(), "t.csv", &["--subset-px", "21"]).unwrap_err();
    assert!(
        error.contains("--subset-px") && error.contains("--mm-per-pixel"),
        "{error}"
    );
}

/// A mean shear that no tension test makes is a shear test's.
#[test]
fn a_field_of_shear_is_none_of_exchanged_displacements() {
    let rows: Vec<FieldRow> = strip()
        .iter()
        .map(|[x, y, ..]| [*x, *y, 2e-3 * y, -1.5e-3 * x])
        .collect();
    let (_, text) = read("x_mm,y_mm,ux_mm,uy_mm", &rows, ",", &[]);
    assert!(!text.contains("exchanged"), "{text}");
}

/// Matrices whose numbers have decimal commas.
#[test]
fn matrices_with_decimal_commas_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for (k, name) in ["X.txt", "Y.txt", "U.txt", "V.txt"].iter().enumerate() {
        let mut text = String::new();
        for row in strip().iter().take(900).collect::<Vec<_>>().chunks(30) {
            for cell in row {
                write!(text, "{:.6};", if k < 2 { cell[k] } else { 1e3 * cell[k] }).unwrap();
            }
            text.push('\n');
        }
        fs::write(folder.path().join(name), text.replace('.', ",")).unwrap();
    }
    let frame = plychain::field::DATA_AXES;
    let field = plychain::field::matrices::read(folder.path(), frame).unwrap();
    assert_eq!(field.len(), 900);
    assert_eq!(field.points[1], [strip()[1][0], strip()[1][1]]);
}
