use plychain::lanes::{ln, ln_vector, sin_cos_turns};

#[test]
fn sine_and_cosine_are_exact_to_1e_15() {
    for k in 0..=10_000 {
        let turns = f64::from(k) / 10_000.0;
        let (sin, cos) = sin_cos_turns(turns);
        let (s, c) = (std::f64::consts::TAU * turns).sin_cos();
        assert!(
            (sin - s).abs() < 1e-15 && (cos - c).abs() < 1e-15,
            "{turns}"
        );
    }
}

struct Logarithm(f64);

impl pulp::WithSimd for Logarithm {
    type Output = f64;

    fn with_simd<S: pulp::Simd>(self, simd: S) -> f64 {
        simd.reduce_max_f64s(ln_vector(simd, simd.splat_f64s(self.0)))
    }
}

#[test]
fn the_logarithm_is_exact_to_an_ulp_or_two() {
    let mut x = 1e-300;
    while x < 1e300 {
        let truth = f64::ln(x);
        assert!(
            (ln(x) - truth).abs() <= 2.0 * f64::EPSILON * truth.abs().max(1e-300),
            "{x}: {} {truth}",
            ln(x)
        );
        let vector = pulp::Arch::new().dispatch(Logarithm(x));
        assert!(
            (vector - truth).abs() <= 3.0 * f64::EPSILON * truth.abs(),
            "{x}: {vector} {truth}"
        );
        x *= 1.001_37;
    }
    assert_eq!(ln(1.0), 0.0);
}
