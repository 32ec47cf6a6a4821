//! Bent plates in closed form, written for these tests alone: curvature kappa = sym grad theta, M = D kappa, Q = div M.

use nalgebra::{Complex, DMatrix, DVector, Matrix3, Matrix4, Vector3};
use plychain::geometry::Mesh;
use plychain::laminate::PlateStiffness;

/// A plate's state at a point.
pub struct State {
    pub deflection: f64,
    pub rotation: [f64; 2],
    /// kappa_1, kappa_2, kappa_12.
    pub curvature: Vector3<f64>,
    pub shear: [f64; 2],
}

pub trait Thing {
    fn at(&self, p: [f64; 2]) -> State;
}

/// Constant curvature.
pub struct Quadratic {
    pub curvature: Vector3<f64>,
}

impl Thing for Quadratic {
    fn at(&self, [x, y]: [f64; 2]) -> State {
        let k = self.curvature;
        State {
            deflection: -0.5 * (k[0] * x * x + k[1] * y * y + k[2] * x * y),
            rotation: [k[0] * x + 0.5 * k[2] * y, 0.5 * k[2] * x + k[1] * y],
            curvature: k,
            shear: [0.0; 2],
        }
    }
}

/// An isotropic plate with theta = -grad f, f = sin(a x) y cosh(a y) biharmonic: Q = -D grad (laplacian f), and w = f - D/S laplacian f.
pub struct Biharmonic {
    a: f64,
    bending: f64,
    shear: f64,
}

impl Biharmonic {
    pub fn new(a: f64, plate: &PlateStiffness) -> Self {
        Self {
            a,
            bending: plate.bending[(0, 0)],
            shear: plate.shear[(0, 0)],
        }
    }
}

impl Thing for Biharmonic {
    fn at(&self, [x, y]: [f64; 2]) -> State {
        let a = self.a;
        let (s, c) = (a * x).sin_cos();
        let (sh, ch) = ((a * y).sinh(), (a * y).cosh());
        let slope = ch + a * y * sh;
        let laplacian = 2.0 * a * s * sh;
        State {
            deflection: s * y * ch - self.bending / self.shear * laplacian,
            rotation: [-a * c * y * ch, -s * slope],
            curvature: Vector3::new(
                a * a * s * y * ch,
                -s * (2.0 * a * sh + a * a * y * ch),
                -2.0 * a * c * slope,
            ),
            shear: [
                -self.bending * 2.0 * a * a * c * sh,
                -self.bending * 2.0 * a * a * s * ch,
            ],
        }
    }
}

/// exp(x) K_n(x), by the integral of exp(-x cosh t) cosh(n t).
fn bessel_k(n: i32, x: f64) -> f64 {
    // the trapezoidal rule on an analytic integrand of width x^(-1/2): exact to rounding
    let step = 0.2 / (1.0 + x).sqrt();
    let value = |t: f64| (-x * (t.cosh() - 1.0)).exp() * (f64::from(n) * t).cosh();
    let mut sum = 0.5 * value(0.0);
    let mut t = step;
    loop {
        let v = value(t);
        sum += v;
        if x * (t.cosh() - 1.0) > 45.0 + f64::from(n) * t {
            return sum * step;
        }
        t += step;
    }
}

/// Reissner's plate (isotropic) with a circular hole under a remote moment M1 = 1: theta_r = -f0' + (-f' + 2 g / r) cos 2a,
/// theta_a = (2 f / r - g') sin 2a with f0 = A r^2 + B ln r, f = C r^2 + E / r^2 + F and g = G K_2(l r), l^2 = 2 S / (D (1 - nu)).
pub struct IsotropicHole {
    radius: f64,
    nu: f64,
    d: f64,
    s: f64,
    l: f64,
    far: [f64; 2],
    log: f64,
    /// E, F, G.
    near: Vector3<f64>,
}

/// Radial functions of the harmonic 2: a, a', b, b', and w's and Q's parts.
struct Radial {
    a: f64,
    da: f64,
    b: f64,
    db: f64,
    f: f64,
    shear: [f64; 2],
}

