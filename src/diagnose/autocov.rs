//! Autocovariance by a radix-2 FFT, averaged over chains: two chains ride in one complex transform, and the inverse
//! transform is taken once, of the summed power.

use std::f64::consts::PI;

/// Mean over the chains of the biased autocovariance (divided by n) at lags 0..n. `rows` is chain x n, already centred.
pub(super) fn mean_autocovariance(rows: &[f64], n: usize) -> Vec<f64> {
    let chains = rows.len() / n.max(1);
    if chains == 0 {
        return Vec::new();
    }
    let size = (2 * n).next_power_of_two();
    let plan = Plan::new(size);
    let mut power = vec![0.0; size];
    let (mut re, mut im) = (vec![0.0; size], vec![0.0; size]);
    for pair in rows.chunks(2 * n) {
        re.fill(0.0);
        im.fill(0.0);
        re[..n].copy_from_slice(&pair[..n]);
        if pair.len() > n {
            im[..n].copy_from_slice(&pair[n..]);
        }
        plan.transform(&mut re, &mut im);
        for ((power, re), im) in power.iter_mut().zip(&re).zip(&im) {
            *power += re * re + im * im;
        }
    }
    // The power is real; the real part of its transform is that of its even part, the sum over both chains of a pair.
    im.fill(0.0);
    plan.transform(&mut power, &mut im);
    let scale = 1.0 / (size as f64 * n as f64 * chains as f64);
    power.truncate(n);
    power.iter_mut().for_each(|v| *v *= scale);
    power
}

/// Twiddle factors of one size.
struct Plan {
    size: usize,
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl Plan {
    fn new(size: usize) -> Self {
        let angle = |k: usize| -2.0 * PI * k as f64 / size as f64;
        Self {
            size,
            cos: (0..size / 2).map(|k| angle(k).cos()).collect(),
            sin: (0..size / 2).map(|k| angle(k).sin()).collect(),
        }
    }

    /// Forward transform in place (Cooley & Tukey, decimation in time).
    fn transform(&self, re: &mut [f64], im: &mut [f64]) {
        let bits = self.size.trailing_zeros();
        for i in 0..self.size {
            let j = i.reverse_bits() >> (usize::BITS - bits);
            if i < j {
                re.swap(i, j);
                im.swap(i, j);
            }
        }
        let mut half = 1;
        while half < self.size {
            let stride = self.size / (2 * half);
            for block in (0..self.size).step_by(2 * half) {
                for k in 0..half {
                    let (wr, wi) = (self.cos[k * stride], self.sin[k * stride]);
                    let (a, b) = (block + k, block + k + half);
                    let (xr, xi) = (re[b] * wr - im[b] * wi, re[b] * wi + im[b] * wr);
                    (re[b], im[b]) = (re[a] - xr, im[a] - xi);
                    (re[a], im[a]) = (re[a] + xr, im[a] + xi);
                }
            }
            half *= 2;
        }
    }
}
