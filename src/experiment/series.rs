//! A load series: one specimen, pictured in several steps. All steps share constants, geometry, thickness and the static map of the
//! picture; each has its own force and its own motion.
//!
//! A series is predicted at few places (averages over blocks of points), from what one solution of the finite elements shows there.

use serde::{Deserialize, Serialize};

use super::{CameraField, FieldSolver, Gauge, PointSet, State, gauged};
use crate::effect::{Acting, Effect, Kind, Scene, Scope, Seen, force_scale};
use crate::error::Result;
use crate::fem::Anchor;
use crate::field::rigid::{self, RigidMotion};

/// How the amplitude of a motion goes over the steps of a series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// It has arisen with the reference picture: the same in every step.
    Constant,
    /// In proportion to the force.
    Load,
    /// There once the specimen is loaded: F / (F + F0) with F0 a twentieth of the largest force.
    Seated,
    /// In proportion to the largest force so far: what has moved stays.
    Kept,
    /// In proportion to the step's number.
    Drift,
    /// An amplitude of its own in every step.
    Free,
}

/// As `simulate --effect` has it: `NAME:LAW`.
pub fn with_law(name: &str, law: Option<Law>) -> String {
    law.map_or_else(|| name.to_string(), |law| format!("{name}:{}", law.key()))
}

impl Law {
    pub const ALL: [Self; 6] = [
        Self::Constant,
        Self::Load,
        Self::Seated,
        Self::Kept,
        Self::Drift,
        Self::Free,
    ];

    /// The name in files, that of its serialisation.
    pub fn key(self) -> String {
        let name = serde_json::to_value(self).ok();
        let name = name.and_then(|v| v.as_str().map(String::from));
        name.unwrap_or_else(|| self.words().into())
    }

    pub fn words(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Load => "with the load",
            Self::Seated => "seated",
            Self::Kept => "with the largest load so far",
            Self::Drift => "drift",
            Self::Free => "free",
        }
    }

    /// The amplitude in each step over the amplitude that is stated, which is that of a full force or, of a drift, of the last step
    /// under load; `loads` are the forces over the largest one. A free amplitude has one set of weights for each step.
    pub fn weights(self, loads: &[f64]) -> Vec<Vec<f64>> {
        let count = loads.len();
        let loaded = loads
            .iter()
            .rposition(|f| *f > 0.0)
            .map_or(count, |k| k + 1);
        match self {
            Self::Constant => vec![vec![1.0; count]],
            Self::Load => vec![loads.to_vec()],
            Self::Seated => vec![loads.iter().map(|f| f / (f.abs() + SEATING)).collect()],
            Self::Kept => vec![acted(loads, true)],
            Self::Drift => vec![(1..=count).map(|k| k as f64 / loaded as f64).collect()],
            Self::Free => (0..count)
                .map(|s| (0..count).map(|k| f64::from(k == s)).collect())
                .collect(),
        }
    }
}

/// The force F0 of [`Law::Seated`] over the largest force (prototype study).
const SEATING: f64 = 0.05;

/// A point of a series' parameter space.
#[derive(Clone, Serialize, Deserialize)]
pub struct SeriesState {
    /// Constants, thickness, and the effects that all steps share.
    pub shared: State,
    /// Force of each step over the nominal one.
    pub loads: Vec<f64>,
    /// Motion in the plane in each step.
    pub rigid: Vec<RigidMotion>,
    /// Effects that move the specimen or change the force, with their amplitudes in each step.
    pub moving: Vec<Moving>,
    /// How far in each step a wave of the exported displacement is shifted along the data's axes, px; empty where it is not.
    pub shifts: Vec<[f64; 2]>,
}

/// An effect whose amplitude is another in each step, by one law.
#[derive(Clone, Serialize, Deserialize)]
pub struct Moving {
    pub effect: &'static dyn Effect,
    /// The amplitude in each step over the stated one.
    pub weights: Vec<f64>,
    /// The stated one, border units.
    pub amplitude: Vec<f64>,
}

impl Moving {
    /// Whether it is another force than the declared one, or acts as one.
    fn is_force(&self) -> bool {
        self.effect.scope() == Scope::Force
    }

    /// The effect with its stated amplitude.
    pub fn acting(&self) -> Acting {
        Acting {
            effect: self.effect,
            amplitude: self.amplitude.clone(),
        }
    }
}