impl IsotropicHole {
    pub fn new(moment: f64, radius: f64, nu: f64, plate: &PlateStiffness) -> Self {
        let (d, s) = (plate.bending[(0, 0)], plate.shear[(0, 0)]);
        let kappa = moment / (d * (1.0 - nu * nu));
        let far = [-0.25 * kappa * (1.0 - nu), -0.25 * kappa * (1.0 + nu)];
        let mut hole = Self {
            radius,
            nu,
            d,
            s,
            l: (2.0 * s / (d * (1.0 - nu))).sqrt(),
            far,
            log: 2.0 * far[0] * radius * radius * (1.0 + nu) / (1.0 - nu),
            near: Vector3::zeros(),
        };
        let alone = hole.conditions();
        let mut system = Matrix3::zeros();
        for k in 0..3 {
            hole.near = Vector3::zeros();
            hole.near[k] = 1.0;
            system.set_column(k, &(hole.conditions() - alone));
        }
        hole.near = -system.lu().solve(&alone).unwrap();
        hole
    }

    /// M_r, M_ra over D, and Q_r over D of the harmonic 2 at the edge.
    fn conditions(&self) -> Vector3<f64> {
        let r = self.radius;
        let at = self.radial(r);
        let hoop = (2.0 * at.b + at.a) / r;
        Vector3::new(
            at.da + self.nu * hoop,
            at.db - (2.0 * at.a + at.b) / r,
            at.shear[0] / self.d,
        )
    }

    fn radial(&self, r: f64) -> Radial {
        let [e, f0, g0] = [self.near[0], self.near[1], self.near[2]];
        let c = self.far[1];
        let f = c * r * r + e / (r * r) + f0;
        let df = 2.0 * c * r - 2.0 * e / r.powi(3);
        let ddf = 2.0 * c + 6.0 * e / r.powi(4);
        // K_2(l r) over K_2(l R), with K_2' = -(K_1 + K_3) / 2
        let x = self.l * r;
        let scale = (-self.l * (r - self.radius)).exp() / bessel_k(2, self.l * self.radius);
        let (g, dg) = if scale > 1e-200 {
            let k2 = bessel_k(2, x);
            let slope = -bessel_k(1, x) - 2.0 / x * k2;
            (g0 * scale * k2, g0 * scale * self.l * slope)
        } else {
            (0.0, 0.0)
        };
        let ddg = (self.l * self.l + 4.0 / (r * r)) * g - dg / r;
        Radial {
            a: -df + 2.0 * g / r,
            da: -ddf + 2.0 * dg / r - 2.0 * g / (r * r),
            b: 2.0 * f / r - dg,
            db: 2.0 * df / r - 2.0 * f / (r * r) - ddg,
            // w = f - D/S laplacian f, the latter -4 F / r^2
            f: f + 4.0 * self.d / self.s * f0 / (r * r),
            shear: [
                -8.0 * self.d * f0 / r.powi(3) + 2.0 * self.s * g / r,
                -8.0 * self.d * f0 / r.powi(3) - self.s * dg,
            ],
        }
    }

    /// M_a over the remote moment at the ends of the diameter across the load.
    pub fn concentration(&self) -> f64 {
        let r = self.radius;
        let at = self.radial(r);
        let (d0, dd0) = self.mean_slopes(r);
        let hoop = -d0 / r - (2.0 * at.b + at.a) / r;
        let radial = -dd0 - at.da;
        self.d * (hoop + self.nu * radial)
    }

    fn mean_slopes(&self, r: f64) -> (f64, f64) {
        let a = self.far[0];
        (2.0 * a * r + self.log / r, 2.0 * a - self.log / (r * r))
    }
}

