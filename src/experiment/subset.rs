//! What image correlation reports of a displacement field: at each point the value, there, of the shape function that is fitted by least
//! squares over a subset of the picture (Sutton, Orteu, Schreier, Image Correlation for Shape, Motion and Deformation Measurements,
//! 2009, ch. 5). Where the subset is whole that is a fixed average over it: for uniform and affine shape functions the mean.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::fem::{Locator, Observer};
use crate::field::rigid::RigidMotion;
use crate::field::{ImageCorrelation, PartialSubsets, SubsetShape};
use crate::numeric::legendre;

/// How images of the specimen are correlated.
#[derive(Debug, Clone, Serialize)]
pub struct Imaging {
    pub subsets: Subsets,
    /// Distance of the camera, mm, where it is declared.
    pub camera_distance_mm: Option<f64>,
    /// Motion of the specimen in the plane between the pictures, as the data show it.
    pub motion: RigidMotion,
}

/// The subsets of an image correlation.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Subsets {
    /// Side of the square, mm.
    pub side_mm: f64,
    /// The declared side, to which the effect of another size is relative, mm.
    pub declared_mm: f64,
    /// Shape function.
    pub shape: SubsetShape,
    /// Whether points stay whose subset reaches over an edge: their fit rests on what is left of it.
    pub kept: bool,
}

/// Gauss points along a side: they integrate the square of a quadratic exactly, and a hole's field to a part in a thousand of what the
/// subset does to it while the side is below half the hole's diameter (measured beside 12 points).
const POINTS: usize = 4;

/// Samples along a side by which whole subsets are told from cut ones, corners included, and by which these are fitted.
const LOOKS: usize = 7;
const SAMPLES: usize = 9;

impl Subsets {
    /// Those of an image correlation.
    pub fn of(images: ImageCorrelation) -> Self {
        Self {
            side_mm: images.effective_subset_mm.unwrap_or(images.subset_mm),
            declared_mm: images.subset_mm,
            shape: images.shape.unwrap_or(SubsetShape::Affine),
            kept: images.partial_subsets == PartialSubsets::Kept,
        }
    }

    /// Places of a whole subset about the origin, with the weight that each has in what is reported.
    fn whole(&self) -> Vec<([f64; 2], f64)> {
        let rule = legendre(POINTS);
        let local: Vec<([f64; 2], f64)> = rule
            .iter()
            .flat_map(|&(x, wx)| {
                rule.iter()
                    .map(move |&(y, wy)| ([2.0 * x - 1.0, 2.0 * y - 1.0], wx * wy))
            })
            .collect();
        self.weighted([0.0; 2], &local)
    }

    /// Weights of `cells` x `cells` equal cells of a whole subset in what is reported, row by row.
    pub(super) fn of_cells(&self, cells: usize) -> Vec<f64> {
        let place = |k: usize| (2 * k + 1) as f64 / cells as f64 - 1.0;
        let local: Vec<([f64; 2], f64)> = (0..cells * cells)
            .map(|k| ([place(k % cells), place(k / cells)], 1.0))
            .collect();
        let weighted = self.weighted([0.0; 2], &local);
        weighted.into_iter().map(|(_, weight)| weight).collect()
    }

    /// Places and weights of the samples of a subset that lie on the specimen; none if too few do.
    fn cut(&self, center: [f64; 2], locator: &Locator<'_>) -> Option<Vec<([f64; 2], f64)>> {
        let half = 0.5 * self.side_mm;
        let place = |k: usize| (2 * k + 1) as f64 / SAMPLES as f64 - 1.0;
        let all: Vec<[f64; 2]> = (0..SAMPLES)
            .flat_map(|i| (0..SAMPLES).map(move |j| [place(i), place(j)]))
            .collect();
        let places: Vec<[f64; 2]> = all
            .iter()
            .map(|l| [0, 1].map(|k| center[k] + half * l[k]))
            .collect();
        let on = locator.holds(&places);
        let left: Vec<([f64; 2], f64)> = all
            .into_iter()
            .zip(on)
            .filter_map(|(l, on)| on.then_some((l, 1.0)))
            .collect();
        let enough = left.len() >= 2 * self.terms([0.0; 2]).len();
        enough.then(|| self.weighted(center, &left))
    }

