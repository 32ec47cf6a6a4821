//! Linearise and weigh about the likeliest account, until it repeats.

use std::sync::Arc;

use super::alias::groups;
use super::averaged::likeliest;
use super::evidence::Evidence;
use super::phases::shifts;
use crate::effect::Kind;
use crate::error::Result;
use crate::files::KeptStages;
use crate::identify::{NumberedPoint, made_of, weighed};
use crate::infer::EffectUnderLaw;
use crate::linearise::{
    CONVERGED, CandidateColumns, Forward, Measured, Sensitivities, divide, shares,
};
use crate::posterior::{LinearisationPoint, Weighing};
use crate::progress::Progress;

/// Linearisations, the identification's with them: each is about the account that the last one found likeliest, a step of Gauss and Newton.
const PASSES: usize = 3;

/// Share of a constant's sd by which a straight line from the point to its estimate may miss: with .5 log evidences were off by up to .6 nat, with
/// this by .2 (`evidence_is_that_of_the_full_model`).
const MISSED: f64 = 0.1;

/// Prior sds by which a constant is moved at once.
const LONGEST: f64 = 2.5;

/// The search for the point about which effects are weighed.
pub struct PointSearch<'a> {
    pub forward: &'a Forward<'a>,
    pub measured: &'a Arc<Measured>,
    pub progress: &'a dyn Progress,
    pub kept: &'a KeptStages,
    pub point: LinearisationPoint,
    /// The effect that was taken into the state.
    pub taken: Option<EffectUnderLaw>,
}

impl PointSearch<'_> {
    /// Weigh what was linearised about the point, and again about the account that is likeliest, with its strongest effect in the state, until
    /// that moves no more. Several new effects at once oscillated on a large offset of the hole (prototype study).
    ///
    /// # Errors
    /// Those of finite-element solutions; too few blocks for the dictionary.
    pub fn converged(
        mut self,
        about: Sensitivities,
        mut known: Option<Weighing>,
    ) -> Result<(Evidence, LinearisationPoint)> {
        let mut sensitivities = about;
        let mut before: Option<Weighing> = None;
        let mut pass = 1;
        loop {
            let weighing = match known.take() {
                Some(weighing) => weighing,
                None => self.weighed(pass, &sensitivities, before.as_ref())?,
            };
            before = Some(weighing.clone());
            let found = Evidence::new(weighing, sensitivities, self.measured)?;
            let strongest = groups(&found.subsets).first().map(|g| g.leader);
            let name = |k: usize| self.point.sought[k].effect.name();
            self.progress.say(strongest.map_or("no effect", name));
            self.progress.end();
            let at = self.point.clone();
            if pass == PASSES {
                return Ok((found, at));
            }
            let Some(moved) = self.follow(&found, strongest)? else {
                return Ok((found, at));
            };
            pass += 1;
            sensitivities = self.linearised(pass, &found, &moved)?;
            if !sensitivities.is_finite() {
                // what was taken in lies beyond where the picture's map has an inverse
                return Ok((found, at));
            }
        }
    }

    /// Move the point to the likeliest account, if that lies beyond what is linear about it; the effects whose amplitudes moved. The ridge takes
    /// all noise for white: noise that is smooth over a third of the window and twice as large as the white one sent E1 to 97 GPa for 154,
    /// and a line from there ends at 137 +- 3.
    fn follow(
        &mut self,
        found: &Evidence,
        strongest: Option<usize>,
    ) -> Result<Option<Vec<&'static str>>> {
        let solution = likeliest(&found.weighing, &found.sensitivities, &found.subsets)?;
        let columns = found.sensitivities.base[..found.sensitivities.constants].iter();
        // a modulus acts by its reciprocal
        let misses = columns.zip(&solution).any(|(c, (mean, sd))| {
            (c.mean + c.sd * mean - c.at).powi(2) > MISSED * c.sd * sd * c.at.abs()
        });
        let before = self.point.state.clone();
        let mut acting = Vec::new();
        let mut moved = 0.0;
        // another law of what was taken in leaves nearly the same field: midway between two a rotation was refitted to half of it
        let is_law = |old: &EffectUnderLaw, new: &EffectUnderLaw| {
            !old.is(new) && old.effect.name() == new.effect.name()
        };
        if let Some(k) = strongest {
            let new = self.point.sought[k];
            let old = self.taken;
            if !old.is_some_and(|old| is_law(&old, &new)) {
                moved = self.adopt(found, k, old);
                self.taken = Some(new);
                acting.extend(old.iter().chain([&new]).map(|e| e.effect.name()));
            }
        }
        let mut again = misses || moved >= CONVERGED;
        again |= self.free(found.subsets.best());
        if before.shifts.is_empty() {
            self.point.state.shifts = shifts(found, &self.forward.phases(&before)?)?;
            again |= !self.point.state.shifts.is_empty();
        }
        if !again {
            return Ok(None);
        }
        let solution: Vec<f64> = solution.into_iter().map(|(mean, _)| mean).collect();
        let LinearisationPoint {
            state, declared, ..
        } = &mut self.point;
        let of = (&found.sensitivities, &solution[..]);
        self.forward.moved(state, declared, of, LONGEST);
        Ok(Some(acting))
    }

    /// Linearise about the point anew: constants, declared effects and what has moved, nothing else.
    fn linearised(
        &self,
        pass: usize,
        before: &Evidence,
        moved: &[&'static str],
    ) -> Result<Sensitivities> {
        let LinearisationPoint {
            state,
            declared,
            sought,
        } = &self.point;
        let of = &before.sensitivities;
        let known = of.candidates.len();
        let own = sought.iter().enumerate();
        let own = own.filter(|(k, e)| *k >= known || moved.contains(&e.effect.name()));
        let anew: Vec<EffectUnderLaw> = own.map(|(_, e)| *e).collect();
        let always = state.shared.constants.len() + self.forward.count(declared, state);
        let most = always + self.forward.count(&anew, state);
        let test = made_of(self.forward.model, self.measured);
        let made_of = (test, of, state, declared, sought, moved);
        let linearised = || {
            let what = format!(
                "tracing, pass {pass}: sensitivities to {} effects",
                anew.len()
            );
            self.progress.begin(&what, Some(most as u64));
            let columns = CandidateColumns::Kept { of, moved };
            let forward = self.forward;
            let found = forward.sensitivities_with(state, declared, sought, columns);
            self.progress.end();
            found
        };
        let name = format!("sensitivities-traced-{pass}");
        self.kept.stage(&name, &made_of, linearised, self.progress)
    }

    fn weighed(
        &self,
        pass: usize,
        sensitivities: &Sensitivities,
        before: Option<&Weighing>,
    ) -> Result<Weighing> {
        let test = (self.forward, &**self.measured);
        let of = NumberedPoint {
            sensitivities,
            number: &format!("traced-{pass}"),
            before,
        };
        weighed(test, of, (self.kept, self.progress))
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
