//! What a table says besides places and displacements: deviations, correlations, pixels, forces.

use std::fs;

use plychain::field::{MeasurementSpec, PartialSubsets, table};
use serde_json::{Value, json};

use super::Case;

#[test]
fn the_image_correlation_says_pixels_and_partial_subsets() {
    let mut case = Case::written();
    let correlation = json!({ "subset_mm": 1.0, "partial_subsets": "kept", "pixel_mm": 0.05 });
    case.model["experiments"][0]["measurement"]["image_correlation"] = correlation.clone();
    let model = case.parse().unwrap();
    let read = model.experiment().measurement.image_correlation.unwrap();
    assert_eq!(
        (read.partial_subsets, read.pixel_mm),
        (PartialSubsets::Kept, Some(0.05))
    );
    let written = serde_json::to_value(&model.file).unwrap();
    assert_eq!(
        written["experiments"][0]["measurement"]["image_correlation"],
        correlation
    );
    for (key, value) in [("pixel_mm", json!(0.0)), ("partial_subsets", json!("some"))] {
        case.model["experiments"][0]["measurement"]["image_correlation"] =
            json!({ "subset_mm": 1.0, key: value });
        let error = case.parse().err().unwrap().to_string();
        assert!(error.contains("image_correlation"), "{error}");
    }
    case.model["experiments"][0]["measurement"]["image_correlation"] = json!({ "subset_mm": 1.0 });
    let read = case
        .parse()
        .unwrap()
        .experiment()
        .measurement
        .image_correlation
        .unwrap();
    assert_eq!(read.partial_subsets, PartialSubsets::Dropped);
}

