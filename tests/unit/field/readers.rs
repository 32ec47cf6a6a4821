use std::fs;
use std::path::Path;

use plychain::error::{Blame, Error};
use plychain::field::{Axis, Field, Frame, Grid, MeasurementSpec, READERS, Source, matrices};
use proptest::prelude::*;

use super::{STEEL, open_hole, spec};
use crate::common::shared;

const FRAME_Y: Frame = Frame {
    loading_axis: Axis::Y,
    hole_center_mm: [0.0; 2],
};

const TABLE: &str = r#"{ "format": "csv", "file": "t.csv", "columns": {"x": "x [mm]", "y": "y", "ux": "u x", "uy": "uy"},
    "units": {"coordinates": "mm", "displacements": "um"}, "loading_axis": "y", "hole_center_in_data_mm": [1.0, 2.0] }"#;

/// A small grid with a hole of NaN.
fn grid() -> Grid {
    let mut grid = Grid::regular([[-6.0, -5.0], [6.0, 5.0]], 11, 13);
    for (p, u) in grid.points.iter().zip(&mut grid.displacement) {
        if p[0].hypot(p[1]) > 2.0 {
            *u = open_hole(*p);
        }
    }
    grid
}

/// A table of the small grid's measured points in the columns of [`TABLE`].
fn table(delimiter: &str) -> String {
    let head = ["id", "x [mm]", "y", "u x", "uy"].join(delimiter);
    let rows = grid().points.into_iter().enumerate().map(|(i, p)| {
        let u = open_hole(p).map(|u| u * 1e3);
        [i as f64, p[0], p[1], u[0], u[1]]
            .map(|v| v.to_string())
            .join(delimiter)
    });
    std::iter::once(head)
        .chain(rows)
        .collect::<Vec<_>>()
        .join("\n")
}

fn read_table(text: impl AsRef<[u8]>) -> Result<Field, Error> {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("t.csv"), text).unwrap();
    spec(TABLE).read(dir.path(), None)
}

/// Read the small grid's files after `edit` has had its way with one of them.
fn read_edited(name: &str, edit: impl Fn(String) -> Vec<u8>) -> Result<Field, Error> {
    let dir = tempfile::tempdir().unwrap();
    matrices::write_matrices(dir.path(), &grid(), None).unwrap();
    let path = dir.path().join(name);
    fs::write(&path, edit(fs::read_to_string(&path).unwrap())).unwrap();
    matrices::read(dir.path(), FRAME_Y)
}

fn assert_names(result: Result<Field, Error>, parts: &[&str]) {
    let error = result.expect_err("an error");
    assert_eq!(error.blame(), Blame::Input);
    for part in parts {
        assert!(
            error.to_string().contains(part),
            "\"{error}\" should name {part}"
        );
    }
}

#[test]
fn matrices_round_trip_within_their_decimals() {
    let dir = tempfile::tempdir().unwrap();
    matrices::write_matrices(dir.path(), &grid(), None).unwrap();
    let (read, written) = (
        matrices::read(dir.path(), FRAME_Y).unwrap(),
        grid().field(FRAME_Y),
    );
    assert_eq!(read.grid, written.grid);
    assert_eq!(read.rejected, written.rejected);
    assert!(read.rejected.missing > 0);
    for i in 0..read.len() {
        for k in 0..2 {
            assert!((read.points[i][k] - written.points[i][k]).abs() <= 0.51e-5);
            assert!((read.displacement[i][k] - written.displacement[i][k]).abs() <= 0.51e-9);
        }
    }
    assert_eq!(read.files.len(), 4);
}

/// The small grid written in a format, and the measurement that reads it.
fn written(
    format: &'static dyn plychain::field::Reader,
    frame: Frame,
    dir: &Path,
) -> MeasurementSpec {
    let path = dir.join("field");
    let columns = format.write(&path, &grid(), frame).unwrap();
    assert_eq!(columns.is_some(), format.has_columns());
    let mut spec = spec(r#"{"format":"matrices","dir":"d","loading_axis":"y","outliers":"keep"}"#);
    spec.frame = frame;
    spec.source = Source {
        reader: format,
        path: Some(path),
        columns,
    };
    spec
}

/// Formats of files of numbers; images have tests of their own.
fn of_numbers() -> impl Iterator<Item = &'static dyn plychain::field::Reader> {
    let all = READERS.iter().copied();
    all.filter(|reader| reader.format() != "fringes")
}

