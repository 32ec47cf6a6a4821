//! Prediction of whole steps of a series from all other steps.
//!
//! The noise of the reference picture is common to all steps, so what the others leave is part of the prediction. Motion in the plane and
//! a force that is not known are the step's own: with their wide priors they are part of the prediction in probabilities, and are fitted to
//! the step where its error is stated in nm; so is a free amplitude, of which the other steps know nothing.

use nalgebra::{DMatrix, DVector};

use super::layout::columns;
use super::subsets::{Subset, SubsetPosterior};
use crate::linearise::{Column, Measured, Sensitivities};
use crate::noise::series::{FramesInformation, InFrames};
use crate::noise::{NormalEquations, solve};
use crate::posterior::Weighing;
use crate::quantity::NM_PER_MM;

/// Steps from which the others can be held out: fewer do not know their noise.
const FEWEST: usize = 3;

/// What all steps, and all but each of them, know.
pub struct HeldOutSteps<'a> {
    sensitivities: &'a Sensitivities,
    measured: &'a Measured,
    ranges: &'a [Vec<usize>],
    in_frames: &'a InFrames,
    all: FramesInformation,
    without: Vec<FramesInformation>,
    /// Share of the reference picture's noise.
    reference: f64,
    residual: [DVector<f64>; 2],
}

impl<'a> HeldOutSteps<'a> {
    /// Of a series of at least three steps that know their noise, new in each, under its likeliest noise without a discrepancy: the account is held
    /// against the noise alone.
    pub fn new(
        measured: &'a Measured,
        sensitivities: &'a Sensitivities,
        weighing: &'a Weighing,
        subsets: &'a SubsetPosterior,
    ) -> Option<Self> {
        let series = weighing.noise.by_frames()?;
        let noise = &series.noise;
        if !noise.by_contrasts || noise.walks || noise.scales.len() < FEWEST {
            return None;
        }
        let log = |k: usize| {
            let projected = &subsets.projected[k];
            let bayes = subsets.layout.log_bayes_factor(projected, subsets.best());
            projected.log_base + bayes
        };
        let plain = (0..series.settings.len()).filter(|k| series.settings[*k].at.rival.is_none());
        let best = plain.max_by(|&a, &b| log(a).total_cmp(&log(b)))?;
        let (all, without) = series.in_frames.known();
        Some(Self {
            sensitivities,
            measured,
            ranges: &subsets.layout.ranges,
            in_frames: &series.in_frames,
            all,
            without,
            reference: series.settings[best].at.reference,
            residual: measured.residual(sensitivities),
        })
    }

    /// Columns of a model with a subset of the candidates, among all.
    fn columns(&self, subset: &Subset) -> Vec<usize> {
        let base = self.sensitivities.base.len();
        let chosen = columns(self.ranges, subset).into_iter();
        (0..base).chain(chosen.map(|k| base + k)).collect()
    }

    /// A column by its place among all.
    fn column(&self, k: usize) -> &Column {
        let mut all = self.sensitivities.columns();
        all.nth(k).unwrap_or(&self.sensitivities.base[0])
    }

    /// The fit of some steps, with the data's square under their noise and its log determinant.
    fn fit(
        &self,
        known: &FramesInformation,
        columns: &[usize],
    ) -> Option<(NormalEquations, f64, f64)> {
        let (gram, log_det) = known.equations(columns, self.reference);
        let p = columns.len();
        let mut right = gram.view((0, p), (p, 1)).column(0).into_owned();
        let mut inside = gram.view((0, 0), (p, p)).into_owned();
        self.sensitivities.add_known(&mut inside, &mut right);
        let fit = NormalEquations::with_unit_prior(inside, right)?;
        Some((fit, gram[(p, p)], log_det))
    }

    /// Log probability of each step, given all others, by a model with a subset of the candidates; up to a constant.
    pub fn scores(&self, subset: &Subset) -> Vec<f64> {
        let columns = self.columns(subset);
        let log = |known: &FramesInformation| {
            let fit = self.fit(known, &columns);
            fit.map_or(0.0, |(fit, square, log_det)| {
                fit.log_evidence() - 0.5 * (square + log_det)
            })
        };
        let all = log(&self.all);
        self.without
            .iter()
            .map(|without| all - log(without))
            .collect()
    }

