//! From fringe images to displacements: errors at the floor of the noise, whatever the frames were, with honest sds; from images to constants.

#[path = "fringes/camera.rs"]
mod camera;

use std::f64::consts::{PI, TAU};
use std::path::Path;

use plychain::error::Blame;
use plychain::field::fringes::{Fringes, Steps};
use plychain::progress::Silent;
use serde_json::{Value, json};

use crate::program::{fresh, identify, plychain, posterior, set_coarse, shared, succeed};
use camera::{Camera, Pictured};

/// What one component's displacement is worth.
#[derive(Debug)]
struct Judged {
    /// rms error over the floor of the noise, and the rms of the stated sds over the rms error.
    over_floor: f64,
    sd_ratio: f64,
    /// Correlation of neighbours' errors.
    neighbours: f64,
    /// Pixels that are off by an order, shares of those that can be measured that are, and of the picture that is claimed without surface.
    off: usize,
    kept: f64,
    claimed: f64,
    steps: Steps,
}

/// Against the phase (rad) at each pixel, NaN where it cannot be measured.
fn judge(
    fringes: &Fringes,
    c: usize,
    truth: &[f64],
    floor: f64,
    surface: &dyn Fn(usize) -> bool,
) -> Judged {
    let own = &fringes.components[c];
    let scale = TAU * fringes.spec.fringe_frequency_per_mm;
    let claimed = (0..truth.len()).filter(|&i| own.displacement_mm[i].is_finite() && !surface(i));
    let able = truth.iter().filter(|t| t.is_finite()).count();
    let mut errors: Vec<(usize, f64, f64)> = (0..truth.len())
        .map(|i| {
            (
                i,
                own.displacement_mm[i] * scale - truth[i],
                own.sd_mm[i] * scale,
            )
        })
        .filter(|(_, e, _)| e.is_finite())
        .collect();
    let mut sorted: Vec<f64> = errors.iter().map(|e| e.1).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted[sorted.len() / 2];
    let kept = errors.len();
    errors.retain(|e| (e.1 - middle).abs() < PI);
    let off = kept - errors.len();
    let n = errors.len() as f64;
    let mean = errors.iter().map(|e| e.1).sum::<f64>() / n;
    errors.iter_mut().for_each(|e| e.1 -= mean);
    let variance = errors.iter().map(|e| e.1 * e.1).sum::<f64>() / n;
    let stated = errors.iter().map(|e| e.2 * e.2).sum::<f64>() / n;
    let pairs = errors.windows(2).filter(|p| p[1].0 == p[0].0 + 1);
    let (product, count) = pairs.fold((0.0, 0.0), |(s, n), p| (s + p[0].1 * p[1].1, n + 1.0));
    Judged {
        over_floor: variance.sqrt() / floor,
        sd_ratio: (stated / variance).sqrt(),
        neighbours: product / count / variance,
        off,
        kept: kept as f64 / able as f64,
        claimed: claimed.count() as f64 / truth.len() as f64,
        steps: own.chosen.steps,
    }
}

fn measured(pictured: &Pictured) -> [Judged; 2] {
    let fringes = Fringes::measure(&pictured.file, &Silent).unwrap();
    [0, 1].map(|c| {
        judge(&fringes, c, &pictured.phase[c], pictured.floor[c], &|i| {
            pictured.surface[i]
        })
    })
}

/// Errors of at most `most` floors, with all that goes with them.
fn check(case: &str, judged: &Judged, most: f64) {
    println!("{case}: {judged:?}");
    assert!(judged.over_floor < most, "{case}: {judged:?}");
    assert!((judged.sd_ratio - 1.0).abs() < 0.15, "{case}: {judged:?}");
    assert!(judged.neighbours.abs() < 0.05, "{case}: {judged:?}");
    assert_eq!(judged.off, 0, "{case}: {judged:?}");
    assert!(
        judged.kept > 0.99 && judged.claimed < 2e-4,
        "{case}: {judged:?}"
    );
}

fn taken(name: &str, camera: &Camera, seed: u64) -> Pictured {
    camera.take(&fresh(&format!("fringes-{name}-{seed}")), seed)
}

/// Frames of equal steps over a turn.
fn frames(frames: usize) -> Camera {
    Camera {
        frames,
        step_deg: 360.0 / frames as f64,
        ..Camera::default()
    }
}

#[test]
fn errors_are_those_of_the_noise_whatever_the_steps_were() {
    for n in 3..=8 {
        for seed in 0..2 {
            let exact = frames(n);
            let wrong = Camera {
                step_error: 0.05,
                ..frames(n)
            };
            let unsteady = Camera {
                jitter_deg: 4.0,
                ..frames(n)
            };
            for (what, camera) in [("exact", exact), ("wrong", wrong), ("unsteady", unsteady)] {
                for judged in measured(&taken(what, &camera, seed)) {
                    check(&format!("{what}, {n} frames, seed {seed}"), &judged, 1.05);
                }
            }
        }
    }
}

/// A detector's gamma makes harmonics; with three frames they look like phase.
#[test]
fn a_bent_response_of_the_detector_is_found() {
    for n in [3, 4, 5] {
        for seed in 0..3 {
            let camera = Camera {
                gamma: 1.12,
                ..frames(n)
            };
            for judged in measured(&taken("gamma", &camera, seed)) {
                check(&format!("gamma, {n} frames, seed {seed}"), &judged, 1.15);
            }
        }
    }
}

