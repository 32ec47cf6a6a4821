//! Closed-form, optical and recorded effects: maps and their inverses, expansions at small amplitude, compatible
//! strains, laminate theory, and the same physics whichever axis carries the load.

mod recording;
mod strain;

use nalgebra::Vector3;
use plychain::effect::{
    Acting, EFFECTS, Effect, Kind, Scene, Seen, amplitude_name, find, recorded_column,
};
use plychain::fem::Setup;
use plychain::field::rigid::RigidMotion;
use plychain::field::{Axis, Frame};
use plychain::laminate::{
    HoleSpec, LoadSpec, Material, MeanSd, Ply, SpecimenSpec, abd, free_expansion,
};

const FRINGES: Option<f64> = Some(2400.0);
const EXPANSION: [f64; 2] = [-0.2e-6, 32e-6];
const CENTER: [f64; 2] = [3.0, -2.0];

const POINTS: [[f64; 2]; 5] = [
    [5.0, 3.0],
    [-7.0, 11.0],
    [0.4, -9.0],
    [-2.0, -6.0],
    [11.5, 0.0],
];

fn effect(name: &str) -> &'static dyn Effect {
    find("test", name).unwrap()
}

fn scene(loading_axis: Axis, layup: &[f64], fringes: Option<f64>) -> Scene {
    let frame = Frame {
        loading_axis,
        hole_center_mm: CENTER,
    };
    let specimen = SpecimenSpec {
        length_mm: 200.0,
        width_mm: 25.0,
        hole: Some(HoleSpec {
            diameter_mm: 4.0,
            center_mm: [0.0, 0.0],
        }),
        layup_deg: Some(layup.to_vec()),
        thickness_mm: MeanSd {
            mean: 0.78,
            sd: 0.0,
        },
        clamp: None,
        note: None,
    };
    Scene {
        frame,
        setup: Setup::nominal(&specimen, &LoadSpec { force_n: 700.0 }, frame.handedness()),
        ply: Ply {
            e1: 140e3,
            e2: 7.9e3,
            nu12: 0.33,
            g12: 5e3,
        },
        fringe_frequency_per_mm: fringes,
        expansion_per_k: Some(EXPANSION),
        material: Material::Ply,
        camera_distance_mm: None,
        pixel_mm: None,
        subset_mm: None,
        solved_elsewhere: false,
        middle: [0.0; 2],
        declared_loads: Vec::new(),
    }
}

/// A smooth displacement (ux, uy) in mm at (x, y) from the hole's centre in the data's axes.
fn field([x, y]: [f64; 2]) -> [f64; 2] {
    [
        1e-3 * x - 4e-4 * y + 3e-5 * x * y + 2e-6 * y * y * y,
        5e-4 * x + 8e-4 * y - 2e-5 * x * x + 1e-6 * x * y * y,
    ]
}

/// Its gradient, [component][axis].
fn gradient([x, y]: [f64; 2]) -> [[f64; 2]; 2] {
    [
        [1e-3 + 3e-5 * y, -4e-4 + 3e-5 * x + 6e-6 * y * y],
        [5e-4 - 4e-5 * x + 1e-6 * y * y, 8e-4 + 2e-6 * x * y],
    ]
}

/// What an optical effect reports of [`field`] at the reported (x, y) from the hole's centre, in the data's axes.
fn reported(
    effect: &'static dyn Effect,
    amplitude: &[f64],
    scene: &Scene,
    xy: [f64; 2],
) -> [f64; 2] {
    reported_of(effect, amplitude, scene, xy, 1.0)
}

/// The same of the field times a factor.
fn reported_of(
    effect: &'static dyn Effect,
    amplitude: &[f64],
    scene: &Scene,
    xy: [f64; 2],
    factor: f64,
) -> [f64; 2] {
    let vector = |v| scene.frame.vector(v);
    let acting = [Acting {
        effect,
        amplitude: amplitude.to_vec(),
    }];
    let camera = Seen::new(&acting, scene);
    let point = vector(xy);
    let u = field(vector(camera.true_point(point))).map(|u| factor * u);
    vector(camera.report(point, vector(u)))
}

fn close(a: [f64; 2], b: [f64; 2], tolerance: f64, what: &str) {
    assert!(
        (0..2).all(|k| (a[k] - b[k]).abs() <= tolerance),
        "{what}: {a:?} and {b:?} differ by more than {tolerance}"
    );
}

