//! Places of nodes along a line, from 0 to 1.

/// `n + 1` places, x -> s x + (1 - s) x^2.5, whose first step is about `first`; even where that is coarser. Steps grow
/// more slowly far out than in a geometric progression, where the corners of the box about a hole need them.
pub fn ring_grading(n: usize, first: f64) -> Vec<f64> {
    let slope = (first * n as f64).min(1.0);
    even(n)
        .into_iter()
        .map(|x| slope * x + (1.0 - slope) * x.powf(2.5))
        .collect()
}

/// `n + 1` places at equal distances.
pub fn even(n: usize) -> Vec<f64> {
    (0..=n).map(|k| k as f64 / n as f64).collect()
}

/// `n + 1` places in geometric progression whose first step is `first`; even where that is coarser.
pub fn graded(n: usize, first: f64) -> Vec<f64> {
    if first * n as f64 >= 1.0 {
        return even(n);
    }
    let total = |q: f64| first * (q.powi(n as i32) - 1.0) / (q - 1.0);
    let [mut low, mut high] = [1.0 + 1e-12, 2.0];
    while total(high) < 1.0 {
        high *= 2.0;
    }
    for _ in 0..200 {
        let q = 0.5 * (low + high);
        if total(q) < 1.0 {
            low = q;
        } else {
            high = q;
        }
    }
    let mut places: Vec<f64> = (0..=n)
        .map(|k| first * (low.powi(k as i32) - 1.0) / (low - 1.0))
        .collect();
    places[n] = 1.0;
    places
}

/// Place `j` on a lattice of corners (even) and midsides (odd).
pub fn at_half(places: &[f64], j: usize) -> f64 {
    0.5 * (places[j / 2] + places[j.div_ceil(2)])
}
