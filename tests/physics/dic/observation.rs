//! Subsets and noise of the simulator against fits by hand and the triangle of overlapping subsets.

use rand::SeedableRng;
use rand_pcg::Pcg64Dxsm;

use super::noise::{Family, Noise, Smooth};
use super::subsets::{Cut, Filter, Layout, Shape};

fn layout(side: usize, shape: Shape, cut: Cut) -> Layout {
    Layout {
        pixel_mm: 0.1,
        side,
        step: 1,
        first_mm: [0.0; 2],
        count: [1, 1],
        shape,
        cut,
    }
}

/// A filter's value of a field over one subset about the origin, in pixels, of which some show the specimen.
fn fitted(
    layout: &Layout,
    shows: impl Fn([f64; 2]) -> bool,
    field: impl Fn([f64; 2]) -> f64,
) -> Option<f64> {
    let pixels: Vec<[f64; 2]> = layout
        .places()
        .iter()
        .map(|p| p.map(|p| (p / layout.pixel_mm).round()))
        .collect();
    let on: Vec<bool> = pixels.iter().map(|&p| shows(p)).collect();
    let values: Vec<f64> = pixels.iter().map(|&p| field(p)).collect();
    Filter::new(layout, &on).apply(&values).first().copied()
}

#[test]
fn subsets_report_their_fit_at_the_centre() {
    let field = |[x, y]: [f64; 2]| 0.7 + 0.3 * x - 0.2 * y + 0.05 * x * x - 0.02 * x * y;
    // the mean of x^2 over -3..3 is 4
    for (shape, expected) in [
        (Shape::Constant, 0.9),
        (Shape::Affine, 0.9),
        (Shape::Quadratic, 0.7),
    ] {
        let value = fitted(&layout(7, shape, Cut::Dropped), |_| true, field).unwrap();
        assert!((value - expected).abs() < 1e-12, "{shape:?}: {value}");
    }
}

/// Of 5 x 5 pixels the columns -2, -1, 0 are left, x^2 there is 4, 1, 0: the mean is 5/3, the line through them by least squares has
/// slope -2 about x = -1 and so -1/3 at 0, and the parabola is itself.
#[test]
fn cut_subsets_are_fitted_over_what_is_left() {
    let shows = |[x, _]: [f64; 2]| x <= 0.0;
    let square = |[x, _]: [f64; 2]| x * x;
    for (shape, expected) in [
        (Shape::Constant, 5.0 / 3.0),
        (Shape::Affine, -1.0 / 3.0),
        (Shape::Quadratic, 0.0),
    ] {
        let value = fitted(&layout(5, shape, Cut::Kept), shows, square).unwrap();
        assert!((value - expected).abs() < 1e-12, "{shape:?}: {value}");
    }
    let dropped = fitted(&layout(5, Shape::Affine, Cut::Dropped), shows, square);
    assert!(dropped.is_none());
}

/// Covariances of neighbours along x and diagonally, over many subsets, against sd^2 times the overlap of both sides; frames share the
/// reference's half.
#[test]
fn noise_follows_the_triangle() {
    let layout = Layout {
        step: 3,
        count: [120, 100],
        ..layout(9, Shape::Affine, Cut::Dropped)
    };
    let [columns, rows] = layout.pixels();
    let filter = Filter::new(&layout, &vec![true; columns * rows]);
    let noise = Noise {
        sd_mm: 2.0,
        ..Noise::default()
    };
    let frames = noise.exposures(&filter, columns * rows, 2, 5);
    let mean = |a: &[[f64; 2]], b: &[[f64; 2]], [dx, dy]: [usize; 2]| {
        let [nx, ny] = layout.count;
        let (mut sum, mut count) = (0.0, 0.0);
        for j in 0..ny - dy {
            for i in 0..nx - dx {
                let (p, q) = (j * nx + i, (j + dy) * nx + i + dx);
                sum += a[p][0] * b[q][0] + a[p][1] * b[q][1];
                count += 2.0;
            }
        }
        sum / count
    };
    // 24,000 values, of which some 5 x 5 / 4 overlap: 2 % of the variance
    for lag in [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [3, 0], [5, 4]] {
        let side = |k: usize| (1.0 - k as f64 / 3.0).max(0.0);
        let expected = 4.0 * side(lag[0]) * side(lag[1]);
        let own = mean(&frames[0], &frames[0], lag);
        let shared = mean(&frames[0], &frames[1], lag);
        assert!((own - 2.0 * expected).abs() < 0.35, "{lag:?}: {own}");
        assert!((shared - expected).abs() < 0.25, "{lag:?}: {shared}");
    }
}

/// Over many fields: unit variance, and the family's correlation at one length.
#[test]
fn smooth_noise_has_its_length() {
    let points = [[0.0, 0.0], [3.0, 4.0], [-20.0, 8.0]];
    let root = 3_f64.sqrt();
    let matern = (1.0 + root) * (-root).exp();
    for (family, expected) in [
        (Family::Gaussian, (-0.5_f64).exp()),
        (Family::Matern32, matern),
    ] {
        let smooth = Smooth {
            ratio: 1.0,
            length_mm: 5.0,
            family,
        };
        let mut rng = Pcg64Dxsm::seed_from_u64(8);
        let (mut variance, mut product) = (0.0, 0.0);
        const FIELDS: usize = 4000;
        for _ in 0..FIELDS {
            let f = smooth.field(&points, &mut rng);
            variance += f[0] * f[0] / FIELDS as f64;
            product += f[0] * f[1] / FIELDS as f64;
        }
        // sd of a mean of squares: sqrt(2 / 4000) = 0.022
        assert!((variance - 1.0).abs() < 0.09, "{family:?}: {variance}");
        assert!((product - expected).abs() < 0.08, "{family:?}: {product}");
    }
}
