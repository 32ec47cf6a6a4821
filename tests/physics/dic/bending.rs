//! A thin plate with a free hole, bent by equal moments at its ends: Ritz' method with polynomials and functions of Lekhnitskii's variables,
//! which decay from the hole. Kirchhoff's plate; (x, y) along the data's axes, the load along y.

use nalgebra::{Complex, DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use super::mechanics::Loaded;

/// A deflection and what derives from it: w, (w_x, w_y), (w_xx, w_yy, w_xy).
type Jet = (f64, [f64; 2], [f64; 3]);

/// Highest even degree of the polynomials and highest even power of the decaying functions.
const DEGREE: i32 = 10;
const POWER: i32 = 10;

/// Half length over the width of the piece of the plate that is solved: further off the hole is not felt.
const REACH: f64 = 1.0;

/// The deflection of the bent plate.
pub struct Bent {
    terms: Vec<Term>,
    coefficients: Vec<f64>,
}

enum Term {
    /// (x / W)^i (y / W)^j.
    Power { width: f64, i: i32, j: i32 },
    /// Real or imaginary part of zeta^-n.
    Decaying {
        to: Outside,
        n: i32,
        imaginary: bool,
    },
    /// ln |zeta|.
    Logarithm(Outside),
    /// The angle between two zetas, single-valued as neither is.
    Angle([Outside; 2]),
}

/// The map of the outside of a circle, in z = x + mu y, to that of the unit circle.
#[derive(Clone, Copy)]
struct Outside {
    mu: Complex<f64>,
    radius: f64,
}

impl Outside {
    /// zeta, z, and the root s with d zeta / dz = zeta / s.
    fn at(&self, [x, y]: [f64; 2]) -> [Complex<f64>; 3] {
        let i = Complex::new(0.0, 1.0);
        let z = self.mu * y + x;
        let s = (z * z - (self.mu * self.mu + 1.0) * (self.radius * self.radius)).sqrt();
        let s = if (z + s).norm() >= (z - s).norm() {
            s
        } else {
            -s
        };
        [
            (z + s) / ((Complex::new(1.0, 0.0) - i * self.mu) * self.radius),
            z,
            s,
        ]
    }

    /// A function's jet from its value and its derivatives along z.
    fn jet(&self, imaginary: bool, [f, f1, f2]: [Complex<f64>; 3]) -> Jet {
        let part = |c: Complex<f64>| if imaginary { c.im } else { c.re };
        let mu = self.mu;
        (
            part(f),
            [part(f1), part(mu * f1)],
            [part(f2), part(mu * mu * f2), part(mu * f2)],
        )
    }
}

impl Term {
    fn jet(&self, p: [f64; 2]) -> Jet {
        let logarithm = |to: &Outside| {
            let [zeta, z, s] = to.at(p);
            [zeta.ln(), s.inv(), -z / (s * s * s)]
        };
        match self {
            Self::Power { width, i, j } => {
                let [x, y] = p.map(|p| p / width);
                let term = |di: i32, dj: i32| {
                    let falling =
                        |n: i32, d: i32| (0..d).map(|k| f64::from(n - k)).product::<f64>();
                    let factor = falling(*i, di) * falling(*j, dj);
                    if factor == 0.0 {
                        return 0.0;
                    }
                    factor * x.powi(i - di) * y.powi(j - dj) / width.powi(di + dj)
                };
                (
                    term(0, 0),
                    [term(1, 0), term(0, 1)],
                    [term(2, 0), term(0, 2), term(1, 1)],
                )
            }
            Self::Decaying { to, n, imaginary } => {
                let [zeta, z, s] = to.at(p);
                let f = zeta.powi(-n);
                let n = f64::from(*n);
                let second = f / (s * s) * (n * n) + f * z / (s * s * s) * n;
                to.jet(*imaginary, [f, -f / s * n, second])
            }
            Self::Logarithm(to) => to.jet(false, logarithm(to)),
            Self::Angle([a, b]) => {
                let (one, two) = (a.jet(true, logarithm(a)), b.jet(true, logarithm(b)));
                let turn = (one.0 - two.0 + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
                (
                    turn - std::f64::consts::PI,
                    [0, 1].map(|k| one.1[k] - two.1[k]),
                    [0, 1, 2].map(|k| one.2[k] - two.2[k]),
                )
            }
        }
    }
}

/// The two roots with positive imaginary part of D11 + 4 D16 mu + 2 (D12 + 2 D66) mu^2 + 4 D26 mu^3 + D22 mu^4, by Durand and Kerner's
/// iteration; equal ones are taken apart, which the energy does not mind: functions need not solve the plate's equation.
fn roots(d: &Matrix3<f64>) -> [Complex<f64>; 2] {
    let c = [
        d[(0, 0)],
        4.0 * d[(0, 2)],
        2.0 * (d[(0, 1)] + 2.0 * d[(2, 2)]),
        4.0 * d[(1, 2)],
        d[(1, 1)],
    ]
    .map(|c| c / d[(1, 1)]);
    let value = |z: Complex<f64>| {
        c.iter()
            .rev()
            .fold(Complex::new(0.0, 0.0), |v, c| v * z + c)
    };
    let mut z: Vec<Complex<f64>> = (0..4).map(|k| Complex::new(0.4, 0.9).powi(k)).collect();
    for _ in 0..500 {
        for k in 0..4 {
            let others = (0..4).filter(|j| *j != k);
            let product = others.fold(Complex::new(1.0, 0.0), |p, j| p * (z[k] - z[j]));
            let step = value(z[k]) / product;
            z[k] -= step;
        }
    }
    let mut upper: Vec<Complex<f64>> = z.into_iter().filter(|z| z.im > 0.0).collect();
    if (upper[0] - upper[1]).norm() < 0.1 {
        let middle = (upper[0] + upper[1]) / 2.0;
        upper = vec![middle * 1.06, middle / 1.06];
    }
    [upper[0], upper[1]]
}

/// Bending stiffness of a laminate, N mm, along (x, y).
fn stiffness(loaded: &Loaded) -> Matrix3<f64> {
    let plies = loaded.ply_stiffness();
    let n = plies.len() as f64;
    let h = loaded.thickness_mm;
    let height = |k: f64| h * (k / n - 0.5);
    let plies = plies.iter().enumerate();
    plies.fold(Matrix3::zeros(), |d, (k, q)| {
        let (low, high) = (height(k as f64), height(k as f64 + 1.0));
        d + q * ((high.powi(3) - low.powi(3)) / 3.0)
    })
}

/// Gauss' rule of 6 points on [0, 1].
const RULE: [(f64, f64); 6] = [
    (0.033_765_242_898_424, 0.085_662_246_189_585),
    (0.169_395_306_766_868, 0.180_380_786_524_069),
    (0.380_690_406_958_402, 0.233_956_967_286_346),
    (0.619_309_593_041_598, 0.233_956_967_286_346),
    (0.830_604_693_233_132, 0.180_380_786_524_069),
    (0.966_234_757_101_576, 0.085_662_246_189_585),
];

/// Places and weights of a rule over the rectangle of these half sides without the circle.
fn rule(radius: f64, [a, b]: [f64; 2]) -> Vec<([f64; 2], f64)> {
    const SECTORS: usize = 48;
    const RINGS: usize = 8;
    let corner = b.atan2(a);
    let borders = [0.0, corner, std::f64::consts::FRAC_PI_2];
    let mut all = Vec::new();
    for quadrant in 0..4 {
        let (sx, sy) = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][quadrant];
        for side in 0..2 {
            let width = (borders[side + 1] - borders[side]) / (SECTORS / 8) as f64;
            for sector in 0..SECTORS / 8 {
                for (t, wt) in RULE {
                    let angle = borders[side] + width * (sector as f64 + t);
                    let (sin, cos) = angle.sin_cos();
                    let outer = if side == 0 { a / cos } else { b / sin };
                    // rings of equal ratio, fine at the hole
                    let ratio = (outer / radius).powf(1.0 / RINGS as f64);
                    for ring in 0..RINGS {
                        let low = radius * ratio.powi(ring as i32);
                        let depth = low * (ratio - 1.0);
                        for (q, wq) in RULE {
                            let r = low + depth * q;
                            let weight = wt * width * wq * depth * r;
                            all.push(([sx * r * cos, sy * r * sin], weight));
                        }
                    }
                }
            }
        }
    }
    all
}

impl Bent {
    /// Bent so that the gross section has a curvature of 1/mm along the load.
    pub fn new(loaded: &Loaded) -> Self {
        let d = stiffness(loaded);
        let (width, radius) = (loaded.specimen.width_mm, 0.5 * loaded.specimen.diameter_mm);
        let half = [0.5 * width, REACH * width];
        let terms = terms(&d, width, radius);
        let curvature = |jet: &Jet| Vector3::new(-jet.2[0], -jet.2[1], -2.0 * jet.2[2]);
        let parts = rule(radius, half);
        let stiff = parts
            .par_chunks(512)
            .map(|chunk| {
                let mut sum = DMatrix::zeros(terms.len(), terms.len());
                for (p, weight) in chunk {
                    let k: Vec<Vector3<f64>> =
                        terms.iter().map(|t| curvature(&t.jet(*p))).collect();
                    let m: Vec<Vector3<f64>> = k.iter().map(|k| d * k * *weight).collect();
                    for i in 0..k.len() {
                        for j in 0..=i {
                            sum[(i, j)] += k[i].dot(&m[j]);
                        }
                    }
                }
                sum
            })
            .collect::<Vec<_>>();
        let mut stiff = stiff
            .into_iter()
            .fold(DMatrix::zeros(terms.len(), terms.len()), |a, b| a + b);
        stiff.fill_upper_triangle_with_lower_triangle();
        // a moment along the load alone that bends the gross section by 1/mm
        let moment = 1.0 / d.try_inverse().unwrap()[(1, 1)];
        let work = |term: &Term| -> f64 {
            let slope = |x: f64, y: f64| term.jet([x, y]).1[1];
            let pieces = (0..8).flat_map(|k| RULE.map(|(t, w)| ((k as f64 + t) / 8.0, w / 8.0)));
            let difference = |(t, w): (f64, f64)| {
                let x = width * (t - 0.5);
                w * width * (slope(x, -half[1]) - slope(x, half[1]))
            };
            moment * pieces.map(difference).sum::<f64>()
        };
        let load = DVector::from_iterator(terms.len(), terms.iter().map(work));
        Self {
            coefficients: least(&stiff, &load),
            terms,
        }
    }

    /// Deflection and slopes at a point of the plate.
    pub fn at(&self, p: [f64; 2]) -> (f64, [f64; 2]) {
        let (w, slope, _) = self.jet(p);
        (w, slope)
    }

    /// With its second derivatives.
    pub fn jet(&self, p: [f64; 2]) -> Jet {
        let mut sum = (0.0, [0.0; 2], [0.0; 3]);
        for (term, c) in self.terms.iter().zip(&self.coefficients) {
            let (w, slope, second) = term.jet(p);
            sum.0 += c * w;
            sum.1 = [0, 1].map(|k| sum.1[k] + c * slope[k]);
            sum.2 = [0, 1, 2].map(|k| sum.2[k] + c * second[k]);
        }
        sum
    }
}

/// Functions that look the same after half a turn, as the plate does.
fn terms(d: &Matrix3<f64>, width: f64, radius: f64) -> Vec<Term> {
    let [one, two] = roots(d).map(|mu| Outside { mu, radius });
    let powers = (2..=DEGREE)
        .step_by(2)
        .flat_map(move |n| (0..=n).map(move |i| Term::Power { width, i, j: n - i }));
    let decaying = [one, two].into_iter().flat_map(|to| {
        (2..=POWER)
            .step_by(2)
            .flat_map(move |n| [false, true].map(|imaginary| Term::Decaying { to, n, imaginary }))
    });
    let single = [
        Term::Logarithm(one),
        Term::Logarithm(two),
        Term::Angle([one, two]),
    ];
    powers.chain(decaying).chain(single).collect()
}

/// The least coefficients that make the energy least: functions that are nearly sums of others do no harm.
fn least(stiff: &DMatrix<f64>, load: &DVector<f64>) -> Vec<f64> {
    let scale = stiff.diagonal().map(|s| 1.0 / s.sqrt());
    let scaled = DMatrix::from_fn(load.len(), load.len(), |i, j| {
        scale[i] * stiff[(i, j)] * scale[j]
    });
    let eigen = scaled.symmetric_eigen();
    let projected = eigen.eigenvectors.transpose() * load.component_mul(&scale);
    let inverse = eigen
        .eigenvalues
        .map(|e| if e > 1e-11 { 1.0 / e } else { 0.0 });
    let solved = &eigen.eigenvectors * projected.component_mul(&inverse);
    solved.component_mul(&scale).as_slice().to_vec()
}