/// Where a state holds less than a fringe, its frames alone do not tell their steps.
#[test]
fn few_fringes_are_no_worse_than_nominal_steps() {
    for n in [3, 4, 5] {
        for seed in 0..3 {
            let camera = Camera {
                initial_fringes: 0.6,
                jitter_deg: 4.0,
                flicker: 0.02,
                background: 130.0,
                ..frames(n)
            };
            let auto = measured(&taken("few", &camera, seed));
            let nominal = Camera {
                steps: "nominal",
                ..camera
            };
            let nominal = measured(&taken("few-nominal", &nominal, seed));
            for (auto, nominal) in auto.iter().zip(&nominal) {
                check(&format!("few, {n} frames, seed {seed}"), auto, 1.4);
                assert!(auto.over_floor < nominal.over_floor, "{auto:?} {nominal:?}");
            }
        }
    }
}

#[test]
fn the_data_say_whether_steps_are_nominal() {
    let steps = |camera: &Camera| measured(&taken("choice", camera, 5)).map(|j| j.steps);
    assert_eq!(steps(&Camera::default()), [Steps::Nominal; 2]);
    let wrong = Camera {
        step_error: 0.01,
        ..Camera::default()
    };
    assert_eq!(steps(&wrong), [Steps::Estimated; 2]);
}

/// Up to 0.4 fringes a pixel no pixel is off by an order.
#[test]
fn dense_fringes_are_unwrapped() {
    for seed in 0..3 {
        let camera = Camera {
            density: 0.4,
            ..Camera::default()
        };
        for judged in measured(&taken("dense", &camera, seed)) {
            check(&format!("dense, seed {seed}"), &judged, 1.05);
        }
    }
}

/// A camera of twelve bits in TIFF files of sixteen, whose pixels in the middle have a clipped frame.
#[test]
fn twelve_bits_in_sixteen_are_read_and_clipped_frames_left_out() {
    let camera = Camera {
        background: 145.0,
        unit: 16.0,
        full: 4095.0,
        ending: "tiff",
        ..Camera::default()
    };
    let pictured = taken("deep", &camera, 1);
    let fringes = Fringes::measure(&pictured.file, &Silent).unwrap();
    for c in 0..2 {
        let judged = judge(&fringes, c, &pictured.phase[c], pictured.floor[c], &|i| {
            pictured.surface[i]
        });
        // pixels with three frames left have larger errors, and say so
        check("twelve bits", &judged, 1.15);
    }
}

/// Independent images, with their truth (README there).
#[test]
#[ignore = "needs ../shared"]
fn independent_images_are_measured_to_the_floor() {
    for (name, most) in [("step-error", 1.05), ("few-fringes", 1.4)] {
        let folder = shared("fringe-images").join(name);
        let truth: Value =
            serde_json::from_str(&std::fs::read_to_string(folder.join("truth.json")).unwrap())
                .unwrap();
        let file = fresh("independent.json");
        let images = folder.join("{component}_{state}_{n}.png");
        let spec = json!({
            "schema": "plychain-fringes/1", "images": images, "frames": 4, "step_deg": 90,
            "fringe_frequency_per_mm": 2400, "pixel_mm": 0.06075, "first_row": "low_y", "U_along": "y",
        });
        std::fs::write(&file, spec.to_string()).unwrap();
        let fringes = Fringes::measure(&file, &Silent).unwrap();
        for (c, component) in ["U", "V"].into_iter().enumerate() {
            let text =
                std::fs::read_to_string(folder.join(format!("truth_{component}.txt"))).unwrap();
            let phase: Vec<f64> = text
                .split_whitespace()
                .map(|u| u.parse::<f64>().unwrap() * 1e-3 * TAU * 2400.0)
                .collect();
            let floor =
                truth[format!("floor_nm_{component}")].as_f64().unwrap() * 1e-6 * TAU * 2400.0;
            // the hole of this specimen has a radius of 2 mm
            let far = |i: usize| {
                let of = |k: usize| (k as f64 - 199.5) * 0.06075;
                of(i / 400).hypot(of(i % 400)) > 1.95
            };
            let judged = judge(&fringes, c, &phase, floor, &far);
            check(&format!("{name} {component}"), &judged, most);
        }
    }
}

/// Images of a simulated test give the constants that the matrices made of them give, and those hold the truth.
#[test]
fn constants_follow_from_images() {
    let folder = fresh("images");
    let place = folder.display().to_string();
    succeed(&[
        "simulate",
        &crate::program::model("openhole.json"),
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
    refused("five-frames", &|s| s["frames"] = 5.into(), "readable file");
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
    image(
        "U_final_2.png",
        &|p| std::fs::remove_file(p).unwrap(),
        "U_final_2.png",
    );
    image(
        "V_initial_1.png",
        &|p| std::fs::write(p, b"no image").unwrap(),
        "grey PNG or TIFF",
    );
    let other = |p: &Path| image::GrayImage::new(59, 60).save(p).unwrap();
    image("V_final_4.png", &other, "60 x 60");
    let coloured = |p: &Path| {
        image::RgbImage::from_fn(60, 60, |x, _| image::Rgb([x as u8, 0, 9]))
            .save(p)
            .unwrap()
    };
    image("V_final_3.png", &coloured, "coloured");
    for n in 1..=4 {
        image::GrayImage::from_pixel(60, 60, image::Luma([255]))
            .save(folder.join(format!("U_final_{n}.png")))
            .unwrap();
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