#[test]
fn sigma_and_correlation_drop_points_and_keep_deviations() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    let mut text = String::from("x;y;u;v;sigma;zncc\n");
    for k in 0..100 {
        let (sigma, zncc) = match k {
            3 => ("-1", "0.99"),
            4 => ("0", "0.99"),
            5 => ("", "0.99"),
            6 => ("0.25", "0.89"),
            7 => ("0.25", "nan"),
            8 => ("nan", ""),
            _ => ("0.25", "0.9"),
        };
        text += &format!(
            "{};{};{};0.5;{sigma};{zncc}\n",
            k % 10,
            k / 10,
            0.01 * f64::from(k)
        );
    }
    fs::write(&path, &text).unwrap();
    let spec = |columns: Value, units: Value| -> MeasurementSpec {
        let mut all = json!({ "x": "x", "y": "y", "ux": "u", "uy": "v" });
        all.as_object_mut()
            .unwrap()
            .extend(columns.as_object().unwrap().clone());
        serde_json::from_value(json!({
            "format": "csv", "file": "t.csv", "columns": all, "units": units, "loading_axis": "x",
            "hole_center_in_data_mm": [0, 0], "outliers": "keep",
        }))
        .unwrap()
    };
    let mm = json!({ "coordinates": "mm", "displacements": "um" });
    let both = spec(
        json!({ "sigma": "sigma", "correlation": "zncc" }),
        mm.clone(),
    );
    let written = serde_json::to_string(&both).unwrap();
    assert_eq!(
        serde_json::from_str::<MeasurementSpec>(&written).unwrap(),
        both
    );
    let field = both.read(folder.path(), None).unwrap();
    assert_eq!((field.len(), field.rejected.uncorrelated), (94, 6));
    let sigma = field.sigma.as_ref().unwrap();
    assert!(sigma.len() == 94 && sigma.iter().all(|s| (s - 0.25e-3).abs() < 1e-12));
    // a window cuts them with their points
    let cut = both
        .read(folder.path(), Some([[0.5, -1.0], [20.0, 20.0]]))
        .unwrap();
    assert_eq!(cut.sigma.unwrap().len(), cut.points.len());
    assert!(
        spec(json!({}), mm.clone())
            .read(folder.path(), None)
            .unwrap()
            .sigma
            .is_none()
    );
    // pixels with a scale are lengths; sigma in pixels without one tells failed points alone
    let px = json!({ "coordinates": "px", "displacements": "px", "mm_per_pixel": 0.5 });
    let pixels = spec(json!({ "sigma": "sigma" }), px)
        .read(folder.path(), None)
        .unwrap();
    assert!(
        (pixels.bounds()[1][0] - 4.5).abs() < 1e-12
            && (pixels.sigma.unwrap()[0] - 0.125).abs() < 1e-12
    );
    let mut of_vic = mm.clone();
    of_vic["sigma"] = json!("px");
    let failed = spec(json!({ "sigma": "sigma" }), of_vic)
        .read(folder.path(), None)
        .unwrap();
    assert_eq!((failed.len(), failed.sigma), (96, None));
    // a residual of the correlation is taken for no coefficient
    fs::write(&path, text.replace(";0.9\n", ";0.02\n")).unwrap();
    let error = both.read(folder.path(), None).unwrap_err();
    assert!(
        error.to_string().contains("t.csv, column \"zncc\"")
            && error.hint_text().unwrap().contains("ZNSSD"),
        "{error}"
    );
    fs::write(&path, text.replace("-1;0.99", "bad;0.99")).unwrap();
    let error = both.read(folder.path(), None).unwrap_err().to_string();
    assert!(
        error.contains("t.csv:5, column \"sigma\": found bad"),
        "{error}"
    );
    for (units, word) in [
        (
            json!({ "coordinates": "px", "displacements": "mm" }),
            "units.mm_per_pixel",
        ),
        (
            json!({ "coordinates": "px", "displacements": "mm", "mm_per_pixel": -1 }),
            "above 0",
        ),
        (
            json!({ "coordinates": "mm", "displacements": "mm", "mm_per_pixel": 1 }),
            "no such key",
        ),
        (
            json!({ "coordinates": "mm", "displacements": "mm", "sigma": "mm" }),
            "units.sigma",
        ),
        (
            json!({ "coordinates": "mm", "displacements": "feet" }),
            "feet",
        ),
    ] {
        let keys = json!({
            "format": "csv", "file": "t.csv", "columns": { "x": "x", "y": "y", "ux": "u", "uy": "v" }, "units": units,
            "loading_axis": "x", "hole_center_in_data_mm": [0, 0],
        });
        let error = serde_json::from_value::<MeasurementSpec>(keys)
            .unwrap_err()
            .to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn forces_stand_in_comments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    for (comment, force) in [
        ("# force : 15000.5", Some(15000.5)),
        ("#   Force [kN]: 15", Some(15000.0)),
        ("# time: 3\n# force = 1.5 kN", Some(1500.0)),
        ("# force_N: -20", Some(-20.0)),
        ("# force: None", None),
        // kilogram-force is 9.80665 N, pound-force 0.45359237 of it, a kip 1000 pounds (NIST SP 811)
        ("# force: 3 kgf", Some(3.0 * 9.80665)),
        ("# load [lbf]: 2", Some(2.0 * 0.45359237 * 9.80665)),
        ("# Force = 2 kip", Some(2000.0 * 0.45359237 * 9.80665)),
        ("# force [mN]: 5", None),
        ("# force: 3 stone", None),
        ("# force max: 3", None),
        ("# enforced: 3", None),
        ("# force: inf", None),
        ("", None),
    ] {
        fs::write(
            &path,
            format!("{comment}\nx,y,dx,dy\n1,2,3,4\n# force: 7\n"),
        )
        .unwrap();
        let found = table::stated_force(&path).unwrap();
        let near = |(a, b): (f64, f64)| (a - b).abs() <= 1e-12 * b.abs();
        assert_eq!(found.is_some(), force.is_some(), "{comment}: {found:?}");
        assert!(found.zip(force).is_none_or(near), "{comment}: {found:?}");
    }
    // the node map of ARAMIS has its header behind a comment sign
    fs::write(
        &path,
        "# force : 3\n# index; x_undef [mm]; y_undef [mm]; u [mm]; v [mm]\n1; 2; 3; 4; 5\n",
    )
    .unwrap();
    let header = table::header(&path).unwrap();
    assert_eq!(
        header,
        ["index", "x_undef [mm]", "y_undef [mm]", "u [mm]", "v [mm]"]
    );
}

/// A row that stands in a file again counts once; two displacements of one point become their mean.
#[test]
fn a_point_counts_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    let row = |k: usize| format!("{},{},{},0.5\n", k % 10, k / 10, 0.01 * k as f64);
    let mut text = String::from("# an export\nx,y,u,v\n");
    (0..100).for_each(|k| text += &row(k));
    text += &row(7);
    text += &row(8);
    fs::write(&path, &text).unwrap();
    let spec: MeasurementSpec = serde_json::from_value(json!({
        "format": "csv", "file": "t.csv", "columns": { "x": "x", "y": "y", "ux": "u", "uy": "v" },
        "units": { "coordinates": "mm", "displacements": "um" }, "loading_axis": "x",
        "hole_center_in_data_mm": [0, 0], "outliers": "keep",
    }))
    .unwrap();
    let field = spec.read(folder.path(), None).unwrap();
    assert_eq!((field.len(), field.rejected.repeated), (100, 2));
    text += "3,0,0.04,0.5\n";
    fs::write(&path, &text).unwrap();
    let field = spec.read(folder.path(), None).unwrap();
    assert_eq!((field.len(), field.rejected.repeated), (100, 3));
    assert!((field.displacement[3][0] - 0.035e-3).abs() < 1e-12);
}
