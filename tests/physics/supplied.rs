//! Snapshots of other programs: the same identification by their fields as by the own finite elements, and what is said of fields that are
//! not what they should be.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use plychain::experiment::{PointSet, predict};
use plychain::infer::{Model, problem_within};
use plychain::reduce::SuppliedSpec;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Dxsm;
use serde_json::{Value, json};

use crate::common::{copy, fresh, plychain_in, root};

/// Rows of a design: 35 monomials of a cubic in four constants, and half as many again.
const ROWS: usize = 60;

const WINDOW: [[f64; 2]; 2] = [[-12.15; 2], [12.15; 2]];

/// A folder with the open-hole test, its thickness known, as `own.json` and, with supplied snapshots, as `model.json`.
struct Bench {
    place: PathBuf,
}

impl Bench {
    fn new(extension: &str, mesh_density: f64, change: impl Fn(&mut Value)) -> Self {
        let place = fresh("supplied");
        std::fs::create_dir(&place).unwrap();
        copy(&root().join("models/openhole"), &place.join("openhole"));
        let text = std::fs::read_to_string(root().join("models/openhole.json")).unwrap();
        let mut model: Value = serde_json::from_str(&text).unwrap();
        let experiment = &mut model["experiments"][0];
        experiment["mesh_density"] = mesh_density.into();
        experiment["specimen"]["thickness_mm"] = json!({ "mean": 0.78, "sd": 0.0 });
        experiment["effects"] = json!(["rigid_translation", "rigid_rotation"]);
        model["reduced_model"] = json!({ "snapshots": ROWS, "modes": 4, "degree": 3 });
        std::fs::write(place.join("own.json"), model.to_string()).unwrap();
        let fields = format!("fields/row-*.{extension}");
        model["reduced_model"]["snapshots"] = json!({ "doe": "doe.csv", "fields": fields });
        change(&mut model);
        std::fs::write(place.join("model.json"), model.to_string()).unwrap();
        let bench = Self { place };
        bench.succeed(&["design-of-experiments", "own.json", "--out", "doe.csv"]);
        bench
    }

    fn succeed(&self, arguments: &[&str]) -> String {
        let end = plychain_in(&self.place, arguments);
        assert!(end.status.success(), "{arguments:?} {end:?}");
        String::from_utf8(end.stdout).unwrap()
    }

    fn refused(&self) -> String {
        let end = plychain_in(&self.place, &["build", "model.json", "--quiet"]);
        assert_eq!(end.status.code(), Some(1), "{end:?}");
        String::from_utf8(end.stderr).unwrap()
    }

    /// Solve the rows at scattered points of the specimen, mm from `origin` in the data's axes, and write them.
    fn solve(&self, origin: [f64; 2], write: impl Fn(&Path, &[[f64; 2]], &[[f64; 2]])) {
        let model = Model::load(&self.place.join("own.json")).unwrap();
        let problem = problem_within(&model, WINDOW, None).unwrap();
        let experiment = &*problem.experiment;
        let frame = experiment.scene().frame;
        let (sight, _) = experiment.locate(&points(), &[]);
        let folder = self.place.join("fields");
        std::fs::create_dir(&folder).unwrap();
        let table = std::fs::read_to_string(self.place.join("doe.csv")).unwrap();
        for line in table.lines().skip(1) {
            let (row, values) = line.split_once(',').unwrap();
            let point: Vec<f64> = values.split(',').map(|v| v.parse().unwrap()).collect();
            let field = predict(experiment, &problem.state(&point), &sight)
                .unwrap()
                .field;
            let place = |sight: &PointSet| -> Vec<[f64; 2]> {
                let moved = |p: &[f64; 2]| {
                    let p = frame.vector(*p);
                    [p[0] + origin[0], p[1] + origin[1]]
                };
                sight.points().iter().map(moved).collect()
            };
            let field: Vec<[f64; 2]> = field.iter().map(|u| frame.vector(*u)).collect();
            write(&folder.join(format!("row-{row}")), &place(&sight), &field);
        }
    }

    /// Mean and sd of the constants.
    fn posterior(&self, model: &str) -> Vec<[f64; 2]> {
        let out = format!("of-{model}");
        self.succeed(&[
            "identify", model, "--data", "plain", "--quiet", "--out", &out,
        ]);
        let text = std::fs::read_to_string(self.place.join(out).join("report.json")).unwrap();
        let report: Value = serde_json::from_str(&text).unwrap();
        let posterior = &report["rounds"][0]["posterior"];
        ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"]
            .map(|name| ["mean", "sd"].map(|key| posterior[name][key].as_f64().unwrap()))
            .to_vec()
    }

