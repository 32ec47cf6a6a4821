//! One turn of the loop.

use super::patches::Patches;
use super::phases::phase_words;
use super::traced::{Traced, forward};
use super::tracing::Tracing;
use crate::identify::{Identification, Patterns};
use crate::infer::Model;
use crate::linearise::{Measured, StepStack};

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

    /// The same round, its misfit held against noise and the effects on which its tracing does not decide: of a field, and where noise alone
    /// does not explain it.
    #[must_use]
    pub fn with_undecided(mut self) -> Self {
        let misfit = &self.identification.misfit;
        if misfit.is_too_large() && !misfit.of_series {
            let columns = self.undecided();
            if !columns.is_empty() {
                self.identification = self.identification.with_effects(&columns);
            }
        }
        self
    }

    /// Columns of the effects on which tracing does not decide, the leader of each group, at all points of a field: tracing itself keeps off
    /// edges. None of a group that does not predict what was held out, whose sign cannot be, or whose field cannot be had.
    fn undecided(&self) -> Vec<StepStack> {
        let groups = self.tracing.groups.iter().filter(|g| g.predicts);
        let groups = groups.filter(|g| self.tracing.undecided.contains(&g.members));
        let leaders = groups.map(|g| g.leader);
        let cannot_act = |name: &str| {
            let mut found = self.tracing.candidates.iter();
            found.any(|c| c.effect.name() == name && c.is_impossible())
        };
        let leaders: Vec<&str> = leaders.filter(|name| !cannot_act(name)).collect();
        if leaders.is_empty() {
            return Vec::new();
        }
        let prepared = &self.identification.inverse.prepared;
        let observation = &prepared.observation;
        let experiment = &*prepared.problem.experiment;
        let sight = (&observation.sight, None);
        let measured = Measured::new(&observation.field, experiment, sight, |_| true);
        let forward = forward(&self.model, prepared, &measured, &|| ());
        let point = &self.traced.point;
        let Ok(here) = forward.about(&point.state) else {
            return Vec::new();
        };
        let sought = point.sought.iter();
        let sought = sought.filter(|e| leaders.contains(&e.effect.name()));
        let columns = sought.filter_map(|effect| here.columns(effect).ok());
        let columns = columns.flatten().map(|column| column.values).collect();
        experiment.rest();
        columns
    }

    /// Patches that the residual holds.
    pub fn patches(&self) -> &Patches {
        &self.tracing.patches
    }

    /// What the noise is, whether a wave has phases, and what a mask of patches would do, as sentences.
    pub fn noise_and_patches(&self) -> String {
        let noise = self.tracing.series.as_ref().map(|s| s.noise.clone());
        let noise = noise.filter(|s| !s.is_empty());
        let phases = phase_words(&self.traced.evidence);
        let all = noise.into_iter().chain(phases);
        let all = all.chain(self.patches().words());
        all.map(|sentence| format!(" {sentence}")).collect()
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
