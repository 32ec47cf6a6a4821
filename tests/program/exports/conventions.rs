//! Conventions that a table does not state are seen in its field, each with one sentence of what to change.

use std::fs;

use plychain::field::{Axis, ColumnMap, Columns, Frame, Units, table};
use serde_json::Value;

use super::{FieldRow, decimals, lines, measurement, proposed, said, strip};

/// The strip under a share of its load.
fn loaded(share: f64) -> Vec<FieldRow> {
    strip()
        .iter()
        .map(|[x, y, u, v]| [*x, *y, share * u, share * v])
        .collect()
}

/// What `init` says of a series, and the model.
fn series(steps: &[(&str, Option<f64>, Vec<FieldRow>)]) -> (String, Value) {
    let folder = tempfile::tempdir().unwrap();
    for (name, force, rows) in steps {
        let force = force.map_or_else(String::new, |f| format!("# force : {f}\n"));
        let text = format!(
            "{force}X [mm];Y [mm];U [mm];V [mm]\n{}",
            lines(rows, ";", decimals)
        );
        fs::write(folder.path().join(name), text).unwrap();
    }
    let (done, text) = said(folder.path(), &["init", "a", "--csv", "s*.csv"]);
    assert!(done, "{text}");
    let model = fs::read_to_string(folder.path().join("a.json")).unwrap();
    (text, serde_json::from_str(&model).unwrap())
}

fn files(model: &Value) -> Vec<&str> {
    let steps = model["experiments"][0]["steps"].as_array().unwrap();
    steps.iter().map(|s| s["file"].as_str().unwrap()).collect()
}

#[test]
fn places_in_the_deformed_state_are_taken_back() {
    let moved = |share: f64| -> Vec<FieldRow> {
        loaded(share)
            .iter()
            .map(|[x, y, u, v]| [x + u, y + v, *u, *v])
            .collect()
    };
    let (text, model) = series(&[
        ("s1.csv", Some(1e3), moved(1.0)),
        ("s2.csv", Some(2e3), moved(2.0)),
        ("s3.csv", Some(3e3), moved(3.0)),
    ]);
    assert!(
        text.contains(&format!("3 steps with {} points in common", strip().len())),
        "{text}"
    );
    assert_eq!(measurement(&model)["columns"]["deformed"], true);
    assert!(text.contains("X [mm] - U [mm]"), "{text}");
}

#[test]
fn the_reference_picture_is_no_step() {
    let (text, model) = series(&[
        ("s0.csv", Some(0.0), loaded(0.0)),
        ("s1.csv", Some(1e3), loaded(1.0)),
        ("s2.csv", Some(2e3), loaded(2.0)),
    ]);
    assert_eq!(files(&model), ["s1.csv", "s2.csv"]);
    assert!(text.contains("s0.csv is the reference picture"), "{text}");
}

#[test]
fn displacements_from_picture_to_picture_are_refused() {
    let forces = [200.0, 500.0, 600.0, 1000.0];
    let steps = |size: &dyn Fn(usize) -> f64| {
        let step = |k: usize| {
            (
                ["s1.csv", "s2.csv", "s3.csv", "s4.csv"][k],
                Some(forces[k]),
                loaded(size(k) / 1000.0),
            )
        };
        series(&[step(0), step(1), step(2), step(3)]).0
    };
    assert!(!steps(&|k| forces[k]).contains("incremental"));
    let text = steps(&|k| forces[k] - if k > 0 { forces[k - 1] } else { 0.0 });
    assert!(
        text.contains("incremental") && text.contains("one reference picture"),
        "{text}"
    );
}

#[test]
fn steps_are_ordered_by_decimal_numbers_and_by_known_forces() {
    let (_, model) = series(&[
        ("s1.5.csv", None, loaded(1.5)),
        ("s1.25.csv", None, loaded(1.25)),
        ("s10.csv", None, loaded(10.0)),
        ("s2.csv", None, loaded(2.0)),
    ]);
    assert_eq!(
        files(&model),
        ["s1.25.csv", "s1.5.csv", "s2.csv", "s10.csv"]
    );
    let (_, model) = series(&[
        ("s1.csv", Some(3e3), loaded(3.0)),
        ("s2.csv", Some(1e3), loaded(1.0)),
        ("s3.csv", Some(2e3), loaded(2.0)),
    ]);
    assert_eq!(files(&model), ["s2.csv", "s3.csv", "s1.csv"]);
}

fn remarks(rows: &[FieldRow]) -> String {
    let text = format!("X;Y;U;V\n{}", lines(rows, ";", decimals));
    proposed(text.as_bytes(), "a.csv", &[]).unwrap().1
}

