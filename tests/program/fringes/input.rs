//! What is read and written, and what is refused.

use std::path::Path;

use plychain::error::Blame;
use plychain::field::fringes::Fringes;
use plychain::progress::Silent;
use serde_json::{Value, json};

use super::camera::Camera;
use super::judge::taken;
use crate::common::pictures::{Format, Raster};
use crate::common::{fresh, identify, plychain, posterior, set_coarse, succeed};

/// Images of a simulated test give the constants that the matrices made of them give, and those hold the truth.
#[test]
#[ignore = "slow: run by .ci/run"]
fn constants_follow_from_images() {
    let folder = fresh("images");
    let place = folder.display().to_string();
    succeed(&[
        "simulate",
        &crate::common::model("openhole.json"),
        "--grid",
        "161",
        "--set",
        "E2_GPa=8.4",
        "--fringes",
        "step_error=0.04,noise=12,jitter_deg=2",
        "--out",
        &place,
    ]);
    let measured = fresh("measured").display().to_string();
    let said = succeed(&[
        "fringes",
        &format!("{place}/fringes.json"),
        "--out",
        &measured,
    ]);
    assert!(said.contains("steps estimated"), "{said}");
    let text = std::fs::read_to_string(folder.join("model.json")).unwrap();
    let mut model: Value = serde_json::from_str(&text).unwrap();
    set_coarse(&mut model);
    let write = |name: &str, model: &Value| {
        let path = folder.join(name);
        std::fs::write(&path, model.to_string()).unwrap();
        path.display().to_string()
    };
    let of_images = identify(&write("coarse.json", &model), &[]);
    let own = &mut model["experiments"][0]["measurement"];
    own["format"] = "matrices".into();
    own.as_object_mut().unwrap().remove("file");
    own["dir"] = measured.into();
    let of_matrices = identify(&write("matrices.json", &model), &[]);
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("truth.json")).unwrap()).unwrap();
    for name in ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"] {
        let (mean, sd) = posterior(&of_images, name);
        let (other, _) = posterior(&of_matrices, name);
        let truth = truth["constants"][name].as_f64().unwrap();
        println!("{name}: {mean} +- {sd}, by matrices {other}, truth {truth}");
        assert!(
            (mean - other).abs() < 0.3 * sd,
            "{name}: {mean} {other} {sd}"
        );
        assert!(
            (mean - truth).abs() < 3.0 * sd,
            "{name}: {mean} +- {sd}, {truth}"
        );
    }
}