    /// By how many sds the misfit of each step, given the others, is larger than the declared model expects: its square has the mean
    /// of the number of values, less those of the step's own motion and force, which have no plausible size.
    pub fn z(&self) -> Vec<f64> {
        let columns = self.columns(&Vec::new());
        let square = |known: &FramesInformation| {
            let fit = self.fit(known, &columns);
            fit.map(|(fit, square, _)| square - fit.quadratic())
        };
        let all = square(&self.all);
        let values = 2 * self.measured.blocks.len();
        let one = |(step, without): (usize, &FramesInformation)| {
            let own = self.own(step, &columns).into_iter();
            let unbounded = own.filter(|c| c.is_rigid() || c.is_force() || c.is_load());
            let freedom = (values - unbounded.count()) as f64;
            let misfit = all
                .zip(square(without))
                .map_or(0.0, |(all, rest)| all - rest);
            (misfit - freedom) / (2.0 * freedom).sqrt()
        };
        self.without.iter().enumerate().map(one).collect()
    }

    /// Whether the forces of all other steps are relative to that of a step: none is known but those of unloaded ones.
    fn is_nominal(&self, step: usize) -> bool {
        let base = self.sensitivities.base.iter().enumerate();
        let forces: Vec<usize> = base.filter(|(_, c)| c.is_force()).map(|(k, _)| k).collect();
        let has = |step: usize| forces.iter().any(|k| self.without[step].lacks(*k));
        let loads = self.in_frames.loads().iter().enumerate();
        let mut others = loads.filter(|(s, f)| *s != step && **f != 0.0);
        !forces.is_empty() && !has(step) && others.all(|(s, _)| has(s))
    }

    /// The columns of what is a step's own and has no plausible size: they do nothing in the others; and the force to which those of the
    /// others are relative. The error of a declared force has a size: a step whose force is another is not predicted.
    fn own(&self, step: usize, columns: &[usize]) -> Vec<&Column> {
        let without = &self.without[step];
        let nominal = self.is_nominal(step);
        let of_step = |k: &usize| {
            let column = self.column(*k);
            let own = without.lacks(*k) && !column.is_force_error();
            own || (nominal && column.is_load())
        };
        let own = columns.iter().copied().filter(of_step);
        own.map(|k| self.column(k)).collect()
    }

    /// Root mean square error of the block averages of each step's (u1, u2), nm, by a model with a subset of the candidates that was
    /// fitted to the other steps.
    pub fn predicted_nm(&self, subset: &Subset) -> Vec<[f64; 2]> {
        let columns = self.columns(subset);
        let steps = self.without.iter().enumerate();
        steps
            .map(|(step, without)| self.predicted(step, without, &columns))
            .collect()
    }

    fn predicted(&self, step: usize, without: &FramesInformation, columns: &[usize]) -> [f64; 2] {
        let n = self.measured.blocks.len();
        let x = self
            .fit(without, columns)
            .map_or_else(|| DVector::zeros(columns.len()), |(fit, ..)| fit.mean());
        let mut weights = self.in_frames.shared(step, self.reference);
        // the prediction is subtracted
        weights.iter_mut().for_each(|w| *w = -*w);
        weights[step] = 1.0;
        let mut left = self.residual.clone();
        for (x, k) in x.iter().zip(columns) {
            for (left, values) in left.iter_mut().zip(&self.column(*k).values) {
                left.axpy(-x, values, 1.0);
            }
        }
        let own = self.own(step, columns);
        let mut error = DVector::zeros(2 * n);
        for (c, left) in left.iter().enumerate() {
            for (s, weight) in weights.iter().enumerate() {
                let mut part = error.rows_mut(c * n, n);
                part.axpy(*weight, &left.rows(s * n, n), 1.0);
            }
        }
        let fitted = DMatrix::from_fn(2 * n, own.len(), |i, k| {
            own[k].values[i / n][step * n + i % n]
        });
        let amplitudes = solve(&fitted.tr_mul(&fitted), &fitted.tr_mul(&error));
        error -= fitted * amplitudes;
        [0, 1].map(|c| (error.rows(c * n, n).norm_squared() / n as f64).sqrt() * NM_PER_MM)
    }
}
