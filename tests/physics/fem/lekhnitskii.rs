//! The infinite anisotropic plate with a circular hole under a uniform remote load, in closed form.
//!
//! Complex potentials of S. G. Lekhnitskii, *Anisotropic Plates* (Gordon and Breach, 1968), chapter VI: with
//! z_k = x1 + mu_k x2, the stress function is 2 Re [F_1(z_1) + F_2(z_2)], and Phi_k = F_k' = C_k / zeta_k outside
//! the hole, where zeta_k maps the hole's image in the plane of z_k to the unit circle. Written for stress
//! resultants and membrane compliances, so that a laminate needs no thickness.

use nalgebra::{Complex, Matrix3, Vector3};

use plychain::error::{Error, Result};
use plychain::laminate::Membrane;

type C64 = Complex<f64>;

/// Exact fields about a circular hole centred on the origin.
#[derive(Debug, Clone)]
pub struct HoleSolution {
    radius: f64,
    /// Remote stress resultants (N11, N22, N12), N/mm.
    remote: Vector3<f64>,
    /// Strains of the remote field (e11, e22, g12).
    strain: Vector3<f64>,
    potentials: [Potential; 2],
}

/// One of the two complex potentials, with its displacement factors p and q.
#[derive(Debug, Clone, Copy)]
struct Potential {
    mu: C64,
    amplitude: C64,
    p: C64,
    q: C64,
}

/// Relative change of a66 that splits the double root of an isotropic plate; the fields change by about as much.
const SPLIT: f64 = 1e-9;

impl HoleSolution {
    /// Plate of a membrane stiffness, hole of `radius` (mm), remote stress resultants `remote` (N11, N22, N12; N/mm).
    ///
    /// Where the characteristic roots nearly coincide (isotropy) a66 is changed by 1e-9 of itself to part them.
    ///
    /// # Errors
    /// A stiffness that is not positive definite, or a radius that is not above 0.
    pub fn new(a: &Membrane, radius: f64, remote: [f64; 3]) -> Result<Self> {
        if !(radius.is_finite() && radius > 0.0) {
            return Err(Error::input("hole radius", "a length above 0 mm").found(radius));
        }
        let mut s = compliance(a)?;
        let mut mu = characteristic_roots(&s);
        if (mu[0] - mu[1]).norm() < SPLIT.sqrt() * mu[0].norm() {
            s[(2, 2)] *= 1.0 + SPLIT;
            mu = characteristic_roots(&s);
        }
        let [n11, n22, n12] = remote;
        // No traction on the hole: both derivatives of the stress function cancel the remote ones there.
        let b = C64::new(-0.5 * radius * n22, 0.5 * radius * n12);
        let d = C64::new(0.5 * radius * n12, -0.5 * radius * n11);
        let split = mu[0] - mu[1];
        let amplitude = [(d - mu[1] * b) / split, (mu[0] * b - d) / split];
        let potential = |k: usize| Potential {
            mu: mu[k],
            amplitude: amplitude[k],
            p: mu[k] * mu[k] * s[(0, 0)] + s[(0, 1)] - mu[k] * s[(0, 2)],
            q: mu[k] * s[(0, 1)] + mu[k].inv() * s[(1, 1)] - s[(1, 2)],
        };
        let remote = Vector3::from(remote);
        Ok(Self {
            radius,
            remote,
            strain: s * remote,
            potentials: [potential(0), potential(1)],
        })
    }

    /// Displacement (u1, u2), mm, at a point outside the hole; no rigid motion at infinity.
    pub fn displacement(&self, [x1, x2]: [f64; 2]) -> [f64; 2] {
        let e = &self.strain;
        let mut u = [e[0] * x1 + 0.5 * e[2] * x2, 0.5 * e[2] * x1 + e[1] * x2];
        for k in &self.potentials {
            let (zeta, _) = k.map([x1, x2], self.radius);
            let phi = k.amplitude / zeta;
            u[0] += 2.0 * (k.p * phi).re;
            u[1] += 2.0 * (k.q * phi).re;
        }
        u
    }