impl SeriesState {
    /// The state of a single field.
    pub fn of_one_step(shared: State) -> Self {
        Self {
            shared,
            loads: vec![1.0],
            rigid: vec![RigidMotion::NONE],
            moving: Vec::new(),
            shifts: Vec::new(),
        }
    }

    /// The state with the amplitude of an effect's parameter raised by some border units: of one that has a law in each step times its
    /// weight; without weights in all steps.
    #[must_use]
    pub fn raised(
        &self,
        effect: &'static dyn Effect,
        parameter: usize,
        by: f64,
        weights: &[f64],
    ) -> Self {
        let mut state = self.clone();
        if weights.is_empty() {
            state.shared.shift(effect, parameter, by);
            return state;
        }
        let acts = |m: &Moving| m.effect.name() == effect.name() && m.weights == weights;
        if !state.moving.iter().any(acts) {
            state.moving.push(Moving {
                effect,
                weights: weights.to_vec(),
                amplitude: vec![0.0; effect.parameters().len()],
            });
        }
        for moving in state.moving.iter_mut().filter(|m| acts(m)) {
            moving.amplitude[parameter] += by;
        }
        state
    }

    /// The stated amplitude of an effect, in border units: of one that has a law by its weights in the steps, without weights in all steps.
    pub fn amplitude(&self, effect: &dyn Effect, weights: &[f64]) -> Vec<f64> {
        if weights.is_empty() {
            return self.shared.amplitude(effect);
        }
        let mut moving = self.moving.iter();
        let acts = |m: &&Moving| m.effect.name() == effect.name() && m.weights == weights;
        moving.find(acts).map_or_else(
            || vec![0.0; effect.parameters().len()],
            |m| m.amplitude.clone(),
        )
    }

    /// Take an effect out, however it acts.
    pub fn remove(&mut self, effect: &'static dyn Effect) {
        self.shared
            .set(effect, vec![0.0; effect.parameters().len()]);
        self.moving.retain(|m| m.effect.name() != effect.name());
    }

    /// The force that acts in each step over the nominal one: the declared one with what effects make of it.
    pub fn acting_loads(&self, scene: &Scene) -> Vec<f64> {
        let mut loads = self.loads.clone();
        for m in self.moving.iter().filter(|m| m.is_force()) {
            let by = m.effect.force(&m.amplitude, scene);
            for (load, weight) in loads.iter_mut().zip(&m.weights) {
                *load += weight * by;
            }
        }
        loads
    }

    /// The same state with these forces as the declared ones.
    #[must_use]
    pub fn under_acting_loads(&self, scene: &Scene) -> Self {
        let mut state = self.clone();
        state.loads = self.acting_loads(scene);
        state.moving.retain(|m| !m.is_force());
        state
    }

    /// Effects that act on the picture of a step.
    fn acting(&self, step: usize) -> Vec<Acting> {
        let mut moving: Vec<Acting> = Vec::new();
        for m in self.moving.iter().filter(|m| !m.is_force()) {
            let own = m.amplitude.iter().map(|a| m.weights[step] * a);
            let known = moving
                .iter_mut()
                .find(|a| a.effect.name() == m.effect.name());
            if let Some(known) = known {
                known
                    .amplitude
                    .iter_mut()
                    .zip(own)
                    .for_each(|(a, own)| *a += own);
            } else {
                moving.push(Acting {
                    effect: m.effect,
                    amplitude: own.collect(),
                });
            }
        }
        moving.retain(|a| a.amplitude.iter().any(|x| *x != 0.0));
        self.shared.acting().iter().cloned().chain(moving).collect()
    }
}

/// What a full nominal force causes at the places of a series.
#[derive(Clone)]
pub struct Loaded {
    /// The part that is proportional to the force, mm.
    pub linear: Vec<[f64; 2]>,
    /// What effects add in each step that are not proportional to the force, mm; empty where there are none.
    pub beyond: Vec<Vec<[f64; 2]>>,
    /// Gradient of the displacement.
    pub gradient: Vec<[[f64; 2]; 2]>,
}

impl Loaded {
    /// Displacement at a place in a step, under a force over the nominal one.
    fn at(&self, place: usize, step: usize, load: f64) -> [f64; 2] {
        let u = self.linear[place].map(|u| load * u);
        match self.beyond.get(step) {
            Some(beyond) => [0, 1].map(|c| u[c] + beyond[place][c]),
            None => u,
        }
    }
}

