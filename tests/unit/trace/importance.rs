//! Draws of a normal distribution, resampled to those of another one.

use plychain::diagnose::{Weighed, weigh};
use plychain::numeric::relative_weights;
use plychain::posterior::importance::{
    in_sds, is_sound, is_told, regressed, resampled, spread_out, standardised,
};
use plychain::sample::{Key, Stream};

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
fn regressed_weights_resample_to_the_wanted_distribution() {
    let points = draws();
    let chosen: Vec<usize> = (0..100).map(|k| 80 * k).collect();
    let logs: Vec<f64> = chosen.iter().map(|&k| log_ratio(&points[k])).collect();
    let fitted = regressed(&standardised(points.clone()), &chosen, &logs);
    let order = resampled(&relative_weights(&fitted), 0.3);
    assert_eq!(order.len(), DRAWS);
    assert!(order.is_sorted());
    let mean = |k: usize| order.iter().map(|&i| points[i][k]).sum::<f64>() / DRAWS as f64;
    // so many draws are effective; the ridge takes a hundredth of the slope, 0.005
    let effective = 0.779 * DRAWS as f64;
    let by = 4.0 / effective.sqrt() + 0.005;
    assert!((mean(0) - 0.5).abs() < by, "{}", mean(0));
    assert!(mean(1).abs() < by, "{}", mean(1));
    let square = |&i: &usize| (points[i][0] - mean(0)).powi(2);
    let variance = order.iter().map(square).sum::<f64>() / DRAWS as f64;
    assert!(
        (variance - 1.0).abs() < 4.0 * (2.0 / effective).sqrt() + 0.005,
        "{variance}"
    );
}

/// Logs that nothing explains, and logs of another shape, leave as many effective draws as they have, or are not used.
#[test]
fn weights_that_features_do_not_explain_do_no_harm() {
    const FEATURES: usize = 12;
    const KNOWN: usize = 192;
    let mut used = 0;
    for case in 0..40 {
        let key = Key {
            seed: 100 + case,
            ensemble: 0,
        };
        let mut rng = Stream::at(key, 0, 0);
        let points: Vec<Vec<f64>> = (0..4000)
            .map(|_| (0..FEATURES).map(|_| rng.normal()).collect())
            .collect();
        let chosen: Vec<usize> = (0..KNOWN).map(|k| 4000 / KNOWN * k).collect();
        let log = |x: &[f64], noise: f64| match case % 3 {
            0 => noise,
            1 => -0.3 * x[0] * x[1] + 0.3 * noise,
            _ => 0.4 * x[0] - 0.1 * x[1] * x[1] + 0.3 * noise,
        };
        let logs: Vec<f64> = chosen
            .iter()
            .map(|&k| log(&points[k], rng.normal()))
            .collect();
        let own: Vec<&[f64]> = chosen.iter().map(|&k| &points[k][..]).collect();
        let weighed = weigh(&own, &logs);
        let shifts = in_sds(&weighed, &points);
        let fitted = regressed(&standardised(points.clone()), &chosen, &logs);
        let weights = relative_weights(&fitted);
        if !is_sound(&weights, &points, &weighed, &shifts) {
            continue;
        }
        used += 1;
        let order = resampled(&weights, 0.5);
        let mut distinct = order;
        distinct.dedup();
        assert!(
            distinct.len() > 1000,
            "case {case}: {} draws",
            distinct.len()
        );
    }
    assert!(used > 10, "{used}");
    // all weight on one draw is no account of anything
    let points = draws();
    let mut one = vec![0.0; DRAWS];
    one[17] = 1.0;
    let flat = Weighed {
        effective: 0.6,
        impossible: 0,
        shifts: vec![[0.0, 0.05]; 2],
    };
    assert!(!is_sound(&one, &points, &flat, &flat.shifts));
}

/// Draws are taken evenly of all, whatever their number, and none twice.
#[test]
fn draws_are_spread_out() {
    const ALL: usize = 960;
    let taken: Vec<usize> = (0..96).map(|k| spread_out(k, ALL)).collect();
    for count in [6, 12, 24, 96] {
        let mut own = taken[..count].to_vec();
        own.sort_unstable();
        own.dedup();
        assert_eq!(own.len(), count);
        let gaps = own.windows(2).map(|pair| pair[1] - pair[0]);
        let widest = gaps.chain([own[0], ALL - own[count - 1]]).max().unwrap();
        assert!(widest * count < 3 * ALL, "{count}: {widest}");
    }
    assert!((0..200).all(|k| spread_out(k, 3) < 3));
}

/// Six draws end a hopeless case and no other, a dozen end a calm one, and after that a shift must be sure to be followed.
#[test]
fn draws_of_the_full_model_end_when_more_say_nothing_else() {
    let share = |effective: f64| Weighed {
        effective,
        impossible: 0,
        shifts: Vec::new(),
    };
    assert!(is_told(&share(0.2), &[[0.9, 0.3]], 6));
    assert!(!is_told(&share(0.99), &[[0.0, 0.01]], 6));
    assert!(is_told(&share(0.99), &[[0.04, 0.02]], 12));
    assert!(!is_told(&share(0.99), &[[0.06, 0.02]], 12));
    assert!(!is_told(&share(0.8), &[[0.0, 0.02]], 12));
    assert!(is_told(&share(0.8), &[[0.06, 0.05]], 24));
    assert!(!is_told(&share(0.8), &[[0.2, 0.05]], 24));
}