impl Thing for IsotropicHole {
    fn at(&self, [x, y]: [f64; 2]) -> State {
        let r = x.hypot(y);
        let (sin, cos) = (y / r, x / r);
        let (s2, c2) = (2.0 * sin * cos, cos * cos - sin * sin);
        let at = self.radial(r);
        let (d0, dd0) = self.mean_slopes(r);
        let (radial, hoop) = (-d0 + at.a * c2, at.b * s2);
        let kr = -dd0 + at.da * c2;
        let ka = (-d0 + (2.0 * at.b + at.a) * c2) / r;
        let kra = (at.db - (2.0 * at.a + at.b) / r) * s2;
        let (qr, qa) = (at.shear[0] * c2, at.shear[1] * s2);
        let mean = self.far[0] * r * r + self.log * r.ln();
        // w = f - D/S laplacian f: the mean part's laplacian is 4 A, a rigid motion
        State {
            deflection: mean + at.f * c2,
            rotation: [radial * cos - hoop * sin, radial * sin + hoop * cos],
            curvature: Vector3::new(
                kr * cos * cos + ka * sin * sin - kra * sin * cos,
                kr * sin * sin + ka * cos * cos + kra * sin * cos,
                2.0 * (kr - ka) * sin * cos + kra * c2,
            ),
            shear: [qr * cos - qa * sin, qr * sin + qa * cos],
        }
    }
}

type C = Complex<f64>;

/// Kirchhoff's plate of any laminate with a circular hole under a remote moment M1 = 1, by Lekhnitskii's complex potentials:
/// w = w_far + 2 Re sum_k phi_k(x + mu_k y), phi_k' = A_k / zeta_k. The two A_k follow from M_r = 0 and V_r = Q_r + dM_ra / (r da) = 0 along
/// the edge by least squares, whose residual, over the remote moment, shows that the form is complete.
pub struct LaminateHole {
    radius: f64,
    far: Vector3<f64>,
    d: Matrix3<f64>,
    mu: [C; 2],
    amplitude: [C; 2],
    pub residual: f64,
}

impl LaminateHole {
    pub fn new(radius: f64, plate: &PlateStiffness) -> Self {
        let d = plate.bending;
        // D22 m^4 + 4 D26 m^3 + (2 D12 + 4 D66) m^2 + 4 D16 m + D11 = 0
        let lead = d[(1, 1)];
        let monic = [
            d[(0, 0)] / lead,
            4.0 * d[(0, 2)] / lead,
            (2.0 * d[(0, 1)] + 4.0 * d[(2, 2)]) / lead,
            4.0 * d[(1, 2)] / lead,
        ];
        let companion = Matrix4::new(
            0.0, 0.0, 0.0, -monic[0], //
            1.0, 0.0, 0.0, -monic[1], //
            0.0, 1.0, 0.0, -monic[2], //
            0.0, 0.0, 1.0, -monic[3],
        );
        let roots = companion.complex_eigenvalues();
        let upper: Vec<C> = roots.iter().copied().filter(|m| m.im > 0.0).collect();
        let mut hole = Self {
            radius,
            far: d.try_inverse().unwrap() * Vector3::x(),
            d,
            mu: [upper[0], upper[1]],
            amplitude: [C::new(0.0, 0.0); 2],
            residual: 0.0,
        };
        let zero = hole.edge();
        let mut system = DMatrix::zeros(zero.len(), 4);
        for k in 0..4 {
            hole.amplitude = [C::new(0.0, 0.0); 2];
            hole.amplitude[k / 2] = [C::new(1.0, 0.0), C::new(0.0, 1.0)][k % 2];
            system.set_column(k, &(hole.edge() - &zero));
        }
        let found = system
            .clone()
            .svd(true, true)
            .solve(&-&zero, 1e-14)
            .unwrap();
        hole.amplitude = [C::new(found[0], found[1]), C::new(found[2], found[3])];
        hole.residual = hole.edge().amax();
        hole
    }

