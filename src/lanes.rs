//! Several points at once: the arithmetic that the compiler turns into vector instructions.

use std::ops::{Deref, DerefMut};

/// Points evaluated together.
pub const WIDTH: usize = 16;

/// One number for each of [`WIDTH`] points, where a vector of any length can be loaded at once.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct Lanes([f64; WIDTH]);

impl Lanes {
    /// The same number for all.
    #[inline(always)]
    pub fn splat(value: f64) -> Self {
        Self([value; WIDTH])
    }

    /// The first numbers, 1 beyond the last. A copy, because the compiler cannot tell that parts of one slice do not
    /// overlap, and then makes no vectors.
    #[inline(always)]
    pub fn of(values: &[f64]) -> Self {
        match values.first_chunk() {
            Some(whole) => Self(*whole),
            None => {
                let mut out = Self::splat(1.0);
                out.0[..values.len()].copy_from_slice(values);
                out
            }
        }
    }

    /// Puts the first numbers where they belong, as many as there is room for.
    #[inline(always)]
    pub fn put(&self, values: &mut [f64]) {
        match values.first_chunk_mut() {
            Some(whole) => *whole = self.0,
            None => {
                let length = values.len();
                values.copy_from_slice(&self.0[..length]);
            }
        }
    }
}

impl Deref for Lanes {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl DerefMut for Lanes {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

/// A number for every lane, computed by the same expression.
#[inline(always)]
pub fn each(f: impl Fn(usize) -> f64) -> Lanes {
    let mut out = Lanes::splat(0.0);
    for (lane, value) in out.iter_mut().enumerate() {
        *value = f(lane);
    }
    out
}

const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Coefficients of the odd and even powers of z^2.
const ODD: [f64; 3] = [
    0.399_999_999_994_094_2,
    0.222_221_984_321_497_84,
    0.153_138_376_992_093_73,
];
const EVEN: [f64; 4] = [
    0.666_666_666_666_673_5,
    0.285_714_287_436_623_9,
    0.181_835_721_616_180_5,
    0.147_981_986_051_165_86,
];

/// k and f with x = 2^k (1 + f) and 1 + f within sqrt(2) of 1.
#[inline(always)]
fn split(x: f64) -> (f64, f64) {
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
    // 2^52 in whose mantissa an integer sits as it is.
    const CARRIER: u64 = 0x4330_0000_0000_0000;
    let shifted = x.to_bits().wrapping_add(ONE - ROOT_HALF);
    let k = f64::from_bits((shifted >> 52) | CARRIER) - (4_503_599_627_370_496.0 + 1023.0);
    let f = f64::from_bits((shifted & MANTISSA).wrapping_add(ROOT_HALF)) - 1.0;
    (k, f)
}

/// Natural logarithm of a positive normal number, to 1 ulp, without branches or tables (fdlibm's `e_log.c`), so that a
/// loop over it vectorises. Zero, negative, subnormal and infinite arguments give a finite number without meaning.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    let (k, f) = split(x);
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let odd = w * (ODD[0] + w * (ODD[1] + w * ODD[2]));
    let even = z * (EVEN[0] + w * (EVEN[1] + w * (EVEN[2] + w * EVEN[3])));
    let half = 0.5 * f * f;
    s * (half + (odd + even)) + k * LN2_LOW - half + f + k * LN2_HIGH
}

/// [`ln`] of a vector, to 2 ulp and with fewer operations, fused where the processor can.
#[inline(always)]
pub fn ln_vector<S: pulp::Simd>(simd: S, x: S::f64s) -> S::f64s {
    let mut powers = Lanes::splat(0.0);
    let mut fractions = Lanes::splat(1.0);
    S::as_mut_simd_f64s(&mut fractions).0[0] = x;
    for (k, x) in powers[..S::F64_LANES].iter_mut().zip(fractions.iter_mut()) {
        (*k, *x) = split(*x);
    }
    let k = S::as_simd_f64s(&powers).0[0];
    let f = S::as_simd_f64s(&fractions).0[0];
    let c = |value| simd.splat_f64s(value);
    let fused = |a, b, c| simd.mul_add_e_f64s(a, b, c);
    let s = simd.div_f64s(f, simd.add_f64s(c(2.0), f));
    let z = simd.mul_f64s(s, s);
    let w = simd.mul_f64s(z, z);
    let odd = fused(w, fused(w, c(ODD[2]), c(ODD[1])), c(ODD[0]));
    let even = fused(
        w,
        fused(w, fused(w, c(EVEN[3]), c(EVEN[2])), c(EVEN[1])),
        c(EVEN[0]),
    );
    let series = fused(z, even, fused(w, odd, c(2.0)));
    fused(s, series, simd.mul_f64s(k, c(std::f64::consts::LN_2)))
}

/// Sine and cosine of 2 pi times a number of [0, 1] to 1e-15, without branches (fdlibm's `k_sin.c` and `k_cos.c` on the
/// nearest quarter of a turn).
#[inline(always)]
pub fn sin_cos_turns(turns: f64) -> (f64, f64) {
    // 1.5 x 2^52: adding it leaves the nearest whole number in the mantissa.
    const CARRIER: f64 = 6_755_399_441_055_744.0;
    let carried = 4.0 * turns + CARRIER;
    let quarter = carried.to_bits();
    let x = (turns - 0.25 * (carried - CARRIER)) * std::f64::consts::TAU;
    let z = x * x;
    let sin = x + x
        * z
        * (-1.666_666_666_666_663_2e-1
            + z * (8.333_333_333_322_49e-3
                + z * (-1.984_126_982_985_795e-4
                    + z * (2.755_731_370_707_007e-6
                        + z * (-2.505_076_025_340_686e-8 + z * 1.589_690_995_211_55e-10)))));
    let cos = 1.0 - 0.5 * z
        + z * z
            * (4.166_666_666_666_66e-2
                + z * (-1.388_888_888_887_411e-3
                    + z * (2.480_158_728_947_673e-5
                        + z * (-2.755_731_435_139_066_3e-7
                            + z * (2.087_572_321_298_175e-9 - z * 1.135_964_755_778_819_5e-11)))));
    let (a, b) = if quarter & 1 == 1 {
        (cos, sin)
    } else {
        (sin, cos)
    };
    (
        f64::from_bits(a.to_bits() ^ ((quarter & 2) << 62)),
        f64::from_bits(b.to_bits() ^ ((quarter.wrapping_add(1) & 2) << 62)),
    )
}

/// Natural logarithms, in place, as [`ln`] has them.
pub fn ln_all(values: &mut [f64]) {
    struct All<'a>(&'a mut [f64]);
    impl pulp::WithSimd for All<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, _simd: S) {
            self.0.iter_mut().for_each(|v| *v = ln(*v));
        }
    }
    pulp::Arch::new().dispatch(All(values));
}
