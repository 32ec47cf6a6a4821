//! Linearise and weigh with the strongest effect in the state, until it repeats.

use std::sync::Arc;

use super::alias::groups;
use super::evidence::{Evidence, evidence};
use super::sought::shares;
use super::traced::LinearisationPoint;
use super::weighing::Weighing;
use crate::effect::Kind;
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::infer::EffectUnderLaw;
use crate::linearise::{CONVERGED, Forward, Measured, STEPS, divide};
use crate::progress::Progress;

/// Passes of linearisation, each with the strongest effect at its estimate: linearising at several new effects at once oscillated on a
/// large offset of the hole (prototype study).
const PASSES: usize = 4;

/// The search for the point about which effects are weighed.
pub(super) struct PointSearch<'a> {
    pub forward: &'a Forward<'a>,
    pub measured: &'a Arc<Measured>,
    pub progress: &'a dyn Progress,
    pub point: LinearisationPoint,
}

impl PointSearch<'_> {
    /// Linearise and weigh, with the strongest effect of the best subset in the state, until that effect and its amplitudes repeat.
    ///
    /// # Errors
    /// Those of finite-element solutions; too few blocks for the dictionary.
    pub fn converged(mut self) -> Result<(Evidence, LinearisationPoint)> {
        let mut leader: Option<EffectUnderLaw> = None;
        let mut before: Option<(Evidence, SeriesState)> = None;
        let mut pass = 0;
        loop {
            pass += 1;
            let LinearisationPoint {
                state,
                declared,
                sought,
            } = &mut self.point;
            let always = state.shared.constants.len() + self.forward.count(declared, state);
            let most = (1 + STEPS) * always + self.forward.count(sought, state);
            let count = sought.len();
            let what = format!("tracing, pass {pass}: sensitivities to {count} effects");
            self.progress.begin(&what, Some(most as u64));
            let sensitivities = self
                .forward
                .at_ridge(self.measured, state, declared, sought)?;
            self.progress.end();
            if let Some((found, at)) = before.take().filter(|_| !sensitivities.is_finite()) {
                // what was taken in lies beyond where the picture's map has an inverse
                self.point.state = at;
                return Ok((found, self.point));
            }
            let what = format!("tracing, pass {pass}: effects against noise");
            self.progress
                .begin(&what, Some(Weighing::steps(self.measured) as u64));
            let step = || self.progress.step();
            let found = evidence(sensitivities, self.measured, &step)?;
            let strongest = groups(&found.subsets).first().map(|g| g.leader);
            let name = |k: usize| self.point.sought[k].effect.name();
            self.progress.say(strongest.map_or("no effect", name));
            self.progress.end();
            let Some(k) = strongest.filter(|_| pass < PASSES) else {
                return Ok((found, self.point));
            };
            let at = self.point.state.clone();
            let moved = self.adopt(&found, k, leader);
            leader = Some(self.point.sought[k]);
            let freed = self.free(found.subsets.best());
            if moved < CONVERGED && !freed {
                return Ok((found, self.point));
            }
            before = Some((found, at));
        }
    }

    /// Offer an amplitude of its own in every step for the motions of a subset; whether any was not offered before.
    fn free(&mut self, subset: &[usize]) -> bool {
        let LinearisationPoint { state, sought, .. } = &mut self.point;
        let loads = &state.loads;
        // in two steps, amplitudes of each step's own are any pair of other laws
        if loads.len() < 3 {
            return false;
        }
        let acting = subset.iter().filter_map(|&k| sought[k].freed());
        // nor where one step's own is another law, as where one step alone is loaded
        let offered = |a: &EffectUnderLaw| sought.iter().any(|b| shares(b, a, loads));
        let new: Vec<EffectUnderLaw> = acting.filter(|a| !offered(a)).collect();
        sought.extend(&new);
        !new.is_empty()
    }

    /// Take the best subset's amplitudes of its strongest effect into the state; how far they move, in prior sds. The effect taken in
    /// before, if it is another one now, leaves the state.
    fn adopt(&mut self, evidence: &Evidence, leader: usize, before: Option<EffectUnderLaw>) -> f64 {
        let LinearisationPoint { state, sought, .. } = &mut self.point;
        let adopted = sought[leader];
        if let Some(old) = before.filter(|b| !b.is(&adopted)) {
            state.remove(old.effect);
        }
        let subsets = &evidence.subsets;
        let best = subsets.best();
        let (mean, _) = subsets.amplitudes(best);
        let before = best.iter().take_while(|k| **k != leader);
        let at: usize = before.map(|&k| subsets.layout.ranges[k].len()).sum();
        let candidate = &evidence.sensitivities.candidates[leader];
        let amplitudes = adopted.amplitudes(&state.loads, self.forward.observing.names());
        let columns = &candidate.columns[..amplitudes.len()];
        let solution = columns.iter().enumerate();
        let mut wanted: Vec<f64> = solution
            .map(|(k, c)| c.mean + c.sd * mean[at + k])
            .collect();
        divide(columns, &mut wanted);
        let mut moved = 0.0_f64;
        for ((amplitude, column), wanted) in amplitudes.iter().zip(columns).zip(wanted) {
            let k = amplitude.parameter;
            let by = column.within(wanted, adopted.effect, k) - column.at;
            *state = state.raised(adopted.effect, k, by, &amplitude.weights);
            moved = moved.max((by / column.sd).abs());
        }
        if adopted.effect.kind() == Kind::Additive {
            // linear: the sensitivities do not depend on the amplitude
            return 0.0;
        }
        moved
    }
}
