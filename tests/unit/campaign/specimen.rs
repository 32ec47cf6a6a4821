use plychain::campaign::population::specimen::{
    KERNELS, LEAST_LEFT, MOST_DRAWS, Specimen, moments,
};
use plychain::chain::Draws;
use plychain::sample::{Key, Stream};

/// A posterior is that of its likelihood and a strong prior; without the prior the likelihood's mean and sd are left.
#[test]
fn the_prior_is_divided_out() {
    let (likelihood, prior): ([f64; 2], [f64; 2]) = ([10.0, 1.0], [8.0, 2.0]);
    let precision = likelihood[1].powi(-2) + prior[1].powi(-2);
    let mean = (likelihood[0] / likelihood[1].powi(2) + prior[0] / prior[1].powi(2)) / precision;
    let key = Key {
        seed: 1,
        ensemble: 0,
    };
    let mut rng = Stream::at(key, 0, 0);
    let count = MOST_DRAWS;
    let values = (0..count).map(|_| mean + rng.normal() / precision.sqrt());
    let names = vec!["c".to_string()];
    let draws = Draws::new(names, vec![0], values.collect(), vec![0.0; count]).unwrap();
    let found = Specimen::of_draws("s", &draws, &[(0, prior)]).unwrap();
    // the sd of the mean of so many weighted draws
    let sd = 1.0 / (found.left * count as f64).sqrt();
    assert!(
        (found.mean[0] - 10.0).abs() < 4.0 * sd,
        "{} {sd}",
        found.mean[0]
    );
    assert!((found.covariance[(0, 0)].sqrt() - 1.0).abs() < 4.0 * sd);
    assert!(found.left > 0.1 && found.left < 0.9, "{}", found.left);
}

/// Where the prior is nearly all there is, the likelihood is found all the same, and is wide where the data are silent.
#[test]
fn a_likelihood_that_says_little_is_divided_as_a_normal_one() {
    let key = Key {
        seed: 3,
        ensemble: 0,
    };
    let mut rng = Stream::at(key, 0, 0);
    // measured: a to 1 about 10, b to 3 about 6, c not at all; priors of sd 2, 1 and 1 about 8, 5 and 4
    let priors = [[8.0, 2.0], [5.0, 1.0], [4.0, 1.0]];
    let measured = [[10.0, 1.0], [6.0, 3.0], [0.0, 1e6]];
    let posterior = [0, 1, 2].map(|k| {
        let ([m, s], [m0, s0]): ([f64; 2], [f64; 2]) = (measured[k], priors[k]);
        let precision = s.powi(-2) + s0.powi(-2);
        [
            (m / s.powi(2) + m0 / s0.powi(2)) / precision,
            precision.powf(-0.5),
        ]
    });
    let count = MOST_DRAWS;
    let mut values = Vec::new();
    for _ in 0..count {
        values.extend(posterior.map(|[mean, sd]| mean + sd * rng.normal()));
    }
    let names = ["a", "b", "c"].map(String::from).to_vec();
    let draws = Draws::new(names, vec![0], values, vec![0.0; count]).unwrap();
    let own: Vec<(usize, [f64; 2])> = priors.into_iter().enumerate().collect();
    let found = Specimen::of_draws("s", &draws, &own).unwrap();
    assert!(found.left < LEAST_LEFT, "{}", found.left);
    let sd = |k: usize| found.covariance[(k, k)].sqrt();
    assert!((found.mean[0] - 10.0).abs() < 0.1 && (sd(0) - 1.0).abs() < 0.05);
    assert!(
        (found.mean[1] - 6.0).abs() < 0.6 && (sd(1) - 3.0).abs() < 0.5,
        "{}",
        sd(1)
    );
    assert!(sd(2) > 5.0, "{}", sd(2));
}

/// Kernels have the mean, the covariance and nearly the skewness of the draws.
#[test]
fn kernels_keep_the_moments_of_a_skewed_chain() {
    let key = Key {
        seed: 2,
        ensemble: 0,
    };
    let mut rng = Stream::at(key, 0, 0);
    let count = MOST_DRAWS;
    let mut values = Vec::new();
    for _ in 0..count {
        let (a, b) = (rng.normal(), rng.normal());
        values.extend([(0.3 * a).exp(), 2.0 + 0.5 * a + b]);
    }
    let names = vec!["a".to_string(), "b".to_string()];
    let draws = Draws::new(names, vec![0], values, vec![0.0; count]).unwrap();
    let own = [(0, [1.0, 1e9]), (1, [1.0, 1e9])];
    let found = Specimen::of_draws("s", &draws, &own).unwrap();
    let even = vec![1.0 / KERNELS as f64; KERNELS];
    let (mean, covariance) = moments(found.centres.iter(), &even);
    assert!((mean - &found.mean).amax() < 1e-9);
    assert!((covariance + &found.kernel - &found.covariance).amax() < 1e-9);
    let third = |centre: f64, values: &mut dyn Iterator<Item = f64>| -> f64 {
        values.map(|v| (v - centre).powi(3)).sum()
    };
    let whole = third(found.mean[0], &mut draws.points().map(|x| x[0])) / count as f64;
    let kept = third(found.mean[0], &mut found.centres.iter().map(|c| c[0])) / KERNELS as f64;
    assert!(kept > 0.1 * whole && kept < whole, "{kept} of {whole}");
}
