//! The greedy choice of a reduced basis's solutions: always the one at which the bound is largest.

use nalgebra::{DMatrix, DVector, DVectorView, Matrix3};
use rayon::prelude::*;

use super::basis::{COMPONENTS, Query, Shape, SpanBasis, TOLERANCE, weights};
use super::columns::ColumnStore;
use super::load::{EndLoad, end_forces, load_parts};
use super::plate::Plate;
use super::probes::Probes;
use super::profile::Profile;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::laminate::Membrane;

/// A basis is grown until all that it is made for stays below this share of the tolerance, so that what lies between does too.
const MARGIN: f64 = 0.3;

/// Solutions in a basis, at most, for each load that it is made for.
const MOST: usize = 20;

impl SpanBasis {
    /// Grow a basis until it answers all queries, which share the mesh, within the tolerance, or has grown as large as pays.
    ///
    /// # Errors
    /// Queries that no one basis can answer; those of a factorisation.
    pub fn greedy(plate: &Plate, mesh: &Mesh, queries: &[Query]) -> Result<Self> {
        let shape = queries.first().and_then(|q| Shape::of(&q.profile));
        let shape = shape.ok_or_else(not_one)?;
        if queries.iter().any(|q| Shape::of(&q.profile) != Some(shape)) {
            return Err(not_one());
        }
        let mut growing = Growing::new(plate, mesh, shape, queries)?;
        let most = MOST * growing.loads.len();
        while growing.basis.size() < most {
            let relative = |q: &Query| {
                let answer = growing.basis.answer(q);
                answer.map_or(f64::INFINITY, |a| a.relative())
            };
            let bounds: Vec<f64> = queries.par_iter().map(relative).collect();
            let worst = worst(queries, &bounds);
            // what is not new is rounding, and so is all that is left
            if worst.is_empty() || !growing.add(&worst)? {
                break;
            }
        }
        Ok(growing.basis)
    }
}

fn not_one() -> Error {
    Error::program(
        "reduced basis",
        "queries of one mesh whose stiffness varies alike",
    )
}

/// The mean membrane stiffness of every stack.
fn means(stacks: usize, queries: &[Query]) -> Result<Vec<Matrix3<f64>>> {
    if queries.iter().any(|q| q.membranes.len() != stacks) {
        return Err(not_one());
    }
    let mean = |k: usize| {
        let all = queries.iter().map(|q| q.membranes[k].matrix());
        all.sum::<Matrix3<f64>>() / queries.len() as f64
    };
    Ok((0..stacks).map(mean).collect())
}

/// The query at which the bound is largest and, for another thread, the one at which it is among those that lie far from it; none where
/// all are small enough.
fn worst<'a>(queries: &'a [Query], bounds: &[f64]) -> Vec<&'a Query> {
    let largest = |weight: &dyn Fn(usize) -> f64| {
        let all = (0..queries.len()).map(|k| (k, weight(k)));
        all.reduce(|a, b| if b.1 > a.1 { b } else { a })
    };
    let Some((first, _)) = largest(&|k| bounds[k]).filter(|(_, b)| *b > MARGIN * TOLERANCE) else {
        return Vec::new();
    };
    if !bounds[first].is_finite() {
        return vec![&queries[first]];
    }
    let distance = |k: usize| {
        let of = |k: usize| weights(&queries[k].membranes, &[1.0]);
        let pairs = of(k).into_iter().zip(of(first));
        pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    let farthest = largest(&distance).map_or(0.0, |(_, d)| d);
    let second = largest(&|k| {
        let far = distance(k) > FAR * farthest;
        if far { bounds[k] } else { 0.0 }
    });
    let second = second.filter(|(_, b)| *b > MARGIN * TOLERANCE);
    let both = [Some(first), second.map(|(k, _)| k)];
    both.into_iter().flatten().map(|k| &queries[k]).collect()
}

/// Two queries lie far from each other beyond this share of the largest distance of any from the first.
const FAR: f64 = 0.4;

/// A basis while it grows.
struct Growing<'a> {
    plate: &'a Plate,
    basis: SpanBasis,
    /// Geometry integrals of the fields of the stiffness.
    integrals: Vec<Vec<[f64; 4]>>,
    /// Geometry integrals of the reference stiffness.
    everywhere: Vec<[f64; 4]>,
    loads: Vec<Vec<f64>>,
    probes: Probes,
}

