//! Autocovariance by FFT, averaged over chains: two chains ride in one complex transform, and the inverse
//! transform is taken once, of the summed power.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Mean over the chains of the biased autocovariance (divided by n) at lags 0..n. `rows` is chain x n, already centred.
pub(super) fn mean_autocovariance(rows: &[f64], n: usize) -> Vec<f64> {
    let chains = rows.len() / n.max(1);
    if chains == 0 {
        return Vec::new();
    }
    let size = (2 * n).next_power_of_two();
    let transform = FftPlanner::new().plan_fft_forward(size);
    let mut scratch = vec![Complex::default(); transform.get_inplace_scratch_len()];
    let mut power = vec![0.0; size];
    let mut values = vec![Complex::default(); size];
    for pair in rows.chunks(2 * n) {
        values.fill(Complex::default());
        for (k, value) in values[..n].iter_mut().enumerate() {
            *value = Complex::new(pair[k], pair.get(n + k).copied().unwrap_or(0.0));
        }
        transform.process_with_scratch(&mut values, &mut scratch);
        for (power, value) in power.iter_mut().zip(&values) {
            *power += value.norm_sqr();
        }
    }
    // The power is real; the real part of its transform is that of its even part, the sum over both chains of a pair.
    let mut values: Vec<Complex<f64>> = power.into_iter().map(Complex::from).collect();
    transform.process_with_scratch(&mut values, &mut scratch);
    let scale = 1.0 / (size as f64 * n as f64 * chains as f64);
    values[..n].iter().map(|v| scale * v.re).collect()
}
