//! One turn of the loop.

use super::patches::Patches;
use super::phases::phase_words;
use super::traced::LinearisedEvidence;
use super::tracing::Tracing;
use crate::identify::{Identification, Patterns};
use crate::infer::Model;

/// An identification and what tracing made of its residual.
pub struct Round {
    /// The number of the attempt that it was: some are taken back.
    pub attempt: usize,
    pub model: Model,
    pub identification: Identification,
    pub tracing: Tracing,
    /// What the tracing rests on.
    pub traced: LinearisedEvidence,
}

impl Round {
    /// An attempt's identification with its tracing, by whose noise it is judged where the frames of a series have measured that.
    pub fn new(
        attempt: usize,
        model: Model,
        identification: Identification,
        (tracing, traced): (Tracing, LinearisedEvidence),
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
            let undecided = self.undecided();
            let p = self.traced.evidence.misfit_of(&undecided);
            if let Some(p) = p.filter(|_| !undecided.is_empty()) {
                self.identification = self.identification.with_effects(p);
            }
        }
        self
    }

    /// Effects on which tracing does not decide, the leader of each group: none of a group that does not predict what was held out, or whose
    /// sign cannot be.
    fn undecided(&self) -> Vec<usize> {
        let groups = self.tracing.groups.iter().filter(|g| g.predicts);
        let groups = groups.filter(|g| self.tracing.undecided.contains(&g.members));
        let cannot_act = |name: &str| {
            let mut found = self.tracing.candidates.iter();
            found.any(|c| c.effect.name() == name && c.is_impossible())
        };
        let leaders: Vec<&str> = groups
            .map(|g| g.leader)
            .filter(|l| !cannot_act(l))
            .collect();
        let candidates = self.traced.evidence.sensitivities.candidates.iter();
        let all = candidates.enumerate();
        let own = all.filter(|(_, c)| leaders.contains(&c.effect.name()));
        own.map(|(k, _)| k).collect()
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
