use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::*;

/// The share of draws in the wedge.
fn counted(mean: Vector2<f64>, covariance: &Matrix2<f64>, weights: [f64; 2]) -> f64 {
    let root = covariance.cholesky().unwrap().l();
    let mut rng = Pcg64::seed_from_u64(1);
    let mut inside = 0;
    for _ in 0..200_000 {
        let z = Vector2::from_fn(|_, _| StandardNormal.sample(&mut rng));
        let x: Vector2<f64> = mean + root * z;
        inside += usize::from(x[0] >= 0.0 && weights[0] * x[0] + weights[1] * x[1] >= 0.0);
    }
    f64::from(u32::try_from(inside).unwrap()) / 200_000.0
}

#[test]
fn a_wedge_has_the_mass_of_its_draws() {
    let weights = [0.26, 0.14];
    let prior = counted(Vector2::zeros(), &Matrix2::identity(), weights);
    let narrow = Matrix2::new(0.16, -0.28, -0.28, 0.62);
    for (mean, tolerance) in [([2.0, 0.0], 0.02), ([0.5, -0.2], 0.3), ([-0.3, -0.2], 1.0)] {
        let mean = Vector2::from(mean);
        let log = (counted(mean, &narrow, weights) / prior).ln();
        let bound = log_in_wedge(mean, &narrow, weights);
        // a bound from above, but for the error of the counts
        assert!(
            log - 0.02 < bound && bound < log + tolerance,
            "{bound} {log}"
        );
    }
}

#[test]
fn amplitudes_far_outside_have_the_exponent_of_the_nearest_point() {
    let far = Vector2::new(-0.75, -0.64);
    let covariance = Matrix2::new(0.16, -0.28, -0.28, 0.62);
    let z2 = far.dot(&(covariance.try_inverse().unwrap() * far));
    let log = log_in_wedge(far, &covariance, [0.26, 0.14]);
    assert!(log < -0.4 * z2 && log > -0.5 * z2 - 6.0, "{log} {z2}");
}

#[test]
fn a_wedge_of_a_half_plane_is_a_half_normal() {
    let z = log_in_wedge(Vector2::new(-0.7, 3.0), &Matrix2::identity(), [1.0, 0.0]);
    assert!((z - log_positive(-0.7)).abs() < 1e-12, "{z}");
}