    /// Of a test without undeclared effects: those that act on the material are no candidates over another program's fields, and would be noise.
    fn agrees(&self, sds: f64) {
        for [a, b] in self.both() {
            assert!((a[0] - b[0]).abs() < sds * a[1], "{a:?} {b:?}");
            assert!((b[1] / a[1] - 1.0).abs() < 0.1, "{a:?} {b:?}");
        }
    }

    /// The same, within a share of every constant.
    fn agrees_within(&self, share: f64) {
        for [a, b] in self.both() {
            println!("{a:?} {b:?}");
            assert!((a[0] / b[0] - 1.0).abs() < share, "{a:?} {b:?}");
            assert!((b[1] / a[1] - 1.0).abs() < 0.1, "{a:?} {b:?}");
        }
    }

    /// Mean and sd of each constant by the own elements and by the supplied fields.
    fn both(&self) -> Vec<[[f64; 2]; 2]> {
        let simulate = "simulate own.json --grid 121 --noise-nm 10 --seed 5 --out plain";
        self.succeed(&simulate.split(' ').collect::<Vec<_>>());
        let (own, theirs) = (self.posterior("own.json"), self.posterior("model.json"));
        own.into_iter().zip(theirs).map(|(a, b)| [a, b]).collect()
    }
}

/// Points as of a mesh about the hole: rings that widen, and a lattice where those have left the window's corners open.
fn points() -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    let mut radius = 2.0;
    while radius < 13.5 {
        let count = (60.0 + 12.0 * radius) as usize;
        for k in 0..count {
            let angle = std::f64::consts::TAU * k as f64 / count as f64;
            points.push([radius * angle.cos(), radius * angle.sin()]);
        }
        radius *= 1.05;
    }
    for k in 0..51 * 81 {
        let p = [
            0.4 * ((k / 51) as f64 - 40.0),
            0.5 * ((k % 51) as f64 - 25.0),
        ];
        if p[0].hypot(p[1]) > radius / 1.05 + 0.2 {
            points.push(p);
        }
    }
    points.retain(|p| p[1].abs() <= 12.5);
    points
}

fn write_csv(path: &Path, points: &[[f64; 2]], field: &[[f64; 2]]) {
    let mut text = String::from("uy_mm,node,x_mm,y_mm,ux_mm\n");
    for (k, (p, u)) in points.iter().zip(field).enumerate() {
        writeln!(text, "{:e},{k},{},{},{:e}", u[1], p[0], p[1], u[0]).unwrap();
    }
    std::fs::write(path.with_extension("csv"), text).unwrap();
}

/// `numpy.savez_compressed`.
fn write_npz(path: &Path, points: &[[f64; 2]], field: &[[f64; 2]]) {
    let file = std::fs::File::create(path.with_extension("npz")).unwrap();
    let mut zip = zip::ZipWriter::new(file);
    let arrays = [(points, 0), (points, 1), (field, 0), (field, 1)];
    for (name, (all, k)) in ["x_mm", "y_mm", "ux_mm", "uy_mm"].iter().zip(arrays) {
        let options = zip::write::SimpleFileOptions::default()
            .compression_method(zip::CompressionMethod::Deflated);
        zip.start_file(format!("{name}.npy"), options).unwrap();
        let header = format!(
            "{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}",
            all.len()
        );
        let header = format!("{header:<117}\n");
        zip.write_all(b"\x93NUMPY\x01\x00").unwrap();
        zip.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
        zip.write_all(header.as_bytes()).unwrap();
        for p in all {
            zip.write_all(&p[k].to_le_bytes()).unwrap();
        }
    }
    zip.finish().unwrap();
}

/// An unstructured grid with zlib blocks of 4096 bytes.
fn write_vtu(path: &Path, points: &[[f64; 2]], field: &[[f64; 2]]) {
    let array = |name: &str, all: &[[f64; 2]]| {
        let bytes: Vec<u8> = all
            .iter()
            .flat_map(|p| [p[0], p[1], 0.0])
            .flat_map(f64::to_le_bytes)
            .collect();
        let block = |bytes: &[u8]| {
            let mut encoder =
                flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            encoder.write_all(bytes).unwrap();
            encoder.finish().unwrap()
        };
        let blocks: Vec<Vec<u8>> = bytes.chunks(4096).map(block).collect();
        let mut head = vec![blocks.len() as u32, 4096, (bytes.len() % 4096) as u32];
        head.extend(blocks.iter().map(|b| b.len() as u32));
        let head: Vec<u8> = head.iter().flat_map(|n| n.to_le_bytes()).collect();
        let data = STANDARD.encode(head) + &STANDARD.encode(blocks.concat());
        format!(
            "<DataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"3\" format=\"binary\">{data}</DataArray>"
        )
    };
    let text = format!(
        "<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\">\
         <UnstructuredGrid><Piece NumberOfPoints=\"{}\"><Points>{}</Points><PointData>{}</PointData></Piece></UnstructuredGrid></VTKFile>",
        points.len(),
        array("Points", points),
        array("Displacement", field)
    );
    std::fs::write(path.with_extension("vtu"), text).unwrap();
}

