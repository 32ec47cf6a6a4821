use plychain::reduce::supplied::spread::weights;

/// Points of a jittered lattice over [-1, 1]^2, so many a side.
fn scattered(side: usize) -> Vec<[f64; 2]> {
    let jitter = |k: usize| 0.2 * ((k * 7919 % 101) as f64 / 101.0 - 0.5);
    let at = |i: usize, k: usize| 2.0 * (i as f64 + jitter(k)) / (side - 1) as f64 - 1.0;
    let all = (0..side * side).map(|k| [at(k / side, k), at(k % side, k + 13)]);
    all.collect()
}

/// Largest error of a function over a lattice within.
fn error(side: usize, of: fn([f64; 2]) -> f64) -> f64 {
    let known = scattered(side);
    let wanted: Vec<[f64; 2]> = scattered(23).iter().map(|p| p.map(|x| 0.8 * x)).collect();
    let weights = weights(&known, &wanted).unwrap();
    let miss = weights.iter().zip(&wanted).map(|(w, p)| {
        let sum: f64 = w.iter().map(|(k, w)| w * of(known[*k as usize])).sum();
        (sum - of(*p)).abs()
    });
    miss.fold(0.0, f64::max)
}

#[test]
fn cubics_are_reproduced_and_others_converge() {
    let cubic = |[x, y]: [f64; 2]| 1.0 + x * y * y - 2.0 * x * x * x + y;
    assert!(error(12, cubic) < 1e-12);
    let wave = |[x, y]: [f64; 2]| (3.0 * x + 1.0).sin() * (2.0 * y).exp();
    let (coarse, fine) = (error(20, wave), error(40, wave));
    let order = (coarse / fine).log2();
    assert!(order > 3.5, "{coarse:e}, {fine:e}: order {order}");
}

#[test]
fn a_known_point_has_its_own_value_and_one_far_away_has_none() {
    let known = scattered(12);
    assert_eq!(weights(&known, &known[5..6]).unwrap(), [[(5, 1.0)]]);
    let (place, gap) = weights(&known, &[[0.1, 0.1], [3.0, 0.0]]).unwrap_err();
    assert_eq!(place, [3.0, 0.0]);
    assert!((1.9..2.1).contains(&gap), "{gap}");
}
