//! From fringe images to displacements: errors at the floor of the noise, whatever the frames were, with honest sds.

#[path = "fringes/camera.rs"]
mod camera;
#[path = "fringes/input.rs"]
mod input;
#[path = "fringes/judge.rs"]
mod judge;

use std::f64::consts::TAU;

use plychain::field::fringes::{Fringes, PhaseSteps};
use plychain::progress::Silent;
use serde_json::{Value, json};

use crate::common::{fresh, shared};
use camera::Camera;
use judge::{check, judge, measured, taken};

/// Frames of equal steps over a turn.
fn frames(frames: usize) -> Camera {
    Camera {
        frames,
        step_deg: 360.0 / frames as f64,
        ..Camera::default()
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn errors_are_those_of_the_noise_whatever_the_steps_were() {
    for n in 3..=8 {
        let seed = n as u64;
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

/// A detector's gamma makes harmonics; with three frames they look like phase.
#[test]
fn a_bent_response_of_the_detector_is_found() {
    for n in [3, 4, 5] {
        for seed in 0..2 {
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
#[ignore = "slow: run by .ci/run"]
fn few_fringes_are_no_worse_than_nominal_steps() {
    for n in [3, 4, 5] {
        for seed in 0..2 {
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
    assert_eq!(steps(&Camera::default()), [PhaseSteps::Nominal; 2]);
    let wrong = Camera {
        step_error: 0.01,
        ..Camera::default()
    };
    assert_eq!(steps(&wrong), [PhaseSteps::Estimated; 2]);
}

/// Up to 0.4 fringes a pixel no pixel is off by an order.
#[test]
fn dense_fringes_are_unwrapped() {
    for seed in 0..2 {
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

/// Steps so wrong that nominal ones leave more than the fringes' modulation hide none of them.
#[test]
#[ignore = "slow: run by .ci/run"]
fn large_errors_of_steps_and_brightness_are_found() {
    let off = |step_deg: f64, frames: usize| Camera {
        frames,
        step_deg,
        step_error: 0.05,
        jitter_deg: 4.0,
        ..Camera::default()
    };
    let flicker = Camera {
        flicker: 0.1,
        ..Camera::default()
    };
    let far = Camera {
        step_error: 0.2,
        ..Camera::default()
    };
    // steps that do not fill turns evenly have a higher floor, by the trace of their least squares
    let cases = [
        ("120 degrees", off(120.0, 4), 1.15),
        ("five at 90", off(90.0, 5), 1.15),
        ("four at 90", off(90.0, 4), 1.05),
        ("flicker", flicker, 1.05),
        ("20 percent", far, 1.15),
    ];
    for (name, camera, most) in cases {
        for seed in 0..2 {
            for judged in measured(&taken("large", &camera, seed)) {
                check(&format!("{name}, seed {seed}"), &judged, most);
            }
        }
    }
}

/// Cameras of 10 and 12 bits at the lower end of files of 16, dim ones too, with few frames.
#[test]
#[ignore = "slow: run by .ci/run"]
fn the_camera_may_use_a_part_of_the_range() {
    for (bits, frames_) in [(10, 3), (10, 4), (12, 3), (12, 5)] {
        for background in [35.0, 100.0] {
            let full = f64::from((1 << bits) - 1);
            let camera = Camera {
                background,
                gamma: 1.12,
                unit: full / 255.0,
                full,
                ending: "tiff",
                ..frames(frames_)
            };
            let pictured = taken("range", &camera, 1);
            for judged in measured(&pictured) {
                check(
                    &format!("{bits} bits, {frames_} frames, {background}"),
                    &judged,
                    1.15,
                );
            }
            let found = Fringes::measure(&pictured.file, &Silent).unwrap();
            for component in &found.components {
                let gamma = component.frames.response.gamma();
                // A dark picture tells nothing about the detector at half of its range.
                let known = background < 100.0 || (gamma - 1.12).abs() < 0.03;
                assert!(known, "{bits} bits: {gamma}");
            }
        }
    }
}

/// Frames that the black level cuts off are left out, and that is said; what is left of three is not enough.
#[test]
fn frames_cut_off_at_black_are_left_out() {
    for seed in 0..2 {
        let camera = Camera {
            black: 35.0,
            ..frames(5)
        };
        let pictured = taken("black", &camera, seed);
        for judged in measured(&pictured) {
            check(&format!("black, seed {seed}"), &judged, 1.3);
        }
        let found = Fringes::measure(&pictured.file, &Silent).unwrap();
        assert!(
            found.warnings.iter().any(|w| w.contains("at black")),
            "{:?}",
            found.warnings
        );
    }
}

/// Noise that grows with the light, and states that differ smoothly: the stated sds stay those of the errors.
#[test]
#[ignore = "slow: run by .ci/run"]
fn sds_are_honest_where_noise_and_light_are_uneven() {
    let uneven = |frames_: usize| Camera {
        background_change: 0.08,
        modulation_change: 0.08,
        jitter_deg: 4.0,
        ..frames(frames_)
    };
    let shot = |frames_: usize| Camera {
        shot: 0.06,
        noise: 0.5,
        ..frames(frames_)
    };
    for seed in 0..2 {
        for n in [3, 4] {
            for judged in measured(&taken("shot", &shot(n), seed)) {
                check(&format!("shot, {n} frames, seed {seed}"), &judged, 1.08);
            }
        }
        for judged in measured(&taken("uneven", &uneven(4), seed)) {
            check(&format!("uneven, seed {seed}"), &judged, 1.05);
        }
        // of three frames alone what the states share is the only check of steps
        for judged in measured(&taken("uneven", &uneven(3), seed)) {
            assert!((judged.sd_ratio - 1.0).abs() < 0.15, "{judged:?}");
            assert!(judged.over_floor < 1.15 && judged.off == 0, "{judged:?}");
        }
    }
}