#[test]
fn turned_and_exchanged_displacements_are_named() {
    let plain = remarks(&strip());
    assert!(
        !plain.contains("exchanged") && !plain.contains("one sign"),
        "{plain}"
    );
    let turned: Vec<FieldRow> = strip()
        .iter()
        .map(|[x, y, u, v]| [*x, *y, *u, -v])
        .collect();
    let text = remarks(&turned);
    assert!(
        text.contains("one sign") && text.contains("\"uy\": \"-V\""),
        "{text}"
    );
    let exchanged: Vec<FieldRow> = strip()
        .iter()
        .map(|[x, y, u, v]| [*x, *y, *v, *u])
        .collect();
    let text = remarks(&exchanged);
    assert!(
        text.contains("exchanged") && text.contains("\"ux\": \"V\""),
        "{text}"
    );
    let large: Vec<FieldRow> = strip()
        .iter()
        .map(|[x, y, u, v]| [*x, *y, 1e3 * u, 1e3 * v])
        .collect();
    assert!(remarks(&large).contains("1000"));
}

/// The remedy that is offered is one: a minus before a name changes the sign, exchanged names the components.
#[test]
fn a_minus_before_a_name_changes_the_sign() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(
        &path,
        format!("X;Y;U;V\n{}", lines(&strip(), ";", decimals)),
    )
    .unwrap();
    let frame = Frame {
        loading_axis: Axis::X,
        hole_center_mm: [0.0; 2],
    };
    let read = |names: [&str; 4]| {
        let map = ColumnMap {
            columns: Columns::new(names.map(String::from)),
            units: Units::new("mm", "mm"),
        };
        table::read(&path, &map, frame).unwrap()
    };
    let (plain, turned) = (read(["X", "Y", "U", "V"]), read(["X", "-Y", "U", "-V"]));
    for k in 0..plain.len() {
        assert_eq!(turned.points[k], [plain.points[k][0], -plain.points[k][1]]);
        assert_eq!(
            turned.displacement[k],
            [plain.displacement[k][0], -plain.displacement[k][1]]
        );
    }
}

#[test]
fn zeros_beside_points_that_moved_are_not_measured() {
    let mut rows = strip();
    let lost = rows.iter().filter(|r| r[0] < -9.0).count();
    rows.iter_mut()
        .filter(|r| r[0] < -9.0)
        .for_each(|r| (r[2], r[3]) = (0.0, 0.0));
    let text = remarks(&rows);
    assert!(
        text.contains(&format!("{lost} points with both displacements exactly 0")),
        "{text}"
    );
    // a field that passes through zero is measured there
    let through: Vec<FieldRow> = strip()
        .iter()
        .map(|[x, y, _, _]| [*x, *y, -3e-4 * (x - 0.25).round(), 1e-3 * (y - 0.5).round()])
        .collect();
    let text = remarks(&through);
    assert!(!text.contains("exactly 0"), "{text}");
}

#[test]
fn what_fills_points_that_failed_is_not_measured() {
    let mut rows = strip();
    let is_lost = |r: &FieldRow| r[0] < -9.0;
    let lost = rows.iter().filter(|r| is_lost(r)).count();
    rows.iter_mut()
        .filter(|r| is_lost(r))
        .for_each(|r| (r[2], r[3]) = (-9999.0, -9999.0));
    let text = remarks(&rows);
    assert!(
        text.contains(&format!(
            "{lost} points with both displacements exactly one number"
        )),
        "{text}"
    );
    let mut rows = strip();
    rows.extend([[0.0; 4]; 5]);
    let text = remarks(&rows);
    assert!(text.contains("5 rows of zeros alone"), "{text}");
}

#[test]
fn a_quality_column_is_what_it_says() {
    let with = |cell: &str| {
        lines(&strip(), ",", |k, v| match k {
            3 => format!("{v:.6},{cell}"),
            _ => decimals(k, v),
        })
    };
    let percent = format!("X,Y,U,V,ZNCC\n{}", with("98.0"));
    let (model, said) = proposed(percent.as_bytes(), "a.csv", &[]).unwrap();
    assert!(
        measurement(&model)["columns"]["correlation"].is_null(),
        "{said}"
    );
    assert!(said.contains("at most 1"), "{said}");
    // named columns do not switch the program's own account of failures off
    let failed = format!("X,Y,U,V,sigma\n{}50.0,50.0,0.0,0.0,-1\n", with("0.01"));
    let options = ["--columns", "x=X,y=Y,ux=U,uy=V", "--units", "mm"];
    let (_, said) = proposed(failed.as_bytes(), "a.csv", &options).unwrap();
    assert!(said.contains("1 that did not correlate"), "{said}");
}

