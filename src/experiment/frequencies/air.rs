//! The mass of the air that moves with a plate without baffle, at frequencies well below coincidence.
//!
//! A thin plate moving with velocity v in incompressible air makes a jump psi of the velocity potential over itself, with v = |k| psi / 2 in
//! wavenumbers k; the air's kinetic energy is rho/2 times the integral of psi v (B. Laulagnet, J. Acoust. Soc. Am. 103 (1998) 2451, here
//! without the wavenumber of sound). Galerkin in psi = sum of c_pq sqrt(1 - xi^2) U_p(xi) sqrt(1 - eta^2) U_q(eta), which has the right root
//! at the edges, gives the mass matrix rho B' A^-1 B. An infinite plate has 2 rho / |k| a unit of area; a strip of width b pi rho b^2 / 4 a
//! unit of length; a square of side a 0.579 (pi / 4) rho a^3 (DNV-RP-H103, 2011, appendix A). Frames about held edges are left out.

use nalgebra::{DMatrix, DVector};

use super::assembly::{Functions, Triangle};
use super::basis::LegendreBasis;
use crate::error::{Error, Result};

/// Wavenumbers times half a side at which the integrals stop, and their step: the tail left out is below 1 % of the added mass.
const LAST_WAVENUMBER: f64 = 250.0;
const STEP: f64 = 0.25;

/// Matrix U of the added mass rho (a b / 4) sqrt(a b) U for the functions of the deflection; `aspect` is a / b.
///
/// # Errors
/// The program's fault if the integrals lost their definiteness.
pub fn added_mass(functions: &Functions, aspect: f64) -> Result<Triangle> {
    let [along, across] = &functions.bases[0];
    let order = along.count();
    let couplings = [couplings(along, order), couplings(across, order)];
    let jump = jump_energy(order, aspect);
    let factor = jump.cholesky().ok_or_else(|| {
        Error::program(
            "added mass of the air",
            "positive energies of the potential's jump",
        )
    })?;
    let own: Vec<(u32, usize, usize)> = (0..)
        .zip(&functions.list)
        .filter(|(_, f)| f.field == 0)
        .map(|(i, f)| (i, f.m, f.n))
        .collect();
    let source = DMatrix::from_fn(order * order, own.len(), |pq, i| {
        let (_, m, n) = own[i];
        couplings[0][(pq / order, m)] * couplings[1][(pq % order, n)]
    });
    let mass = source.transpose() * factor.solve(&source);
    let largest = mass.amax();
    let mut triangle = Triangle::new();
    for (i, &(row, ..)) in own.iter().enumerate() {
        for (j, &(column, ..)) in own[..=i].iter().enumerate() {
            /// Below it a product of even and odd functions is rounding.
            const ROUNDING: f64 = 1e-14;
            if mass[(i, j)].abs() > ROUNDING * largest {
                triangle.push((row, column, mass[(i, j)]));
            }
        }
    }
    Ok(triangle)
}

/// Chebyshev's rule of the second kind with `nodes` nodes: (x, weight) for the weight function sqrt(1 - x^2), and the angle of x.
fn chebyshev(nodes: usize) -> impl Iterator<Item = (f64, f64)> {
    let step = std::f64::consts::PI / (nodes + 1) as f64;
    (1..=nodes).map(move |j| {
        let angle = j as f64 * step;
        (angle, step * angle.sin().powi(2))
    })
}

/// U_p at cos(angle).
fn second_kind(p: usize, angle: f64) -> f64 {
    ((p + 1) as f64 * angle).sin() / angle.sin()
}

/// Integrals of sqrt(1 - x^2) U_p times the polynomials of a basis (order x count).
fn couplings(basis: &LegendreBasis, order: usize) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(order, basis.count());
    /// Resolves edge layers down to 1e-3 of a side, and is exact for polynomials.
    const NODES: usize = 400;
    for (angle, weight) in chebyshev(NODES) {
        let jets = basis.jets(angle.cos());
        for p in 0..order {
            let left = weight * second_kind(p, angle);
            for (m, jet) in jets.iter().enumerate() {
                sum[(p, m)] += left * jet[0];
            }
        }
    }
    // of one parity or exactly zero
    if basis.has_parity() {
        for p in 0..order {
            (0..basis.count())
                .filter(|m| (p + m) % 2 == 1)
                .for_each(|m| sum[(p, m)] = 0.0);
        }
    }
    sum
}

/// Amplitudes of the Fourier transforms of sqrt(1 - x^2) U_p at the wavenumbers of the rule: the cosine part for even p, the sine part
/// for odd p (wavenumbers x order).
fn transforms(order: usize) -> DMatrix<f64> {
    let count = (LAST_WAVENUMBER / STEP) as usize;
    // the rule resolves a wave when it has more nodes than half its phase
    let nodes: Vec<_> = chebyshev(LAST_WAVENUMBER as usize + order + 40).collect();
    let mut sum = DMatrix::zeros(count, order);
    for i in 0..count {
        let k = wavenumber(i);
        for &(angle, weight) in &nodes {
            let (sin, cos) = (k * angle.cos()).sin_cos();
            for p in 0..order {
                let wave = if p % 2 == 0 { cos } else { sin };
                sum[(i, p)] += weight * second_kind(p, angle) * wave;
            }
        }
    }
    sum
}

fn wavenumber(i: usize) -> f64 {
    (i as f64 + 0.5) * STEP
}

/// Energies of products of the jump's functions (order^2 x order^2):
/// 1 / (4 pi^2) times the integral of sqrt(alpha^2 / aspect + beta^2 aspect) times the transforms.
fn jump_energy(order: usize, aspect: f64) -> DMatrix<f64> {
    let transforms = transforms(order);
    let count = transforms.nrows();
    let pairs: Vec<(usize, usize)> = (0..order)
        .flat_map(|p| (0..=p).map(move |r| (p, r)))
        .filter(|(p, r)| (p + r) % 2 == 0)
        .collect();
    let products = DMatrix::from_fn(count, pairs.len(), |i, l| {
        transforms[(i, pairs[l].0)] * transforms[(i, pairs[l].1)]
    });
    // four quadrants
    let scale = (STEP / std::f64::consts::PI).powi(2);
    let mut weighed = DMatrix::zeros(count, pairs.len());
    for j in 0..count {
        let row = DVector::from_fn(count, |i, _| {
            scale * (wavenumber(i).powi(2) / aspect + wavenumber(j).powi(2) * aspect).sqrt()
        });
        weighed.set_row(j, &(products.tr_mul(&row)).transpose());
    }
    let energy = products.tr_mul(&weighed).transpose();
    let place = |p: usize, r: usize| pairs.iter().position(|&l| l == (p.max(r), p.min(r)));
    let lookup = DMatrix::from_fn(order, order, place);
    DMatrix::from_fn(order * order, order * order, |a, b| {
        let along = lookup[(a / order, b / order)];
        let across = lookup[(a % order, b % order)];
        match (along, across) {
            (Some(l), Some(m)) => energy[(l, m)],
            _ => 0.0,
        }
    })
}
