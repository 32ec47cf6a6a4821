//! What the base model and the best subset of effects fit: what they leave, and the amplitudes with which they do.

use nalgebra::DVector;

use super::evidence::Evidence;
use super::left_out::HeldOutSteps;
use super::linearity::linearity;
use super::noise_words::noise_words;
use super::subsets::Subset;
use super::tracing::{HeldOutStep, SeriesResidual, StepMaps, StepResidual, StiffnessField};
use crate::experiment::series::rigid_free;
use crate::linearise::{Column, Sensitivities};
use crate::noise::NormalEquations;
use crate::posterior::NoisePair;
use crate::quantity::NM_PER_MM;

impl Evidence {
    /// What is found of a series that was linearised at a state. What it found is linearised anew at the constants it found: those of the
    /// state are the ridge's, which takes all noise for white, and effects grow with the compliance (E1 of 154 GPa for 162 made a camera's
    /// rotation of 0.710 deg one of 0.700 +- 0.002).
    pub(super) fn traced_steps(
        &self,
        pair: &NoisePair,
        held_out: Option<&HeldOutSteps<'_>>,
        stiffness: Option<StiffnessField>,
    ) -> SeriesResidual {
        SeriesResidual {
            residuals: self.steps(pair, held_out),
            maps: self.step_maps(pair),
            linearity: linearity(self),
            misfit: self.misfit(),
            stiffness,
            noise: noise_words(&self.weighing, pair),
        }
    }

    /// The linearisation with the best subset's effects as parts of the model, and those that are none of them as candidates.
    pub(super) fn with_best(&self) -> Sensitivities {
        let mut all = self.sensitivities.clone();
        let best = self
            .subsets
            .best()
            .iter()
            .map(|&k| &self.sensitivities.candidates[k]);
        all.base
            .extend(best.clone().flat_map(|c| c.columns.clone()));
        let named: Vec<&str> = best.map(|c| c.effect.name()).collect();
        all.candidates.retain(|c| !named.contains(&c.effect.name()));
        all
    }

    /// Columns of the base model and of the best subset, among all.
    pub(super) fn taking_part(&self) -> Vec<usize> {
        let base = self.sensitivities.base.len();
        let best = self.subsets.layout.columns(self.subsets.best());
        (0..base)
            .chain(best.into_iter().map(|k| base + k))
            .collect()
    }

    /// What the base model, and with the best subset what is explained, leave of every step of a series: root mean squares of the block
    /// averages of both components, nm. Empty for a single field.
    pub(super) fn steps(
        &self,
        pair: &NoisePair,
        left_out: Option<&HeldOutSteps<'_>>,
    ) -> Vec<StepResidual> {
        let Some(series) = self.weighing.noise.by_frames() else {
            return Vec::new();
        };
        let (bare, explained) = (
            self.without_rigid_motion(pair, &Vec::new()),
            self.without_rigid_motion(pair, self.subsets.best()),
        );
        let predicted = left_out.map(|held| {
            let one = |subset: &Subset| held.predicted_nm(subset);
            (one(&Vec::new()), one(self.subsets.best()), held.z())
        });
        let n = self.measured.blocks.len();
        let rms = |left: &DVector<f64>, step: usize| {
            (left.rows(step * n, n).norm_squared() / n as f64).sqrt() * NM_PER_MM
        };
        let scales = series.noise.scales.iter().enumerate();
        scales
            .map(|(step, scale)| StepResidual {
                bare_nm: bare.each_ref().map(|left| rms(left, step)),
                explained_nm: explained.each_ref().map(|left| rms(left, step)),
                noise_scale: scale.sqrt(),
                predicted: predicted.as_ref().map(|(bare, explained, z)| HeldOutStep {
                    bare_nm: bare[step],
                    explained_nm: explained[step],
                    z: z[step],
                }),
            })
            .collect()
    }