#[test]
fn a_sigma_that_is_zero_everywhere_is_not_used() {
    let with = |sigma: &str| {
        let text = lines(&strip(), ",", |k, v| {
            if k == 3 {
                format!("{v:.6},{sigma}")
            } else {
                decimals(k, v)
            }
        });
        format!("X,Y,U,V,sigma\n{}50.0,50.0,0.0,0.0,-1\n", text)
    };
    let (_, text) = proposed(with("0.0").as_bytes(), "a.csv", &[]).unwrap();
    assert!(
        text.contains("sigma is 0 everywhere") && text.contains("1 that did not correlate"),
        "{text}"
    );
    let (_, text) = proposed(with("0.5").as_bytes(), "a.csv", &[]).unwrap();
    assert!(!text.contains("sigma is 0 everywhere"), "{text}");
}

/// A notch and a lost patch are no hole; the plate is as wide as the points need.
#[test]
fn a_hole_is_round_and_closed_and_the_plate_holds_it() {
    let without = |gap: &dyn Fn(f64, f64) -> bool| -> Vec<FieldRow> {
        let all = (0..61 * 81).map(|k| (f64::from(k % 61) - 30.0, f64::from(k / 61) - 40.0));
        all.filter(|(x, y)| !gap(*x, *y))
            .map(|(x, y)| [x + 0.5, y + 0.5, -3e-4 * x, 1e-3 * y])
            .collect()
    };
    let model = |rows: &[FieldRow]| {
        let text = format!(
            "X [mm];Y [mm];U [mm];V [mm]\n{}",
            lines(rows, ";", decimals)
        );
        proposed(text.as_bytes(), "a.csv", &[]).unwrap().0["experiments"][0]["specimen"].clone()
    };
    let hole = model(&without(&|x, y| x.hypot(y) < 12.5));
    assert!(
        (24.0..26.0).contains(&hole["hole"]["diameter_mm"].as_f64().unwrap()),
        "{hole}"
    );
    assert!(hole["width_mm"].as_f64().unwrap() >= 60.0, "{hole}");
    for gap in [
        &(|x: f64, y: f64| (x + 30.0).hypot(y) < 6.0) as &dyn Fn(f64, f64) -> bool,
        &|x, y| x.abs() < 2.0 && y.abs() < 15.0,
    ] {
        let specimen = model(&without(gap));
        assert_eq!(specimen.get("hole"), None, "{specimen}");
    }
}

/// Few points, and the plate ends near the hole, so that no ring about it can be counted: the gap's own area, in whatever order the rows are.
#[test]
fn a_hole_among_few_points_is_as_large_as_its_gap() {
    for [x, y] in [[0.2, -0.1], [0.9, 0.4], [-0.6, 0.8], [0.3, 0.9]] {
        let all = (0..9 * 27).map(|k| {
            let (x, y) = (f64::from(k % 9) - 4.0, f64::from(k / 9) - 13.0);
            (1.75 * x, 1.75 * y)
        });
        let mut rows: Vec<FieldRow> = all
            .filter(|(s, t)| (s - x).hypot(t - y) > 3.55)
            .map(|(x, y)| [x, y, -3e-4 * x, 1e-3 * y])
            .collect();
        let mut diameter = || {
            rows.reverse();
            let text = lines(&rows, ";", decimals);
            let text = format!("X [mm];Y [mm];U [mm];V [mm]\n{text}");
            let (model, said) = proposed(text.as_bytes(), "a.csv", &[]).unwrap();
            assert!(!said.contains("not settled"), "{said}");
            let specimen = &model["experiments"][0]["specimen"];
            specimen["hole"]["diameter_mm"].as_f64().unwrap()
        };
        let [forwards, backwards] = [diameter(), diameter()];
        // of 13 points in the gap two more or less are 8 % of the diameter, and a lattice has a few such
        assert!((forwards / 7.1 - 1.0).abs() < 0.2, "{forwards}");
        assert_eq!(forwards, backwards);
    }
}