#[test]
fn every_format_reads_back_what_it_wrote() {
    for (k, reader) in of_numbers().enumerate() {
        let name = reader.format();
        assert!(READERS[..k].iter().all(|r| r.format() != name), "{name}");
        for axis in [Axis::X, Axis::Y] {
            let frame = Frame {
                loading_axis: axis,
                hole_center_mm: [0.5, -0.25],
            };
            let dir = tempfile::tempdir().unwrap();
            let spec = written(reader, frame, dir.path());
            let read = spec.read(Path::new(""), None).unwrap();
            let expected = grid().field(frame);
            assert_eq!(read.len(), expected.len(), "{name}");
            assert_eq!(read.rejected.missing, expected.rejected.missing, "{name}");
            for i in 0..read.len() {
                for k in 0..2 {
                    assert!((read.points[i][k] - expected.points[i][k]).abs() <= 0.51e-5);
                    let u = [read.displacement[i][k], expected.displacement[i][k]];
                    assert!((u[0] - u[1]).abs() <= 0.51e-9, "{name}: {u:?}");
                }
            }
            assert_eq!(read.files, spec.files(Path::new("")).unwrap(), "{name}");
            let text = serde_json::to_string(&spec).unwrap();
            assert_eq!(
                serde_json::from_str::<MeasurementSpec>(&text).unwrap(),
                spec
            );
        }
    }
}

#[test]
fn every_format_names_the_file_and_line_of_a_broken_number() {
    for reader in of_numbers() {
        let dir = tempfile::tempdir().unwrap();
        let spec = written(reader, FRAME_Y, dir.path());
        for file in spec.files(Path::new("")).unwrap() {
            let text = fs::read_to_string(&file).unwrap();
            let start = text.match_indices('\n').nth(2).unwrap().0;
            let digit = text[start..].find(|c: char| c.is_ascii_digit()).unwrap() + start;
            fs::write(&file, [&text[..digit], "x", &text[digit + 1..]].concat()).unwrap();
            let place = format!("{}:4", file.display());
            assert_names(spec.read(Path::new(""), None), &[&place, "x"]);
            fs::remove_file(&file).unwrap();
            assert_names(
                spec.read(Path::new(""), None),
                &[&file.display().to_string(), "readable"],
            );
            fs::write(&file, text).unwrap();
        }
    }
}

#[test]
fn u_is_along_the_loading_axis_whatever_the_axis() {
    let grid = grid();
    for (axis, sign) in [(Axis::X, 1.0), (Axis::Y, -1.0)] {
        let frame = Frame {
            loading_axis: axis,
            hole_center_mm: [1.0, -2.0],
        };
        let field = grid.field(frame);
        assert_eq!(frame.handedness(), sign);
        assert_eq!(field.displacement[0], grid.displacement[0]);
        let [x, y] = grid.points[0];
        let expected = if axis == Axis::X {
            [x - 1.0, y + 2.0]
        } else {
            [y + 2.0, x - 1.0]
        };
        assert_eq!(field.points[0], expected);
        assert_eq!(frame.data_point(expected), [x, y]);
    }
}

#[test]
fn bad_matrices_are_named_by_place_and_value() {
    let keep = |text: String| text.into_bytes();
    assert!(read_edited("U.txt", keep).is_ok());
    let cell = |value: &'static str| {
        move |text: String| text.replacen(' ', &format!(" {value} "), 1).into_bytes()
    };
    assert_names(
        read_edited("U.txt", cell("1,5")),
        &["U.txt:1, column 2", "1,5"],
    );
    assert_names(
        read_edited("V.txt", cell("inf")),
        &["V.txt:1, column 2", "inf"],
    );
    assert_names(
        read_edited("V.txt", cell("1.0")),
        &["V.txt:2", "13 columns", "14 columns"],
    );
    let shorter = |text: String| text.split_once('\n').unwrap().1.as_bytes().to_vec();
    assert_names(
        read_edited("Y.txt", shorter),
        &["Y.txt", "10 rows", "11 rows"],
    );
    assert_names(
        read_edited("X.txt", |_| b" \n\n".to_vec()),
        &["X.txt", "empty"],
    );
    assert_names(read_edited("X.txt", |_| Vec::new()), &["X.txt", "empty"]);
    let nan = |text: String| {
        text.split(' ')
            .map(|_| "nan")
            .collect::<Vec<_>>()
            .join(" ")
            .into_bytes()
    };
    assert_names(
        read_edited("U.txt", |t| {
            t.lines()
                .map(|l| String::from_utf8(nan(l.into())).unwrap() + "\n")
                .collect::<String>()
                .into()
        }),
        &["U.txt", "NaN everywhere"],
    );
    let first_nan = |text: String| format!("NaN {}", text.split_once(' ').unwrap().1).into_bytes();
    assert_names(
        read_edited("Y.txt", first_nan),
        &["Y.txt:1, column 1", "NaN", "coordinate"],
    );
    assert_names(
        read_edited("X.txt", |t| [t.as_bytes(), &[0xff, 0xfe]].concat()),
        &["X.txt:12, column 1", "a number or NaN"],
    );
    assert_names(
        read_edited("X.txt", |t| t.into_bytes().into_iter().rev().collect()),
        &["X.txt:2, column"],
    );
    let far = |text: String| format!("1e200 {}", text.split_once(' ').unwrap().1).into_bytes();
    assert_names(read_edited("X.txt", far), &["X.txt:1, column 1"]);
    let nowhere = tempfile::tempdir().unwrap();
    assert_names(
        matrices::read(nowhere.path(), FRAME_Y),
        &["X.txt", "readable"],
    );
}