/// Fields at points of another mesh, in a frame of their own: the posterior is that of the own solver.
#[test]
#[ignore = "slow: run by .ci/run"]
fn fields_of_another_mesh_give_the_same_posterior() {
    let bench = Bench::new("csv", 0.4, |model| {
        model["reduced_model"]["snapshots"]["origin_mm"] = json!([100.0, 7.5]);
        model["material"]["parameters"]["E2_GPa"]["published"] =
            json!({ "mean": 7.123, "sd": 0.2 });
    });
    bench.solve([100.0, 7.5], write_csv);
    bench.agrees(0.1);
    let shown = bench.succeed(&["identify", "model.json", "--verbose", "--out", "again"]);
    assert!(shown.contains("Under the full nonlinear model"), "{shown}");
    assert!(
        shown.contains("published") && shown.contains("7.12 +- 0.20"),
        "{shown}"
    );
    let effects = bench.succeed(&["effects", "model.json", "--json"]);
    let effects: Value = serde_json::from_str(&effects).unwrap();
    let cannot: Vec<&str> = effects
        .as_array()
        .unwrap()
        .iter()
        .filter(|e| !e["cannot_act"].is_null())
        .map(|e| e["name"].as_str().unwrap())
        .collect();
    assert!(cannot.contains(&"load_misalignment") && cannot.contains(&"hole_size"));
    assert!(!cannot.contains(&"magnification") && !cannot.contains(&"uniform_strain"));
}

/// What acts on the picture is traced over fields of another program as over the own.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_pixel_scale_is_found_over_supplied_fields() {
    let bench = Bench::new("csv", 1.0, |_| {});
    bench.solve([0.0; 2], write_csv);
    let measured = [
        "simulate",
        "own.json",
        "--grid",
        "81",
        "--noise-nm",
        "10",
        "--effect",
        "magnification=0.8",
        "--set",
        "E1_GPa=155",
        "--set",
        "E2_GPa=7.9",
        "--seed",
        "5",
        "--out",
        "measured",
    ];
    bench.succeed(&measured);
    let shown = bench.succeed(&[
        "loop",
        "model.json",
        "--data",
        "measured",
        "--verbose",
        "--out",
        "closed",
    ]);
    assert!(shown.contains("VERDICT: explained by: "), "{shown}");
    assert!(shown.contains("consistent with magnification"), "{shown}");
}

/// Tables, archives of NumPy and grids of VTK say the same.
#[test]
#[ignore = "slow: run by .ci/run"]
fn all_formats_hold_the_same_fields() {
    let built = [
        ("csv", write_csv as fn(&Path, &[[f64; 2]], &[[f64; 2]])),
        ("npz", write_npz),
        ("vtu", write_vtu),
    ]
    .map(|(extension, write)| {
        let bench = Bench::new(extension, 0.4, |_| {});
        bench.solve([0.0; 2], write);
        bench.succeed(&["build", "model.json", "--quiet", "--out", "built"]);
        let text = std::fs::read_to_string(bench.place.join("built/reduced_model.json")).unwrap();
        let value: Value = serde_json::from_str(&text).unwrap();
        value["model"].clone()
    });
    assert!(built[0] == built[1] && built[1] == built[2]);
}

