//! Plies whose stress does not grow with their strain: softer in shear (Hahn and Tsai, J. Composite Materials 7 (1973)), stiffer along
//! stretched fibres.

use nalgebra::Vector3;

use super::anderson::Anderson;
use super::initial_stress::{Gauss, add_forces, gauss_points};
use super::setup::Setup;
use super::solve::Factor;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::laminate::{Ply, strain_rotation};

/// gamma12 = tau12 / G12 + beta tau12^3 and sigma1 = E1 (1 + k epsilon1) epsilon1 + .. in every ply. Shear and normal stresses of a ply in its own axes do not act on
/// each other, so that a ply's shear stress follows from its shear strain alone. What it lacks against G12 gamma12 is
/// an initial stress of the linear plate, and so is what a ply has beyond E1 epsilon1 along its fibres.
///
/// For a negative beta that relation ends at some stress. There the ply stiffens by what it would lose at -beta: defined
/// for any strain, the same to first order, and odd in beta.
pub struct PlyLaw {
    beta: f64,
    g12: f64,
    /// E1 k, MPa.
    fibre: f64,
    /// Different ply angles of every stack.
    stacks: Vec<Vec<PlyRows>>,
}

/// The rows that take laminate strains to a ply's strain along its fibres and to its shear strain, and its thickness, mm.
type PlyRows = ([Vector3<f64>; 2], f64);

/// Relative change of the field at which the iteration ends.
const TOLERANCE: f64 = 1e-11;

/// Most iterations.
const MOST: usize = 200;

impl PlyLaw {
    /// The law of a test; none where it is linear.
    pub fn new(setup: &Setup, ply: &Ply) -> Option<Self> {
        if setup.shear_cubic == 0.0 && setup.fibre_quadratic == 0.0 {
            return None;
        }
        let stacks = setup.stacks();
        let stacks = stacks.iter().map(|(angles, h)| plies(angles, *h)).collect();
        Some(Self {
            beta: setup.shear_cubic,
            g12: ply.g12,
            fibre: setup.fibre_quadratic * ply.e1,
            stacks,
        })
    }

    /// Shear stress that a ply lacks against G12 gamma, MPa.
    fn deficit(&self, gamma: f64) -> f64 {
        let linear = self.g12 * gamma;
        let x = self.g12 * self.beta.abs() * linear * linear;
        self.beta.signum() * linear * (1.0 - softening(x))
    }

    /// Stress resultants N11, N22, N12 that a stack lacks at a strain, N/mm.
    fn resultant_deficit(&self, stack: usize, strain: &Vector3<f64>) -> Vector3<f64> {
        self.stacks[stack]
            .iter()
            .map(|([along, shear], h)| {
                let fibre = along.dot(strain);
                along * (-h * self.fibre * fibre * fibre)
                    + shear * (h * self.deficit(shear.dot(strain)))
            })
            .sum()
    }

    /// Add to `force` (N) the nodal forces of what the laminate lacks under the displacements `nodal` (mm), its stiffness times `scale`;
    /// `gauss` are the mesh's Gauss points.
    pub fn add_forces(
        &self,
        (mesh, gauss): (&Mesh, &[Gauss]),
        scale: &dyn Fn([f64; 2]) -> f64,
        nodal: &[f64],
        force: &mut [f64],
    ) {
        let lacking = |at: &Gauss, strain: &Vector3<f64>| {
            self.resultant_deficit(at.stack, strain) * scale(at.place)
        };
        add_forces(mesh, gauss, nodal, &lacking, force);
    }

    /// From displacements in `nodal` that are near, solve K u = load + (nodal forces of the deficit) until u stands still. K is
    /// factorised already.
    ///
    /// # Errors
    /// An iteration that does not converge.
    pub fn iterate(
        &self,
        mesh: &Mesh,
        scale: &dyn Fn([f64; 2]) -> f64,
        load: &[f64],
        factor: &mut Factor<'_>,
        nodal: &mut Vec<f64>,
    ) -> Result<()> {
        let gauss = gauss_points(mesh);
        let mut accelerated = Anderson::default();
        for _ in 0..MOST {
            let mut image = load.to_vec();
            self.add_forces((mesh, &gauss), scale, nodal, &mut image);
            factor.solve(&mut image);
            let size = image.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
            let change = image
                .iter()
                .zip(nodal.iter())
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            if change <= TOLERANCE * size {
                *nodal = image;
                return Ok(());
            }
            *nodal = accelerated.next(nodal, image);
        }
        Err(Error::input(
            "nonlinear plies",
            "plies under which the plate comes to rest",
        )
        .found(format!("{:e} MPa^-3, {:e} MPa", self.beta, self.fibre))
        .hint("make the coefficient or the load smaller: the plies' stiffness is all but gone"))
    }
}

/// Different ply angles of a stack of equal plies.
fn plies(angles: &[f64], thickness: f64) -> Vec<PlyRows> {
    let each = thickness / angles.len() as f64;
    let mut plies: Vec<(f64, f64)> = Vec::new();
    for &angle in angles {
        match plies.iter_mut().find(|(known, _)| *known == angle) {
            Some((_, h)) => *h += each,
            None => plies.push((angle, each)),
        }
    }
    let rows = |angle: f64| [0, 2].map(|k| strain_rotation(angle).row(k).transpose());
    plies.into_iter().map(|(a, h)| (rows(a), h)).collect()
}

/// The root f of f + x f^3 = 1 for x >= 0: shear stress over its linear value.
fn softening(x: f64) -> f64 {
    if x == 0.0 {
        return 1.0;
    }
    // From f = 1 the convex cubic's Newton steps fall to the root without passing it.
    let mut f: f64 = 1.0;
    for _ in 0..100 {
        let step = (f + x * f.powi(3) - 1.0) / (1.0 + 3.0 * x * f * f);
        f -= step;
        if step.abs() <= 1e-15 {
            break;
        }
    }
    f
}