fn turned(angle: f64, [x, y]: [f64; 2]) -> [f64; 2] {
    let (s, c) = angle.sin_cos();
    [c * x - s * y, s * x + c * y]
}

/// An optical effect with an amplitude and its forward map, true to reported, as the dictionary states it.
type Forward = (&'static str, Vec<f64>, fn(&[f64], [f64; 2]) -> [f64; 2]);

/// Solve reported = X for the two effects that are stated from reported to true, by fixed-point iteration.
fn forward_of(scale: impl Fn([f64; 2]) -> f64, x: [f64; 2]) -> [f64; 2] {
    let mut reported = x;
    for _ in 0..200 {
        let s = scale(reported);
        reported = [x[0] / s, x[1] / s];
    }
    reported
}

fn forward_maps() -> Vec<Forward> {
    vec![
        ("registration_offset", vec![0.3, -0.2], |a, [x, y]| {
            [x + a[0], y + a[1]]
        }),
        ("camera_rotation", vec![7.0], |a, x| {
            turned(a[0].to_radians(), x)
        }),
        ("magnification", vec![1.5], |a, x| {
            x.map(|x| x * (1.0 + a[0] / 100.0))
        }),
        ("camera_tilt", vec![4e-4, -2e-4], |a, x| {
            forward_of(|[x, y]| 1.0 - (a[0] * x + a[1] * y), x)
        }),
        ("lens_distortion", vec![0.9, 0.0, 0.0], |a, x| {
            forward_of(|[x, y]| 1.0 - a[0] / 100.0 * (x * x + y * y) / 144.0, x)
        }),
    ]
}

#[test]
fn true_points_invert_the_stated_maps() {
    let optical = EFFECTS.iter().filter(|e| e.kind() == Kind::Optical).count();
    // two change what is seen, not where, and two move the specimen out of its plane
    assert_eq!(optical, forward_maps().len() + 4);
    for axis in [Axis::X, Axis::Y] {
        let scene = scene(axis, &[0.0], FRINGES);
        for (name, amplitude, forward) in forward_maps() {
            for truth in POINTS {
                let seen = scene.frame.vector(forward(&amplitude, truth));
                let back = effect(name).true_point(&amplitude, &scene, seen);
                close(scene.frame.vector(back), truth, 1e-12, name);
            }
        }
    }
}

/// Displacements from image coordinates are differences of reported places, forward(X + U) - forward(X), of any size.
#[test]
fn displacements_from_image_coordinates_follow_the_map() {
    for axis in [Axis::X, Axis::Y] {
        let scene = scene(axis, &[0.0], None);
        let vector = |v| scene.frame.vector(v);
        for (name, amplitude, forward) in forward_maps() {
            for truth in POINTS {
                let u = [0.7, -1.2];
                let start = forward(&amplitude, truth);
                let end = forward(&amplitude, [truth[0] + u[0], truth[1] + u[1]]);
                let expected = [end[0] - start[0], end[1] - start[1]];
                let acting = [Acting {
                    effect: effect(name),
                    amplitude: amplitude.clone(),
                }];
                let seen = Seen::new(&acting, &scene).report(vector(start), vector(u));
                close(vector(seen), expected, 1e-11, name);
            }
        }
    }
}

/// Reported minus true field to first order: -(grad u) xi + (grad xi) u, with xi = reported - true place; the second
/// term is there for image coordinates, and for a rotation also for fringes. What is left is quadratic in the amplitude.
#[test]
fn small_amplitudes_follow_the_gradient_expansion() {
    type Shift = fn([f64; 2]) -> ([f64; 2], [[f64; 2]; 2]);
    // so that the square of the displacement does not count
    const SMALL: f64 = 1e-4;
    // The field xi and its gradient for one unit of the first parameter.
    let cases: [(&str, f64, bool, Shift); 6] = [
        ("registration_offset", 0.05, false, |_| {
            ([1.0, 0.0], [[0.0; 2]; 2])
        }),
        ("camera_rotation", 0.3, true, |[x, y]| {
            let w = 1f64.to_radians();
            ([-w * y, w * x], [[0.0, -w], [w, 0.0]])
        }),
        ("magnification", 0.5, false, |[x, y]| {
            ([0.01 * x, 0.01 * y], [[0.01, 0.0], [0.0, 0.01]])
        }),
        ("camera_tilt", 1e-4, false, |[x, y]| {
            ([x * x, x * y], [[2.0 * x, 0.0], [y, x]])
        }),
        ("lens_distortion", 0.3, false, |[x, y]| {
            let k = 0.01 / 144.0;
            let r2 = x * x + y * y;
            (
                [k * r2 * x, k * r2 * y],
                [
                    [k * (r2 + 2.0 * x * x), 2.0 * k * x * y],
                    [2.0 * k * x * y, k * (r2 + 2.0 * y * y)],
                ],
            )
        }),
        ("registration_offset", -0.05, false, |_| {
            ([1.0, 0.0], [[0.0; 2]; 2])
        }),
    ];
    for fringes in [FRINGES, None] {
        for axis in [Axis::X, Axis::Y] {
            let scene = scene(axis, &[0.0], fringes);
            for (name, size, both, shift) in cases {
                let effect = effect(name);
                let left = |size: f64| {
                    let mut amplitude = vec![0.0; effect.parameters().len()];
                    amplitude[0] = size;
                    let mut sum = 0.0;
                    for p in POINTS {
                        let u = field(p).map(|u| SMALL * u);
                        let g = gradient(p).map(|g| g.map(|g| SMALL * g));
                        let (xi, dxi) = shift(p);
                        let seen = reported_of(effect, &amplitude, &scene, p, SMALL);
                        for c in 0..2 {
                            let moved = -(g[c][0] * xi[0] + g[c][1] * xi[1]);
                            let pushed = dxi[c][0] * u[0] + dxi[c][1] * u[1];
                            let pushed = if both || fringes.is_none() {
                                pushed
                            } else {
                                0.0
                            };
                            let rest = seen[c] - u[c] - size * (moved + pushed);
                            sum += rest * rest;
                        }
                    }
                    sum.sqrt()
                };
                let ratio = left(size) / left(size / 2.0);
                assert!(
                    (3.5..4.5).contains(&ratio),
                    "{name}, fringes {fringes:?}: halving leaves 1/{ratio} of the rest"
                );
            }
        }
    }
}

#[test]
fn a_quarter_turn_of_the_camera_is_exact() {
    let rotation = effect("camera_rotation");
    for axis in [Axis::X, Axis::Y] {
        let scene = scene(axis, &[0.0], FRINGES);
        for [x, y] in POINTS {
            // Reported (x, y) is the image of the true (y, -x), and (ux, uy) there becomes (-uy, ux).
            let [ux, uy] = field([y, -x]);
            close(
                reported(rotation, &[90.0], &scene, [x, y]),
                [-uy, ux],
                1e-15,
                "quarter turn",
            );
        }
    }
}

/// The same specimen, measured once with the load along x and once along y: the second picture is the first turned by a
/// quarter, although its (direction 1, direction 2) is left-handed.
#[test]
fn physics_does_not_depend_on_the_axis_of_the_load() {
    // Amplitudes along x, and what the same is along y: (x, y) of the first picture is (-y, x) of the second.
    let cases: [(&str, &[f64], &[f64]); 12] = [
        ("rigid_translation", &[2.0, 3.0], &[-3.0, 2.0]),
        ("rigid_rotation", &[50.0], &[50.0]),
        ("uniform_strain", &[10.0, -20.0, 5.0], &[-20.0, 10.0, -5.0]),
        ("thermal_strain", &[3.0], &[3.0]),
        ("out_of_plane_bending", &[0.02, 0.001], &[0.02, 0.001]),
        ("registration_offset", &[0.3, -0.1], &[0.1, 0.3]),
        ("camera_rotation", &[4.0], &[4.0]),
        ("magnification", &[1.0], &[1.0]),
        ("camera_tilt", &[2e-4, 3e-4], &[-3e-4, 2e-4]),
        ("lens_distortion", &[0.5, 2.0, 1.0], &[0.5, 2.0, -1.0]),
        (
            "phase_shift_error",
            &[10.0, 0.0, 3.0, 0.0],
            &[10.0, 0.0, 3.0, 0.0],
        ),
        (
            "fringe_order_jump",
            &[1.0, 2.0, 4.0, -2.0, 6.0],
            // The disc's centre lies at (1, 0) from the hole's centre, which stays where it is.
            &[-2.0, 1.0, 3.0, -1.0, 6.0],
        ),
    ];
    let quarter = |[x, y]: [f64; 2]| [-y, x];
    for fringes in [FRINGES, None] {
        let along_x = scene(Axis::X, &[30.0, -10.0, 0.0], fringes);
        let along_y = scene(Axis::Y, &[30.0, -10.0, 0.0], fringes);
        for (name, a, b) in cases {
            let effect = effect(name);
            let seen = |amplitude: &[f64], scene: &Scene, xy: [f64; 2], u: [f64; 2]| {
                let vector = |v| scene.frame.vector(v);
                let (p, u) = (vector(xy), vector(u));
                match effect.kind() {
                    Kind::Additive => vector(effect.displacement(amplitude, scene, p)),
                    Kind::Optical => {
                        let place = vector(effect.true_point(amplitude, scene, p));
                        let u = vector(effect.components(amplitude, scene, p, u));
                        [place[0] + u[0], place[1] + u[1]]
                    }
                    _ => vector(effect.recorded(amplitude, scene, p, u)),
                }
            };
            for p in POINTS {
                // A sine is odd, so that the ripple turns with its component.
                let u = field(p);
                let first = seen(a, &along_x, p, u);
                let second = seen(b, &along_y, quarter(p), quarter(u));
                close(second, quarter(first), 1e-11, name);
            }
        }
    }
}

/// Whatever the kind, no amplitude means no change, names are unique, and the box of three plausible sizes lies within the bound.
#[test]
fn every_effect_of_no_size_does_nothing() {
    let mut names = Vec::new();
    for effect in EFFECTS {
        let scene = scene(Axis::Y, &[30.0, 0.0], FRINGES);
        let zero = vec![0.0; effect.parameters().len()];
        for p in POINTS {
            let u = field(p);
            close(
                effect.displacement(&zero, &scene, p),
                [0.0; 2],
                0.0,
                effect.name(),
            );
            close(effect.true_point(&zero, &scene, p), p, 0.0, effect.name());
            close(
                effect.components(&zero, &scene, p, u),
                u,
                0.0,
                effect.name(),
            );
            close(effect.recorded(&zero, &scene, p, u), u, 0.0, effect.name());
        }
        for parameter in effect.parameters() {
            names.push(amplitude_name(*effect, parameter));
            if let Some(sd) = parameter.prior_sd {
                assert!(sd > 0.0 && 3.0 * sd <= parameter.bound, "{}", effect.name());
            }
        }
    }
    let count = names.len();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), count);
}

