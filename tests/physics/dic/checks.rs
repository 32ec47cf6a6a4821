//! The simulator against closed forms: maps written out by hand, first-order formulas at small angles, Hooke's law, plate theory.

use std::collections::{BTreeSet, HashMap};

use plychain::infer::Model;

use super::bending::Bent;
use super::camera::{Exposure, Motion, Picture, Pinhole};
use super::cases::{Kind, ON_LAMINATE, ON_STEEL, campaign, case};
use super::causes::{Cause, Law};
use super::folder::{SERIES, SINGLE};
use super::mechanics::{Loaded, Specimen, hold};
use super::ordinary::{ORDINARY, ordinary};
use super::series::Series;
use super::subsets::Shape;

const POINTS: [[f64; 2]; 4] = [[12.0, 0.5], [-9.0, 11.0], [3.0, -21.0], [0.0, 7.0]];

const PINHOLE: Pinhole = Pinhole {
    distance_mm: 500.0,
    principal_mm: [4.0, -7.0],
};

/// What is reported of a point of a specimen that does not strain.
fn reported(motion: &Motion, picture: Picture, p: [f64; 2]) -> [f64; 2] {
    let x = picture.true_point(p);
    let place = Exposure::new(motion, PINHOLE, picture).place([x[0], x[1], 0.0]);
    [place[0] - p[0], place[1] - p[1]]
}

fn close(a: [f64; 2], b: [f64; 2], tolerance: f64) {
    assert!(
        (0..2).all(|k| (a[k] - b[k]).abs() < tolerance),
        "{a:?}, expected {b:?} to {tolerance}"
    );
}

/// 0.3 % at 12 mm and 5 mm of translation, with a rotation: tens of micrometres that are no rigid motion.
#[test]
fn a_rigid_motion_through_a_lens_is_the_exact_map() {
    let k1 = 3e-3 / 144.0;
    let (center, shift, angle) = ([2.0, -3.0], [4.0, 3.0], 2e-3_f64);
    let motion = Motion {
        shift_mm: shift,
        angle_rad: angle,
        ..Motion::default()
    };
    let picture = Picture {
        k1_per_mm2: k1,
        lens_mm: center,
        ..Picture::default()
    };
    let lens = |[x, y]: [f64; 2]| {
        let d = [x - center[0], y - center[1]];
        let factor = 1.0 + k1 * (d[0] * d[0] + d[1] * d[1]);
        [center[0] + factor * d[0], center[1] + factor * d[1]]
    };
    let (s, c) = angle.sin_cos();
    let mut most = 0.0_f64;
    for [x, y] in POINTS {
        let moved = [c * x - s * y + shift[0], s * x + c * y + shift[1]];
        let (before, after) = (lens([x, y]), lens(moved));
        let expected = [after[0] - before[0], after[1] - before[1]];
        close(reported(&motion, picture, before), expected, 1e-11);
        let rigid = [moved[0] - x, moved[1] - y];
        most = most.max((expected[0] - rigid[0]).hypot(expected[1] - rigid[1]));
    }
    assert!((0.02..0.2).contains(&most), "{most} mm");
}

/// u = (X - c) z / Z with z = w + ax y - ay x, and what is left falls to a quarter with half the motion.
#[test]
fn small_motions_out_of_the_plane_follow_the_first_order() {
    let left = |size: f64| {
        let (w, [ax, ay]) = (size * 0.3, [size * 2e-3, size * -3e-3]);
        let motion = Motion {
            rise_mm: w,
            turn_rad: [ax, ay],
            ..Motion::default()
        };
        let mut most = 0.0_f64;
        for p in POINTS {
            let z = w + ax * p[1] - ay * p[0];
            let u = reported(&motion, Picture::default(), p);
            for k in 0..2 {
                let first = (p[k] - PINHOLE.principal_mm[k]) * z / PINHOLE.distance_mm;
                most = most.max((u[k] - first).abs());
            }
        }
        most
    };
    let (whole, half) = (left(1.0), left(0.5));
    assert!((3.8..4.2).contains(&(whole / half)), "{whole} {half}");
    // a point that comes nearer moves away from the principal point by far more than what is left
    assert!(whole < 2e-4, "{whole}");
}

#[test]
fn a_turn_keeps_its_pivot_where_it_is() {
    let motion = Motion {
        turn_rad: [3e-3, -2e-3],
        pivot_mm: [3.0, -21.0],
        ..Motion::default()
    };
    close(
        reported(&motion, Picture::default(), [3.0, -21.0]),
        [0.0; 2],
        1e-12,
    );
}

