//! Plies whose shear strain grows faster than their shear stress (Hahn and Tsai, J. Composite Materials 7 (1973)).

use nalgebra::Vector3;

use super::element::{self, GAUSS};
use super::setup::Setup;
use super::solve::Factor;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::laminate::{Ply, strain_rotation};

/// gamma12 = tau12 / G12 + beta tau12^3 in every ply. Shear and normal stresses of a ply in its own axes do not act on
/// each other, so that a ply's shear stress follows from its shear strain alone. What it lacks against G12 gamma12 is
/// an initial stress of the linear plate.
///
/// For a negative beta that relation ends at some stress. There the ply stiffens by what it would lose at -beta: defined
/// for any strain, the same to first order, and odd in beta.
pub struct ShearLaw {
    beta: f64,
    g12: f64,
    /// Different ply angles: the row that takes laminate strains to the ply's shear strain, and the plies' thickness, mm.
    plies: Vec<(Vector3<f64>, f64)>,
}

/// Relative change of the field at which the iteration ends.
const TOLERANCE: f64 = 1e-11;

/// Most iterations.
const MOST: usize = 200;

impl ShearLaw {
    /// The law of a test; none where it is linear.
    pub fn new(setup: &Setup, ply: &Ply) -> Option<Self> {
        if setup.shear_cubic == 0.0 {
            return None;
        }
        let thickness = setup.thickness / setup.angles.len() as f64;
        let mut plies: Vec<(f64, f64)> = Vec::new();
        for &angle in &setup.angles {
            match plies.iter_mut().find(|(known, _)| *known == angle) {
                Some((_, h)) => *h += thickness,
                None => plies.push((angle, thickness)),
            }
        }
        let row = |angle: f64| -> Vector3<f64> { strain_rotation(angle).row(2).transpose() };
        Some(Self {
            beta: setup.shear_cubic,
            g12: ply.g12,
            plies: plies.into_iter().map(|(a, h)| (row(a), h)).collect(),
        })
    }

    /// Shear stress that a ply lacks against G12 gamma, MPa.
    fn deficit(&self, gamma: f64) -> f64 {
        let linear = self.g12 * gamma;
        let x = self.g12 * self.beta.abs() * linear * linear;
        self.beta.signum() * linear * (1.0 - softening(x))
    }

    /// Stress resultants N11, N22, N12 that the laminate lacks at a strain, N/mm.
    fn resultant_deficit(&self, strain: &Vector3<f64>) -> Vector3<f64> {
        self.plies
            .iter()
            .map(|(row, h)| row * (h * self.deficit(row.dot(strain))))
            .sum()
    }

    /// From the linear solution in `nodal`, solve K u = load + (nodal forces of the deficit) until u stands still. K is
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
        let gauss = gauss_points(mesh, scale);
        for _ in 0..MOST {
            let mut next = load.to_vec();
            self.add_forces(mesh, &gauss, nodal, &mut next);
            factor.solve(&mut next);
            let size = next.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
            let change = next
                .iter()
                .zip(nodal.iter())
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            *nodal = next;
            if change <= TOLERANCE * size {
                return Ok(());
            }
        }
        Err(Error::input(
            "shear_nonlinearity",
            "a shear law under which the plate comes to rest",
        )
        .found(format!("{:e} MPa^-3", self.beta))
        .hint(
            "make the coefficient or the load smaller: the plies' shear stiffness is all but gone",
        ))
    }

    fn add_forces(&self, mesh: &Mesh, gauss: &[Gauss], nodal: &[f64], force: &mut [f64]) {
        let points = GAUSS.len() * GAUSS.len();
        for (nodes, gauss) in mesh.elements.iter().zip(gauss.chunks(points)) {
            let u = nodes.map(|n| [nodal[2 * n as usize], nodal[2 * n as usize + 1]]);
            for (g, weight) in gauss {
                let mut strain = Vector3::zeros();
                for (g, u) in g.iter().zip(u) {
                    strain.x += g[0] * u[0];
                    strain.y += g[1] * u[1];
                    strain.z += g[1] * u[0] + g[0] * u[1];
                }
                let n = self.resultant_deficit(&strain) * *weight;
                for (node, g) in nodes.iter().zip(g) {
                    force[2 * *node as usize] += g[0] * n.x + g[1] * n.z;
                    force[2 * *node as usize + 1] += g[1] * n.y + g[0] * n.z;
                }
            }
        }
    }
}

/// Gradients of an element's shape functions at a Gauss point, and its weight (mm^2, the scale included).
type Gauss = ([[f64; 2]; 8], f64);

fn gauss_points(mesh: &Mesh, scale: &dyn Fn([f64; 2]) -> f64) -> Vec<Gauss> {
    let mut points = Vec::with_capacity(9 * mesh.elements.len());
    for e in 0..mesh.elements.len() {
        let x = mesh.corners(e);
        for (a, wa) in GAUSS {
            for (b, wb) in GAUSS {
                let (g, det) = element::physical_gradient(&x, a, b);
                let p = element::position(&x, &element::shape(a, b));
                points.push((g, wa * wb * det * scale(p)));
            }
        }
    }
    points
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