#[test]
fn a_table_is_read_with_any_delimiter_comments_and_failed_points() {
    let plain = read_table(table(",")).unwrap();
    let p = grid().points[0];
    assert_eq!(plain.points[0], [p[1] - 2.0, p[0] - 1.0]);
    let u = open_hole(p);
    assert!(
        (plain.displacement[0][0] - u[1]).abs() < 1e-15
            && (plain.displacement[0][1] - u[0]).abs() < 1e-15
    );
    for text in [
        table(";"),
        table("\t"),
        format!("\u{feff}# made by \"us, today\n\n{}", table(",")),
        table(", ").replace('\n', "\r\n"),
    ] {
        assert_eq!(read_table(text).unwrap().points, plain.points);
    }
    let failed = table(",") + "\n900,1,1,,\n901,2,2,NaN,nan\n902,,,,";
    let field = read_table(failed).unwrap();
    assert_eq!(field.rejected.missing, plain.rejected.missing + 3);
    assert_eq!(field.points, plain.points);
}

#[test]
fn bad_tables_are_named_by_place_and_value() {
    assert_names(
        read_table(table(",").replace("u x", "u")),
        &["columns.ux", "\"u x\"", "\"x [mm]\"", "\"uy\""],
    );
    assert_names(
        read_table(table(",").replace("id", "uy")),
        &["columns.uy", "one column"],
    );
    assert_names(
        read_table(format!(
            "# one\n# two\n{}\n# three\n\n7,1,oops,1,1",
            table(",")
        )),
        &["t.csv:149", "\"y\"", "oops"],
    );
    assert_names(
        read_table(table(",") + "\n7,1,inf,1,1"),
        &["t.csv:145", "inf"],
    );
    assert_names(
        read_table(table(",") + "\n7,1"),
        &["t.csv:145", "2 cells", "5 cells"],
    );
    assert_names(
        read_table(table(";") + "\n7;1,5;1;1;1"),
        &["t.csv:145", "1,5"],
    );
    assert_names(read_table(""), &["t.csv", "empty"]);
    assert_names(
        read_table("id,x [mm],y,u x,uy\n1,,,,"),
        &["t.csv", "none complete"],
    );
    assert_names(read_table([0x80, 0x81]), &["t.csv:1", "0x80"]);
    assert_names(
        spec(TABLE).read(Path::new("/nowhere"), None),
        &["t.csv", "readable"],
    );
}

