//! Classical lamination theory against closed forms and invariants.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use nalgebra::Matrix3;
use plychain::laminate::{Ply, abd, rotate_stiffness};
use proptest::prelude::*;

const PLY: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

fn assert_close(a: &Matrix3<f64>, b: &Matrix3<f64>, scale: f64) {
    assert!((a - b).amax() <= 1e-12 * scale, "{a} {b}");
}

#[test]
fn stiffness_is_symmetric_positive_and_inverts_to_the_engineering_constants() {
    let q = PLY.stiffness();
    assert_eq!(q, q.transpose());
    let s = q.cholesky().unwrap().inverse();
    for (found, expected) in [
        (1.0 / s[(0, 0)], PLY.e1),
        (1.0 / s[(1, 1)], PLY.e2),
        (-s[(0, 1)] / s[(0, 0)], PLY.nu12),
        (1.0 / s[(2, 2)], PLY.g12),
    ] {
        assert!((found / expected - 1.0).abs() < 1e-12);
    }
}

#[test]
fn rotation_by_45_degrees_has_its_textbook_form() {
    let q = PLY.stiffness();
    let r = rotate_stiffness(&q, FRAC_PI_4);
    let [q11, q22, q12, q66] = [q[(0, 0)], q[(1, 1)], q[(0, 1)], q[(2, 2)]];
    let a11 = 0.25 * (q11 + q22 + 2.0 * q12) + q66;
    let a12 = 0.25 * (q11 + q22 + 2.0 * q12) - q66;
    let a16 = 0.25 * (q11 - q22);
    let a66 = 0.25 * (q11 + q22 - 2.0 * q12);
    assert_close(
        &r,
        &Matrix3::new(a11, a12, a16, a12, a11, a16, a16, a16, a66),
        q11,
    );
    let r = rotate_stiffness(&q, FRAC_PI_2);
    assert!((r[(0, 0)] - q22).abs() < 1e-9 && (r[(1, 1)] - q11).abs() < 1e-9);
}

#[test]
fn quasi_isotropic_stack_is_isotropic_in_its_plane() {
    let a = abd(&PLY, &[0.0, PI / 3.0, -PI / 3.0], 1.0).a;
    let scale = a[(0, 0)];
    assert!((a[(0, 0)] - a[(1, 1)]).abs() < 1e-12 * scale);
    assert!((a[(0, 0)] - a[(0, 1)] - 2.0 * a[(2, 2)]).abs() < 1e-12 * scale);
    assert!(a[(0, 2)].abs().max(a[(1, 2)].abs()) < 1e-12 * scale);
}

#[test]
fn one_ply_bends_with_h_cubed_over_12_and_symmetric_stacks_do_not_couple() {
    let q = PLY.stiffness();
    let one = abd(&PLY, &[0.0], 0.8);
    assert_close(&one.d, &(q * (0.8_f64.powi(3) / 12.0)), q[(0, 0)]);
    let stack = abd(&PLY, &[0.7, -0.3, 0.1, 0.1, -0.3, 0.7], 0.78);
    assert!(stack.b.amax() < 1e-12 * stack.a.amax());
    let uneven = abd(&PLY, &[0.0, 0.7], 0.78);
    assert!(uneven.b.amax() > 1e-3 * uneven.a.amax());
}

proptest! {
    #[test]
    fn rotating_back_restores_and_invariants_stay(
        angle in -4.0..4.0_f64, e1 in 20e3..300e3_f64, e2 in 2e3..15e3_f64, nu12 in 0.0..0.5_f64, g12 in 1e3..9e3_f64,
    ) {
        let q = Ply { e1, e2, nu12, g12 }.stiffness();
        let r = rotate_stiffness(&q, angle);
        prop_assert!((rotate_stiffness(&r, -angle) - q).amax() < 1e-12 * e1);
        // Tsai and Pagano: A11 + A22 + 2 A12 and A66 - A12 do not depend on the axes.
        let first = |m: &Matrix3<f64>| m[(0, 0)] + m[(1, 1)] + 2.0 * m[(0, 1)];
        let second = |m: &Matrix3<f64>| m[(2, 2)] - m[(0, 1)];
        prop_assert!((first(&r) - first(&q)).abs() < 1e-12 * 4.0 * e1);
        prop_assert!((second(&r) - second(&q)).abs() < 1e-12 * 4.0 * e1);
    }
}
