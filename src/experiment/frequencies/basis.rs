//! Polynomials on [-1, 1] that satisfy the essential conditions of two edges, and the integrals of their products.

use nalgebra::DMatrix;

use crate::numeric;

/// How an edge is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlateEdge {
    Free,
    /// No deflection; with transverse shear no rotation along the edge either ("hard").
    SimplySupported,
    Clamped,
}

/// Value, first and second derivative.
pub type Jet = [f64; 3];

/// Derivatives that a [`Jet`] holds.
const JET: usize = 3;

/// Orthonormal polynomials on [-1, 1] that vanish with their derivatives up to a given order at both ends:
/// X_m = c_m (1 + x)^p (1 - x)^q P_m^(2q, 2p)(x) with the Jacobi polynomials P_m, whose weight is the square of the factor before them. They
/// span all polynomials of degree < count + p + q that satisfy the conditions; Legendre's for p = q = 0.
///
/// Behind them may stand [`LAYERED`] functions that decay from the free ends as e^-t and t e^-t, t the distance over `layer`, made
/// orthonormal to all before them.
#[derive(Debug, Clone)]
pub struct LegendreBasis {
    /// Order of the zero at -1 (p) and at 1 (q).
    zeros: [usize; 2],
    polynomials: usize,
    /// Decay length of the layer at free ends.
    layer: Option<f64>,
    /// Rows make orthonormal functions of the raw ones (count x count, lower triangle).
    mix: DMatrix<f64>,
}

/// Layer functions behind the polynomials: two kinds, even and odd.
const LAYERED: usize = 4;

impl LegendreBasis {
    /// `polynomials` polynomials with zeros of order `zeros` at -1 and 1; with a `layer`, its functions at the free ends.
    ///
    /// Without a free end there is no layer, and one longer than a tenth of the side needs no functions of its own.
    pub fn new(zeros: [usize; 2], polynomials: usize, layer: Option<f64>) -> Self {
        /// Twice a tenth: the side has length 2.
        const LONGEST: f64 = 0.2;
        let free = zeros.contains(&0);
        let layer = layer.filter(|&length| free && length > 0.0 && length <= LONGEST);
        let extra = match (layer, zeros) {
            (None, _) => 0,
            (Some(_), [0, 0]) => LAYERED,
            (Some(_), _) => LAYERED / 2,
        };
        let count = polynomials + extra;
        let mut basis = Self {
            zeros,
            polynomials,
            layer,
            mix: DMatrix::identity(count, count),
        };
        basis.normalise();
        basis
    }

    /// Gram-Schmidt on the raw functions, twice, by quadrature.
    fn normalise(&mut self) {
        for _ in 0..2 {
            let mut gram = DMatrix::zeros(self.count(), self.count());
            for (x, weight) in self.rule(self.degree() + 1) {
                let values = self.jets(x);
                for (m, left) in values.iter().enumerate() {
                    for (n, right) in values[..=m].iter().enumerate() {
                        // polynomials are orthogonal as they are
                        if m == n || m >= self.polynomials {
                            gram[(m, n)] += weight * left[0] * right[0];
                        }
                    }
                }
            }
            gram.fill_upper_triangle_with_lower_triangle();
            if let Some(inverse) = gram.cholesky().and_then(|factor| factor.l().try_inverse()) {
                self.mix = inverse * &self.mix;
            }
        }
    }

    /// Number of functions.
    pub fn count(&self) -> usize {
        self.mix.nrows()
    }

    /// Degree above that of all polynomials.
    fn degree(&self) -> usize {
        self.polynomials + self.zeros[0] + self.zeros[1]
    }

    /// Whether X_m(-x) = (-1)^m X_m(x).
    pub fn has_parity(&self) -> bool {
        self.zeros[0] == self.zeros[1]
    }

    /// Values and derivatives of all functions at `x`.
    pub fn jets(&self, x: f64) -> Vec<Jet> {
        let raw = self.raw(x);
        let row = |m: usize| {
            let first = if m < self.polynomials { m } else { 0 };
            let terms = (first..=m).map(|n| raw[n].map(|v| self.mix[(m, n)] * v));
            terms.fold([0.0; JET], |sum, term| {
                std::array::from_fn(|r| sum[r] + term[r])
            })
        };
        (0..self.count()).map(row).collect()
    }

    /// Jacobi's polynomials with their factor, and the layers' functions.
    fn raw(&self, x: f64) -> Vec<Jet> {
        let [p, q] = self.zeros;
        let factor = product(power(1.0 + x, 1.0, p), power(1.0 - x, -1.0, q));
        let (alpha, beta) = (2.0 * q as f64, 2.0 * p as f64);
        let mut jets: Vec<Jet> = Vec::with_capacity(self.count());
        for m in 0..self.polynomials {
            let next = match m {
                0 => [1.0, 0.0, 0.0],
                1 => {
                    let slope = 0.5 * (alpha + beta + 2.0);
                    [alpha + 1.0 + slope * (x - 1.0), slope, 0.0]
                }
                _ => jacobi_step(m as f64, [alpha, beta], x, &jets[m - 1], &jets[m - 2]),
            };
            jets.push(next);
        }
        if let Some(length) = self.layer {
            jets.extend((self.polynomials..self.count()).map(|m| self.layered(m, length, x)));
        }
        jets.into_iter().map(|jet| product(factor, jet)).collect()
    }