/// Each of the picture's maps as the dictionary states it, to first order in the displacement: M' u.
#[test]
fn the_picture_is_what_the_dictionary_states() {
    let plain = Picture::default();
    let u = [1e-4, -2e-4];
    let motion = Motion {
        shift_mm: u,
        ..Motion::default()
    };
    let p = [6.0, -4.0];
    let magnified = Picture {
        magnification_percent: 2.0,
        ..plain
    };
    close(reported(&motion, magnified, p), u.map(|u| 1.02 * u), 1e-12);
    let turned = Picture {
        rotation_deg: 90.0,
        ..plain
    };
    // counter-clockwise: (ux, uy) becomes (-uy, ux); the picture of (x, y) is at (-y, x)
    close(turned.reported(p), [4.0, 6.0], 1e-12);
    let place = Exposure::new(&motion, PINHOLE, turned).place([p[0], p[1], 0.0]);
    close([place[0] - 4.0, place[1] - 6.0], [-u[1], u[0]], 1e-12);
    let shifted = Picture {
        offset_mm: [0.3, -0.1],
        ..plain
    };
    close(shifted.true_point(p), [5.7, -3.9], 1e-12);
    close(reported(&motion, shifted, p), u, 1e-12);
    // true X = X (1 - (a x + b y)): what is left is quadratic in the tilt
    let tilted = Picture {
        tilt_per_mm: [1e-4, -2e-4],
        ..plain
    };
    let scale = 1.0 - (1e-4 * p[0] - 2e-4 * p[1]);
    close(tilted.true_point(p), p.map(|p| p * scale), 2e-5);
    // true X = X (1 - k r^2)
    let lens = Picture {
        k1_per_mm2: 1e-5,
        ..plain
    };
    let scale = 1.0 - 1e-5 * 52.0;
    close(lens.true_point(p), p.map(|p| p * scale), 1e-5);
    let all = Picture {
        tilt_per_mm: [1e-4, -2e-4],
        k1_per_mm2: 2e-5,
        decentring_per_mm: [2e-5, -1e-5],
        lens_mm: [3.0, 1.0],
        rotation_deg: 1.5,
        magnification_percent: -2.0,
        offset_mm: [0.2, 0.1],
    };
    for p in POINTS {
        close(all.reported(all.true_point(p)), p, 1e-12);
    }
}

fn steel(diameter_mm: f64, width_mm: f64) -> Loaded {
    Loaded {
        specimen: Specimen {
            diameter_mm,
            width_mm,
            ..Specimen::steel()
        },
        constants: vec![200.0, 0.3],
        thickness_mm: 2.0,
        effects: Vec::new(),
        stiffness: None,
        finer: 0.3,
    }
}

/// Goodier: beside a small hole in a wide thin plate the moment is (5 + 3 nu) / (3 + nu) times that far off. Along the hole's edge at the
/// ends of the diameter across the load only that moment acts: its curvature is that many times the gross one.
#[test]
fn a_bent_plate_has_the_stress_concentration_of_plate_theory() {
    let bent = Bent::new(&steel(8.0, 100.0));
    let nu = 0.3;
    let (_, _, [xx, yy, _]) = bent.jet([4.0, 0.0]);
    // M_y / D over the gross M_y / D = 1 - nu^2
    let moment = -(yy + nu * xx) / (1.0 - nu * nu);
    let expected = (5.0 + 3.0 * nu) / (3.0 + nu);
    assert!((moment / expected - 1.0).abs() < 0.02, "{moment}");
    // far off, the gross curvature and its counterpart across
    let (_, slope, _) = bent.jet([0.0, 90.0]);
    assert!((slope[1] / -90.0 - 1.0).abs() < 0.02, "{slope:?}");
}

#[test]
fn expansion_follows_laminate_theory() {
    let [along, across] = [-0.2e-6, 32e-6];
    let laminate = |layup: Vec<f64>| Loaded {
        specimen: Specimen {
            layup_deg: Some(layup),
            ..Specimen::laminate()
        },
        constants: vec![150.0, 8.0, 0.33, 4.8],
        ..steel(8.0, 20.0)
    };
    let near = |found: [f64; 3], expected: [f64; 3]| {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-15, "{found:?}, expected {expected:?}");
        }
    };
    // fibres along the load, along y
    near(laminate(vec![0.0]).expansion_per_k(), [across, along, 0.0]);
    near(laminate(vec![90.0]).expansion_per_k(), [along, across, 0.0]);
    let (e1, e2, nu) = (150.0, 8.0, 0.33);
    let d = 1.0 - nu * nu * e2 / e1;
    let q = [e1 / d, nu * e2 / d, e2 / d];
    let both =
        (q[0] * along + q[1] * (along + across) + q[2] * across) / (q[0] + 2.0 * q[1] + q[2]);
    near(
        laminate(vec![0.0, 90.0]).expansion_per_k(),
        [both, both, 0.0],
    );
    near(steel(8.0, 20.0).expansion_per_k(), [12e-6, 12e-6, 0.0]);
}

