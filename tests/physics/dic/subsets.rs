//! Subsets of pixels, each fitted by least squares: what image correlation reports is the fit's value at the subset's centre.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A regular grid of pixels and the subsets on it.
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    /// Distance of pixels, mm.
    pub pixel_mm: f64,
    /// Pixels along a side of a subset, odd.
    pub side: usize,
    /// Pixels from one subset's centre to the next one's.
    pub step: usize,
    /// The centre of the first subset, mm.
    pub first_mm: [f64; 2],
    /// Subsets along x and along y.
    pub count: [usize; 2],
    pub shape: Shape,
    /// What becomes of subsets that reach beyond the specimen.
    pub cut: Cut,
}

/// How the displacement varies over a subset in the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Not at all: the mean. The file's "full".
    Constant,
    Affine,
    Quadratic,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cut {
    Dropped,
    /// Fitted over what is left, where that is a third of the pixels with the central one.
    Kept,
}

impl Layout {
    /// Side of a subset, mm.
    pub fn subset_mm(&self) -> f64 {
        self.side as f64 * self.pixel_mm
    }

    /// Distance of subsets' centres, mm.
    pub fn step_mm(&self) -> f64 {
        self.step as f64 * self.pixel_mm
    }

    /// Pixels along x and along y.
    pub fn pixels(&self) -> [usize; 2] {
        self.count.map(|n| (n - 1) * self.step + self.side)
    }

    /// Places of all pixels, mm, row by row along x.
    pub fn places(&self) -> Vec<[f64; 2]> {
        let half = (self.side / 2) as f64;
        let [columns, rows] = self.pixels();
        let at = |k: usize, i: usize| self.first_mm[k] + (i as f64 - half) * self.pixel_mm;
        let row = |j| (0..columns).map(move |i| [at(0, i), at(1, j)]);
        (0..rows).flat_map(row).collect()
    }

    /// Values of a fit's terms at an offset from the centre, in half sides.
    fn terms(&self, [x, y]: [f64; 2]) -> Vec<f64> {
        match self.shape {
            Shape::Constant => vec![1.0],
            Shape::Affine => vec![1.0, x, y],
            Shape::Quadratic => vec![1.0, x, y, x * x, x * y, y * y],
        }
    }

    /// The weights with which the values at some pixels (offsets from the centre) make the fit's value there.
    fn weights(&self, offsets: &[[i64; 2]]) -> Vec<f64> {
        let half = self.side as f64 / 2.0;
        let rows: Vec<f64> = offsets
            .iter()
            .flat_map(|o| self.terms(o.map(|o| o as f64 / half)))
            .collect();
        let terms = rows.len() / offsets.len();
        let design = DMatrix::from_row_slice(offsets.len(), terms, &rows);
        let normal = (design.transpose() * &design).cholesky();
        let mut unit = DVector::zeros(terms);
        unit[0] = 1.0;
        let solved = normal.expect("pixels that determine the fit").solve(&unit);
        (design * solved).as_slice().to_vec()
    }
}

/// The subsets that report, and how.
pub struct Filter {
    /// Centres, mm, row by row along x.
    pub points: Vec<[f64; 2]>,
    subsets: Vec<Subset>,
    /// Offsets of pixels in the list of all, and weights, of a subset that is not cut.
    whole: Vec<(i64, f64)>,
}

/// The central pixel, and the pixels and weights of a cut subset.
struct Subset {
    center: i64,
    own: Option<Vec<(i64, f64)>>,
}

impl Filter {
    /// `on_specimen`: which pixels show the specimen.
    pub fn new(layout: &Layout, on_specimen: &[bool]) -> Self {
        let columns = layout.pixels()[0] as i64;
        let half = (layout.side / 2) as i64;
        let offsets: Vec<[i64; 2]> = (-half..=half)
            .flat_map(|y| (-half..=half).map(move |x| [x, y]))
            .collect();
        let index = |[x, y]: [i64; 2]| y * columns + x;
        let listed = |offsets: &[[i64; 2]]| -> Vec<(i64, f64)> {
            let weights = layout.weights(offsets);
            offsets.iter().map(|&o| index(o)).zip(weights).collect()
        };
        let centers: Vec<[usize; 2]> = (0..layout.count[1])
            .flat_map(|j| (0..layout.count[0]).map(move |i| [i, j]))
            .collect();
        let made = |&[i, j]: &[usize; 2]| {
            let center = index([i, j].map(|k| (k * layout.step) as i64 + half));
            let shows = |o: &&[i64; 2]| on_specimen[(center + index(**o)) as usize];
            let left: Vec<[i64; 2]> = offsets.iter().filter(shows).copied().collect();
            let own = if left.len() == offsets.len() {
                None
            } else if layout.cut == Cut::Kept
                && left.contains(&[0, 0])
                && 3 * left.len() >= offsets.len()
            {
                Some(listed(&left))
            } else {
                return None;
            };
            let point = [
                layout.first_mm[0] + i as f64 * layout.step_mm(),
                layout.first_mm[1] + j as f64 * layout.step_mm(),
            ];
            Some((point, Subset { center, own }))
        };
        let (points, subsets) = centers.par_iter().filter_map(made).unzip();
        Self {
            points,
            subsets,
            whole: listed(&offsets),
        }
    }

    /// What is reported of values at all pixels; those off the specimen do not count.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        let value = |s: &Subset| {
            let kernel = s.own.as_ref().unwrap_or(&self.whole);
            let terms = kernel.iter();
            terms
                .map(|(o, w)| w * values[(s.center + o) as usize])
                .sum()
        };
        self.subsets.par_iter().map(value).collect()
    }

    /// Factor by which a whole subset reduces the sd of white noise of the pixels.
    pub fn gain(&self) -> f64 {
        self.whole.iter().map(|(_, w)| w * w).sum::<f64>().sqrt()
    }
}
