//! Linearise and weigh with the strongest effect in the state, until it repeats.

use std::sync::Arc;

use super::alias::groups;
use super::averaged::likeliest;
use super::evidence::Evidence;
use super::phases::shifts;
use crate::effect::Kind;
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::files::{KeptStages, Stored};
use crate::identify::{bytes_of, weighed};
use crate::infer::EffectUnderLaw;
use crate::linearise::shares;
use crate::linearise::{
    CONVERGED, CandidateColumns, Forward, Measured, STEPS, Sensitivities, constants_moved, divide,
};
use crate::posterior::LinearisationPoint;
use crate::posterior::Weighing;
use crate::progress::Progress;

/// Passes of linearisation, each with the strongest effect at its estimate: linearising at several new effects at once oscillated on a
/// large offset of the hole (prototype study).
const PASSES: usize = 4;

/// How often the constants are moved to where the noise has them, and by how many prior sds each time at most.
const RESTARTS: usize = 3;
const LONGEST: f64 = 2.5;

/// Share of a constant's sd by which a straight line from the ridge estimate to its own may miss.
const MISSED: f64 = 0.5;

/// The search for the point about which effects are weighed.
pub struct PointSearch<'a> {
    pub forward: &'a Forward<'a>,
    /// The test on a coarse mesh, from which columns of candidates are taken at first.
    pub coarse: Option<&'a Forward<'a>>,
    pub measured: &'a Arc<Measured>,
    pub progress: &'a dyn Progress,
    pub kept: &'a KeptStages,
    pub point: LinearisationPoint,
    /// How often the constants were moved to where the noise has them. From then on they are not those of the ridge.
    pub restarts: usize,
    /// What is known of the first pass: the identification's.
    pub first: Option<(&'a Sensitivities, &'a Weighing)>,
}