/// A series on few pixels and few elements.
fn coarse(mut series: Series) -> Series {
    let scale = 4;
    let layout = &mut series.layout;
    layout.pixel_mm *= f64::from(scale);
    layout.side = 7;
    layout.step = 4;
    layout.count = layout.count.map(|n| n / 2);
    series.finer = 0.3;
    series
}

/// Far from the hole the strain is stress over modulus; the frame without load shows the rigid motion alone.
#[test]
fn a_pulled_strip_strains_as_hooke_has_it() {
    let mut series = coarse(case(&Kind::Null, false, 3));
    series.layout.side = 1;
    series.layout.shape = Shape::Constant;
    let half = 0.5 * series.layout.step_mm();
    series.layout.count = [9, 61];
    series.layout.first_mm = [-8.0 * half, -60.0 * half];
    let (filter, frames) = series.exact();
    let at = |frame: usize, p: [f64; 2]| {
        let near = |q: &[f64; 2]| (q[0] - p[0]).hypot(q[1] - p[1]) < 1e-6;
        frames[frame][filter.points.iter().position(near).unwrap()]
    };
    let (top, bottom) = ([0.0, 60.0 * half], [0.0, -60.0 * half]);
    let stretch = at(3, top)[1] - at(3, bottom)[1] - (at(4, top)[1] - at(4, bottom)[1]);
    let force = series.forces_n[3];
    let strain = force / (20.0 * series.thickness_mm * 1e3 * series.constants[0]);
    let ratio = stretch / (strain * 120.0 * half);
    // the hole adds compliance, rotations of the frames take 1e-6 of the length
    assert!((1.0..1.6).contains(&ratio), "{ratio}");
    let ([tx, ty], angle) = series.rigid[4];
    let (s, c) = angle.sin_cos();
    for ([x, y], u) in filter.points.iter().zip(&frames[4]) {
        let expected = [c * x - s * y + tx - x, s * x + c * y + ty - y];
        close(*u, expected, 1e-10);
    }
}

#[test]
fn laws_go_over_the_frames_as_their_names_say() {
    let forces = [500.0, 1000.0, 1500.0, 2000.0, 0.0];
    let near = |law: Law, expected: [f64; 5]| {
        for (a, b) in law.weights(&forces).iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "{law:?}");
        }
    };
    near(Law::Constant, [1.0; 5]);
    near(Law::Load, [0.25, 0.5, 0.75, 1.0, 0.0]);
    near(Law::Seated, [5. / 6., 10. / 11., 0.9375, 20. / 21., 0.0]);
    near(Law::Drift, [0.25, 0.5, 0.75, 1.0, 1.25]);
}

/// Every case of the campaign is its own, and what it draws is within twice the usual size.
#[test]
fn the_campaign_draws_what_it_says() {
    let all = campaign();
    assert!(all.len() > 40, "{}", all.len());
    let mut names = BTreeSet::new();
    for (kind, laminate, seed) in &all {
        let series = case(kind, *laminate, *seed);
        assert!(names.insert(series.name.clone()), "{}", series.name);
        let count = match kind {
            Kind::Null | Kind::Hard(None) => 0,
            Kind::Pair(..) => 2,
            Kind::Many => 10,
            _ => 1,
        };
        assert_eq!(series.causes.len(), count, "{}", series.name);
        assert_eq!(series.truth().len(), count);
        if let Cause::Magnification(percent) = series
            .causes
            .first()
            .unwrap_or(&Cause::Rise(0.0, Law::Load))
        {
            assert!(percent.abs() <= 2.0);
        }
        assert_eq!(
            series.noise.smooth.is_some(),
            matches!(kind, Kind::Hard(_)),
            "{}",
            series.name
        );
    }
    for what in ORDINARY {
        let series = ordinary(what, 100.0, 1);
        assert_eq!(series.forces_n.len(), 1, "{}", series.name);
    }
}

