//! Weighing draws: of a normal distribution that another one is wanted of.

use super::*;

const DRAWS: usize = 8000;

/// Draws of two standard normal variables.
fn draws() -> Vec<Vec<f64>> {
    let key = Key {
        seed: 11,
        ensemble: 0,
    };
    let mut rng = Stream::at(key, 0, 0);
    (0..DRAWS)
        .map(|_| vec![rng.normal(), rng.normal()])
        .collect()
}

/// Log of N(0.5, 1) over N(0, 1) in the first variable.
fn log_ratio(x: &[f64]) -> f64 {
    0.5 * x[0] - 0.125
}

#[test]
fn weights_find_the_shift_of_a_mean_and_its_error() {
    let points = draws();
    let chosen: Vec<usize> = (0..400).map(|k| 20 * k).collect();
    let logs: Vec<f64> = chosen.iter().map(|&k| log_ratio(&points[k])).collect();
    let found = of_weights(&points, &chosen, &relative(&logs));
    let [first, second] = [found.shifts[0], found.shifts[1]];
    assert!((first[0] - 0.5).abs() < 4.0 * first[1], "{first:?}");
    assert!(second[0].abs() < 4.0 * second[1], "{second:?}");
    // the error of a mean of w z, w log-normal with sd 0.5
    assert!((0.03..0.15).contains(&first[1]), "{first:?}");
    // 1 / E[w^2] = exp(-0.25)
    assert!(
        (found.effective - 0.779).abs() < 0.08,
        "{}",
        found.effective
    );
    assert!(found.draws == 400 && found.impossible == 0);
}

#[test]
fn regressed_weights_resample_to_the_wanted_distribution() {
    let points = draws();
    let chosen: Vec<usize> = (0..100).map(|k| 80 * k).collect();
    let logs: Vec<f64> = chosen.iter().map(|&k| log_ratio(&points[k])).collect();
    let fitted = regressed(&standardised(points.clone()), &chosen, &logs);
    let order = resampled(&relative(&fitted), 0.3);
    assert_eq!(order.len(), DRAWS);
    assert!(order.is_sorted());
    let mean = |k: usize| order.iter().map(|&i| points[i][k]).sum::<f64>() / DRAWS as f64;
    let error = 1.0 / (0.7 * DRAWS as f64).sqrt();
    assert!((mean(0) - 0.5).abs() < 4.0 * error + 0.02, "{}", mean(0));
    assert!(mean(1).abs() < 4.0 * error + 0.02, "{}", mean(1));
    let variance = order
        .iter()
        .map(|&i| (points[i][0] - mean(0)).powi(2))
        .sum::<f64>()
        / DRAWS as f64;
    assert!((variance - 1.0).abs() < 0.1, "{variance}");
}

#[test]
fn draws_that_the_full_model_cannot_have_weigh_nothing() {
    let points = draws();
    let chosen: Vec<usize> = (0..100).collect();
    let bounded = |k: &usize| {
        if points[*k][0] < 0.0 {
            f64::NEG_INFINITY
        } else {
            0.0
        }
    };
    let logs: Vec<f64> = chosen.iter().map(bounded).collect();
    let found = of_weights(&points, &chosen, &relative(&logs));
    let outside = chosen.iter().filter(|k| points[**k][0] < 0.0).count();
    assert_eq!(found.impossible, outside);
    assert!(found.shifts[0][0] > 0.5, "{:?}", found.shifts);
}
