//! Strain that the load does not cause: expansion, uniform strain, bending of the face.

use super::*;

#[test]
fn a_uniform_strain_is_given_in_the_datas_axes() {
    for axis in [Axis::X, Axis::Y] {
        let scene = scene(axis, &[0.0], FRINGES);
        let u = effect("uniform_strain").displacement(
            &[10.0, -20.0, 5.0],
            &scene,
            scene.frame.vector([2.0, 3.0]),
        );
        // ux = exx x + exy y, uy = exy x + eyy y
        close(
            scene.frame.vector(u),
            [35e-6, -50e-6],
            1e-18,
            "uniform strain",
        );
    }
}

#[test]
fn free_expansion_follows_laminate_theory() {
    let ply = scene(Axis::X, &[0.0], None).ply;
    let check = |angles: &[f64], alpha: [f64; 2], expected: [f64; 3]| {
        let angles: Vec<f64> = angles.iter().map(|a| a.to_radians()).collect();
        let strain = free_expansion(&ply, &angles, alpha);
        for k in 0..3 {
            assert!(
                (strain[k] - expected[k]).abs() < 1e-18,
                "{angles:?}: {strain}, expected {expected:?}"
            );
        }
    };
    // A ply that expands alike in all directions makes a laminate that does.
    check(&[30.0, -10.0, 80.0], [7e-6; 2], [7e-6, 7e-6, 0.0]);
    check(&[0.0; 4], EXPANSION, [EXPANSION[0], EXPANSION[1], 0.0]);
    check(&[90.0], EXPANSION, [EXPANSION[1], EXPANSION[0], 0.0]);
    // A ply at 30 degrees: the strain of its own axes, seen from the laminate's.
    let (s, c) = 30f64.to_radians().sin_cos();
    let [a1, a2] = EXPANSION;
    check(
        &[30.0],
        EXPANSION,
        [
            c * c * a1 + s * s * a2,
            s * s * a1 + c * c * a2,
            2.0 * s * c * (a1 - a2),
        ],
    );
    // Cross-ply: both directions alike, from the balance of the two plies' forces.
    let q = ply.stiffness();
    let (q11, q12, q22) = (q[(0, 0)], q[(0, 1)], q[(1, 1)]);
    let cross = (q11 * a1 + q12 * (a1 + a2) + q22 * a2) / (q11 + 2.0 * q12 + q22);
    check(&[0.0, 90.0], EXPANSION, [cross, cross, 0.0]);
}

#[test]
fn thermal_strain_is_the_laminates_expansion() {
    let scene = scene(Axis::Y, &[0.0], None);
    let u = effect("thermal_strain").displacement(&[2.0], &scene, [3.0, -5.0]);
    close(
        u,
        [2.0 * EXPANSION[0] * 3.0, -2.0 * EXPANSION[1] * 5.0],
        1e-18,
        "[0]",
    );
    let mut unknown = scene.clone();
    unknown.expansion_per_k = None;
    let reason = effect("thermal_strain").why_not(&unknown).unwrap();
    assert!(reason.contains("expansion_per_K"));
    assert!(effect("thermal_strain").why_not(&scene).is_none());
}

/// Strains (e1, e2, gamma12) of an additive effect by central differences, exact for quadratic fields.
fn strains(effect: &dyn Effect, amplitude: &[f64], scene: &Scene, [s, t]: [f64; 2]) -> [f64; 3] {
    let h = 0.5;
    let d = |axis: usize| {
        let mut step = [0.0; 2];
        step[axis] = h;
        let at = |sign: f64| {
            effect.displacement(amplitude, scene, [s + sign * step[0], t + sign * step[1]])
        };
        let (high, low) = (at(1.0), at(-1.0));
        [0, 1].map(|c| (high[c] - low[c]) / (2.0 * h))
    };
    let (ds, dt) = (d(0), d(1));
    [ds[0], dt[1], dt[0] + ds[1]]
}

/// The strains of the face are those of D^-1 (M, 0, 0), for balanced and unbalanced stacks. Where the moment grows along the load, that
/// holds on the middle line, whose sides it leaves free: no M2, and a twisting moment that is constant along them. The face moves by the
/// deflection's gradient, which has no curl.
#[test]
fn bending_out_of_the_plane_strains_the_surface_as_plate_theory_has_it() {
    let bending = effect("out_of_plane_bending");
    for layup in [
        vec![45.0, -45.0, 0.0, 0.0, -45.0, 45.0],
        vec![30.0, 10.0, 10.0, 30.0],
        vec![90.0],
    ] {
        let scene = scene(Axis::Y, &layup, FRINGES);
        let h = scene.setup.thickness;
        let d = abd(&scene.ply, &scene.setup.angles, h).d;
        let moment = |amplitude: &[f64], p| {
            let e = strains(bending, amplitude, &scene, p);
            d * nalgebra::Vector3::new(e[0], e[1], e[2]) * (2.0 / h)
        };
        for (amplitude, at_hole, slope) in [([0.025, 0.0], 25e-6, 0.0), ([0.0, 0.003], 0.0, 3e-6)] {
            for [s, t] in POINTS {
                let kappa1 = at_hole + slope * s;
                let middle = strains(bending, &amplitude, &scene, [s, 0.0]);
                assert!(
                    (middle[0] - 0.5 * h * kappa1).abs() < 1e-14,
                    "{layup:?}: strain {} along the load, curvature {kappa1} per mm",
                    middle[0]
                );
                let size = d[(0, 0)] * 25e-6 * 1e-8;
                let [here, there] = [s, s + 1.0].map(|s| moment(&amplitude, [s, t]));
                assert!(here[1].abs() < size, "{layup:?}: moments {here}");
                assert!(
                    (here[2] - there[2]).abs() < size,
                    "{layup:?}: {here} {there}"
                );
                if slope == 0.0 || t == 0.0 {
                    assert!(here[2].abs() < size, "{layup:?}: moments {here}");
                }
                let at = |s: f64, t: f64| bending.displacement(&amplitude, &scene, [s, t]);
                let curl =
                    at(s + 0.5, t)[1] - at(s - 0.5, t)[1] - at(s, t + 0.5)[0] + at(s, t - 0.5)[0];
                assert!(curl.abs() < 1e-14, "{layup:?}: curl {curl}");
            }
        }
    }
}
