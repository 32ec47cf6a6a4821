//! Choices of the noise of a series whose frames measure it.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::noise_choices::{NoiseChoices, NoisePair, alone, correlated, with_data};
use crate::error::Result;
use crate::field::Blocks;
use crate::infer::with_the_load;
use crate::linearise::{Measured, Sensitivities};
use crate::noise::series::{Frames, SeriesNoise, Setting, SpatialNoise, grams, settings_under};
use crate::noise::{ComponentOfNoise, Hyperparameters};

impl NoiseChoices for SeriesNoise {
    fn pairs(&self) -> Vec<NoisePair> {
        let pair = |(k, setting): (usize, &Setting)| NoisePair {
            of: [k, k],
            log_prior: setting.log_prior,
            discrepancy: setting.at.rival.is_some(),
        };
        self.settings.iter().enumerate().map(pair).collect()
    }

    fn gram(&self, pair: &NoisePair) -> DMatrix<f64> {
        self.settings[pair.of[0]].gram.clone()
    }

    fn grams(
        &self,
        blocks: &Blocks,
        columns: [&DMatrix<f64>; 2],
        pairs: &[NoisePair],
    ) -> Result<Vec<DMatrix<f64>>> {
        let frames = Frames {
            blocks,
            loads: self.in_frames.loads.clone(),
            // only the search for the noise asks for it
            subset_mm: None,
        };
        let which: Vec<usize> = pairs.iter().map(|p| p.of[0]).collect();
        grams(&frames, self, columns, &which)
    }

    fn log_det(&self, pair: &NoisePair) -> f64 {
        self.settings[pair.of[0]].log_det
    }

    fn misfit(&self, pair: &NoisePair) -> f64 {
        let Setting { log_det, gram, .. } = &self.settings[pair.of[0]];
        let data = gram.nrows() - 1;
        log_det + gram[(data, data)]
    }

    /// The same: it is measured where nothing that grows with the load can enter.
    fn beyond_rival(&self) -> Arc<dyn NoiseChoices> {
        Arc::new(self.clone())
    }

    fn lengths_mm(&self, _pair: &NoisePair) -> [f64; 2] {
        let spatial = &self.noise.spatial;
        spatial
            .each_ref()
            .map(|n| correlated(n.shape.length_mm, n.shape.ratio))
    }

    fn variances(&self, pair: &NoisePair, blocks: &Blocks) -> [DVector<f64>; 2] {
        let reference = self.settings[pair.of[0]].at.reference;
        self.noise.spatial.each_ref().map(|s| {
            let all = s.covariance.variances();
            let white: Vec<f64> = all.iter().map(|v| (v - s.shape.ratio).max(0.0)).collect();
            let variance = |d: f64, w: f64| {
                d * s.scale2 * (w + s.shape.ratio * alone(blocks, s.shape.length_mm))
            };
            let frames = self.noise.of_frames(reference).diagonal();
            let frames = frames.iter();
            let all = frames.flat_map(|d| white.iter().map(move |w| variance(*d, *w)));
            DVector::from_vec(all.collect())
        })
    }

    /// Where the weights do not sum to nothing, the reference picture's noise is in the sum too.
    fn of_sum(&self, pair: &NoisePair, over: &Frames<'_>) -> Result<[ComponentOfNoise; 2]> {
        let reference = self.settings[pair.of[0]].at.reference;
        let weights = DVector::from_vec(with_the_load(&over.loads));
        let share = weights.dot(&(self.noise.of_frames(reference) * &weights));
        let of = |s: &SpatialNoise| Hyperparameters {
            length_mm: s.shape.length_mm,
            ratio: s.shape.ratio,
            scale2: share * s.scale2,
            log_likelihood: 0.0,
        };
        let [first, second] = self.noise.spatial.each_ref().map(of);
        let [of_first, of_second] = self.noise.over(over)?;
        Ok([(first, of_first), (second, of_second)])
    }

    /// What frame contrasts know holds about every point: no model reaches them.
    fn again(
        &self,
        measured: &Measured,
        sensitivities: &Sensitivities,
        step: &(dyn Fn() + Sync),
    ) -> Result<Option<Arc<dyn NoiseChoices>>> {
        let Some(frames) = measured.frames() else {
            return Ok(None);
        };
        let noise = &self.noise;
        let blocks = noise.spatial[0].covariance.variances().len();
        let is_same = noise.scales.len() == frames.len() && blocks == frames.blocks.len();
        if !noise.by_contrasts || !is_same {
            return Ok(None);
        }
        let [first, second] = [0, 1].map(|c| with_data(measured, sensitivities, c));
        let found = settings_under(&frames, [&first, &second], noise.clone(), step)?;
        Ok(Some(Arc::new(found)))
    }

    fn by_frames(&self) -> Option<&SeriesNoise> {
        Some(self)
    }
}
