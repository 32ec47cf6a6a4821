use plychain::identify::waves::{PART, of_subsets};

/// The expected power of a row of points with the triangle's covariance, which white pixels have after averages over subsets `width` parts
/// wide, under the window of the periodogram.
fn power(width: f64, number: f64) -> f64 {
    let n = PART as usize;
    let place = |i: usize| (i as f64 + 0.5) / PART - 0.5;
    let term = |i: usize| {
        let window = (std::f64::consts::PI * place(i)).cos().powi(2);
        let phase = std::f64::consts::TAU * number * place(i);
        [window * phase.cos(), window * phase.sin()]
    };
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let apart = (place(i) - place(j)).abs() / width;
            let [a, b] = [term(i), term(j)];
            sum += (1.0 - apart).max(0.0) * (a[0] * b[0] + a[1] * b[1]);
        }
    }
    sum
}

#[test]
fn the_spectrum_of_subsets_is_that_of_the_triangle() {
    for spacings in [2.5, 3.3, 4.125, 6.0] {
        let width = spacings / PART;
        let numbers: Vec<[f64; 2]> = (0..=11).map(|a| [f64::from(a), 3.0]).collect();
        let shape = of_subsets(&numbers, width);
        for (k, found) in shape.iter().enumerate() {
            let expected = power(width, k as f64) / power(width, 0.0);
            let found = found / shape[0];
            assert!(
                (found - expected).abs() < 0.05 * expected + 0.003,
                "{spacings}, {k}: {found} {expected}"
            );
        }
    }
}