/// Every fault is the input's, named with its file.
#[test]
#[ignore = "slow: run by .ci/run"]
fn supplied_fields_that_do_not_fit_are_refused() {
    let bench = Bench::new("csv", 0.4, |_| {});
    assert!(bench.refused().contains("a folder of fields"));
    bench.solve([0.0; 2], write_csv);
    let path = |name: &str| bench.place.join(name);
    let changed = |name: &str, change: &dyn Fn(String) -> String, said: &str| {
        let text = std::fs::read_to_string(path(name)).unwrap();
        std::fs::write(path(name), change(text.clone())).unwrap();
        let errors = bench.refused();
        assert!(errors.contains(said), "{said} in {errors}");
        std::fs::write(path(name), text).unwrap();
    };
    let first = "fields/row-1.csv";
    changed(first, &|t| t.replace("ux_mm", "ux"), "no column ux_mm");
    changed(first, &|t| t.lines().take(1).collect(), "points");
    changed(
        "fields/row-7.csv",
        &|t| t.lines().take(90).collect::<Vec<_>>().join("\n"),
        "89 points",
    );
    changed(
        "fields/row-7.csv",
        &|t| t.replacen("e-", "x", 1),
        "a number in",
    );
    changed(
        "fields/row-7.csv",
        &|t| t.replacen(",2,", ",2.1,", 1),
        "the points of the first row",
    );
    changed("doe.csv", &|t| t.replace("nu12", "nu21"), "no column nu12");
    changed("doe.csv", &|t| t.replace("\n2,", "\n1,"), "row 1 again");
    changed(
        "doe.csv",
        &|t| t.lines().take(ROWS).collect::<Vec<_>>().join("\n"),
        "a row 60 of the design",
    );
    changed(
        "doe.csv",
        &|t| t + "61,150,8,0.3,4.4\n",
        "the field of row 61",
    );
    let model = |change: &dyn Fn(&mut Value), said: &str| {
        let change = |text: String| {
            let mut value: Value = serde_json::from_str(&text).unwrap();
            change(&mut value);
            value.to_string()
        };
        changed("model.json", &change, said);
    };
    model(
        &|m| m["experiments"][0]["effects"] = json!(["load_misalignment"]),
        "another program's",
    );
    model(
        &|m| m["experiments"][0]["gauge"] = json!({ "zero_at_mm": [0.0, 10.0] }),
        "gauge",
    );
    model(
        &|m| m["reduced_model"]["snapshots"]["origin_mm"] = json!([500.0, 0.0]),
        "none nearer than",
    );
    model(
        &|m| m["reduced_model"]["snapshots"]["fields"] = "fields/row-1.csv".into(),
        "one *",
    );
    model(
        &|m| m["reduced_model"]["doe"] = json!({ "nu12": [0.3, 0.4] }),
        "whose rows are the box",
    );
    model(
        &|m| m["reduced_model"]["snapshots"] = json!({ "doe": "doe.csv" }),
        "snapshots",
    );
    std::fs::copy(path(first), path("fields/row-01.csv")).unwrap();
    assert!(bench.refused().contains("one file a row"));
}

/// Bytes that are flipped, cut out or doubled are read or refused; nothing panics.
#[test]
fn mangled_fields_are_read_or_refused() {
    let points: Vec<[f64; 2]> = (0..40)
        .map(|k| [f64::from(k % 8), f64::from(k / 8)])
        .collect();
    let place = fresh("mangled");
    std::fs::create_dir(&place).unwrap();
    std::fs::write(place.join("doe.csv"), "row,E_GPa,nu\n1,200,0.3\n").unwrap();
    let mut rng = Pcg64Dxsm::seed_from_u64(21);
    let writers = [
        ("csv", write_csv as fn(&Path, &[[f64; 2]], &[[f64; 2]])),
        ("npz", write_npz),
        ("vtu", write_vtu),
    ];
    for (extension, write) in writers {
        write(&place.join("1"), &points, &points);
        let path = place.join(format!("1.{extension}"));
        let whole = std::fs::read(&path).unwrap();
        let spec = SuppliedSpec {
            doe: "doe.csv".into(),
            fields: format!("*.{extension}").into(),
            origin_mm: None,
        };
        let read = || spec.read(&place, &["E_GPa", "nu"]);
        assert_eq!(read().unwrap().points, points);
        let mut refused = 0;
        for _ in 0..3000 {
            let mut bytes = whole.clone();
            let at = rng.random_range(0..bytes.len());
            let end = (at + rng.random_range(1..60)).min(bytes.len());
            match rng.random_range(0..4) {
                0 => bytes[at] ^= 1 << rng.random_range(0..8),
                1 => drop(bytes.drain(at..end)),
                2 => bytes.truncate(at),
                _ => bytes.extend_from_within(at..end),
            }
            std::fs::write(&path, bytes).unwrap();
            refused += usize::from(read().is_err());
        }
        assert!(refused > 300, "{refused} of {extension}");
        std::fs::remove_file(&path).unwrap();
    }
}

/// The example with CalculiX: its fields, of a mesh of its own, and the own finite elements agree.
#[test]
#[ignore = "needs CalculiX"]
fn calculix_gives_the_posterior_of_the_own_solver() {
    let place = fresh("calculix");
    std::fs::create_dir(&place).unwrap();
    let bench = Bench { place };
    let models = root().join("models");
    copy(&models.join("openhole"), &bench.place.join("openhole"));
    copy(&models.join("calculix"), &bench.place.join("calculix"));
    for (from, to) in [
        ("openhole.json", "own.json"),
        ("openhole-calculix.json", "model.json"),
    ] {
        std::fs::copy(models.join(from), bench.place.join(to)).unwrap();
    }
    let doe = "calculix/doe.csv";
    bench.succeed(&[
        "design-of-experiments",
        "model.json",
        "--snapshots",
        "90",
        "--out",
        doe,
    ]);
    let solved = Command::new("python3")
        .args(["calculix/solve.py", doe, "calculix/fields"])
        .current_dir(&bench.place)
        .output()
        .unwrap();
    assert!(solved.status.success(), "{solved:?}");
    // two meshes, neither of them converged: of a modulus as much as a force of class 1 leaves
    bench.agrees_within(0.005);
}
