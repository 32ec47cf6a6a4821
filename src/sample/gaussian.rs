//! The little linear algebra of the moves: Cholesky factors in row-major slices, no allocation in a loop.

/// Lower Cholesky factor of the `dim` x `dim` row-major matrix `a`, in place (the upper triangle is zeroed). False if
/// `a` is not positive definite to working precision.
pub(crate) fn cholesky(a: &mut [f64], dim: usize) -> bool {
    for i in 0..dim {
        let scale = a[i * dim + i];
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| a[i * dim + k] * a[j * dim + k]).sum();
            let rest = a[i * dim + j] - dot;
            if i != j {
                a[i * dim + j] = rest / a[j * dim + j];
            } else if rest > 1e-14 * scale && rest.is_finite() {
                a[i * dim + i] = rest.sqrt();
            } else {
                return false;
            }
        }
        a[i * dim + i + 1..(i + 1) * dim].fill(0.0);
    }
    true
}

/// `out += scale * L z` for a lower triangular row-major `lower`.
pub(crate) fn add_lower(lower: &[f64], z: &[f64], scale: f64, out: &mut [f64]) {
    let dim = z.len();
    for (i, value) in out.iter_mut().enumerate() {
        let row = &lower[i * dim..=i * dim + i];
        *value += scale * row.iter().zip(z).map(|(l, z)| l * z).sum::<f64>();
    }
}

/// |L^-1 r|^2; `r` becomes L^-1 r.
pub(crate) fn whiten(lower: &[f64], r: &mut [f64]) -> f64 {
    let dim = r.len();
    let mut sum = 0.0;
    for i in 0..dim {
        let dot: f64 = (0..i).map(|k| lower[i * dim + k] * r[k]).sum();
        r[i] = (r[i] - dot) / lower[i * dim + i];
        sum += r[i] * r[i];
    }
    sum
}

/// Mean and scatter matrix (sum of outer products of deviations, lower triangle mirrored) of row-major points.
pub(crate) fn scatter(points: &[f64], dim: usize, mean: &mut [f64], scatter: &mut [f64]) {
    let n = (points.len() / dim) as f64;
    mean.fill(0.0);
    scatter.fill(0.0);
    for point in points.chunks_exact(dim) {
        mean.iter_mut().zip(point).for_each(|(m, x)| *m += x / n);
    }
    for point in points.chunks_exact(dim) {
        for i in 0..dim {
            let di = point[i] - mean[i];
            for j in 0..=i {
                scatter[i * dim + j] += di * (point[j] - mean[j]);
            }
        }
    }
    for i in 0..dim {
        for j in 0..i {
            scatter[j * dim + i] = scatter[i * dim + j];
        }
    }
}
