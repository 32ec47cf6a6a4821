//! Counter-based random streams: Threefry-2x64 with 20 rounds (Salmon, Moraes, Dror & Shaw 2011, "Parallel random
//! numbers: as easy as 1, 2, 3").
//!
//! A number is a function of (seed, ensemble, lane, place): the key is the run's seed and the ensemble, the counter the
//! lane (a walker) and the place in the lane's stream. So the draws do not depend on how walkers are spread over
//! threads or over vectors, and a resumed run continues to the same bits from the places alone.

use std::convert::Infallible;

use rand::TryRng;
use rand_distr::{Distribution, StandardNormal};

/// What names the streams of one ensemble: the run's seed and the ensemble's index.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Seed of the run.
    pub seed: u64,
    /// Index of the ensemble (or of the chain, for samplers of single chains).
    pub ensemble: u64,
}

const ROUNDS: usize = 20;
const ROTATIONS: [u32; 8] = [16, 42, 12, 31, 16, 32, 24, 21];
const PARITY: u64 = 0x1BD1_1BDA_A9FC_1A22;

/// The two numbers of each of `N` lanes at one place.
#[inline(always)]
pub fn blocks<const N: usize>(key: Key, mut lane: [u64; N], place: u64) -> ([u64; N], [u64; N]) {
    let keys = [key.seed, key.ensemble, PARITY ^ key.seed ^ key.ensemble];
    let mut other = [place.wrapping_add(keys[1]); N];
    lane.iter_mut().for_each(|x| *x = x.wrapping_add(keys[0]));
    for round in 0..ROUNDS {
        let rotation = ROTATIONS[round % 8];
        for (a, b) in lane.iter_mut().zip(&mut other) {
            *a = a.wrapping_add(*b);
            *b = b.rotate_left(rotation) ^ *a;
        }
        if round % 4 == 3 {
            let n = round / 4 + 1;
            let (first, second) = (keys[n % 3], keys[(n + 1) % 3].wrapping_add(n as u64));
            for (a, b) in lane.iter_mut().zip(&mut other) {
                *a = a.wrapping_add(first);
                *b = b.wrapping_add(second);
            }
        }
    }
    (lane, other)
}

/// One stream of random numbers, at a known place.
#[derive(Debug)]
pub struct Stream {
    key: Key,
    lane: u64,
    used: u64,
    /// The second number of the block whose first was drawn last.
    spare: u64,
}

impl Stream {
    /// The stream of `lane` (a walker) under `key`, after `used` numbers.
    pub fn at(key: Key, lane: u64, used: u64) -> Self {
        let (_, [spare]) = blocks(key, [lane], used / 2);
        Self {
            key,
            lane,
            used,
            spare,
        }
    }

    /// Numbers drawn so far: with the key, all that is needed to continue.
    pub fn used(&self) -> u64 {
        self.used
    }

    /// The next 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.used += 1;
        if self.used.is_multiple_of(2) {
            return self.spare;
        }
        let ([bits], [spare]) = blocks(self.key, [self.lane], self.used / 2);
        self.spare = spare;
        bits
    }

    /// Uniform on [0, 1), 53 bits.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Logarithm of a uniform number on (0, 1].
    #[inline]
    pub fn log_uniform(&mut self) -> f64 {
        (1.0 - self.uniform()).ln()
    }

    /// Standard normal.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(self)
    }
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
