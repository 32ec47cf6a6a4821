//! Random displacements that measure the dual norm of residuals.
//!
//! Random signs of stress at the Gauss points, by the root of the reference stiffness, have nodal forces of covariance K; so z = K^-1 f has covariance
//! K^-1, and the product z.r with a residual r has the residual's dual norm, (r' K^-1 r)^1/2, for its standard deviation. The mean square of
//! [`COUNT`] such products is the square of the norm times chi2 / [`COUNT`]: each is a sum over many points, so nearly normal. (Smetana, Zahm and Patera, SIAM J. Sci. Comput. 41 (2019).)
//! A product is linear in the residual: nothing is squared before what cancels has cancelled.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::Rng;
use rayon::prelude::*;

use super::columns::ColumnStore;
use super::initial_stress::{Gauss, forces_of, gauss_points};
use super::plate::Plate;
use super::solve::Kept;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::sample::{Key, Stream};

/// Products a residual is measured by.
const COUNT: usize = 48;

/// By which their root mean square is multiplied, so that it lies below the norm once in five million residuals: chi2 of 48 degrees of
/// freedom is below 12 with a probability of 2e-7.
const SAFETY: f64 = 2.0;

/// Columns that are solved for together.
const TOGETHER: usize = 8;

/// Scaled so that the norm of the products is the safe side of a residual's dual norm.
pub struct Probes(ColumnStore);

impl Probes {
    /// Draw them for a mesh, the mean membrane stiffness of every stack, and its factorisation. They are the same every time.
    ///
    /// # Errors
    /// A stiffness that is not positive definite.
    pub fn new(
        plate: &Plate,
        mesh: &Mesh,
        means: &[Matrix3<f64>],
        reference: &Kept,
    ) -> Result<Self> {
        let roots = means.iter().map(|mean| {
            let root = mean.cholesky().map(|c| c.l());
            root.ok_or_else(|| Error::program("probes", "a positive definite reference stiffness"))
        });
        let roots = roots.collect::<Result<Vec<_>>>()?;
        let gauss = gauss_points(mesh);
        let scale = SAFETY / (COUNT as f64).sqrt();
        let drawn = |k: usize| {
            let mut stream = Stream::at(KEY, k as u64, 0);
            let resultant = |point: &Gauss| {
                let bits = stream.next_u32();
                let white = Vector3::from_fn(|i, _| if bits >> i & 1 == 0 { 1.0 } else { -1.0 });
                roots[point.stack] * white * (scale / point.weight.sqrt())
            };
            let resultants: Vec<_> = gauss.iter().map(resultant).collect();
            forces_of(mesh, &gauss, &resultants)
        };
        let groups: Vec<Vec<f64>> = (0..COUNT.div_ceil(TOGETHER))
            .into_par_iter()
            .map(|group| {
                let own = group * TOGETHER..COUNT.min((group + 1) * TOGETHER);
                let mut all: Vec<f64> = own.flat_map(drawn).collect();
                plate.solve_with(reference, &mut all);
                all
            })
            .collect();
        let mut probes = ColumnStore::new(mesh.unknowns());
        for column in groups.iter().flat_map(|g| g.chunks(mesh.unknowns())) {
            probes.push(column);
        }
        Ok(Self(probes))
    }

    /// Products of all probes with forces, one column after the other.
    pub fn products(&self, forces: Vec<f64>) -> DMatrix<f64> {
        let rows = self.0.rows;
        self.0
            .products(&DMatrix::from_vec(rows, forces.len() / rows, forces))
    }
}

const KEY: Key = Key {
    seed: 0x70_726f_6265,
    ensemble: 0,
};
