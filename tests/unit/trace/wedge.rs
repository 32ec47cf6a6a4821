use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Matrix2, Vector2};
use plychain::trace::wedge::{log_in_wedge, log_positive};

/// The mass in the wedge, by the midpoint rule over angle and radius.
fn integrated(mean: Vector2<f64>, covariance: &Matrix2<f64>, weights: [f64; 2]) -> f64 {
    const COUNT: usize = 1500;
    let inverse = covariance.try_inverse().unwrap();
    let lowest = -weights[0].atan2(weights[1]);
    let [angle_step, radius_step] = [FRAC_PI_2 - lowest, 12.0].map(|all| all / COUNT as f64);
    let mut sum = 0.0;
    for i in 0..COUNT {
        let (sin, cos) = (lowest + (i as f64 + 0.5) * angle_step).sin_cos();
        for j in 0..COUNT {
            let radius = (j as f64 + 0.5) * radius_step;
            let d = radius * Vector2::new(cos, sin) - mean;
            sum += radius * (-0.5 * d.dot(&(inverse * d))).exp();
        }
    }
    sum * angle_step * radius_step / (TAU * covariance.determinant().sqrt())
}

/// A bound from above, by less than the 5 nats that exclude a subset: inside, across an edge, and up to 12 sds outside.
#[test]
fn the_bound_is_near_the_mass_of_a_wedge() {
    let weights = [0.26, 0.14];
    let narrow = Matrix2::new(0.16, -0.28, -0.28, 0.62);
    let wide = Matrix2::identity();
    let prior = integrated(Vector2::zeros(), &wide, weights);
    for covariance in [narrow, wide] {
        for mean in [
            [2.0, 0.0],
            [0.5, -0.2],
            [-0.3, -0.2],
            [-0.75, -0.64],
            [-1.5, -1.3],
        ] {
            let mean = Vector2::from(mean);
            let log = (integrated(mean, &covariance, weights) / prior).ln();
            let above = log_in_wedge(mean, &covariance, weights) - log;
            assert!(-1e-4 < above && above < 2.0, "{mean} {log} {above}");
        }
    }
}

#[test]
fn a_wedge_of_a_half_plane_is_a_half_normal() {
    let log = log_in_wedge(Vector2::new(-0.7, 3.0), &Matrix2::identity(), [1.0, 0.0]);
    assert!((log - log_positive(-0.7)).abs() < 1e-12, "{log}");
}