    /// Stress resultants (N11, N22, N12), N/mm, at a point outside the hole.
    pub fn resultants(&self, point: [f64; 2]) -> [f64; 3] {
        let mut n = [self.remote[0], self.remote[1], self.remote[2]];
        for k in &self.potentials {
            let (zeta, slope) = k.map(point, self.radius);
            let phi = -k.amplitude * slope / (zeta * zeta);
            n[0] += 2.0 * (k.mu * k.mu * phi).re;
            n[1] += 2.0 * phi.re;
            n[2] -= 2.0 * (k.mu * phi).re;
        }
        n
    }
}

impl Potential {
    /// zeta at a point, and its derivative with respect to z_k. Of the two inverse images the one outside the
    /// unit circle is meant, which also settles the branch of the root.
    fn map(&self, [x1, x2]: [f64; 2], radius: f64) -> (C64, C64) {
        let i = C64::i();
        let z = self.mu * x2 + x1;
        let root = (z * z - (self.mu * self.mu + 1.0) * radius * radius).sqrt();
        let scale = (C64::from(1.0) - i * self.mu) * radius;
        let [plus, minus] = [(z + root) / scale, (z - root) / scale];
        if plus.norm() >= minus.norm() {
            (plus, plus / root)
        } else {
            (minus, -minus / root)
        }
    }
}

/// Stress concentration factor at the end of the hole's transverse diameter of an orthotropic plate (A16 = A26 = 0)
/// in tension along direction 1: 1 + sqrt(2 (sqrt(Ex/Ey) - nu_xy) + Ex/Gxy) (Lekhnitskii).
///
/// # Errors
/// A stiffness that is not positive definite.
pub fn stress_concentration(a: &Membrane) -> Result<f64> {
    let s = compliance(a)?;
    let [ex_ey, nu, ex_g] = [
        s[(1, 1)] / s[(0, 0)],
        -s[(0, 1)] / s[(0, 0)],
        s[(2, 2)] / s[(0, 0)],
    ];
    Ok(1.0 + (2.0 * (ex_ey.sqrt() - nu) + ex_g).sqrt())
}

/// Membrane compliance (mm/N) in engineering shear strain.
fn compliance(a: &Membrane) -> Result<Matrix3<f64>> {
    let stiffness = a.matrix();
    stiffness.cholesky().map(|c| c.inverse()).ok_or_else(|| {
        Error::input("membrane stiffness", "a positive definite matrix").found(format!("{a:?}"))
    })
}

/// The two roots with positive imaginary part of
/// a11 mu^4 - 2 a16 mu^3 + (2 a12 + a66) mu^2 - 2 a26 mu + a22 = 0, by the simultaneous iteration of Weierstrass
/// (Durand and Kerner), in a fixed number of steps: twice as many as a double root needs.
fn characteristic_roots(s: &Matrix3<f64>) -> [C64; 2] {
    let scale = (s[(1, 1)] / s[(0, 0)]).powf(0.25);
    // Coefficients of the monic quartic in mu / scale, from the cubic term down.
    let c = [
        -2.0 * s[(0, 2)],
        2.0 * s[(0, 1)] + s[(2, 2)],
        -2.0 * s[(1, 2)],
        s[(1, 1)],
    ];
    let c = [0, 1, 2, 3].map(|k| c[k] / (s[(0, 0)] * scale.powi(k as i32 + 1)));
    let start = C64::new(0.4, 0.9);
    let mut roots = [0, 1, 2, 3].map(|k| start.powi(k));
    for _ in 0..100 {
        for k in 0..4 {
            let x = roots[k];
            let value = c.iter().fold(C64::from(1.0), |sum, &c| sum * x + c);
            let others = roots.iter().enumerate().filter(|&(j, _)| j != k);
            let product = others.fold(C64::from(1.0), |product, (_, &y)| product * (x - y));
            if product.norm() > 0.0 {
                roots[k] = x - value / product;
            }
        }
    }
    roots.sort_by(|x, y| y.im.total_cmp(&x.im));
    [roots[0] * scale, roots[1] * scale]
}
