//! The forms of programs, each written here with the numbers of [`super::strip`].

use serde_json::{Value, json};

use super::{decimals, lines, measurement, proposed, strip};

/// A table, what `init` is to call its program, its units, and the options that it needs.
struct Form {
    name: &'static str,
    text: Vec<u8>,
    label: &'static str,
    units: [&'static str; 2],
    options: &'static [&'static str],
}

fn form(
    name: &'static str,
    text: impl Into<Vec<u8>>,
    label: &'static str,
    units: [&'static str; 2],
) -> Form {
    Form {
        name,
        text: text.into(),
        label,
        units,
        options: &[],
    }
}

fn in_pixels(name: &'static str, text: String, label: &'static str) -> Form {
    Form {
        options: &["--mm-per-pixel", "0.05"],
        ..form(name, text, label, ["px"; 2])
    }
}

const MM: [&str; 2] = ["mm", "mm"];

/// Lines of the strip in pixels of 0.05 mm, with other cells behind them.
fn pixels(delimiter: &str, more: &str) -> String {
    let rows: Vec<_> = strip().iter().map(|r| r.map(|v| v / 0.05)).collect();
    lines(&rows, delimiter, |k, v| {
        if k == 3 {
            format!("{v:.6}{more}")
        } else {
            format!("{v:.6}")
        }
    })
}

fn plain(delimiter: &str) -> String {
    lines(&strip(), delimiter, decimals)
}

/// Rows with more cells before and after: an index, and what stands behind.
fn around(delimiter: &str, more: &str) -> String {
    let number = |(k, line): (usize, &str)| format!("{k}{delimiter}{line}{more}\n");
    plain(delimiter).lines().enumerate().map(number).collect()
}

fn utf16(text: &str, big: bool) -> Vec<u8> {
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
}

fn windows_1252(text: &str) -> Vec<u8> {
    text.chars()
        .map(|c| u8::try_from(u32::from(c)).unwrap())
        .collect()
}

/// A file of MATLAB 4: single precision, little-endian.
pub fn matlab_4(names: [&str; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let rows = strip();
    for (k, name) in names.iter().enumerate() {
        for n in [0, rows.len(), 1, 0, name.len() + 1] {
            bytes.extend(i32::try_from(n).unwrap().to_le_bytes());
        }
        bytes.extend(name.bytes().chain([0]));
        bytes.extend(rows.iter().flat_map(|r| r[k].to_le_bytes()));
    }
    bytes
}

/// A file of MATLAB 5 with uncompressed arrays.
fn matlab_5(names: [&str; 4]) -> Vec<u8> {
    let mut bytes = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".to_vec();
    bytes.resize(124, b' ');
    bytes.extend([0, 1, b'I', b'M']);
    let rows = strip();
    let element = |kind: u32, data: &[u8]| {
        let mut all = [
            kind.to_le_bytes(),
            u32::try_from(data.len()).unwrap().to_le_bytes(),
        ]
        .concat();
        all.extend(data);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    };
    for (k, name) in names.iter().enumerate() {
        let values: Vec<u8> = rows.iter().flat_map(|r| r[k].to_le_bytes()).collect();
        let size = [
            u32::try_from(rows.len()).unwrap().to_le_bytes(),
            1u32.to_le_bytes(),
        ]
        .concat();
        let parts = [
            element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
            element(5, &size),
            element(1, name.as_bytes()),
            element(9, &values),
        ];
        bytes.extend(element(14, &parts.concat()));
    }
    bytes
}

const DICE: &str = "***\n*** Digital Image Correlation Engine (DICe), Copyright\n***\n*** Deformed image: ./b_1.tif \n*** Incremental correlation: false\n*** Subset size: 27\n*** Step size: x 20 y 20 (-1 implies not regular grid)\n*** Coordinates given with (0,0) as upper left corner of image, x positive right, y positive down\n***\n";

fn of_programs() -> Vec<Form> {
    let quoted = |names: &[&str]| {
        names
            .iter()
            .map(|n| format!(" \"{n}\""))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let matchid = "disp.Horizontal Displacement U [mm];disp.Vertical Displacement V [mm]";
    let gom = "# Units: length:mm angle:deg time:s \r\n# Stage: Stufe 3\r\nstage;index;relative_time;date\r\n\"Stufe 3\";3;12.5;\"2024-01-01T00:00:00\"\r\n# Name : Fl\u{e4}che 1\r\nid;x;y;displacement_x;displacement_y\r\n";
    vec![
        form(
            "gom.csv",
            format!("{gom}{}", around(";", "").replace('\n', "\r\n")),
            "ARAMIS / GOM",
            MM,
        ),
        form(
            "inspect.csv",
            format!("X [mm];Y [mm];dX [mm];dY [mm]\n{}", plain(";")),
            "ARAMIS / GOM",
            MM,
        ),
        form(
            "nodemap.txt",
            windows_1252(&format!(
                "# specimen   : 90 mm\u{b3}\n# facet_size : 19\n####\n#   ID;  x_undef [mm];  y_undef [mm];  u [mm];  v [mm]\n{}",
                around("; ", "")
            )),
            "nodemap",
            MM,
        ),
        form(
            "vic2d.csv",
            format!("{}\n{}", quoted(&["x_c", "y_c", "u_c", "v_c"]), plain(",")),
            "VIC-2D (calibrated)",
            MM,
        ),
        form(
            "vic3d.csv",
            format!("{}\n{}", quoted(&["X", "Y", "U", "V"]), plain(",")),
            "VIC-3D",
            MM,
        ),
        form(
            "vic3d.dat",
            format!(
                "TITLE = \"B00010\"\nVARIABLES = \"X [mm]\"\n\"Y [mm]\"\n\"U [mm]\"\n\"V [mm]\"\nZONE T=\"area 1\", I=31, J=41, F=POINT\n{}",
                plain(" ")
            ),
            "VIC-3D",
            MM,
        ),
        in_pixels(
            "vic2d-pixels.csv",
            format!(
                "\"x\",\"y\",\"u\",\"v\",\"exx\",\"eyy\",\"sigma\"\n{}",
                pixels(",", ",0,0,0.01")
            ),
            "VIC-2D (not calibrated)",
        ),
        form(
            "matchid.csv",
            format!(
                "coor.X [mm];coor.Y [mm];{matchid};\n{}",
                plain(";").replace('\n', ";\n")
            ),
            "MatchID",
            MM,
        ),
        form(
            "matchid-2024.csv",
            format!(
                "coor.Image X [mm];coor.Image Y [mm];{matchid}\r\n{}",
                lines(&strip(), ";", |_, v| format!("{v:.9E}"))
            ),
            "MatchID",
            MM,
        ),
        in_pixels(
            "dice.txt",
            format!(
                "{DICE}COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA,MATCH\n{}",
                pixels(",", ",0.01,0")
            ),
            "DICe",
        ),
        in_pixels(
            "dice-blanks.txt",
            format!(
                "{DICE}COORDINATE_X COORDINATE_Y DISPLACEMENT_X DISPLACEMENT_Y\n{}",
                pixels(" ", "")
            ),
            "DICe",
        ),
        form(
            "dice-stereo.txt",
            format!(
                "MODEL_COORDINATES_X,MODEL_COORDINATES_Y,MODEL_DISPLACEMENT_X,MODEL_DISPLACEMENT_Y\n{}",
                plain(",")
            ),
            "DICe (calibrated)",
            MM,
        ),
        in_pixels(
            "opencorr.csv",
            format!(
                "x,y,u,v,u0,v0,ZNCC,iteration\n{}",
                pixels(",", ",0,0,0.998,3")
            ),
            "OpenCorr",
        ),
        in_pixels(
            "pyaldic.csv",
            format!("\u{feff}x_px,y_px,disp_u,disp_v\n{}", pixels(",", "")),
            "pyALDIC",
        ),
        in_pixels(
            "sundic.csv",
            format!("X Coord,Y Coord,X Disp,Y Disp\n{}", pixels(",", "")),
            "SUN-DIC",
        ),
        in_pixels(
            "pyvale.csv",
            format!(
                "subset_x,subset_y,displacement_u,displacement_v,converged\n{}",
                pixels(",", ",True")
            ),
            "pyvale",
        ),
        in_pixels(
            "pyvale-2026.csv",
            format!(
                "\"subset_x\",\"subset_y\",\"disp_u\",\"disp_v\",\"converged\",\n{}",
                pixels(",", ",1")
            ),
            "pyvale",
        ),
        in_pixels(
            "davis8.txt",
            format!(
                "#DaVis 8.4.0 2D-vector 12 41 31 \"\" \"pixel\" \"\" \"pixel\" \"displacement\" \"pixel\"\n{}",
                pixels("\t", "")
            ),
            "DaVis",
        ),
        form(
            "davis10.txt",
            format!(
                "#DaVis 10.2 2C vector field 4 31 41 \"x [mm]\";\"y [mm]\";\"Vx [mm]\";\"Vy [mm]\"\n{}",
                plain(";")
            ),
            "DaVis",
            MM,
        ),
        form(
            "davis10.csv",
            format!(
                "x [mm];y [mm];x-displacement [mm];y-displacement [mm];Displacement [mm]\n{}",
                plain(";").replace('\n', ";0.01\n")
            ),
            "DaVis",
            MM,
        ),
        form(
            "davis10-stereo.csv",
            format!(
                "x [mm];y [mm];z [mm];X-displacement [mm];Y-displacement [mm]\n{}",
                lines(&strip(), ";", |k, v| decimals(k, v)
                    + if k == 1 { ";0.3" } else { "" })
            ),
            "DaVis",
            MM,
        ),
        form(
            "comsol.csv",
            format!(
                "% Model,Untitled.mph\n% Version,COMSOL 6.1\n% Length unit,mm\n% X,Y,u (mm),v (mm)\n{}",
                plain(",")
            ),
            "COMSOL",
            MM,
        ),
        form(
            "crackpy.txt",
            format!(
                "#   index   ;    x_undf  ;    y_undf  ;    ux   ;    uy\n{}",
                around(";  ", "")
            ),
            "crackpy",
            MM,
        ),
        form(
            "matlab4.mat",
            matlab_4(["x_c", "y_c", "u_c", "v_c"]),
            "VIC-2D (calibrated)",
            MM,
        ),
        // somebody's own arrays have no habit
        Form {
            options: &["--units", "mm"],
            ..form("matlab5.mat", matlab_5(["X", "Y", "U", "V"]), "VIC-3D", MM)
        },
    ]
}

/// The same table as one may save it again.
fn of_editors() -> Vec<Form> {
    let head = "X [mm];Y [mm];U [mm];V [mm]\n";
    let semicolons = || format!("{head}{}", plain(";"));
    let commas = |text: &str| text.replace('.', ",");
    let quoted = |_: usize, v: f64| format!("\"{}\"", format!("{v:.6}").replace('.', ","));
    let vic = |name, text: Vec<u8>| form(name, text, "VIC-3D", MM);
    vec![
        vic("sep.csv", format!("sep=;\n{}", semicolons()).into()),
        vic(
            "title.csv",
            format!("Project;coupon 7\nDate;2024-05-01\n\n{}", semicolons()).into(),
        ),
        vic(
            "format.txt",
            format!(
                "# Project: coupon 7\n# Format: X[mm] Y[mm] U[mm] V[mm]\n{}",
                plain(" ")
            )
            .into(),
        ),
        vic("bom.csv", format!("\u{feff}{}", semicolons()).into()),
        vic("cr.csv", semicolons().replace('\n', "\r").into()),
        vic(
            "utf16le.csv",
            utf16(&semicolons().replace(';', "\t"), false),
        ),
        vic("utf16be.csv", utf16(&semicolons(), true)),
        vic("commas.csv", commas(&semicolons()).into()),
        vic(
            "quoted-commas.csv",
            format!("\"X\",\"Y\",\"U\",\"V\"\n{}", lines(&strip(), ",", quoted)).into(),
        ),
        vic(
            "curly.csv",
            format!(
                "\u{201c}X\u{201d},\u{201c}Y\u{201d},\u{201c}U\u{201d},\u{201c}V\u{201d}\n{}",
                plain(",")
            )
            .into(),
        ),
        vic("minus.csv", semicolons().replace('-', "\u{2212}").into()),
        vic(
            "fortran.csv",
            format!(
                "X,Y,U,V\n{}",
                lines(&strip(), ",", |_, v| format!("{v:.8E}").replace('E', "D"))
            )
            .into(),
        ),
        vic(
            "units-row.csv",
            format!("X;Y;U;V\n[mm];[mm];[mm];[mm]\n{}", plain(";")).into(),
        ),
        vic(
            "slash.csv",
            format!("X/mm;Y/mm;U/mm;V/mm\n{}", plain(";")).into(),
        ),
        vic(
            "trailing.csv",
            format!("X;Y;U;V\n{}", plain(";").replace('\n', ";\n")).into(),
        ),
        vic(
            "blanks.txt",
            format!("   X [mm]   Y [mm]   U [mm]   V [mm]\n{}", plain("    ")).into(),
        ),
        vic(
            "footer.csv",
            format!("{}\nPoints;1248;;\nEnd of export\n", semicolons()).into(),
        ),
        vic("areas.csv", {
            let rows = strip();
            let (a, b) = rows.split_at(500);
            format!(
                "{head}{}\nArea 2\n{head}{}",
                lines(a, ";", decimals),
                lines(b, ";", decimals)
            )
            .into()
        }),
        form(
            "um.csv",
            windows_1252(&format!(
                "X [mm];Y [mm];U [\u{b5}m];V [\u{b5}m]\n{}",
                lines(&strip(), ";", |k, v| if k > 1 {
                    format!("{:.3}", 1e3 * v)
                } else {
                    format!("{v:.6}")
                })
            )),
            "VIC-3D",
            ["mm", "um"],
        ),
    ]
}

/// Whatever the form, the model is one: hole, axis, extent, number of points.
#[test]
fn every_form_gives_one_model() {
    let count = format!("{} points", strip().len());
    for Form {
        name,
        text,
        label,
        units,
        options,
    } in of_programs().into_iter().chain(of_editors())
    {
        let (model, said) =
            proposed(&text, name, options).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(
            said.contains(&count) && said.contains(label),
            "{name}: {said}"
        );
        let read = measurement(&model);
        assert_eq!(
            [
                &read["units"]["coordinates"],
                &read["units"]["displacements"]
            ],
            units,
            "{name}"
        );
        assert_eq!(read["loading_axis"], "y", "{name}");
        for (k, known) in [3.25, -1.5].iter().enumerate() {
            let found = read["hole_center_in_data_mm"][k].as_f64().unwrap();
            assert!((found - known).abs() < 0.1, "{name}: {found}");
        }
        let diameter = model["experiments"][0]["specimen"]["hole"]["diameter_mm"]
            .as_f64()
            .unwrap();
        // the gap is wider than the hole by part of a subset, where the file says its side
        let least = if read.get("image_correlation").is_some() {
            4.2
        } else {
            5.5
        };
        assert!((least..6.5).contains(&diameter), "{name}: {diameter}");
        assert!(!said.contains("not settled"), "{name}: {said}");
        assert_eq!(read["columns"].get("deformed"), None, "{name}");
    }
}

#[test]
fn what_was_assumed_is_said() {
    let commas = proposed(
        lines(&strip(), ";", |_, v| format!("{v:.6}").replace('.', ","))
            .replacen("", "X;Y;U;V\n", 1)
            .as_bytes(),
        "a.csv",
        &[],
    );
    assert!(commas.unwrap().1.contains("decimal commas"));
    let dice = of_programs()
        .into_iter()
        .find(|f| f.name == "dice.txt")
        .unwrap();
    let (model, said) = proposed(&dice.text, dice.name, dice.options).unwrap();
    assert_eq!(measurement(&model)["image_correlation"]["subset_mm"], 1.35);
    assert!(
        said.contains("step of the grid 20 px") && said.contains("b_1.tif"),
        "{said}"
    );
    let footer = of_editors()
        .into_iter()
        .find(|f| f.name == "footer.csv")
        .unwrap();
    assert!(
        proposed(&footer.text, footer.name, &[])
            .unwrap()
            .1
            .contains("Points;1248")
    );
}

/// A unit that nothing states is asked for, with both ways out, and each of them is one.
#[test]
fn a_unit_that_nothing_states_is_asked_for() {
    for head in ["x,y,u,v", "x,y,ux,uy", "x,y,Vx,Vy"] {
        let table = format!("{head}\n{}", plain(","));
        let asked = proposed(table.as_bytes(), "a.csv", &[]).unwrap_err();
        assert!(
            asked.contains("a.csv:1")
                && asked.contains("--mm-per-pixel")
                && asked.contains("--units"),
            "{asked}"
        );
        let (model, _) = proposed(table.as_bytes(), "a.csv", &["--units", "mm,um"]).unwrap();
        assert_eq!(measurement(&model)["units"]["displacements"], "um");
        let (model, _) = proposed(table.as_bytes(), "a.csv", &["--mm-per-pixel", "0.5"]).unwrap();
        assert_eq!(measurement(&model)["units"]["mm_per_pixel"], 0.5);
    }
    let whole = lines(&strip(), ",", |k, v| {
        if k < 2 {
            format!("{:.0}", v.floor())
        } else {
            decimals(k, v)
        }
    });
    let asked = proposed(format!("x,y,u,v\n{whole}").as_bytes(), "a.csv", &[]).unwrap_err();
    assert!(asked.contains("whole number"), "{asked}");
    let (_, said) = proposed(format!("X,Y,U,V\n{whole}").as_bytes(), "a.csv", &[]).unwrap();
    assert!(said.contains("whole number"), "{said}");
}

/// What the file says goes before what its program writes, also where nobody knows the unit.
#[test]
fn a_stated_unit_goes_before_the_habit() {
    let rows = plain(",");
    let heads = [
        ("# unit: um\nX,Y,U,V", Some("um")),
        ("# units in mm\nX,Y,U,V", Some("mm")),
        (
            "# Coordinate unit: mm\n# Displacement unit: m\nX,Y,U,V",
            None,
        ),
        ("# Units: coordinates mm, displacements um\nX,Y,U,V", None),
        (
            "# Coordinate unit: um\n# Displacement unit: um\nX,Y,U,V",
            Some("um"),
        ),
        ("# Units: angle:deg length:um time:s\nX,Y,U,V", Some("um")),
        ("# Units: length:cm angle:deg\nX,Y,U,V", None),
        ("# units: pixel\nX,Y,U,V", None),
        ("X,Y,U,V\n[cm],[cm],[cm],[cm]", None),
        ("X,Y,U,V\nmil,mil,mil,mil", None),
        ("X,Y,U,V\n10^-3 mm,10^-3 mm,10^-3 mm,10^-3 mm", None),
        ("x,y,dx,dy", None),
        ("# load unit: kN\nX,Y,U,V", Some("mm")),
    ];
    for (head, unit) in heads {
        let table = format!("{head}\n{rows}");
        match (proposed(table.as_bytes(), "a.csv", &[]), unit) {
            (Ok((model, _)), Some(unit)) => {
                assert_eq!(measurement(&model)["units"]["coordinates"], unit, "{head}");
            }
            (Err(error), None) => assert!(error.contains("a unit of length"), "{head}: {error}"),
            (Ok((model, _)), None) => panic!("{head}: {}", measurement(&model)["units"]),
            (Err(error), Some(_)) => panic!("{head}: {error}"),
        }
    }
}

#[test]
fn an_option_that_is_not_used_is_an_error() {
    let table = format!("X [mm];Y [mm];U [mm];V [mm]\n{}", plain(";"));
    let refused = proposed(table.as_bytes(), "a.csv", &["--mm-per-pixel", "0.05"]).unwrap_err();
    assert!(
        refused.contains("--mm-per-pixel") && refused.contains("leave it out"),
        "{refused}"
    );
    let refused = proposed(table.as_bytes(), "a.csv", &["--units", "um"]).unwrap_err();
    assert!(
        refused.contains("--units") && refused.contains("found um"),
        "{refused}"
    );
    let folder = tempfile::tempdir().unwrap();
    let (done, _) = super::said(folder.path(), &["init", "a", "--units", "mm"]);
    assert!(!done);
    for size in ["nan", "inf", "0", "-1", "1 mm"] {
        for option in ["--subset-mm", "--camera-distance-mm", "--mm-per-pixel"] {
            let option = format!("{option}={size}");
            let (done, text) = super::said(folder.path(), &["init", "a", &option]);
            assert!(!done && text.contains("a length in mm above 0"), "{text}");
        }
    }
}

#[test]
fn any_names_are_columns_that_the_user_chooses() {
    let table = format!("PosH;PosV;DispH, total;DispV\n{}", plain(";"));
    let unknown = proposed(table.as_bytes(), "a.csv", &[]).unwrap_err();
    assert!(
        unknown.contains("PosH, PosV")
            && unknown.contains("--columns")
            && unknown.contains("VIC-3D"),
        "{unknown}"
    );
    let columns = "x=PosH,y=PosV,ux=DispH, total,uy=DispV";
    let asked = proposed(table.as_bytes(), "a.csv", &["--columns", columns]).unwrap_err();
    assert!(
        asked.contains("--units") && !asked.contains("--columns"),
        "{asked}"
    );
    let (model, _) = proposed(
        table.as_bytes(),
        "a.csv",
        &["--columns", columns, "--units", "mm"],
    )
    .unwrap();
    assert_eq!(measurement(&model)["columns"]["ux"], "DispH, total");
    for (wrong, named) in [
        ("x=PosH,y=PosV,ux=nothing,uy=DispV", "nothing"),
        ("x=PosH,y=PosV", "uy=NAME"),
        ("x=PosH,x=PosV,ux=a,uy=b", "x=PosV"),
    ] {
        let error = proposed(
            table.as_bytes(),
            "a.csv",
            &["--columns", wrong, "--units", "mm"],
        )
        .unwrap_err();
        assert!(error.contains(named), "{error}");
    }
}

/// Calibrated columns that are pixels all the same: the program writes them before it is calibrated.
#[test]
fn columns_that_were_never_calibrated_are_pixels() {
    let text: String = strip()
        .iter()
        .map(|r| {
            let [x, y, u, v] = r.map(|v| 20.0 * v);
            format!("{x},{y},{u},{v},{},{},{u},{v}\n", x - 500.0, 400.0 - y)
        })
        .collect();
    let table = format!("x,y,u,v,x_c,y_c,u_c,v_c\n{text}");
    let asked = proposed(table.as_bytes(), "a.csv", &[]).unwrap_err();
    assert!(
        asked.contains("in pixels") && asked.contains("--mm-per-pixel"),
        "{asked}"
    );
    // nor does the file of open places say mm, or forget the column of points that failed
    let folder = tempfile::tempdir().unwrap();
    let with_sigma = |(k, line): (usize, &str)| match k {
        0 => format!("{line},sigma\n"),
        _ => format!("{line},{}\n", if k % 9 == 0 { -1.0 } else { 0.01 }),
    };
    let marked: String = table.lines().enumerate().map(with_sigma).collect();
    std::fs::write(folder.path().join("a.csv"), marked).unwrap();
    let (done, _) = super::said(folder.path(), &["init", "a", "--csv", "a.csv"]);
    let draft = std::fs::read_to_string(folder.path().join("a.json")).unwrap();
    let draft: Value = serde_json::from_str(&draft).unwrap();
    let own = measurement(&draft);
    assert!(!done && own["units"]["coordinates"] == "?", "{own}");
    assert_eq!(own["columns"]["sigma"], "sigma", "{own}");
}

/// Beside vx and vy, ux and uy are gradients; a column that marks points and is not used is said.
#[test]
fn gradients_are_no_displacements_and_marks_are_said() {
    let rows: String = strip()
        .iter()
        .map(|[x, y, u, v]| format!("{x},{y},{u},1e-3,2e-4,{v},1e-4,-3e-4,1\n"))
        .collect();
    let table = format!("x,y,u,ux,uy,v,vx,vy,valid\n{rows}");
    let (model, said) = proposed(table.as_bytes(), "a.csv", &["--units", "mm"]).unwrap();
    let columns = &measurement(&model)["columns"];
    assert_eq!((&columns["ux"], &columns["uy"]), (&json!("u"), &json!("v")));
    assert!(said.contains("\"valid\" is not used"), "{said}");
}

#[test]
fn what_cannot_be_read_names_line_cell_and_remedy() {
    let good = format!("X;Y;U;V\n{}", plain(";"));
    let with = |at: usize, line: &str| {
        let mut all: Vec<&str> = good.lines().collect();
        all[at] = line;
        all.join("\n") + "\n"
    };
    let separated = |_: usize, v: f64| {
        let n = (1e3 * v) as i64 + 100_000;
        format!("{},{:03}", n / 1000, n % 1000)
    };
    let thousands = format!("X;Y;U;V\n{}", lines(&strip(), ";", separated));
    for (text, parts) in [
        (with(9, "1.0;2.0;oops;0.1"), vec!["a.csv:10", "\"U\"", "oops"]),
        (with(9, "1.0;2.0;0.1"), vec!["a.csv:10", "3 cells", "4 cells"]),
        (with(9, "1.0;2.0;1,5;0.1"), vec!["a.csv:10", "1,5", "decimal"]),
        (with(9, "Mean;2.0;1.5;0.1"), vec!["a.csv:10", "Mean"]),
        (thousands, vec!["a.csv:2", "decimal"]),
        (plain(";"), vec!["a.csv:1", "names of the columns"]),
        (format!("X,Y,U,V\n{}", plain(",").replace('.', ",")), vec!["a.csv:2", "8 cells", "decimal"]),
        (good.trim_end().trim_end_matches(|c: char| c.is_ascii_digit()).to_string(), vec!["a.csv:", "cut"]),
        ("TITLE = \"a\"\nVARIABLES = \"X\", \"Y\", \"U\", \"V\"\nZONE I=4, DATAPACKING=BLOCK\n1 2 3 4\n1 2 3 4\n".into(), vec!["BLOCK", "POINT"]),
        ("version https://git-lfs.github.com/spec/v1\noid sha256:0\n".into(), vec!["Git LFS"]),
        ("\u{89}HDF".into(), vec!["a.csv"]),
    ] {
        let error = proposed(text.as_bytes(), "a.csv", &[]).unwrap_err();
        for part in parts {
            assert!(error.contains(part), "{error} should name {part}");
        }
    }
    let hdf5 = proposed(b"\x89HDF\r\n\x1a\n", "a.mat", &[]).unwrap_err();
    assert!(hdf5.contains("HDF5") && hdf5.contains("-v7"), "{hdf5}");
    let newer = proposed(b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "a.mat", &[]).unwrap_err();
    assert!(newer.contains("7.3") && newer.contains("-v7"), "{newer}");
}

#[test]
fn words_for_no_value_are_points_that_were_not_measured() {
    for word in [
        "NaN",
        "-nan(ind)",
        "1.#QNAN",
        "#N/A",
        "#NV",
        "NA",
        "null",
        "None",
        "---",
        "",
    ] {
        let text = lines(&strip(), ";", |k, v| {
            if k == 3 && v > -0.1725 {
                word.into()
            } else {
                decimals(k, v)
            }
        });
        let lost = strip().iter().filter(|r| r[3] > -0.1725).count();
        let (_, said) = proposed(format!("X;Y;U;V\n{text}").as_bytes(), "a.csv", &[]).unwrap();
        assert!(
            lost > 3 && said.contains(&format!("{lost} without a value")),
            "{word}: {said}"
        );
        assert!(
            said.contains(&format!("{} points, columns", strip().len() - lost)),
            "{word}: {said}"
        );
    }
}