    /// The power of the side with which the error of a whole subset goes: derivatives of second order are what a plane misses, of fourth
    /// order what a quadratic surface does.
    pub(super) fn power(&self) -> i32 {
        match self.shape {
            SubsetShape::Full | SubsetShape::Affine => 2,
            SubsetShape::Quadratic => 4,
        }
    }

    /// What these subsets lack of larger ones, over what they do themselves, where larger ones do `more` than the declared ones, over what those do.
    pub(super) fn lacking(&self, more: f64) -> f64 {
        let declared = (self.declared_mm / self.side_mm).powi(self.power());
        (1.0 + more) * declared - 1.0
    }

    /// Terms of the shape function at local coordinates, the constant first.
    fn terms(&self, [x, y]: [f64; 2]) -> Vec<f64> {
        match self.shape {
            SubsetShape::Full => vec![1.0],
            SubsetShape::Affine => vec![1.0, x, y],
            SubsetShape::Quadratic => vec![1.0, x, y, x * x, x * y, y * y],
        }
    }

    /// Weights of the value at the centre of the shape function fitted to places in local coordinates, each with its own weight.
    fn weighted(&self, center: [f64; 2], local: &[([f64; 2], f64)]) -> Vec<([f64; 2], f64)> {
        let half = 0.5 * self.side_mm;
        let n = self.terms([0.0; 2]).len();
        let mut gram = DMatrix::zeros(n, n);
        for (l, w) in local {
            let a = DVector::from_vec(self.terms(*l));
            gram.ger(*w, &a, &a, 1.0);
        }
        let mut first = DVector::zeros(n);
        first[0] = 1.0;
        // places on a line determine no plane: then their mean
        let row = gram.cholesky().map(|factor| factor.solve(&first));
        let total: f64 = local.iter().map(|(_, w)| w).sum();
        let weight = |l: &[f64; 2], w: f64| match &row {
            Some(row) => w * row.dot(&DVector::from_vec(self.terms(*l))),
            None => w / total,
        };
        let place = |l: &[f64; 2]| [0, 1].map(|k| center[k] + half * l[k]);
        local
            .iter()
            .map(|(l, w)| (place(l), weight(l, *w)))
            .collect()
    }

    /// Whether the subset about each point lies on the specimen altogether.
    pub fn are_whole(&self, points: &[[f64; 2]], locator: &Locator<'_>) -> Vec<bool> {
        let half = 0.5 * self.side_mm;
        let place = |k: usize| 2.0 * k as f64 / (LOOKS - 1) as f64 - 1.0;
        let looks = |p: &[f64; 2]| -> Vec<[f64; 2]> {
            let p = *p;
            (0..LOOKS)
                .flat_map(|i| {
                    (0..LOOKS).map(move |j| [p[0] + half * place(i), p[1] + half * place(j)])
                })
                .collect()
        };
        let all: Vec<[f64; 2]> = points.iter().flat_map(looks).collect();
        let on = locator.holds(&all);
        on.chunks(LOOKS * LOOKS)
            .map(|on| on.iter().all(|x| *x))
            .collect()
    }

    /// What is reported at points.
    pub fn observe(&self, points: &[[f64; 2]], locator: &Locator<'_>) -> Observer {
        let kernel = self.whole();
        let shifted = |p: [f64; 2]| -> Vec<([f64; 2], f64)> {
            let place = |(l, w): &([f64; 2], f64)| ([p[0] + l[0], p[1] + l[1]], *w);
            kernel.iter().map(place).collect()
        };
        let whole = if self.kept {
            self.are_whole(points, locator)
        } else {
            vec![true; points.len()]
        };
        let samples: Vec<Vec<([f64; 2], f64)>> = points
            .iter()
            .zip(whole)
            .map(|(&p, whole)| match whole {
                true => shifted(p),
                false => self.cut(p, locator).unwrap_or_else(|| vec![(p, 1.0)]),
            })
            .collect();
        locator.observe_averages(&samples)
    }
}