/// One field exported in millimetres, in micrometres with decimal commas, and in pixels: the same model file, but for the names and units of the columns.
#[test]
fn three_exports_of_one_field_give_one_model() {
    let pixel = 0.05;
    let fine = |_: usize, value: f64| format!("{value:.9}");
    let plain = lines(&strip(), ";", fine);
    let um: Vec<FieldRow> = strip()
        .iter()
        .map(|[x, y, u, v]| [*x, *y, 1e3 * u, 1e3 * v])
        .collect();
    let of_pixels: Vec<FieldRow> = strip().iter().map(|row| row.map(|v| v / pixel)).collect();
    let comma = |k: usize, value: f64| fine(k, value).replace('.', ",");
    let exports: [(String, &[&str]); 3] = [
        (format!("X [mm];Y [mm];U [mm];V [mm]\n{plain}"), &[]),
        (
            format!(
                "x [mm];y [mm];displacement_x [um];displacement_y [um]\n{}",
                lines(&um, ";", comma)
            ),
            &[
                "--columns",
                "x=x [mm],y=y [mm],ux=displacement_x [um],uy=displacement_y [um]",
                "--units",
                "mm,um",
            ],
        ),
        (
            format!("x,y,u,v\n{}", lines(&of_pixels, ",", fine)),
            &["--mm-per-pixel", "0.05"],
        ),
    ];
    let models: Vec<Value> = exports
        .iter()
        .map(|(table, more)| {
            let (mut model, said) = proposed(table.as_bytes(), "a.csv", more).unwrap();
            let of = model["experiments"][0]["measurement"].as_object_mut();
            let of = of.unwrap_or_else(|| panic!("{said}"));
            for named in ["columns", "units"] {
                of.remove(named).unwrap();
            }
            model
        })
        .collect();
    assert_eq!(models[0], models[1]);
    assert_eq!(models[0], models[2]);
    let hole = &models[0]["experiments"][0]["specimen"]["hole"]["diameter_mm"];
    assert!((hole.as_f64().unwrap() - 6.0).abs() < 0.5, "{hole}");
}

/// One table alone, of a strain of a thousandth: places after the deformation are those whose lines are bent.
#[test]
fn places_of_one_table_are_told_by_the_lines_of_their_grid() {
    let table = |deformed: bool| {
        let rows: Vec<FieldRow> = strip()
            .iter()
            .map(|[x, y, u, v]| match deformed {
                true => [x + u, y + v, *u, *v],
                false => [*x, *y, *u, *v],
            })
            .collect();
        format!(
            "X [mm];Y [mm];U [mm];V [mm]\n{}",
            lines(&rows, ";", decimals)
        )
    };
    for deformed in [false, true] {
        let (model, text) = proposed(table(deformed).as_bytes(), "t.csv", &[]).unwrap();
        let found = &measurement(&model)["columns"]["deformed"];
        assert_eq!(*found == true, deformed, "{text}");
    }
}

/// Displacements of a few steps of the last decimal: those that are 0 were measured.
#[test]
fn zeros_among_small_displacements_are_measured() {
    let coarse = |k: usize, v: f64| match k {
        0 | 1 => format!("{v:.4}"),
        _ => format!(
            "{:.4}",
            0.02 * (v - 0.3125 * f64::from(u8::from(k == 2))
                + 0.1875 * f64::from(u8::from(k == 3)))
        ),
    };
    let rows: Vec<FieldRow> = strip()
        .iter()
        .map(|[x, y, u, v]| [*x, *y, *u, *v])
        .collect();
    let text = format!("X [mm];Y [mm];U [mm];V [mm]\n{}", lines(&rows, ";", coarse));
    assert!(text.contains(";0.0000;0.0000"), "zeros");
    let (_, said) = proposed(text.as_bytes(), "t.csv", &[]).unwrap();
    assert!(said.contains(&format!("{} points", rows.len())), "{said}");
}

/// What a table does not tell is open in the file, no verb takes it, and an answer replaces it.
#[test]
fn init_writes_its_file_with_open_places() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("x;y;ux;uy\n{}", lines(&strip(), ";", decimals));
    fs::write(folder.path().join("t.csv"), text).unwrap();
    let run = |arguments: &[&str]| said(folder.path(), arguments);
    let (done, question) = run(&["init", "a", "--csv", "t.csv"]);
    assert!(
        !done && question.contains("a.json written") && question.contains("--units mm"),
        "{question}"
    );
    let model = |name: &str| -> Value {
        serde_json::from_str(&fs::read_to_string(folder.path().join(name)).unwrap()).unwrap()
    };
    let open = model("a.json");
    assert_eq!(measurement(&open)["units"]["coordinates"], "?");
    assert_eq!(measurement(&open)["columns"]["ux"], "ux");
    let (done, refused) = run(&["loop", "a.json", "--out", "r"]);
    assert!(
        !done && refused.contains('?') && refused.contains("a.json"),
        "{refused}"
    );
    let (done, text) = run(&["init", "a", "--csv", "t.csv", "--units", "mm"]);
    assert!(done, "{text}");
    assert_eq!(measurement(&model("a.json"))["units"]["coordinates"], "mm");
    assert_eq!(model("a.json.old"), open);
    let (done, text) = run(&["init", "a", "--csv", "t.csv", "--units", "mm"]);
    assert!(!done && text.contains("give another name"), "{text}");
    // columns that nobody knows
    let text = format!("p;q;r;s\n{}", lines(&strip(), ";", decimals));
    fs::write(folder.path().join("u.csv"), text).unwrap();
    let (done, text) = run(&["init", "b", "--csv", "u.csv"]);
    assert!(!done && text.contains("--columns"), "{text}");
    assert_eq!(measurement(&model("b.json"))["columns"]["x"], "?");
    // an option that says nothing is no open place
    let (done, _) = run(&["init", "c", "--csv", "t.csv", "--units", "furlong"]);
    assert!(!done && !folder.path().join("c.json").exists());
}

