//! Counter-based random streams.
//!
//! Every walker of every ensemble has its own PCG64-DXSM generator, whose state and increment are hashed from (seed,
//! ensemble, walker), and counts the numbers it has drawn. A stream is therefore known from the key and that count
//! alone: `advance` puts a new generator at the same place in O(log count). So the draws do not depend on how
//! walkers are spread over threads, and a resumed run continues to the same bits from stored counts. (The count is
//! of numbers, not of steps: jumping at every step costs more than the step.)

use std::convert::Infallible;

use rand::TryRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Lcg128CmDxsm64;

/// What names the streams of one ensemble: the run's seed and the ensemble's index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key {
    /// Seed of the run.
    pub seed: u64,
    /// Index of the ensemble (or of the chain, for samplers of single chains).
    pub ensemble: u64,
}

/// One stream of random numbers, at a known place.
#[derive(Debug, Clone)]
pub struct Stream {
    rng: Lcg128CmDxsm64,
    used: u64,
}

impl Stream {
    /// The stream of `lane` (a walker) under `key`, after `used` numbers.
    pub fn at(key: Key, lane: u64, used: u64) -> Self {
        // The seed is scrambled first: seeds, ensembles and lanes are small numbers, whose plain XOR would give two runs
        // with neighbouring seeds some streams in common.
        let mut hash = split_mix(key.seed);
        let mut word = |salt: u64| {
            hash = split_mix(hash ^ salt);
            u128::from(hash)
        };
        word(key.ensemble.wrapping_add(0x9E37_79B9_7F4A_7C15));
        word(lane.wrapping_add(0xD1B5_4A32_D192_ED03));
        let state = (word(1) << 64) | word(2);
        let stream = (word(3) << 64) | word(4);
        let mut rng = Lcg128CmDxsm64::new(state, stream);
        rng.advance(u128::from(used));
        Self { rng, used }
    }

    /// Numbers drawn so far: with the key, all that is needed to continue.
    pub fn used(&self) -> u64 {
        self.used
    }

    /// The next 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.used += 1;
        let Ok(bits) = self.rng.try_next_u64();
        bits
    }

    /// Uniform on [0, 1), 53 bits.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform on 0..n (bias below n / 2^64).
    #[inline]
    pub fn index(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// Standard normal.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(self)
    }
}

/// SplitMix64's finaliser (Steele, Lea, Flood 2014).
fn split_mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

impl TryRng for Stream {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok((self.bits() >> 32) as u32)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        Ok(self.bits())
    }

    fn try_fill_bytes(&mut self, out: &mut [u8]) -> Result<(), Infallible> {
        for chunk in out.chunks_mut(8) {
            let bytes = self.bits().to_le_bytes();
            chunk.copy_from_slice(&bytes[..chunk.len()]);
        }
        Ok(())
    }
}