/// Points that are worth less count less: averages are as sure as the stated sds say.
#[test]
fn averages_follow_the_stated_sds() {
    use plychain::field::{Axis, Blocks, Frame, Grid};
    let mut grid = Grid::regular([[0.0; 2], [20.0; 2]], 81, 81);
    grid.displacement.iter_mut().for_each(|u| *u = [0.0; 2]);
    let frame = Frame {
        loading_axis: Axis::X,
        hole_center_mm: [0.0; 2],
    };
    let mut field = grid.field(frame);
    let sd = |i: usize| if i.is_multiple_of(2) { 1e-6 } else { 4e-6 };
    field.sigma = Some((0..field.len()).map(sd).collect());
    let blocks = Blocks::new(&field, 2.0, |_| true);
    let ones = blocks.average(&vec![1.0; field.len()]);
    assert!(ones.iter().all(|v| (v - 1.0).abs() < 1e-12));
    let mean_variance = (0..field.len()).map(|i| sd(i).powi(2)).sum::<f64>() / field.len() as f64;
    for block in 0..blocks.len() {
        let own = (0..field.len()).filter(|&i| blocks.of_point[i] == Some(block as u32));
        let precision: f64 = own.map(|i| sd(i).powi(-2)).sum();
        let worth = mean_variance / blocks.worth[block];
        assert!((worth * precision - 1.0).abs() < 1e-9, "{block}");
    }
}
/// A file or image that cannot be right: an error that names it.
#[test]
fn what_cannot_be_right_is_said() {
    let pictured = taken(
        "bad",
        &Camera {
            size: 60,
            ..Camera::default()
        },
        2,
    );
    let folder = pictured.file.parent().unwrap().to_path_buf();
    let spec: Value =
        serde_json::from_str(&std::fs::read_to_string(&pictured.file).unwrap()).unwrap();
    let refused = |what: &str, change: &dyn Fn(&mut Value), says: &str| {
        let mut spec = spec.clone();
        change(&mut spec);
        let path = folder.join(format!("{what}.json"));
        std::fs::write(&path, spec.to_string()).unwrap();
        said(&path, what, says);
    };
    refused(
        "schema",
        &|s| s["schema"] = "plychain-fringes/9".into(),
        "plychain-fringes/1",
    );
    refused("two-frames", &|s| s["frames"] = 2.into(), "3 to 64");
    refused("five-frames", &|s| s["frames"] = 5.into(), "readable image");
    refused(
        "half-turns",
        &|s| s["step_deg"] = 180.into(),
        "tells background",
    );
    refused(
        "no-name",
        &|s| s["images"] = "{component}_{n}.png".into(),
        "{state}",
    );
    refused(
        "frequency",
        &|s| s["fringe_frequency_per_mm"] = 0.into(),
        "above 0",
    );
    refused("pixel", &|s| s["pixel_mm"] = (-1).into(), "above 0");
    refused("key", &|s| s["pixels_mm"] = 1.into(), "pixels_mm");
    let twice = |s: &mut Value| {
        let names = |state: &str| -> Vec<String> {
            (1..=4).map(|n| format!("U_{state}_{n}.png")).collect()
        };
        let both = json!({"initial": names("initial"), "final": names("final")});
        s["images"] = json!({"U": both, "V": both});
    };
    refused("twice", &twice, "another image");
    let image = |name: &str, act: &dyn Fn(&Path), says: &str| {
        let path = folder.join(name);
        let before = std::fs::read(&path).unwrap();
        act(&path);
        said(&pictured.file, name, says);
        std::fs::write(&path, before).unwrap();
    };
    for source in ["U_final_1.png", "U_initial_2.png", "V_final_2.png"] {
        image(
            "U_final_2.png",
            &|p| assert!(std::fs::copy(folder.join(source), p).unwrap() > 0),
            "the same pixels as",
        );
    }
    image(
        "U_final_2.png",
        &|p| std::fs::remove_file(p).unwrap(),
        "U_final_2.png",
    );
    image(
        "V_initial_1.png",
        &|p| std::fs::write(p, b"no image").unwrap(),
        "PNG, TIFF, JPEG or BMP",
    );
    let write = |p: &Path, raster: Raster<u8>| std::fs::write(p, raster.file(Format::Png)).unwrap();
    let other = |p: &Path| write(p, Raster::of([59, 60], |_, _| [0]));
    image("V_final_4.png", &other, "60 x 60");
    let coloured = |p: &Path| write(p, Raster::of([60, 60], |x, _| [x as u8, 0, 9]));
    image("V_final_3.png", &coloured, "coloured");
    for n in 1..=4 {
        let white = Raster::of([60, 60], |_, _| [255]);
        write(&folder.join(format!("U_final_{n}.png")), white);
    }
    said(&pictured.file, "saturated", "stand out of the noise");
}

fn said(file: &Path, what: &str, says: &str) {
    let error = Fringes::measure(file, &Silent)
        .err()
        .unwrap_or_else(|| panic!("{what} is accepted"));
    assert!(error.to_string().contains(says), "{what}: {error}");
    assert_eq!(error.blame(), Blame::Input, "{what}");
}

/// Fringes finer than half a pixel look coarser; what can be seen of them is said.
#[test]
fn fringes_that_are_too_fine_are_left_out_and_said() {
    let camera = Camera {
        density: 0.47,
        ..Camera::default()
    };
    let pictured = taken("fine", &camera, 3);
    let fringes = Fringes::measure(&pictured.file, &Silent).unwrap();
    assert!(
        fringes.warnings.iter().any(|w| w.contains("finer than")),
        "{:?}",
        fringes.warnings
    );
}

#[test]
fn the_program_writes_what_its_readers_take() {
    let pictured = taken(
        "files",
        &Camera {
            size: 120,
            ..Camera::default()
        },
        4,
    );
    let out = fresh("measured");
    let (file, place) = (
        pictured.file.display().to_string(),
        out.display().to_string(),
    );
    succeed(&["fringes", &file, "--out", &place]);
    for name in [
        "X.txt",
        "Y.txt",
        "U.txt",
        "V.txt",
        "SU.txt",
        "SV.txt",
        "report.html",
    ] {
        assert!(out.join(name).is_file(), "{name}");
    }
    let report: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("fringes.json")).unwrap()).unwrap();
    assert_eq!(report["schema"], "plychain-fringes-result/1");
    let again = plychain(&["fringes", &file, "--out", &place]);
    assert_eq!(again.status.code(), Some(1));
}