    /// What the base model leaves of every step, block by block.
    pub(super) fn step_maps(&self, pair: &NoisePair) -> Option<StepMaps> {
        let series = self.weighing.noise.by_frames()?;
        let left = self.without_rigid_motion(pair, &Vec::new());
        let blocks = &self.measured.blocks;
        let n = blocks.len();
        let of = |step: usize| {
            left.each_ref().map(|left| {
                let own = left.rows(step * n, n);
                own.iter().map(|u| u * NM_PER_MM).collect()
            })
        };
        Some(StepMaps {
            size_mm: blocks.size_mm,
            places: blocks.centroid.clone(),
            left_nm: (0..series.noise.scales.len()).map(of).collect(),
        })
    }

    /// The residual of the base model with a subset of the candidates, without the motion in the plane of each step, mm: noise that is
    /// correlated over the window leaves that to itself.
    fn without_rigid_motion(&self, pair: &NoisePair, subset: &Subset) -> [DVector<f64>; 2] {
        let mut left = self.left(pair, subset);
        let (places, counts) = (&self.measured.blocks.centroid, &self.measured.blocks.count);
        let n = places.len();
        for from in (0..left[0].len()).step_by(n.max(1)) {
            let step: Vec<[f64; 2]> = (from..from + n).map(|i| [left[0][i], left[1][i]]).collect();
            for (i, u) in rigid_free(places, counts, &step).into_iter().enumerate() {
                left[0][from + i] = u[0];
                left[1][from + i] = u[1];
            }
        }
        left
    }

    /// The residual of the base model with a subset of the candidates, mm.
    fn left(&self, pair: &NoisePair, subset: &Subset) -> [DVector<f64>; 2] {
        let mut left = self.measured.residual(&self.sensitivities);
        let Some((own, fit)) = self.fit(pair, subset) else {
            return left;
        };
        let all: Vec<&Column> = self.sensitivities.columns().collect();
        for (k, x) in own.iter().zip(fit.mean().iter()) {
            for (left, values) in left.iter_mut().zip(&all[*k].values) {
                left.axpy(-x, values, 1.0);
            }
        }
        left
    }

    /// Probability of a misfit as large by the noise of a series, with the best subset; none of a single field.
    pub(super) fn misfit(&self) -> Option<f64> {
        self.weighing.noise.by_frames()?;
        self.misfit_of(self.subsets.best())
    }

    /// Probability of a misfit as large by the likeliest noise, with a subset.
    pub(super) fn misfit_of(&self, subset: &Subset) -> Option<f64> {
        let pair = &self.weighing.pairs[self.subsets.best_pair];
        let (_, fit) = self.fit(pair, subset)?;
        let gram = self.weighing.gram(pair);
        let data = gram.nrows() - 1;
        let values = self
            .measured
            .averages
            .iter()
            .map(DVector::len)
            .sum::<usize>() as f64;
        // of a linear model with normal priors the whole has as many degrees of freedom as values
        let square = gram[(data, data)] - fit.quadratic();
        let z = (square - values) / (2.0 * values).sqrt();
        Some(0.5 * statrs::function::erf::erfc(z / std::f64::consts::SQRT_2))
    }

    /// The fit of the base model with a subset of the candidates, and which columns it is of.
    fn fit(&self, pair: &NoisePair, subset: &Subset) -> Option<(Vec<usize>, NormalEquations)> {
        let gram = self.weighing.gram(pair);
        let data = gram.nrows() - 1;
        let base = self.sensitivities.base.len();
        let chosen = self.subsets.layout.columns(subset).into_iter();
        let own: Vec<usize> = (0..base).chain(chosen.map(|k| base + k)).collect();
        let scaled: Vec<(usize, f64)> = own.iter().map(|k| (*k, 1.0)).collect();
        let fit = NormalEquations::of_columns(&gram, |k| gram[(k, data)], &scaled)?;
        Some((own, fit))
    }
}