/// Averages, at the places of a series, of values at measured points.
pub type Average<'a> = dyn Fn(&[[f64; 2]]) -> Vec<[f64; 2]> + Sync + 'a;

/// How a series' displacements are obtained.
pub struct Solver<'a> {
    pub experiment: &'a dyn FieldSolver,
    pub sight: &'a PointSet,
    /// Averages of values at the sight's points: those at the places of the series.
    pub average: &'a Average<'a>,
}

impl Solver<'_> {
    /// What a state's solutions are found from under the forces of the steps, `loads` over the nominal one.
    ///
    /// # Errors
    /// Those of a prediction.
    pub fn anchor(&self, state: &State, loads: &[f64]) -> Result<Option<Anchor>> {
        self.experiment.anchor(state, &followed(state, loads))
    }

    /// Solve for what the forces of the steps cause, `loads` over the nominal one; what is not in proportion to them from the state's own
    /// anchor, where it is known.
    ///
    /// # Errors
    /// Those of a prediction.
    pub fn loaded(&self, about: Option<&Anchor>, state: &State, loads: &[f64]) -> Result<Loaded> {
        let look = self.experiment.look(&plain(state), self.sight, true)?;
        // what remains is plastic, and tabulated
        let follows = nonlinear(state).any(|a| !a.effect.remains());
        let own = match about {
            None if follows => self.anchor(state, loads)?,
            _ => None,
        };
        self.with_beyond(about.or(own.as_ref()), state, loads, &look)
    }

    /// The same, without the gradient, at a state so near to an anchor's that only differences matter.
    ///
    /// # Errors
    /// Those of a prediction.
    pub fn loaded_near(&self, about: &Anchor, state: &State, loads: &[f64]) -> Result<Loaded> {
        let about = Some(about);
        let look = self
            .experiment
            .look_near(about, &plain(state), self.sight)?;
        self.with_beyond(about, state, loads, &look)
    }

    /// What a state causes that looks so without its nonlinear effects.
    fn with_beyond(
        &self,
        about: Option<&Anchor>,
        state: &State,
        loads: &[f64],
        look: &CameraField,
    ) -> Result<Loaded> {
        let solved = self.places(look);
        let mut linear = solved.clone();
        for a in state.acting().iter().filter(|a| is_added_by_the_load(a)) {
            let added = self.experiment.added(a.effect, &a.amplitude, self.sight)?;
            for (u, added) in linear.iter_mut().zip((self.average)(&added)) {
                *u = [0, 1].map(|c| u[c] + added[c]);
            }
        }
        let beyond = match nonlinear(state).next() {
            Some(_) => self.beyond(about, state, loads, &solved)?,
            None => Vec::new(),
        };
        Ok(Loaded {
            gradient: self.gradient(look),
            linear,
            beyond,
        })
    }

    /// What a state's nonlinear effects add in each step to what is `solved` without them, mm.
    fn beyond(
        &self,
        about: Option<&Anchor>,
        state: &State,
        loads: &[f64],
        solved: &[[f64; 2]],
    ) -> Result<Vec<Vec<[f64; 2]>>> {
        let forces = followed(state, loads);
        let own = state.amplitude(force_scale())[0];
        let under = |load: &f64| {
            let mut state = state.clone();
            let percent = (1.0 + 0.01 * own) * load - 1.0;
            state.set(force_scale(), vec![100.0 * percent]);
            state
        };
        let states: Vec<State> = forces.iter().map(under).collect();
        let looks = self.experiment.looks_near(about, &states, self.sight)?;
        let added = |(look, load): (&CameraField, &f64)| {
            let whole = self.places(look).into_iter().zip(solved);
            let added = whole.map(|(u, solved)| [0, 1].map(|c| u[c] - load * solved[c]));
            added.collect()
        };
        let known: Vec<Vec<[f64; 2]>> = looks.iter().zip(&forces).map(added).collect();
        let of_step = |load: f64| match forces.iter().position(|f| *f == load) {
            Some(k) => known[k].clone(),
            None => vec![[0.0; 2]; solved.len()],
        };
        Ok(acting(state, loads).into_iter().map(of_step).collect())
    }

    /// Displacements at the places, free of the rigid motion over the points.
    fn places(&self, look: &CameraField) -> Vec<[f64; 2]> {
        (self.average)(&gauged(Gauge::Window, self.sight, &look.loaded))
    }

    fn gradient(&self, look: &CameraField) -> Vec<[[f64; 2]; 2]> {
        if look.gradient.is_empty() {
            return Vec::new();
        }
        let rows = [0, 1].map(|i| {
            let own = &look.gradient[..self.sight.points().len()];
            let row: Vec<[f64; 2]> = own.iter().map(|g| g[i]).collect();
            (self.average)(&row)
        });
        rows[0]
            .iter()
            .zip(&rows[1])
            .map(|(a, b)| [*a, *b])
            .collect()
    }
}