/// A lens about a point far from the origin, under a millimetre of rigid motion: tens of micrometres, by the exact map of the moved
/// point. The origin stays where it is reported.
#[test]
fn a_lens_sees_rigid_motion() {
    let mut scene = scene(Axis::X, &[0.0], None);
    scene.middle = [4.0, -3.0];
    let amplitude = vec![0.3, 2.0, 1.0];
    let lens = effect("lens_distortion");
    let acting = [Acting {
        effect: lens,
        amplitude: amplitude.clone(),
    }];
    let motion = RigidMotion {
        shift: [3.0, 4.0],
        angle: 2e-3,
        own: 0.0,
        center: [1.0, 1.0],
    };
    let camera = Seen::new(&acting, &scene).moved(motion);
    close(
        lens.true_point(&amplitude, &scene, [0.0; 2]),
        [0.0; 2],
        1e-15,
        "origin",
    );
    let center = [6.0, -2.0];
    let k = 0.003 / 144.0;
    // the forward map by bisection along the ray from the lens' centre, on which a point stays
    let imaged = |x: [f64; 2]| {
        let d = [x[0] - center[0], x[1] - center[1]];
        let r = d[0].hypot(d[1]);
        let (mut low, mut high) = (0.0, 2.0 * r);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if middle * (1.0 - k * middle * middle) < r {
                low = middle
            } else {
                high = middle
            }
        }
        [0, 1].map(|i| center[i] + d[i] * low / r)
    };
    let corner = |p: [f64; 2]| {
        let d = [p[0] - center[0], p[1] - center[1]];
        let scale = 1.0 - k * (d[0] * d[0] + d[1] * d[1]);
        [0, 1].map(|i| center[i] + d[i] * scale)
    };
    let mut largest = 0.0_f64;
    for p in POINTS {
        let u = [2e-3, -1e-3];
        let seen = camera.report(p, u);
        // in coordinates whose origin is the lens' own picture of the hole
        let before = corner(p);
        let origin = corner([0.0; 2]);
        // the specimen moves as it is strained
        let x = [0, 1].map(|i| before[i] - origin[i] + u[i]);
        let (sin, cos) = motion.angle.sin_cos();
        let rigid = [
            motion.shift[0] + (cos - 1.0) * (x[0] - 1.0) - sin * (x[1] - 1.0),
            motion.shift[1] + sin * (x[0] - 1.0) + (cos - 1.0) * (x[1] - 1.0),
        ];
        let after = imaged([0, 1].map(|i| before[i] + u[i] + rigid[i]));
        close(seen, [0, 1].map(|i| after[i] - p[i]), 1e-10, "lens");
        let optical = (seen[0] - u[0] - rigid[0]).hypot(seen[1] - u[1] - rigid[1]);
        largest = largest.max(optical);
    }
    assert!(largest > 0.02, "{largest} mm of distortion");
}