#[test]
fn unknown_and_misplaced_keys_are_errors_that_name_the_key() {
    let good = r#"{"format":"matrices","dir":"d","loading_axis":"y"}"#;
    assert_eq!(spec(good).frame, FRAME_Y);
    for (json, key) in [
        (good.replace("}", r#","colour":"red"}"#), "colour"),
        (good.replace("}", r#","file":"f"}"#), "file"),
        (good.replace("\"y\"", "\"z\""), "`z`"),
        (
            good.replace("}", r#","fringe_frequency_per_mm":-1}"#),
            "fringe_frequency_per_mm",
        ),
        (good.replace("}", r#","outliers":"maybe"}"#), "maybe"),
        (
            TABLE
                .replace(r#","hole_center_in_data_mm": [1.0, 2.0]"#, "")
                .replace(r#", "hole_center_in_data_mm": [1.0, 2.0]"#, ""),
            "hole_center_in_data_mm",
        ),
        (TABLE.replace("\"um\"", "\"furlong\""), "furlong"),
        (
            TABLE.replace("\"uy\": \"uy\"", "\"uy\": \"u x\""),
            "columns.uy",
        ),
        (
            TABLE.replace("\"uy\": \"uy\"", "\"uy\": \"uy\", \"uz\": \"w\""),
            "uz",
        ),
    ] {
        let error = serde_json::from_str::<MeasurementSpec>(&json)
            .unwrap_err()
            .to_string();
        assert!(error.contains(key), "\"{error}\" should name {key}");
    }
    // the steps of a series have the path: without them it is missed where the field is to be read, if not by the model file
    let nowhere = spec(&good.replace("\"dir\":\"d\",", ""));
    assert_names(
        nowhere.read(Path::new(""), None),
        &["measurement.dir", "no such key"],
    );
    for json in [good, TABLE, STEEL] {
        let text = serde_json::to_string(&spec(json)).unwrap();
        assert_eq!(spec(&text), spec(json));
    }
}

#[test]
fn a_window_counts_what_it_cuts_and_may_not_be_empty() {
    let dir = tempfile::tempdir().unwrap();
    matrices::write_matrices(&dir.path().join("d"), &grid(), None).unwrap();
    let spec =
        spec(r#"{"format":"matrices","dir":"elsewhere","loading_axis":"y"}"#).with_path("d".into());
    let all = spec.read(dir.path(), None).unwrap();
    let cut = spec
        .read(dir.path(), Some([[-6.0, -5.0], [6.0, 3.0]]))
        .unwrap();
    // direction 1 is y here: the two uppermost rows of 13 points are gone
    assert_eq!(cut.rejected.outside_window, 26);
    assert!(cut.points.iter().all(|p| p[0] <= 3.0));
    assert_eq!(
        cut.len() + 26 + cut.rejected.outliers,
        all.len() + all.rejected.outliers
    );
    assert_eq!(cut.grid.as_ref().unwrap().index.len(), cut.len());
    assert_names(
        spec.read(dir.path(), Some([[50.0; 2], [60.0; 2]])),
        &["X.txt", "0 (", "measured points"],
    );
    assert_names(
        spec.read(dir.path(), Some([[1.0; 2], [0.0; 2]])),
        &["window_mm"],
    );
}

#[test]
fn a_wrong_hole_centre_is_refused_with_the_void_that_is_there() {
    let centred = super::simulated(61, 1e-5, 1);
    assert!(centred.check_hole(2.0).is_ok());
    let mut shifted = centred.clone();
    shifted.points.iter_mut().for_each(|p| p[0] += 3.0);
    let error = shifted.check_hole(2.0).unwrap_err();
    assert!(error.to_string().contains("hole_center_in_data_mm"));
    // the disc between grid points is a little larger than the hole
    assert!(
        error.hint_text().unwrap().contains("radius 2."),
        "{:?}",
        error.hint_text()
    );
    assert!(
        error.hint_text().unwrap().contains("(3.0"),
        "{:?}",
        error.hint_text()
    );
}

#[test]
#[ignore = "needs ../shared"]
fn the_steel_measurement_is_read() {
    let dir = shared("steel-s235");
    let field = spec(STEEL).read(&dir, None).unwrap();
    assert_eq!(field.len() + field.rejected.outliers, 5475);
    assert!((0.55..0.61).contains(&field.spacing_mm()));
    assert!(field.check_hole(4.0).is_ok());
    let misplaced = STEEL.replace("[39.8, 10.2]", "[20.0, 10.0]");
    assert!(
        spec(&misplaced)
            .read(&dir, None)
            .unwrap()
            .check_hole(4.0)
            .is_err()
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn mutated_bytes_never_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20), file in 0..5_usize) {
        let mutate = |text: String| {
            let mut bytes = text.into_bytes();
            for (place, byte) in &edits {
                let place = place.index(bytes.len());
                // an ASCII byte three times in four: the reader then gets past the check for UTF-8
                bytes[place] = if byte % 4 > 0 { byte & 0x7f } else { *byte };
            }
            bytes
        };
        let result = match file {
            4 => read_table(mutate(table(","))),
            _ => read_edited(["X.txt", "Y.txt", "U.txt", "V.txt"][file], mutate),
        };
        match result {
            Err(error) => prop_assert_eq!(error.blame(), Blame::Input),
            Ok(field) => {
                prop_assert!(field.points.iter().chain(&field.displacement).flatten().all(|v| v.is_finite()));
                let _ = plychain::field::outliers::outliers(&field.points, &field.displacement);
                let _ = field.check_hole(2.0);
            }
        }
    }
}