    /// Layer function number `m`: of the parity of m where both ends are free.
    fn layered(&self, m: usize, length: f64, x: f64) -> Jet {
        let kind = m - self.polynomials;
        let decay = |inner: f64, linear: bool| {
            let (t, slope) = ((1.0 + inner * x) / length, inner / length);
            let e = (-t).exp();
            let jet = if linear {
                [t * e, (1.0 - t) * e, (t - 2.0) * e]
            } else {
                [e, -e, e]
            };
            [jet[0], jet[1] * slope, jet[2] * slope * slope]
        };
        match self.zeros {
            [0, 0] => {
                let (low, high) = (decay(1.0, kind >= 2), decay(-1.0, kind >= 2));
                let sign = if m.is_multiple_of(2) { 1.0 } else { -1.0 };
                std::array::from_fn(|r| sign * low[r] + high[r])
            }
            [0, _] => decay(1.0, kind == 1),
            _ => decay(-1.0, kind == 1),
        }
    }

    /// Gauss-Legendre rule on [-1, 1] for products of functions, exact for polynomials to degree 2 `nodes` - 1.
    fn rule(&self, nodes: usize) -> Vec<(f64, f64)> {
        let ends = match self.layer {
            None => vec![-1.0, 1.0],
            Some(length) => {
                // few decay lengths a panel: e^-2t is then a polynomial to rounding
                let near = [0.0, 3.0, 10.0, 30.0].map(|t| -1.0 + t * length);
                let mut ends: Vec<f64> = near.into_iter().filter(|&x| x < 0.0).collect();
                let mirrored: Vec<f64> = ends.iter().rev().map(|x| -x).collect();
                ends.extend(mirrored);
                ends
            }
        };
        let nodes = numeric::legendre(nodes + if self.layer.is_some() { 12 } else { 0 });
        let panel = |ends: &[f64]| {
            let (low, size) = (ends[0], ends[1] - ends[0]);
            let on = nodes.iter().map(move |(x, w)| (low + size * x, size * w));
            on.collect::<Vec<_>>()
        };
        ends.windows(2).flat_map(panel).collect()
    }
}

/// Jacobi's recurrence (Abramowitz and Stegun 22.7.1) from degrees n - 1 and n - 2 to n, with its derivatives.
fn jacobi_step(n: f64, [a, b]: [f64; 2], x: f64, last: &Jet, before: &Jet) -> Jet {
    let s = 2.0 * n + a + b;
    let scale = 2.0 * n * (n + a + b) * (s - 2.0);
    let slope = (s - 1.0) * s * (s - 2.0) / scale;
    let shift = (s - 1.0) * (a * a - b * b) / scale;
    let back = 2.0 * (n + a - 1.0) * (n + b - 1.0) * s / scale;
    let line = slope * x + shift;
    [
        line * last[0] - back * before[0],
        line * last[1] + slope * last[0] - back * before[1],
        line * last[2] + 2.0 * slope * last[1] - back * before[2],
    ]
}

/// u^n with its derivatives, where u' = `inner`.
fn power(u: f64, inner: f64, n: usize) -> Jet {
    match n {
        0 => [1.0, 0.0, 0.0],
        1 => [u, inner, 0.0],
        _ => [u * u, 2.0 * u * inner, 2.0 * inner * inner],
    }
}

/// The product of two functions.
fn product(f: Jet, g: Jet) -> Jet {
    [
        f[0] * g[0],
        f[1] * g[0] + f[0] * g[1],
        f[2] * g[0] + 2.0 * f[1] * g[1] + f[0] * g[2],
    ]
}

/// Integrals over [-1, 1] of products of derivatives of the functions of two bases.
#[derive(Debug, Clone)]
pub struct Integrals([[DMatrix<f64>; JET]; JET]);

impl Integrals {
    /// For f of basis `f` and g of basis `g`.
    pub fn of(f: &LegendreBasis, g: &LegendreBasis) -> Self {
        /// What is smaller beside its Cauchy-Schwarz bound is rounding of a zero.
        const ROUNDING: f64 = 1e-12;
        let nodes = f.degree().max(g.degree()) + 1;
        let finer = if f.layer.is_some() { f } else { g };
        let mut sum: [[DMatrix<f64>; JET]; JET] =
            std::array::from_fn(|_| std::array::from_fn(|_| DMatrix::zeros(f.count(), g.count())));
        let mut squares = [
            DMatrix::<f64>::zeros(f.count(), JET),
            DMatrix::zeros(g.count(), JET),
        ];
        for (x, weight) in finer.rule(nodes) {
            let (fs, gs) = (f.jets(x), g.jets(x));
            for (square, jets) in squares.iter_mut().zip([&fs, &gs]) {
                for (m, jet) in jets.iter().enumerate() {
                    (0..JET).for_each(|r| square[(m, r)] += weight * jet[r] * jet[r]);
                }
            }
            for (r, row) in sum.iter_mut().enumerate() {
                for (s, matrix) in row.iter_mut().enumerate() {
                    for (n, right) in gs.iter().enumerate() {
                        for (m, left) in fs.iter().enumerate() {
                            matrix[(m, n)] += weight * left[r] * right[s];
                        }
                    }
                }
            }
        }
        for (r, row) in sum.iter_mut().enumerate() {
            for (s, matrix) in row.iter_mut().enumerate() {
                for m in 0..f.count() {
                    for n in 0..g.count() {
                        let bound = (squares[0][(m, r)] * squares[1][(n, s)]).sqrt();
                        if matrix[(m, n)].abs() <= ROUNDING * bound {
                            matrix[(m, n)] = 0.0;
                        }
                    }
                }
            }
        }
        Self(sum)
    }

    /// Integral of the r-th derivative of f_m times the s-th derivative of g_n.
    pub fn get(&self, [r, s]: [usize; 2], [m, n]: [usize; 2]) -> f64 {
        self.0[r][s][(m, n)]
    }
}
