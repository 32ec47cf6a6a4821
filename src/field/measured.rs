//! The measured field: points, displacements, and what was dropped on the way.

use std::path::PathBuf;

use rstar::RTree;
use serde::{Deserialize, Serialize};

use super::frame::Frame;
use crate::error::{Error, Result};
use crate::numeric::median;

/// Coordinates and displacements beyond this are taken for a mistake in the units, mm.
pub(super) const FARTHEST_MM: f64 = 1e5;

/// Share of the field's extent by which outliers may lie outside of the other points, and of outliers that do, and still
/// be taken for measured there.
const BORDER: f64 = 0.05;

/// Points whose stated sds lie further from the median, by this factor, count as if they did not.
const FARTHEST_SD: f64 = 5.0;

/// A measured displacement field. All vectors have one entry a point.
#[derive(Debug, Clone)]
pub struct Field {
    /// Points (s, t) in mm: along direction 1 and 2, origin at the hole's centre.
    pub points: Vec<[f64; 2]>,
    /// Displacements (u1, u2) in mm along direction 1 and 2.
    pub displacement: Vec<[f64; 2]>,
    /// Standard deviations of the displacements, mm, where the measurement states them: how much points count, relative to each other.
    pub sigma: Option<Vec<f64>>,
    /// The declared axes and origin.
    pub frame: Frame,
    /// The matrix the points come from, if they do.
    pub grid: Option<GridShape>,
    /// How many points were dropped, and why.
    pub rejected: Rejected,
    /// Places of the outliers among them, mm, as far as they are believed. They were measured all the same: a gauge over
    /// the measured points counts them.
    pub outlying: Vec<[f64; 2]>,
    /// Frequency of a moire grating, lines per mm of displacement.
    pub fringe_frequency_per_mm: Option<f64>,
    /// Side of the subsets of an image correlation, mm, where it is declared.
    pub subset_mm: Option<f64>,
    /// Angle by which the plane of a stereo measurement's points was tilted, degrees; places and displacements are along its axes.
    pub levelled_deg: Option<f64>,
    /// The files that were read, for the manifest's hashes.
    pub files: Vec<PathBuf>,
}

/// Where the points lie in a matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct GridShape {
    /// Rows of the matrix.
    pub rows: usize,
    /// Columns of the matrix.
    pub cols: usize,
    /// `row * cols + col` of each point.
    pub index: Vec<usize>,
}

/// Numbers of dropped points by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// Not measured: NaN or empty cells.
    pub missing: usize,
    /// The images did not correlate there, by the export's own account (`sigma`, `correlation`).
    #[serde(default)]
    pub uncorrelated: usize,
    /// Rows at places that stand in the file already.
    #[serde(default)]
    pub repeated: usize,
    /// Not measured in another step of the series.
    #[serde(default)]
    pub unmatched: usize,
    /// Outside the declared window.
    pub outside_window: usize,
    /// In the declared mask.
    #[serde(default)]
    pub masked: usize,
    /// Outliers ([`super::outliers`]).
    pub outliers: usize,
    /// Outside the plate or inside the hole, as the caller knows them.
    pub outside_plate: usize,
}

/// Why points are dropped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// Outside the declared window.
    OutsideWindow,
    /// The images did not correlate there.
    Uncorrelated,
    /// In the declared mask.
    Masked,
    /// At the place of another point.
    Repeated,
    /// Not measured in another step of the series.
    Unmatched,
    Outlier,
    /// Outside the plate or inside the hole.
    OutsidePlate,
}

impl Field {
    /// A field with fewer points than this is refused when it is read.
    pub const FEWEST: usize = 24;

