use plychain::numeric::log_sum_exp;
use plychain::trace::averaged::{AveragedPart, above_zero, mixture};

fn part(log_weight: f64, mean: f64, sd: f64) -> AveragedPart {
    AveragedPart {
        log_weight,
        mean: vec![mean],
        sd: vec![sd],
        covariance: vec![sd * sd],
    }
}

/// Half of a normal distribution has the mean sqrt(2 / pi) and the variance 1 - 2 / pi.
#[test]
fn what_lies_above_zero_is_a_half_normal_distribution() {
    let (share, mean, sd) = above_zero(0.0, 1.0);
    let two_over_pi = std::f64::consts::FRAC_2_PI;
    assert!((share - 0.5).abs() < 1e-12);
    assert!((mean - two_over_pi.sqrt()).abs() < 1e-10, "{mean}");
    assert!((sd - (1.0 - two_over_pi).sqrt()).abs() < 1e-10, "{sd}");
}

#[test]
fn a_modulus_is_positive_and_one_that_is_known_does_not_change() {
    let wide = [part(0.0, -2.0, 3.0), part(-1.0, 1.0, 3.0)];
    let total = log_sum_exp([0.0, -1.0].into_iter());
    let found = mixture(&wide, total, 0, true);
    assert!(0.0 < found.low && found.low < found.median && found.median < found.high);
    assert!(0.0 < found.mean && found.mean < found.high);
    let known = [part(0.0, 7.9, 0.1)];
    let [a, b] = [true, false].map(|modulus| mixture(&known, 0.0, 0, modulus));
    for (a, b) in [
        (a.mean, b.mean),
        (a.sd, b.sd),
        (a.low, b.low),
        (a.high, b.high),
    ] {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    // where nearly all of the probability lies below zero, what little does not
    let absurd = [part(0.0, -300.0, 3.0), part(-900.0, 1.0, 3.0)];
    let found = mixture(&absurd, 0.0, 0, true);
    assert!(0.0 < found.low && found.high < 10.0);
    // no ratio is a modulus
    assert!(mixture(&wide, total, 0, false).low < 0.0);
}
