//! The random numbers of a half-step for all its walkers at once, in vectors: a row a number, a column a walker.

use pulp::{Simd, WithSimd};

use super::stream::{Key, blocks};
use crate::lanes::{WIDTH, each, ln, sin_cos_turns};

/// How many numbers a proposal takes for each walker.
#[derive(Debug, Clone, Copy)]
pub struct Needs {
    pub uniforms: usize,
    /// Standard normal numbers.
    pub normals: usize,
}

impl Needs {
    /// Places of a stream that they take, two numbers each: pairs of normals from pairs of uniforms, and one uniform more
    /// for the acceptance.
    pub(super) fn places(self) -> usize {
        self.normals.div_ceil(2) + (self.uniforms + 1).div_ceil(2)
    }
}

/// The numbers of one half-step.
#[derive(Debug)]
pub struct Numbers {
    count: usize,
    padded: usize,
    needs: Needs,
    /// Normals, then uniforms on (0, 1], last the logarithms for the acceptance; rows of length `padded`.
    rows: Vec<f64>,
}

impl Numbers {
    /// Room for `count` walkers.
    pub(super) fn new(count: usize) -> Self {
        Self {
            count,
            padded: count.next_multiple_of(WIDTH),
            needs: Needs {
                uniforms: 0,
                normals: 0,
            },
            rows: Vec::new(),
        }
    }

    /// Draws for the walkers from lane `first` on.
    pub(super) fn draw(&mut self, key: Key, first: u64, place: u64, needs: Needs) {
        self.needs = needs;
        let rows = 2 * needs.places();
        if self.rows.len() < rows * self.padded {
            self.rows.resize(rows * self.padded, 0.0);
        }
        pulp::Arch::new().dispatch(Draw {
            key,
            first,
            place,
            numbers: self,
        });
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.rows[row * self.padded..][..self.count]
    }

    /// A standard normal number of each walker.
    pub fn normal(&self, index: usize) -> &[f64] {
        self.row(index)
    }

    /// A uniform number on (0, 1] of each walker.
    pub fn uniform(&self, index: usize) -> &[f64] {
        self.row(self.needs.normals.next_multiple_of(2) + index)
    }

    /// The logarithm of a uniform number on (0, 1] of each walker, for the acceptance.
    pub(super) fn log_uniform(&self) -> &[f64] {
        self.row(2 * self.needs.places() - 1)
    }
}

/// One of `0..n`, from a uniform number on (0, 1] (bias below n / 2^52).
#[inline]
pub fn index(uniform: f64, n: usize) -> usize {
    ((1.0 - uniform) * n as f64) as usize
}

/// `N` different ones of `0..n`, in random order (there must be that many), from uniform numbers on (0, 1].
#[inline]
pub fn pick<const N: usize>(uniforms: [f64; N], n: usize) -> [usize; N] {
    let mut picked = [0; N];
    for k in 0..N {
        // A uniform choice among those left, by stepping over the picked ones in increasing order.
        let mut candidate = index(uniforms[k], n - k);
        let mut taken = picked;
        if k > 1 {
            taken[..k].sort_unstable();
        }
        for &other in &taken[..k] {
            candidate += usize::from(candidate >= other);
        }
        picked[k] = candidate;
    }
    picked
}

struct Draw<'a> {
    key: Key,
    first: u64,
    place: u64,
    numbers: &'a mut Numbers,
}

impl WithSimd for Draw<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Numbers {
            padded,
            needs,
            rows,
            ..
        } = self.numbers;
        let (normal, places) = (needs.normals.div_ceil(2), needs.places());
        for from in (0..*padded).step_by(WIDTH) {
            let mut lanes = [0; WIDTH];
            for (k, lane) in lanes.iter_mut().enumerate() {
                *lane = self.first + (from + k) as u64;
            }
            for (at, pair) in rows.chunks_exact_mut(2 * *padded).take(places).enumerate() {
                let (a, b) = blocks(self.key, lanes, self.place + at as u64);
                let (mut a, mut b) = (each(|l| unit(a[l])), each(|l| unit(b[l])));
                if at < normal {
                    // Box and Muller (1958).
                    for (a, b) in a.iter_mut().zip(b.iter_mut()) {
                        let radius = (-2.0 * ln(*a)).sqrt();
                        let (sin, cos) = sin_cos_turns(*b);
                        (*a, *b) = (radius * cos, radius * sin);
                    }
                } else if at + 1 == places {
                    b = each(|l| ln(b[l]));
                }
                let (first, second) = pair.split_at_mut(*padded);
                first[from..from + WIDTH].copy_from_slice(&a);
                second[from..from + WIDTH].copy_from_slice(&b);
            }
        }
    }
}

/// Uniform on (0, 1], 52 bits.
#[inline(always)]
fn unit(bits: u64) -> f64 {
    2.0 - f64::from_bits((bits >> 12) | 0x3ff0_0000_0000_0000)
}