    /// Without points yet; all that a field may have beside them is unset.
    pub fn empty(frame: Frame) -> Self {
        Self {
            points: Vec::new(),
            displacement: Vec::new(),
            sigma: None,
            frame,
            grid: None,
            rejected: Rejected::default(),
            outlying: Vec::new(),
            fringe_frequency_per_mm: None,
            subset_mm: None,
            levelled_deg: None,
            files: Vec::new(),
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether no point is left.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// How much each point counts: the mean variance over its own, where sds are stated. One that is far better or worse than most
    /// counts as one that is five times better or worse.
    pub fn weights(&self) -> Option<Vec<f64>> {
        let mut sorted = self.sigma.clone()?;
        let typical = median(&mut sorted);
        let range = typical / FARTHEST_SD..=typical * FARTHEST_SD;
        let sds = self.sigma.iter().flatten();
        let variances: Vec<f64> = sds
            .map(|sd| sd.clamp(*range.start(), *range.end()).powi(2))
            .collect();
        let mean = variances.iter().sum::<f64>() / variances.len().max(1) as f64;
        (mean > 0.0).then(|| variances.iter().map(|v| mean / v).collect())
    }

    /// One component of the displacement, mm: 0 for u1, 1 for u2.
    pub fn component(&self, component: usize) -> Vec<f64> {
        self.displacement.iter().map(|u| u[component]).collect()
    }

    /// Keep the points for which `keep(index)` holds, count the others under `reason`, and return how many went.
    pub fn retain(&mut self, reason: Reason, keep: impl Fn(usize) -> bool) -> usize {
        let kept: Vec<usize> = (0..self.len()).filter(|&i| keep(i)).collect();
        let dropped = self.len() - kept.len();
        if dropped > 0 {
            if reason == Reason::Outlier {
                let gone = (0..self.len()).filter(|&i| !keep(i));
                self.outlying.extend(gone.map(|i| self.points[i]));
            }
            self.points = kept.iter().map(|&i| self.points[i]).collect();
            self.displacement = kept.iter().map(|&i| self.displacement[i]).collect();
            if let Some(sigma) = &mut self.sigma {
                *sigma = kept.iter().map(|&i| sigma[i]).collect();
            }
            if let Some(grid) = &mut self.grid {
                grid.index = kept.iter().map(|&i| grid.index[i]).collect();
            }
        }
        *match reason {
            Reason::OutsideWindow => &mut self.rejected.outside_window,
            Reason::Uncorrelated => &mut self.rejected.uncorrelated,
            Reason::Masked => &mut self.rejected.masked,
            Reason::Repeated => &mut self.rejected.repeated,
            Reason::Unmatched => &mut self.rejected.unmatched,
            Reason::Outlier => &mut self.rejected.outliers,
            Reason::OutsidePlate => &mut self.rejected.outside_plate,
        } += dropped;
        dropped
    }

    /// Drop the points outside `[[x0, y0], [x1, y1]]` (data's coordinates, mm, borders included).
    pub fn restrict_to(&mut self, [low, high]: [[f64; 2]; 2]) -> usize {
        let frame = self.frame;
        let inside: Vec<bool> = self
            .points
            .iter()
            .map(|&p| frame.data_point(p))
            .map(|p| (0..2).all(|k| low[k] <= p[k] && p[k] <= high[k]))
            .collect();
        self.retain(Reason::OutsideWindow, |i| inside[i])
    }

    /// Its first file, for errors.
    pub(super) fn place(&self) -> String {
        self.files
            .first()
            .map_or_else(String::new, |file| file.display().to_string())
    }

    /// Refuse a field of fewer than [`Field::FEWEST`] points; `place` names its file.
    pub(super) fn check_enough(&self, place: &str) -> Result<()> {
        if self.len() >= Self::FEWEST {
            return Ok(());
        }
        let Rejected {
            missing,
            uncorrelated,
            unmatched,
            outside_window,
            outliers,
            masked,
            ..
        } = self.rejected;
        let failed = if uncorrelated > 0 {
            format!("{uncorrelated} not correlated, ")
        } else {
            String::new()
        };
        let elsewhere = if unmatched > 0 {
            format!("{unmatched} not measured in every step, ")
        } else {
            String::new()
        };
        Err(Error::input(
            place,
            format!("at least {} measured points in the window", Self::FEWEST),
        )
        .found(format!(
            "{} ({missing} missing, {failed}{elsewhere}{outside_window} outside the window, {masked} masked, {outliers} outliers)",
            self.len()
        ))
        .hint("check window_mm and the mask (both in the data's coordinates), and the units"))
    }

    /// The smallest and largest (s, t), mm. Both are zero for an empty field.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        bounds(&self.points)
    }

    /// The same with the outliers that a gauge counts.
    pub fn measured_bounds(&self) -> [[f64; 2]; 2] {
        bounds(&[&self.points[..], &self.outlying[..]].concat())
    }

    /// No longer count outliers far from all other points: their places may be as wrong as their displacements.
    pub(super) fn forget_remote_outliers(&mut self) {
        let mut remote = std::mem::take(&mut self.outlying);
        loop {
            let [low, high] = self.measured_bounds();
            let near = |p: &[f64; 2]| {
                (0..2).all(|k| {
                    let margin = BORDER * (high[k] - low[k]);
                    (low[k] - margin..=high[k] + margin).contains(&p[k])
                })
            };
            let (more, rest) = remote.into_iter().partition::<Vec<_>, _>(near);
            self.outlying.extend(&more);
            remote = rest;
            if more.is_empty() {
                return;
            }
        }
    }

    /// The typical distance of neighbouring points in mm: the median distance to the nearest other point (of some
    /// 2000 points). Zero for a field of fewer than two distinct points.
    pub fn spacing_mm(&self) -> f64 {
        let tree = RTree::bulk_load(self.points.clone());
        let stride = self.len() / 2000 + 1;
        let mut nearest: Vec<f64> = self
            .points
            .iter()
            .step_by(stride)
            .filter_map(|&p| {
                // coincident points (a repeated measurement) say nothing about the spacing
                tree.nearest_neighbor_iter_with_distance_2(p)
                    .take(64)
                    .map(|(_, d2)| d2)
                    .find(|d2| *d2 > 0.0)
            })
            .map(f64::sqrt)
            .collect();
        median(&mut nearest)
    }

    /// Check that the declared centre lies in the hole: nothing is measured well inside it (r < 0.8 `radius_mm`).
    ///
    /// # Errors
    /// Of the input, with the number of points there and the largest void near the declared centre.
    pub fn check_hole(&self, radius_mm: f64) -> Result<()> {
        let reach = 0.8 * radius_mm;
        let inside = self
            .points
            .iter()
            .filter(|p| p[0].hypot(p[1]) < reach)
            .count();
        let spacing = self.spacing_mm();
        let expected = std::f64::consts::PI * (reach / spacing.max(f64::MIN_POSITIVE)).powi(2);
        // a few deviant points of a correlation program are not evidence of a wrong centre
        let void = (inside as f64) < (0.02 * expected).max(3.0);
        if void && (self.surrounds_origin() || !self.has_void(reach, spacing)) {
            return self.check_scale_of_hole(radius_mm, spacing);
        }
        let [cx, cy] = self.frame.hole_center_mm;
        let error = Error::input(
            "hole_center_in_data_mm",
            format!("no point within {reach:.3} mm of the hole's centre"),
        )
        .found(if self.surrounds_origin() {
            format!("{inside} points near ({cx}, {cy})")
        } else {
            format!("({cx}, {cy}), which lies beyond the measured points")
        });
        Err(match self.largest_void(radius_mm) {
            Some((center, radius)) if radius > 2.0 * spacing => {
                let [x, y] = self.frame.data_point(center);
                let unit = factor(radius_mm / radius).map_or_else(String::new, |name| {
                    format!(", {name} times as small as declared: check units.coordinates")
                });
                error.hint(format!("the largest void nearby has radius {radius:.2} mm about ({x:.2}, {y:.2}) in the data{unit}"))
            }
            _ => error
                .hint("the data show no hole nearby: check its centre, its diameter and the units"),
        })
    }

    /// A hole that is larger in the data than declared by the factor of two units.
    fn check_scale_of_hole(&self, radius_mm: f64, spacing: f64) -> Result<()> {
        let nearest = self
            .points
            .iter()
            .map(|p| p[0].hypot(p[1]))
            .fold(f64::INFINITY, f64::min);
        match factor(nearest / radius_mm).filter(|_| nearest > 3.0 * spacing && self.surrounds_origin()) {
            None => Ok(()),
            Some(name) => Err(Error::input("hole.diameter_mm", format!("about {:.1} mm, as the points leave free", 2.0 * nearest))
                .found(2.0 * radius_mm)
                .hint(format!("the data's hole is {name} times as large as the declared one: check units.coordinates and the drawing"))),
        }
    }

    /// Whether points lie on all four sides of the declared centre.
    fn surrounds_origin(&self) -> bool {
        let [low, high] = self.bounds();
        (0..2).all(|k| low[k] < 0.0 && high[k] > 0.0)
    }

    /// Whether the data show a hole of about `radius` somewhere.
    fn has_void(&self, radius: f64, spacing: f64) -> bool {
        let [low, high] = self.bounds();
        let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        let moved: Vec<[f64; 2]> = self
            .points
            .iter()
            .map(|p| [p[0] - middle[0], p[1] - middle[1]])
            .collect();
        let reach = (0..2).map(|k| 0.5 * (high[k] - low[k])).fold(0.0, f64::max);
        let centred = Field {
            points: moved,
            ..self.clone()
        };
        centred
            .largest_void(reach / 6.0)
            .is_some_and(|(_, r)| r > 0.9 * radius && r > 3.0 * spacing)
    }

    /// Centre (s, t) and radius of the largest empty disc inside the bounds with its centre within six `radius_mm`
    /// of the origin, on a lattice refined twice.
    fn largest_void(&self, radius_mm: f64) -> Option<([f64; 2], f64)> {
        let tree = RTree::bulk_load(self.points.clone());
        let [low, high] = self.bounds();
        let clearance = |c: [f64; 2]| {
            let to_border = (0..2)
                .map(|k| (c[k] - low[k]).min(high[k] - c[k]))
                .fold(f64::INFINITY, f64::min);
            let to_point = tree
                .nearest_neighbor_iter_with_distance_2(c)
                .next()
                .map_or(0.0, |(_, d2)| d2.sqrt());
            to_border.min(to_point)
        };
        let mut best: Option<([f64; 2], f64)> = None;
        let mut reach = 6.0 * radius_mm;
        for _ in 0..3 {
            const HALF: i32 = 24;
            let middle = best.map_or([0.0; 2], |(c, _)| c);
            for i in -HALF..=HALF {
                for j in -HALF..=HALF {
                    let step = reach / f64::from(HALF);
                    let c = [
                        middle[0] + step * f64::from(i),
                        middle[1] + step * f64::from(j),
                    ];
                    let r = clearance(c);
                    if r > 0.0 && best.is_none_or(|(_, largest)| r > largest) {
                        best = Some((c, r));
                    }
                }
            }
            reach /= 12.0;
        }
        best
    }
}

/// The factor between two units of length that `ratio` is, within a twelfth.
fn factor(ratio: f64) -> Option<&'static str> {
    const FACTORS: [(f64, &str); 3] = [(25.4, "25.4"), (1000.0, "1000"), (1000.0 / 25.4, "39.4")];
    const NEAR: f64 = 1.0 / 12.0;
    FACTORS
        .iter()
        .find(|(f, _)| (ratio / f - 1.0).abs() < NEAR)
        .map(|(_, name)| *name)
}

/// The smallest and largest coordinates of `points`; zeros if there are none.
pub fn bounds(points: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let Some(&first) = points.first() else {
        return [[0.0; 2]; 2];
    };
    points.iter().fold([first, first], |[low, high], p| {
        [
            [low[0].min(p[0]), low[1].min(p[1])],
            [high[0].max(p[0]), high[1].max(p[1])],
        ]
    })
}
