//! One turn of the loop.

use super::patches::Patches;
use super::traced::Traced;
use super::tracing::Tracing;
use crate::identify::{Identification, Patterns};
use crate::infer::Model;
use crate::quantity::significant;

/// An identification and what tracing made of its residual.
pub struct Round {
    /// The number of the attempt that it was: some are taken back.
    pub attempt: usize,
    pub model: Model,
    pub identification: Identification,
    pub tracing: Tracing,
    /// What the tracing rests on.
    pub traced: Traced,
}

impl Round {
    /// An attempt's identification with its tracing, by whose noise it is judged where the frames of a series have measured that.
    pub fn new(
        attempt: usize,
        model: Model,
        identification: Identification,
        (tracing, traced): (Tracing, Traced),
    ) -> Self {
        let of_series = tracing.series.as_ref().and_then(|s| s.misfit);
        Self {
            attempt,
            model,
            identification: match of_series {
                Some(p) => identification.held_against(p),
                None => identification,
            },
            tracing,
            traced,
        }
    }

    /// Patches that the residual holds.
    pub fn patches(&self) -> &Patches {
        &self.tracing.patches
    }

    /// What the noise is and what a mask of its patches would do, as sentences.
    pub fn noise_and_patches(&self) -> String {
        let noise = self.tracing.series.as_ref().map(|s| s.noise.clone());
        let noise = noise.filter(|s| !s.is_empty()).or(self.edge_error());
        let all = noise.into_iter().chain(self.patches().words());
        all.map(|sentence| format!(" {sentence}")).collect()
    }

    /// The error near edges that the noise of a field has, in words.
    fn edge_error(&self) -> Option<String> {
        let noise = &self.identification.inverse.noise;
        let of = |c: usize| {
            let sd = noise.edge_sd_nm(c)?;
            Some(format!("{} nm in u{}", significant(sd, 0.1 * sd), c + 1))
        };
        let sizes: Vec<String> = (0..2).filter_map(of).collect();
        let sizes = Some(sizes.join(" and ")).filter(|s| !s.is_empty())?;
        Some(format!(
            "Half a subset from an edge the displacements are off by {sizes} (sd), as where a program shifts or cuts its subsets. Points there count for less."
        ))
    }

    /// What of the residual stationary noise does not do. The one field of a series is held against noise of short lengths: where the
    /// series' own noise, which may be smooth, explains its misfit, a place where that breaks out is none.
    pub fn patterns(&self) -> Patterns {
        let mut found = self.identification.patterns.clone();
        let of_series = self.tracing.series.is_some();
        if of_series && !self.identification.misfit.is_too_large() {
            found.exceedance = None;
        }
        found
    }
}