/// A folder has a table a frame, a series and a single field that the program reads; all kinds of causes at once do not disturb it.
#[test]
fn folders_hold_what_a_user_would_have() {
    let mut series = coarse(case(&Kind::Many, true, 11));
    series.causes = vec![
        Cause::Mechanical("hole_size", vec![2.0]),
        Cause::Rise(0.1, Law::Drift),
        Cause::Turn([1.0, -2.0], [3.0, 9.0], Law::Load),
        Cause::UniformStrain([20.0, -30.0, 10.0], Law::Seated),
        Cause::ThermalStrain(5.0, Law::Constant),
        Cause::Lens(0.07, [4.0, 8.0]),
        Cause::Interpolation(0.02),
        Cause::Bending {
            per_m: 0.1,
            lift_mm: 0.05,
        },
    ];
    let observed = series.observed();
    let folder = tempfile::tempdir().unwrap();
    let truth = series.write(&observed, folder.path());
    assert_eq!(truth.effects.len(), series.causes.len());
    assert_eq!(truth.constants[3].0, "G12_GPa");
    let model = Model::load(&folder.path().join(SINGLE)).unwrap();
    let field = model.read_field().unwrap();
    assert!(field.points.len() > observed.points.len() * 9 / 10);
    let text = std::fs::read_to_string(folder.path().join(SERIES)).unwrap();
    let series_model: serde_json::Value = serde_json::from_str(&text).unwrap();
    let steps = series_model["experiments"][0]["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 5);
    assert_eq!(steps[4]["file"], "unloaded.csv");
    assert_eq!(steps[4]["force_N"], 0.0);
    for step in steps {
        let file = folder.path().join(step["file"].as_str().unwrap());
        let rows = std::fs::read_to_string(file).unwrap().lines().count();
        assert_eq!(rows, observed.points.len() + 1);
    }
}

/// What acts in each case of the campaign, beyond rigid motion, is there, and not beyond all measure.
#[test]
#[ignore = "half a hundred series, half a minute"]
fn what_acts_is_as_large_as_it_should_be() {
    let mut faults = Vec::new();
    for (kind, laminate, seed) in campaign() {
        let series = coarse(case(&kind, laminate, seed));
        if series.causes.is_empty() {
            continue;
        }
        let nothing = Series {
            causes: Vec::new(),
            ..series.clone()
        };
        let (with, without) = (series.exact(), nothing.exact());
        // an effect that moves the hole's edge changes which subsets are whole
        let place = |p: &[f64; 2]| p.map(|p| (p * 1e4).round() as i64);
        let known: HashMap<_, _> = without.0.points.iter().map(place).zip(0..).collect();
        let pairs = with.0.points.iter().enumerate();
        let pairs = pairs.filter_map(|(i, p)| Some((i, *known.get(&place(p))?)));
        let pairs: Vec<(usize, usize)> = pairs.collect();
        let rms = (0..series.forces_n.len()).map(|k| {
            let points: Vec<[f64; 2]> = pairs.iter().map(|(i, _)| with.0.points[*i]).collect();
            let change =
                |&(i, j): &(usize, usize)| [0, 1].map(|c| with.1[k][i][c] - without.1[k][j][c]);
            let mut u: Vec<[f64; 2]> = pairs.iter().map(change).collect();
            hold(&points, &mut u);
            1e3 * (u.iter().flatten().map(|u| u * u).sum::<f64>() / (2 * u.len()) as f64).sqrt()
        });
        let rms: Vec<f64> = rms.collect();
        println!("{}: {rms:.3?} um", series.name);
        let most = rms.iter().copied().fold(0.0, f64::max);
        if !(0.02..100.0).contains(&most) {
            faults.push(series.name);
        }
    }
    assert!(faults.is_empty(), "{faults:?}");
}

/// Every effect of the dictionary is among the causes that are drawn here, or stands below with where it is simulated instead: an effect that is
/// new to the dictionary has to be put into one of the lists.
#[test]
fn every_effect_is_drawn_here_or_simulated_elsewhere() {
    let elsewhere = |name: &str| match name {
        "rigid_translation" | "rigid_rotation" => "in every series",
        "interpolation_bias" => "in the campaign, without a law",
        "phase_shift_error" | "fringe_order_jump" => {
            "fringes: unit effect::recording, phase, jumps"
        }
        "load_introduction_1" | "load_introduction_2" => "meshes: imported::introduction",
        "yielding" => "metal beyond its yield stress: yielding",
        "subset_size" => "loops: subsets that are larger than declared",
        "ply_share_1" | "ply_share_2" | "balanced_misorientation" => "layup",
        "load_scale" => "every series has its own error of the force",
        "width_error" => "mechanics, posterior",
        "force_offset" | "residual_load" | "softening" | "hysteresis" => "load_mistakes",
        "thermal_gradient" | "component_sensitivity" | "fibre_nonlinearity" | "anisotropy" => {
            "every_effect"
        }
        ply if ply.starts_with("single_ply_misorientation") => "every_effect",
        step if step.starts_with("step_force") => "load_mistakes",
        _ => "",
    };
    let drawn: Vec<&str> = ON_LAMINATE.iter().chain(&ON_STEEL).copied().collect();
    for effect in plychain::effect::EFFECTS {
        let name = effect.name();
        let known = [drawn.contains(&name), !elsewhere(name).is_empty()];
        assert_eq!(known.iter().filter(|k| **k).count(), 1, "{name}");
    }
}