/// A reference picture that is left out is no step: forces go to the steps that stay.
#[test]
fn forces_go_to_the_steps_that_stay() {
    let folder = tempfile::tempdir().unwrap();
    for (k, share) in [0.0, 1.0, 2.0].into_iter().enumerate() {
        let text = format!(
            "X [mm];Y [mm];U [mm];V [mm]\n{}",
            lines(&loaded(share), ";", decimals)
        );
        fs::write(folder.path().join(format!("s{k}.csv")), text).unwrap();
    }
    fs::write(
        folder.path().join("f.csv"),
        "index;Force [kN]\n0;0.5\n1;1.5\n2;2.5\n",
    )
    .unwrap();
    let arguments = ["init", "a", "--csv", "s*.csv", "--forces", "f.csv"];
    let (done, text) = said(folder.path(), &arguments);
    assert!(done, "{text}");
    let model: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("a.json")).unwrap()).unwrap();
    assert_eq!(files(&model), ["s1.csv", "s2.csv"]);
    let steps = model["experiments"][0]["steps"].as_array().unwrap();
    let forces: Vec<f64> = steps
        .iter()
        .map(|s| s["force_N"].as_f64().unwrap())
        .collect();
    assert_eq!(forces, [1000.0, 2000.0], "{text}");
    // with one step left it is no series
    let (done, text) = said(folder.path(), &["init", "b", "--csv", "s0.csv", "s1.csv"]);
    assert!(
        done && text.contains("load.force_N ") && !text.contains("steps[].force_N"),
        "{text}"
    );
}

/// What is dropped of a grid goes from its index and its sds too.
#[test]
fn zeros_in_matrices_are_not_measured() {
    const SIDE: usize = 12;
    let place = tempfile::tempdir().unwrap();
    let lost = |i: usize, j: usize| i < 3 && j < 3;
    let sd = |i: usize, j: usize| 1.0 + 0.1 * i as f64 + 0.01 * j as f64;
    let moved = |i: usize, j: usize, u: usize| if lost(i, j) { 0.0 } else { u as f64 };
    let write = |names: &[&str], value: &dyn Fn(usize, usize) -> f64| {
        let row = |i: usize| -> String {
            let cells: Vec<_> = (0..SIDE).map(|j| value(i, j).to_string()).collect();
            cells.join(" ") + "\n"
        };
        let text: String = (0..SIDE).map(row).collect();
        for name in names {
            std::fs::write(place.path().join(name), &text).unwrap();
        }
    };
    write(&["X.txt"], &|_, j| j as f64);
    write(&["Y.txt"], &|i, _| i as f64);
    write(&["U.txt"], &|i, j| moved(i, j, 40 + j));
    write(&["V.txt"], &|i, j| moved(i, j, 30 - i));
    write(&["SU.txt", "SV.txt"], &sd);
    let mut readers = plychain::field::READERS.iter();
    let reader = readers.find(|r| r.format() == "matrices").unwrap();
    let axes = plychain::field::DATA_AXES;
    let field = reader.read(place.path(), None, axes).unwrap();
    assert_eq!(field.len(), SIDE * SIDE - 9);
    assert_eq!(field.rejected.uncorrelated, 9);
    let index = &field.grid.as_ref().unwrap().index;
    assert_eq!(index.len(), field.len());
    for (k, sigma) in field.sigma.as_ref().unwrap().iter().enumerate() {
        let (i, j) = (index[k] / SIDE, index[k] % SIDE);
        assert_eq!(field.points[k], [j as f64, i as f64]);
        assert!((sigma - 1e-3 * sd(i, j)).abs() < 1e-12);
    }
}
