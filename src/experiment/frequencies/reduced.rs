//! Fewer unknowns for many draws: the functions replaced by modes at a few designs, and by the changes between them.

use nalgebra::{DMatrix, DVector};

use super::assembly::{IntegralFamily, Triangle};
use super::plate::PlateCoefficients;
use super::ritz::{Ritz, VibrationMode};
use crate::error::{Error, Result};

impl Ritz {
    /// The same problem in the span of the `count` lowest modes of every family at each of the designs: the stored matrices become small
    /// (a few dozen unknowns) while everything else, also the sensitivities, stays as it is. By the Rayleigh-Ritz principle its frequencies lie
    /// above those of the full problem, exactly on them at the designs, and by a second-order error beside them: choose designs at the corners
    /// of what the constants may be, and check at draws. Modes that were computed before belong to the full problem.
    ///
    /// # Errors
    /// Those of [`Ritz::modes`]; the input's fault without designs.
    pub fn reduced(&self, designs: &[PlateCoefficients], count: usize) -> Result<Self> {
        /// Norm of a vector beyond those before it, as a share, below which it adds nothing but rounding.
        const NEW: f64 = 1e-6;
        self.in_span(designs, NEW, &|_| count)
    }

    /// The same in the span of all modes up to a frequency and some beyond, without what is new by less than a thousandth in them: errors of
    /// frequencies are of the order of its square.
    ///
    /// # Errors
    /// Those of [`Ritz::reduced`].
    pub fn reduced_below(&self, designs: &[PlateCoefficients], end_hz: f64) -> Result<Self> {
        const NEW: f64 = 1e-3;
        /// Modes of a family beyond the end.
        const BEYOND: usize = 1;
        let below =
            |modes: &[VibrationMode]| modes.iter().filter(|m| m.frequency_hz() < end_hz).count();
        self.in_span(designs, NEW, &|modes| below(modes) + BEYOND)
    }

    /// In the span of the first of each family's modes at the designs, as many as `count` says of them.
    fn in_span(
        &self,
        designs: &[PlateCoefficients],
        new: f64,
        count: &dyn Fn(&[VibrationMode]) -> usize,
    ) -> Result<Self> {
        /// Modes of a family that are found.
        const MOST: usize = 64;
        let Some(first) = designs.first() else {
            return Err(Error::input("reduced frequencies", "at least one design"));
        };
        let mut reduced = self.clone();
        for (partition, families) in self.partitions.iter().enumerate() {
            let mut small = Vec::new();
            for (index, family) in families.iter().enumerate() {
                let mut columns: Vec<DVector<f64>> = family.rigid.clone();
                for design in designs {
                    let modes = self.family_modes(design, MOST, [partition, index])?;
                    let count = count(&modes);
                    columns.extend(modes.into_iter().take(count).map(|mode| mode.amplitudes));
                }
                small.push(family.spanned(&columns, first, new));
            }
            reduced.partitions[partition] = small;
        }
        Ok(reduced)
    }
}

impl IntegralFamily {
    /// The family in the span of some vectors, orthonormal in the mass of `of`, without those that are new by a share less than `new`.
    fn spanned(&self, columns: &[DVector<f64>], of: &PlateCoefficients, new: f64) -> Self {
        let [_, mass] = self.matrices(of);
        let mut basis: Vec<[DVector<f64>; 2]> = Vec::new();
        for column in columns {
            let size = column.dot(&(&mass * column)).sqrt();
            let mut rest = column / size;
            // once is not enough where vectors are nearly dependent
            for _ in 0..2 {
                for [vector, image] in &basis {
                    rest.axpy(-image.dot(&rest), vector, 1.0);
                }
            }
            let norm = rest.dot(&(&mass * &rest)).max(0.0).sqrt();
            if norm > new {
                rest /= norm;
                let image = &mass * &rest;
                basis.push([rest, image]);
            }
        }
        let vectors: Vec<_> = basis.iter().map(|[vector, _]| vector.clone()).collect();
        let images: Vec<_> = basis.into_iter().map(|[_, image]| image).collect();
        let (span, images) = (
            DMatrix::from_columns(&vectors),
            DMatrix::from_columns(&images),
        );
        let project =
            |triangles: &[Triangle]| triangles.iter().map(|t| projected(t, &span)).collect();
        Self {
            odd: self.odd,
            functions: self.functions.clone(),
            stiffness: project(&self.stiffness),
            inertia: project(&self.inertia),
            rigid: self.rigid.iter().map(|r| images.tr_mul(r)).collect(),
            lift: Some(match &self.lift {
                Some(lift) => lift * span,
                None => span,
            }),
        }
    }
}

/// Lower triangle of V' T V.
fn projected(triangle: &Triangle, span: &DMatrix<f64>) -> Triangle {
    if triangle.is_empty() {
        return Triangle::new();
    }
    let mut image = DMatrix::zeros(span.nrows(), span.ncols());
    for &(r, c, v) in triangle {
        let (r, c) = (r as usize, c as usize);
        for j in 0..span.ncols() {
            image[(r, j)] += v * span[(c, j)];
            if r != c {
                image[(c, j)] += v * span[(r, j)];
            }
        }
    }
    let small = span.tr_mul(&image);
    let rows = 0..small.nrows();
    rows.flat_map(|r| (0..=r).map(move |c| (r, c)))
        .map(|(r, c)| (r as u32, c as u32, small[(r, c)]))
        .collect()
}
