//! What the recording of a picture does: fringes, whole orders, grey values.

use super::*;

#[test]
fn magnification_changes_strain_read_from_fringes_only() {
    let magnification = effect("magnification");
    for (fringes, factor) in [(FRINGES, 1.0 / 1.02), (None, 1.0)] {
        let scene = scene(Axis::Y, &[0.0], fringes);
        for p in POINTS {
            let strained = |[s, t]: [f64; 2]| [1e-3 * s, -3e-4 * t];
            let acting = [Acting {
                effect: magnification,
                amplitude: vec![2.0],
            }];
            let camera = Seen::new(&acting, &scene);
            let seen = camera.report(p, strained(camera.true_point(p)));
            close(
                seen,
                strained(p).map(|u| u * factor),
                1e-13,
                "magnification",
            );
        }
    }
}

#[test]
fn a_phase_shift_error_is_a_ripple_at_twice_the_fringe_frequency() {
    let ripple = effect("phase_shift_error");
    let scene = scene(Axis::Y, &[0.0], FRINGES);
    let order = 1.0 / 2400.0;
    let read = |[a, b]: [f64; 2], u: f64| {
        let [u1, u2] = ripple.recorded(&[a, b, a, b], &scene, [0.0; 2], [u, -u]);
        (u1 - u, u2 + u)
    };
    // sin(4 pi f F) is 1 at an eighth of an order, the cosine at whole halves.
    for k in 0..4 {
        let (u1, u2) = read([20.0, 0.0], (0.125 + 0.5 * f64::from(k)) * order);
        assert!((u1 - 20e-6).abs() < 1e-15 && (u2 + 20e-6).abs() < 1e-15);
        let (u1, u2) = read([0.0, 7.0], 0.5 * f64::from(k) * order);
        assert!((u1 - 7e-6).abs() < 1e-15 && (u2 - 7e-6).abs() < 1e-15);
    }
    let points = POINTS.to_vec();
    let smooth: Vec<_> = points.iter().map(|&p| field(p)).collect();
    let columns = [0, 1, 2, 3].map(|k| recorded_column(ripple, k, &scene, &points, &smooth));
    for (i, &u) in smooth.iter().enumerate() {
        let seen = ripple.recorded(&[3.0, -4.0, 5.0, 2.0], &scene, points[i], u);
        let added = |c: usize| -> f64 {
            let columns = columns.iter().zip([3.0, -4.0, 5.0, 2.0]);
            columns.map(|(column, a)| a * column[i][c]).sum()
        };
        let linear = [0, 1].map(|c| u[c] + added(c));
        close(seen, linear, 1e-15, "linear in its amplitudes");
    }
}

#[test]
fn a_jump_adds_whole_orders_inside_its_disc() {
    let jump = effect("fringe_order_jump");
    let scene = scene(Axis::Y, &[0.0], FRINGES);
    let amplitude = [2.0, -1.0, CENTER[0] + 4.0, CENTER[1], 3.0];
    for (xy, inside) in [([4.0, 2.9], true), ([6.9, 0.0], true), ([0.9, 0.0], false)] {
        let u = jump.recorded(&amplitude, &scene, scene.frame.vector(xy), [0.0; 2]);
        let expected = if inside {
            [2.0 / 2400.0, -1.0 / 2400.0]
        } else {
            [0.0; 2]
        };
        close(scene.frame.vector(u), expected, 1e-18, "jump");
    }
    assert!(jump.inadmissible(&amplitude).is_none());
    assert!(jump.inadmissible(&[0.5, 0.0, 0.0, 0.0, 3.0]).is_some());
    assert!(jump.inadmissible(&[1.0, 0.0, 0.0, 0.0, 0.0]).is_some());
}

#[test]
fn effects_on_fringes_need_a_fringe_frequency() {
    for name in ["phase_shift_error", "fringe_order_jump"] {
        for (fringes, can) in [(FRINGES, true), (None, false)] {
            let reason = effect(name).why_not(&scene(Axis::X, &[0.0], fringes));
            assert_eq!(reason.is_none(), can, "{name}");
        }
    }
}

/// Nothing at whole and half pixels, the amplitude a quarter beyond: of the whole displacement along the data's axes.
#[test]
fn the_interpolation_of_grey_values_misreads_parts_of_pixels() {
    let pixel = 0.05;
    for axis in [Axis::X, Axis::Y] {
        let mut scene = scene(axis, &[0.0], None);
        let bias = effect("interpolation_bias");
        assert!(bias.why_not(&scene).unwrap().contains("pixel_mm"));
        scene.pixel_mm = Some(pixel);
        assert!(bias.why_not(&scene).is_none());
        let acting = [Acting {
            effect: bias,
            amplitude: vec![0.02],
        }];
        for (parts, misread) in [
            ([0.0, 0.5], [0.0; 2]),
            ([0.25, -0.75], [1.0, 1.0]),
            ([2.75, 1.0], [-1.0, 0.0]),
        ] {
            let whole = scene.frame.vector(parts.map(|p| p * pixel));
            // most of it is the specimen's motion
            let u = [1e-3, -2e-3];
            let motion = RigidMotion {
                shift: [0, 1].map(|k| whole[k] - u[k]),
                ..RigidMotion::NONE
            };
            let seen = Seen::new(&acting, &scene)
                .moved(motion)
                .report([3.0, 4.0], u);
            let expected = [0, 1].map(|k| parts[k] * pixel + 0.02 * pixel * misread[k]);
            close(scene.frame.vector(seen), expected, 1e-12, "interpolation");
            // the same wave of a displacement that was exported as that
            let wave = bias.exported(&scene, whole).unwrap();
            let expected = misread.map(|share| share * pixel);
            close(scene.frame.vector(wave), expected, 1e-12, "wave");
        }
    }
}