/// Effects of a state that are not in proportion to the force.
fn nonlinear(state: &State) -> impl Iterator<Item = &Acting> {
    let acting = state.acting().iter();
    acting.filter(|a| a.effect.kind() == Kind::Mechanical && !a.effect.scales())
}

/// A state without them.
fn plain(state: &State) -> State {
    let mut plain = state.clone();
    for a in nonlinear(state) {
        plain.set(a.effect, vec![0.0; a.amplitude.len()]);
    }
    plain
}

/// The force that counts in each step for them.
fn acting(state: &State, loads: &[f64]) -> Vec<f64> {
    acted(loads, nonlinear(state).any(|a| a.effect.remains()))
}

/// The forces under which they are followed, each once.
fn followed(state: &State, loads: &[f64]) -> Vec<f64> {
    let mut known: Vec<f64> = Vec::new();
    for load in acting(state, loads) {
        if load.abs() >= LEAST_LOAD && !known.contains(&load) {
            known.push(load);
        }
    }
    known
}

/// Whether an effect adds a field that grows with the force.
fn is_added_by_the_load(a: &Acting) -> bool {
    a.effect.kind() == Kind::Additive && a.effect.scope() == Scope::Mechanical
}

/// Whether an effect adds a field that is another in each step.
fn is_motion(a: &Acting) -> bool {
    a.effect.kind() == Kind::Additive && a.effect.scope() == Scope::Motion
}

/// Forces over the nominal one below which nothing yields or softens.
const LEAST_LOAD: f64 = 0.02;

/// The force that counts in each step: the largest so far where what it did remains.
fn acted(loads: &[f64], remains: bool) -> Vec<f64> {
    let mut largest = 0.0_f64;
    let one = |f: &f64| {
        largest = largest.max(*f);
        if remains { largest } else { *f }
    };
    loads.iter().map(one).collect()
}

/// What the camera reports in each step at places, mm, from what a full force causes there, rigid motion included where displacements are
/// imaged. `linearised` is the state of which that is: where the picture's map differs, the displacement follows the material point by its
/// gradient.
pub fn reported(
    state: &SeriesState,
    linearised: &State,
    loaded: &Loaded,
    scene: &Scene,
    places: &[[f64; 2]],
) -> Vec<Vec<[f64; 2]>> {
    let before = Seen::new(linearised.acting(), scene);
    let loads = state.acting_loads(scene);
    let steps = loads.iter().zip(&state.rigid).enumerate();
    let one = |(step, (&load, rigid)): (usize, (&f64, &RigidMotion))| {
        let acting = state.acting(step);
        let camera = Seen::new(&acting, scene).moved(*rigid);
        let report = |(k, &place): (usize, &[f64; 2])| {
            let mut u = loaded.at(k, step, load);
            let point = camera.true_point(place);
            if let Some(g) = loaded.gradient.get(k) {
                let from = before.true_point(place);
                let shift = [point[0] - from[0], point[1] - from[1]];
                u = [0, 1].map(|i| u[i] + load * (g[i][0] * shift[0] + g[i][1] * shift[1]));
            }
            for a in acting.iter().filter(|a| is_motion(a)) {
                let added = a.effect.displacement(&a.amplitude, scene, point);
                u = [0, 1].map(|i| u[i] + added[i]);
            }
            camera.report(place, u)
        };
        places.iter().enumerate().map(report).collect()
    };
    steps.map(one).collect()
}

/// A field without its least-squares rigid motion, each place counting with its weight.
pub fn rigid_free(places: &[[f64; 2]], weights: &[usize], field: &[[f64; 2]]) -> Vec<[f64; 2]> {
    rigid::fit_weighted(places, weights, field).removed(places, field)
}