impl PointSearch<'_> {
    /// Linearise and weigh, with the strongest effect of the best subset in the state, until that effect and its amplitudes repeat. Where two
    /// accounts follow each other in turn, each the other's cause, the evidence midway between them decides.
    ///
    /// # Errors
    /// Those of finite-element solutions; too few blocks for the dictionary.
    pub fn converged(mut self) -> Result<(Evidence, LinearisationPoint)> {
        let mut leaders: Vec<EffectUnderLaw> = Vec::new();
        let mut before: Option<(Evidence, SeriesState)> = None;
        let mut pass = 0;
        loop {
            pass += 1;
            let evidence = before.as_ref().map(|(evidence, _)| evidence);
            let first = self.first.take().filter(|_| pass == 1);
            let sensitivities = match first {
                Some((known, _)) => known.clone(),
                None => self.linearised(pass, evidence, &leaders)?,
            };
            if !sensitivities.is_finite()
                && let Some((found, at)) = before
            {
                // what was taken in lies beyond where the picture's map has an inverse
                self.point.state = at;
                return Ok((found, self.point));
            }
            let found = match first {
                Some((_, weighing)) => {
                    Evidence::new(weighing.clone(), sensitivities, self.measured)?
                }
                None => self.weighed(pass, sensitivities)?,
            };
            let again = match self.is_moved(&found)? {
                true => Some("again, from the constants that the measured noise asks for"),
                false if self.is_shifted(&found)? => {
                    Some("again, with the phase that the wave has in each step")
                }
                false => None,
            };
            if let Some(why) = again {
                self.progress.say(why);
                self.progress.end();
                pass -= 1;
                before = None;
                continue;
            }
            let strongest = groups(&found.subsets).first().map(|g| g.leader);
            let name = |k: usize| self.point.sought[k].effect.name();
            self.progress.say(strongest.map_or("no effect", name));
            self.progress.end();
            let in_turn = pass > 1 && is_in_turn(&leaders);
            let Some(k) = strongest.filter(|_| pass < PASSES && !in_turn) else {
                return Ok((found, self.point));
            };
            let at = self.point.state.clone();
            let moved = self.adopt(&found, k, leaders.last().copied());
            leaders.push(self.point.sought[k]);
            let freed = self.free(found.subsets.best());
            if let Some((_, other)) = before.as_ref().filter(|_| is_in_turn(&leaders)) {
                self.point.state = midway(other, &at);
            } else if moved < CONVERGED && !freed {
                return Ok((found, self.point));
            }
            before = Some((found, at));
        }
    }

    /// Move the constants to where the noise that was found has them, where those of the ridge, which takes all noise for white, are too far
    /// off to be linear up to there; whether they moved. Noise that is smooth over a third of the window and twice as large as the white
    /// one sent E1 to 97 GPa for 154, and a line from there ends at 137 +- 3.
    fn is_moved(&mut self, found: &Evidence) -> Result<bool> {
        if self.restarts == RESTARTS {
            return Ok(false);
        }
        let wanted = likeliest(&found.weighing, &found.sensitivities, &found.subsets)?;
        let state = &mut self.point.state.shared;
        // a modulus acts by its reciprocal
        let misses =
            |(at, (mean, sd)): (&f64, &(f64, f64))| (mean - at).powi(2) > MISSED * sd * at.abs();
        if !state.constants.iter().zip(&wanted).any(misses) {
            return Ok(false);
        }
        let columns = wanted.iter().zip(&found.sensitivities.base);
        let wanted: Vec<f64> = columns.map(|((m, _), c)| (m - c.mean) / c.sd).collect();
        constants_moved(state, &found.sensitivities, &wanted, LONGEST);
        self.restarts += 1;
        Ok(true)
    }

    /// Shift a wave of the state in each step, where that is called for and was not done; whether it is now.
    fn is_shifted(&mut self, found: &Evidence) -> Result<bool> {
        let state = &mut self.point.state;
        if !state.shifts.is_empty() {
            return Ok(false);
        }
        state.shifts = shifts(found, &self.forward.phases(state)?)?;
        Ok(!state.shifts.is_empty())
    }

    /// Linearise about the ridge estimate. After the first pass constants, declared effects and what has moved are taken anew, nothing else.
    fn linearised(
        &mut self,
        pass: usize,
        before: Option<&Evidence>,
        leaders: &[EffectUnderLaw],
    ) -> Result<Sensitivities> {
        let name = format!("sensitivities-{}", self.numbered(pass));
        let LinearisationPoint {
            state,
            declared,
            sought,
        } = &mut self.point;
        let last = leaders.iter().rev().take(2);
        let moved: Vec<&'static str> = last.map(|l| l.effect.name()).collect();
        let columns = match (before, self.coarse) {
            (Some(evidence), _) => CandidateColumns::Kept {
                of: &evidence.sensitivities,
                moved: &moved,
            },
            // the steps of a series tell more of a column than one field does: there the discrepancy's probability went from 0.72 to 0.49
            (None, Some(coarse)) if !self.forward.observing.of_each_step() => {
                CandidateColumns::On(coarse)
            }
            (None, _) => CandidateColumns::Here,
        };
        let anew: Vec<EffectUnderLaw> = match before {
            Some(evidence) => {
                let known = evidence.sensitivities.candidates.len();
                let own = sought.iter().enumerate();
                let own = own.filter(|(k, e)| *k >= known || moved.contains(&e.effect.name()));
                own.map(|(_, e)| *e).collect()
            }
            None => sought.clone(),
        };
        let mut of = bytes_of(self.forward.model, self.measured);
        let sensitivities = before.map(|evidence| evidence.sensitivities.clone());
        (sensitivities, (state.clone(), declared.clone())).put(&mut of);
        (sought.clone(), (self.coarse.is_some(), self.restarts)).put(&mut of);
        moved.iter().for_each(|name| of.extend(name.bytes()));
        let (forward, measured, progress) = (self.forward, self.measured, self.progress);
        let restarts = self.restarts;
        let always = state.shared.constants.len() + forward.count(declared, state);
        let most = (1 + STEPS) * always + forward.count(&anew, state);
        let count = anew.len();
        let what = format!("tracing, pass {pass}: sensitivities to {count} effects");
        let at_ridge = || {
            progress.begin(&what, Some(most as u64));
            let mut at = state.clone();
            let found = match restarts {
                0 => forward.at_ridge(measured, &mut at, declared, sought, columns),
                _ => forward.sensitivities_with(&at, declared, sought, columns),
            };
            progress.end();
            Ok((at, found?))
        };
        let (at, found) = self.kept.stage(&name, &of, at_ridge, progress)?;
        *state = at;
        Ok(found)
    }

    /// The number of a pass, how often the constants had been moved, and in how many steps a wave is shifted.
    fn numbered(&self, pass: usize) -> String {
        let shifted = self.point.state.shifts.len();
        format!("{pass}-{}-{shifted}", self.restarts)
    }

    fn weighed(&self, pass: usize, sensitivities: Sensitivities) -> Result<Evidence> {
        let test = (self.forward, &**self.measured);
        let number = self.numbered(pass);
        let of = (&sensitivities, &*number);
        let weighing = weighed(test, of, (self.kept, self.progress))?;
        Evidence::new(weighing, sensitivities, self.measured)
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

/// Whether the strongest effect of the last pass is that of the pass before the one before, and another came between.
pub fn is_in_turn(leaders: &[EffectUnderLaw]) -> bool {
    match leaders {
        [.., first, other, last] => last.is(first) && !last.is(other),
        _ => false,
    }
}

/// The state midway between two, in constants and in amplitudes: as far from the one's account as from the other's.
pub fn midway(a: &SeriesState, b: &SeriesState) -> SeriesState {
    let mean = |a: &[f64], b: &[f64]| -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect()
    };
    let mut state = a.clone();
    state.shared.constants = mean(&a.shared.constants, &b.shared.constants);
    for acting in a.shared.acting().iter().chain(b.shared.acting()) {
        let own = [a, b].map(|s| s.shared.amplitude(acting.effect));
        state.shared.set(acting.effect, mean(&own[0], &own[1]));
    }
    for moving in b.moving.iter().chain(&a.moving) {
        let own = [a, b].map(|s| s.amplitude(moving.effect, &moving.weights));
        let now = state.amplitude(moving.effect, &moving.weights);
        let wanted = mean(&own[0], &own[1]);
        for (k, (wanted, now)) in wanted.iter().zip(&now).enumerate() {
            state = state.raised(moving.effect, k, wanted - now, &moving.weights);
        }
    }
    state
}
