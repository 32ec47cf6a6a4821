//! Several points at once: the arithmetic that the compiler turns into vector instructions.

/// Points evaluated together.
pub(super) const WIDTH: usize = 16;

/// One number for each of [`WIDTH`] points.
pub(super) type Lanes = [f64; WIDTH];

/// A number for every lane, computed by the same expression.
#[inline(always)]
pub(super) fn each(f: impl Fn(usize) -> f64) -> Lanes {
    let mut out = [0.0; WIDTH];
    for (lane, value) in out.iter_mut().enumerate() {
        *value = f(lane);
    }
    out
}

/// Natural logarithm of a positive normal number, to 1 ulp, without branches or tables (fdlibm's `e_log.c`), so that a
/// loop over it vectorises. Zero, negative, subnormal and infinite arguments give a finite number without meaning.
#[inline(always)]
pub(super) fn ln(x: f64) -> f64 {
    const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
    // 2^52 in whose mantissa an integer sits as it is.
    const CARRIER: u64 = 0x4330_0000_0000_0000;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let shifted = x.to_bits().wrapping_add(ONE - ROOT_HALF);
    let k = f64::from_bits((shifted >> 52) | CARRIER) - (4_503_599_627_370_496.0 + 1023.0);
    let f = f64::from_bits((shifted & MANTISSA).wrapping_add(ROOT_HALF)) - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let odd = w
        * (0.399_999_999_994_094_2 + w * (0.222_221_984_321_497_84 + w * 0.153_138_376_992_093_73));
    let even = z
        * (0.666_666_666_666_673_5
            + w * (0.285_714_287_436_623_9
                + w * (0.181_835_721_616_180_5 + w * 0.147_981_986_051_165_86)));
    let half = 0.5 * f * f;
    s * (half + (odd + even)) + k * LN2_LOW - half + f + k * LN2_HIGH
}

#[cfg(test)]
mod tests {
    use super::ln;

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
            x *= 1.001_37;
        }
        assert_eq!(ln(1.0), 0.0);
    }
}