/// A pinhole at a distance Z over the middle of the picture sees a point (X, Y, z) at c + (X - c) Z / (Z - z).
#[test]
fn motion_out_of_the_plane_is_seen_in_perspective() {
    let mut scene = scene(Axis::Y, &[0.0], None);
    scene.camera_distance_mm = Some(500.0);
    scene.middle = [1.0, 2.0];
    let acting = [
        Acting {
            effect: effect("out_of_plane_translation"),
            amplitude: vec![0.4],
        },
        Acting {
            effect: effect("out_of_plane_rotation"),
            amplitude: vec![3.0, -5.0],
        },
    ];
    let motion = RigidMotion {
        shift: [0.3, -0.2],
        angle: 1e-3,
        own: 0.0,
        center: [0.0; 2],
    };
    let camera = Seen::new(&acting, &scene).moved(motion);
    for p in POINTS {
        let (sin, cos) = motion.angle.sin_cos();
        let rigid = [
            0.3 + (cos - 1.0) * p[0] - sin * p[1],
            -0.2 + sin * p[0] + (cos - 1.0) * p[1],
        ];
        let u = [1e-3, 2e-3];
        // the specimen is strained in its own axes, which turn with it
        let own = [cos * u[0] - sin * u[1], sin * u[0] + cos * u[1]];
        let plane = [0, 1].map(|k| p[k] + rigid[k] + own[k]);
        // then it is rotated by the vector a = (3, -5, 0) mrad about axes that stand still, exactly: Rodrigues
        let a: Vector3<f64> = Vector3::new(3e-3, -5e-3, 0.0);
        let x = Vector3::new(plane[0], plane[1], 0.0);
        let turned = nalgebra::Rotation3::new(a) * x + Vector3::new(0.0, 0.0, 0.4);
        let scale = 500.0 / (500.0 - turned[2]);
        let expected =
            [0, 1].map(|k| scene.middle[k] + (turned[k] - scene.middle[k]) * scale - p[k]);
        // third order in the rotation is left out
        close(camera.report(p, u), expected, 1e-6, "perspective");
    }
}