    /// M_r and R V_r around the edge, and the step of w once around the hole, as a moment: edge conditions on moments and forces alone leave a
    /// dislocation open.
    fn edge(&self) -> DVector<f64> {
        let count = 48;
        let polar = |angle: f64| {
            let (s, c) = angle.sin_cos();
            let at = self.at([self.radius * c, self.radius * s]);
            let m = self.d * at.curvature;
            (
                m[0] * c * c + m[1] * s * s + 2.0 * m[2] * s * c,
                (m[1] - m[0]) * s * c + m[2] * (c * c - s * s),
                at.shear[0] * c + at.shear[1] * s,
            )
        };
        let step = 1e-4;
        let values = (0..count).flat_map(|i| {
            let angle = std::f64::consts::TAU * (f64::from(i) + 0.3) / f64::from(count);
            let (radial, _, shear) = polar(angle);
            let twist = (polar(angle + step).1 - polar(angle - step).1) / (2.0 * step);
            [radial, self.radius * shear + twist]
        });
        let step: f64 = (0..2)
            .map(|k| (self.amplitude[k] * (1.0 - C::new(0.0, 1.0) * self.mu[k])).im)
            .sum();
        let step = step * self.d[(0, 0)] / self.radius.powi(2);
        DVector::from_iterator(2 * count as usize + 1, values.chain([step]))
    }

    /// phi', phi'', phi''' of the two potentials.
    fn potentials(&self, [x, y]: [f64; 2]) -> [[C; 3]; 2] {
        let (r, i) = (self.radius, C::new(0.0, 1.0));
        [0, 1].map(|k| {
            let (mu, a) = (self.mu[k], self.amplitude[k]);
            let z = C::new(x, 0.0) + mu * y;
            let (inner, outer) = (1.0 + i * mu, 1.0 - i * mu);
            let root = (z * z - (1.0 + mu * mu) * (r * r)).sqrt();
            let [plus, minus] = [(z + root) / (outer * r), (z - root) / (outer * r)];
            let zeta = if plus.norm() > minus.norm() {
                plus
            } else {
                minus
            };
            let slope = (outer - inner / (zeta * zeta)) * (0.5 * r);
            let p = outer * zeta * zeta - inner;
            let second = -a * (2.0 / r) / p;
            let third = a * (4.0 / r) * outer * zeta / (p * p) / slope;
            [a / zeta, second, third]
        })
    }

    /// What the hole changes in the rotations over the rotations, at some nodes.
    pub fn share(&self, mesh: &Mesh, of: impl Fn([f64; 2]) -> bool) -> f64 {
        let far = Quadratic {
            curvature: self.far,
        };
        let mut sums = [0.0; 2];
        for &p in mesh.nodes.iter().filter(|p| of(**p)) {
            let (here, plain) = (self.at(p).rotation, far.at(p).rotation);
            for c in 0..2 {
                sums[0] += (here[c] - plain[c]).powi(2);
                sums[1] += plain[c].powi(2);
            }
        }
        (sums[0] / sums[1]).sqrt()
    }
}

impl Thing for LaminateHole {
    fn at(&self, p: [f64; 2]) -> State {
        let plain = Quadratic {
            curvature: self.far,
        };
        let mut state = plain.at(p);
        let mut third = [0.0; 4];
        for (k, [first, second, by_third]) in self.potentials(p).into_iter().enumerate() {
            let mu = self.mu[k];
            let twice = |value: C| 2.0 * value.re;
            state.rotation[0] -= twice(first);
            state.rotation[1] -= twice(mu * first);
            state.curvature -= Vector3::new(
                twice(second),
                twice(mu * mu * second),
                2.0 * twice(mu * second),
            );
            for (n, third) in third.iter_mut().enumerate() {
                *third -= twice(mu.powi(n as i32) * by_third);
            }
        }
        // derivatives of the curvatures along 1 and 2
        let along = Vector3::new(third[0], third[2], 2.0 * third[1]);
        let across = Vector3::new(third[1], third[3], 2.0 * third[2]);
        let (m1, m2) = (self.d * along, self.d * across);
        state.shear = [m1[0] + m2[2], m1[2] + m2[1]];
        state
    }
}