impl<'a> Growing<'a> {
    fn new(plate: &'a Plate, mesh: &Mesh, shape: Shape, queries: &[Query]) -> Result<Self> {
        let geometry = &*plate.geometry;
        let count = shape.count();
        let integrals: Vec<_> = (0..count)
            .into_par_iter()
            .map(|k| match shape {
                Shape::Uniform => plate.assembly.nominal().to_vec(),
                _ => {
                    let field = |p: [f64; 2]| shape.fields(geometry, p)[k];
                    plate.assembly.integrals(mesh, &field)
                }
            })
            .collect();
        let everywhere = sum(&integrals, &shape.factors(&Profile::default(), 1.0).0);
        let means = means(plate.assembly.stacks(), queries)?;
        let reference: Vec<Membrane> = means.iter().map(Membrane::from).collect();
        let mut factor = plate.factor();
        factor.factorise_with(&everywhere, &reference)?;
        let whitening = means.iter().map(|mean| {
            let inverse = mean.cholesky().and_then(|c| c.l().try_inverse());
            inverse.ok_or_else(not_one)
        });
        let whitening = whitening.collect::<Result<_>>()?;
        let unit = |k: usize| {
            let mut load = end_forces(mesh, &EndLoad::unit(k));
            plate.assembly.pin_loads(&mut load);
            load
        };
        let loads: Vec<Vec<f64>> = (0..load_parts(mesh)).map(unit).collect();
        let n = mesh.unknowns();
        let probes = Probes::new(plate, mesh, &means, &factor.keep())?;
        let mut growing = Self {
            plate,
            basis: SpanBasis {
                shape,
                widening: geometry.widening(),
                reference,
                whitening,
                vectors: ColumnStore::new(n),
                stiffness: vec![DMatrix::zeros(0, 0); COMPONENTS * count * plate.assembly.stacks()],
                loads: vec![DVector::zeros(0); loads.len()],
                residual: DMatrix::zeros(0, 0),
            },
            integrals,
            everywhere,
            loads,
            probes,
        };
        let loads = growing.loads.concat();
        growing.add_residuals(loads);
        Ok(growing)
    }

    /// Solve some queries and add their answers; whether any was new.
    fn add(&mut self, queries: &[&Query]) -> Result<bool> {
        let solve = |query: &&Query| -> Result<Vec<f64>> {
            let (factors, _) = self.basis.shape.factors(&query.profile, 1.0);
            let mut nodal = vec![0.0; self.basis.vectors.rows];
            for (load, a) in self.loads.iter().zip(query.load.parts()) {
                for (sum, f) in nodal.iter_mut().zip(load) {
                    *sum += a * f;
                }
            }
            let mut factor = self.plate.factor();
            factor.factorise_with(&sum(&self.integrals, &factors), &query.membranes)?;
            factor.solve(&mut nodal);
            Ok(nodal)
        };
        let solutions: Vec<Vec<f64>> = queries.par_iter().map(solve).collect::<Result<_>>()?;
        let mut any = false;
        for solution in solutions {
            any |= self.add_vector(solution);
        }
        Ok(any)
    }

    /// Orthonormalise a solution and add it with its forces under every term; nothing where it is not new.
    fn add_vector(&mut self, solution: Vec<f64>) -> bool {
        let assembly = &self.plate.assembly;
        let energy = |v: &DVector<f64>| {
            let forces = assembly.multiply(&self.everywhere, &self.basis.reference, v.as_slice());
            DVector::from_vec(forces)
        };
        let mut v = DVector::from_vec(solution);
        let mut scale = 0.0;
        // twice for the rounding
        for _ in 0..2 {
            let forces = energy(&v);
            scale = v.dot(&forces).max(scale);
            let vectors = self.basis.vectors.view();
            v -= vectors * vectors.tr_mul(&forces);
        }
        let norm = v.dot(&energy(&v)).max(0.0).sqrt();
        // what rounding leaves of a solution that is known already
        if norm <= LOST * scale.sqrt() {
            return false;
        }
        v /= norm;
        self.basis.vectors.push(v.as_slice());
        let terms: Vec<Vec<f64>> = self
            .integrals
            .par_iter()
            .flat_map(|integrals| {
                let mut all = assembly.multiply_components(integrals, v.as_slice());
                for forces in &mut all {
                    assembly.pin_loads(forces);
                }
                all
            })
            .collect();
        let vectors = self.basis.vectors.view();
        let n = vectors.ncols();
        for (matrix, forces) in self.basis.stiffness.iter_mut().zip(&terms) {
            let row = vectors.tr_mul(&DVectorView::from_slice(forces, forces.len()));
            matrix.resize_mut(n, n, 0.0);
            matrix.set_column(n - 1, &row);
            matrix.set_row(n - 1, &row.transpose());
        }
        for (own, load) in self.basis.loads.iter_mut().zip(&self.loads) {
            let last = v.dot(&DVectorView::from_slice(load, load.len()));
            *own = own.push(last);
        }
        self.add_residuals(terms.concat());
        true
    }

    /// Add forces, one column after the other, to those that residuals are made of.
    fn add_residuals(&mut self, forces: Vec<f64>) {
        let products = self.probes.products(forces);
        let all = &mut self.basis.residual;
        let before = all.ncols();
        all.resize_mut(products.nrows(), before + products.ncols(), 0.0);
        all.columns_mut(before, products.ncols())
            .copy_from(&products);
    }
}

/// What is left of a column after what it shares with the others is taken out, over the column, below which it is rounding.
const LOST: f64 = 1e-13;

/// Geometry integrals of a sum of fields.
fn sum(integrals: &[Vec<[f64; 4]>], factors: &[f64]) -> Vec<[f64; 4]> {
    let mut all = vec![[0.0; 4]; integrals[0].len()];
    for (one, factor) in integrals.iter().zip(factors) {
        for (sum, x) in all.iter_mut().zip(one) {
            for (s, x) in sum.iter_mut().zip(x) {
                *s += factor * x;
            }
        }
    }
    all
}