/// A specimen that the load strains and turns to first order, and that moves as a whole besides: what is its own comes back, to rounding, and
/// a strain under its own rotation is no shear. Of a motion alone the strain turns with it.
#[test]
fn a_rotation_that_the_load_causes_turns_no_strain() {
    let center = [1.0, -2.0];
    let (strain, own, besides) = (0.01, 1.3e-3, 4e-3);
    let motion = RigidMotion {
        shift: [0.3, -0.1],
        angle: own + besides,
        own: 0.0,
        center,
    };
    let (sin, cos) = f64::sin_cos(besides);
    for p in [[3.0, 1.0], [-4.0, 5.0], [1.0, -2.0]] {
        let from = [p[0] - center[0], p[1] - center[1]];
        let strained = [strain * p[0], -0.3 * strain * p[1]];
        let turned = [-own * from[1], own * from[0]];
        let place = [0, 1].map(|k| from[k] + strained[k] + turned[k]);
        let moved = [
            cos * place[0] - sin * place[1],
            sin * place[0] + cos * place[1],
        ];
        let u = [0, 1].map(|k| moved[k] - from[k] + motion.shift[k]);
        close(
            motion.with_own(own).released(p, u),
            strained,
            1e-15,
            "released",
        );
        let turned = motion.released(p, u);
        let shear = own * strain * p[0];
        assert!(from == [0.0; 2] || (turned[1] - strained[1]).abs() > 0.1 * shear.abs());
    }
    // no more of a rotation is the load's than there is, and none of one the other way round
    assert_eq!(motion.with_own(1.0).own, motion.angle);
    assert_eq!(motion.with_own(-own).own, 0.0);
}
