//! A load series observed at places that are averages over points, in every step.
//!
//! Values are stacked step by step. The recipe and its figures are those of a prototype study on 28 + 28 series of image correlation
//! (right in 28 and 27, no wrong name): the whole chain of the camera is differenced, the reference picture's noise is common to all
//! steps, and every step has its own motion in the plane.

use nalgebra::DVector;

use super::column::{Column, PHASES, StepStack};
use super::exported::{self, Waves};
use super::observing::{ObservedAbout, Observing, quotient};
use super::slopes::averages;
use crate::effect::{Effect, Scene, Scope};
use crate::error::Result;
use crate::experiment::series::{Loaded, SeriesState, Solver, reported, rigid_free};
use crate::experiment::{Direction, FieldSolver, PointSet, Softening, State};
use crate::fem::Anchor;
use crate::field::Blocks;
use crate::infer::{FREE_MM, Model, Steps};
use crate::parameter::Parameter;

/// A series, where its averages lie.
pub struct AtPlaces<'a> {
    pub experiment: &'a dyn FieldSolver,
    pub sight: &'a PointSet,
    pub steps: &'a Steps,
    /// Where the averages lie, mm, and how much each counts.
    pub places: &'a [[f64; 2]],
    pub counts: &'a [usize],
    /// Averages over these, or the points themselves.
    pub blocks: Option<&'a Blocks>,
}

/// Step of the central difference of a load, over the nominal one.
const LOAD_STEP: f64 = 0.01;

const PERCENT: f64 = 0.01;

/// Prior sd of the shift of a wave in one step, px (prototype study).
const SHIFT_PX: f64 = 0.015;

/// A quarter of a wave, px.
const QUARTER: f64 = 0.25;

/// Prior sd of a force that is not known, over the nominal one and over its own size.
const UNKNOWN: [f64; 2] = [0.05, 0.5];

impl<'a> AtPlaces<'a> {
    /// Over blocks of a sight's points.
    pub fn over_blocks(
        experiment: &'a dyn FieldSolver,
        sight: &'a PointSet,
        steps: &'a Steps,
        blocks: &'a Blocks,
    ) -> Self {
        Self {
            experiment,
            sight,
            steps,
            places: &blocks.centroid,
            counts: &blocks.count,
            blocks: Some(blocks),
        }
    }

    /// What all steps measured, free of rigid motion, mm.
    pub fn measured(&self) -> StepStack {
        let steps = self.steps.displacement.iter();
        let free = |u: &Vec<[f64; 2]>| rigid_free(self.places, self.counts, &self.average(u));
        stacked(&steps.map(free).collect::<Vec<_>>())
    }

    fn average(&self, field: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let Some(blocks) = self.blocks else {
            return field.to_vec();
        };
        let [first, second] = averages(blocks, field);
        let pairs = first.iter().zip(&second);
        pairs.map(|(a, b)| [*a, *b]).collect()
    }

    /// What solves a state under the forces of its steps.
    fn solving<T>(
        &self,
        at: &SeriesState,
        solve: impl FnOnce(&Solver<'_>, &State, &[f64]) -> Result<T>,
    ) -> Result<T> {
        let solver = Solver {
            experiment: self.experiment,
            sight: self.sight,
            average: &|u| self.average(u),
        };
        let loads = at.acting_loads(self.experiment.scene());
        solve(&solver, &at.shared, &loads)
    }

    /// What acts through the displacements that are exported about a state that was solved for.
    fn waves(&self, at: &SeriesState, loaded: &Loaded) -> Waves {
        let scene = self.experiment.scene();
        let plain = exported::without(at, scene);
        let seen = reported(&plain, &at.shared, loaded, scene, self.places);
        Waves::about(at, &seen, scene, (self.places, self.counts))
    }

    /// All steps as the camera of a scene reports them, from what forces cause in the state `solved`.
    fn reported(
        &self,
        state: &SeriesState,
        (solved, loaded): (&State, &Loaded),
        (scene, waves): (&Scene, &Waves),
    ) -> StepStack {
        let plain = exported::without(state, scene);
        let mut steps = reported(&plain, solved, loaded, scene, self.places);
        if let Some(added) = waves.added(state, scene) {
            exported::add(&mut steps, &added);
        }
        let free = |u: &Vec<[f64; 2]>| rigid_free(self.places, self.counts, u);
        stacked(&steps.iter().map(free).collect::<Vec<_>>())
    }

    /// Whether no force is declared and that of a step is the largest: the one that all constants are relative to.
    fn is_relative(&self, step: usize) -> bool {
        let steps = self.steps;
        let largest = steps.loads.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        let mut declared = steps.known.iter().zip(&steps.loads);
        !declared.any(|(known, f)| *known && *f != 0.0) && steps.loads[step].abs() == largest
    }
}

impl Observing for AtPlaces<'_> {
    fn experiment(&self) -> &dyn FieldSolver {
        self.experiment
    }

    fn sight(&self) -> &PointSet {
        self.sight
    }

    fn names(&self) -> &[String] {
        &self.steps.names
    }

    fn prior_sd(&self, model: &Model, effect: &dyn Effect, k: usize) -> f64 {
        model.prior_sd_in_series(self.experiment.scene(), effect, k)
    }

    fn beginning(&self, shared: State) -> SeriesState {
        SeriesState {
            shared,
            loads: self.steps.loads.clone(),
            rigid: self.steps.rigid.clone(),
            moving: Vec::new(),
            shifts: Vec::new(),
        }
    }

    fn shown(&self, at: &SeriesState) -> Result<StepStack> {
        let loaded = self.solving(at, |solver, state, loads| solver.loaded(None, state, loads))?;
        let about = (self.experiment.scene(), &self.waves(at, &loaded));
        Ok(self.reported(at, (&at.shared, &loaded), about))
    }

    fn about<'a>(&'a self, at: &'a SeriesState) -> Result<Box<dyn ObservedAbout + 'a>> {
        let (anchor, loaded) = self.solving(at, |solver, state, loads| {
            let anchor = solver.anchor(state, loads)?;
            let loaded = solver.loaded(anchor.as_ref(), state, loads)?;
            Ok((anchor, loaded))
        })?;
        Ok(Box::new(AboutPlaces {
            observing: self,
            waves: self.waves(at, &loaded),
            loaded,
            anchor,
            at,
        }))
    }

    fn of_each_step(&self) -> bool {
        true
    }
}

fn stacked(steps: &[Vec<[f64; 2]>]) -> StepStack {
    let count = steps.iter().map(Vec::len).sum();
    [0, 1].map(|c| DVector::from_iterator(count, steps.iter().flatten().map(|u| u[c])))
}

struct AboutPlaces<'a> {
    observing: &'a AtPlaces<'a>,
    loaded: Loaded,
    waves: Waves,
    anchor: Option<Anchor>,
    at: &'a SeriesState,
}

impl AboutPlaces<'_> {
    /// The difference quotient of two states that share this one's load displacements.
    fn pictured(&self, [high, low]: [&SeriesState; 2], over: f64) -> StepStack {
        let scene = self.observing.experiment.scene();
        quotient([high, low].map(|state| self.reported(state, scene)), over)
    }

    /// The same of two states that are solved for.
    fn solved(&self, states: [SeriesState; 2], over: f64) -> Result<StepStack> {
        let scene = self.observing.experiment.scene();
        let shown = |state: &SeriesState| -> Result<StepStack> {
            let loaded =
                self.observing
                    .solving(state, |solver, state, loads| match &self.anchor {
                        Some(anchor) => solver.loaded_near(anchor, state, loads),
                        None => solver.loaded(None, state, loads),
                    })?;
            Ok(self
                .observing
                .reported(state, (&state.shared, &loaded), (scene, &self.waves)))
        };
        Ok(quotient([shown(&states[0])?, shown(&states[1])?], over))
    }

    /// The change for forces that are all twice as large.
    fn of_the_load(&self) -> StepStack {
        let at = self
            .at
            .under_acting_loads(self.observing.experiment.scene());
        let times = |factor: f64| {
            let mut state = at.clone();
            state.loads.iter_mut().for_each(|f| *f *= factor);
            state
        };
        let moved = [&times(1.0 + LOAD_STEP), &times(1.0 - LOAD_STEP)];
        self.pictured(moved, 2.0 * LOAD_STEP)
    }

    /// The column of a force that is not declared.
    fn unknown_force(&self, step: usize) -> Column {
        let steps = self.observing.steps;
        let guess = steps.loads[step];
        let moved = [LOAD_STEP, -LOAD_STEP].map(|by| {
            let mut state = self.at.clone();
            state.loads[step] += by;
            state
        });
        let slope = self.pictured(moved.each_ref(), 2.0 * LOAD_STEP);
        let sd = UNKNOWN[0].hypot(UNKNOWN[1] * guess);
        let name = Parameter::force(&steps.names[step]).name();
        Column::new(name, [guess, sd], self.at.loads[step], slope)
    }

    /// Columns of the errors of declared forces, each in its own step, percent: what is wrong with one is a multiple of the whole field that
    /// the load causes there, hole and all, and no step's field depends on the force of another.
    fn force_errors(&self) -> Vec<Column> {
        let steps = self.observing.steps;
        let sd = steps.force_sd_percent;
        let declared = |s: &usize| steps.known[*s] && steps.loads[*s] != 0.0 && sd > 0.0;
        let declared: Vec<usize> = (0..steps.loads.len()).filter(declared).collect();
        if declared.is_empty() {
            return Vec::new();
        }
        let of_all = self.of_the_load();
        let n = self.observing.places.len();
        let of_step = |step: usize| {
            let slope = of_all.each_ref().map(|all| {
                let mut own = DVector::zeros(all.len());
                own.rows_mut(step * n, n)
                    .copy_from(&(all.rows(step * n, n) * PERCENT));
                own
            });
            let name = Parameter::force_error(&steps.names[step]).name();
            Column::new(name, [0.0, sd], 0.0, slope)
        };
        declared.into_iter().map(of_step).collect()
    }

    /// Columns of the shifts of a wave in each step, where the state has some.
    fn phases(&self) -> Vec<Column> {
        let mut columns = Vec::new();
        let names = &self.observing.steps.names;
        let wave = exported::acting(self.at, self.observing.experiment.scene()).next();
        let shifts = self.at.shifts.iter().zip(names).enumerate();
        for (step, (shift, name)) in shifts.filter(|_| wave.is_some()) {
            for axis in 0..2 {
                // a quarter of a pixel on, a sine is its slope over 2 pi
                let moved = [QUARTER, -QUARTER].map(|by| {
                    let mut state = self.at.clone();
                    state.shifts[step][axis] += by;
                    state
                });
                let slope = self.pictured(moved.each_ref(), std::f64::consts::PI.recip());
                let effect = wave.map_or("", |a| a.effect.name());
                let own = Parameter::amplitude(effect, PHASES[axis]).in_step(name);
                columns.push(Column {
                    product: true,
                    ..Column::new(own.name(), [0.0, SHIFT_PX], shift[axis], slope)
                });
            }
        }
        columns
    }

    /// Columns of the motion in the plane in one step.
    fn motion(&self, step: usize) -> [Column; 3] {
        let places = self.observing.places;
        let (n, count) = (places.len(), self.at.loads.len());
        let reach = places.iter().fold(1.0_f64, |m, p| m.max(p[0].hypot(p[1])));
        [0, 1, 2].map(|motion| {
            let mut slope = [DVector::zeros(n * count), DVector::zeros(n * count)];
            for (k, &p) in places.iter().enumerate() {
                let u = match motion {
                    0 => [1.0, 0.0],
                    1 => [0.0, 1.0],
                    _ => [-p[1] / reach, p[0] / reach],
                };
                slope[0][step * n + k] = u[0];
                slope[1][step * n + k] = u[1];
            }
            Column::new(Parameter::rigid_motion().name(), [0.0, FREE_MM], 0.0, slope)
        })
    }
}

impl ObservedAbout for AboutPlaces<'_> {
    fn predicted(&self) -> Result<StepStack> {
        Ok(self.reported(self.at, self.observing.experiment.scene()))
    }

    fn reported(&self, state: &SeriesState, scene: &Scene) -> StepStack {
        let solved = (&self.at.shared, &self.loaded);
        self.observing.reported(state, solved, (scene, &self.waves))
    }

    fn slope(&self, direction: Direction, weights: &[f64], step: f64) -> Result<StepStack> {
        match direction {
            Direction::Load => Ok(self.of_the_load().map(|v| v * PERCENT)),
            // a field under a force goes with their ratio
            Direction::Thickness => {
                let thickness = self.at.shared.thickness_mm;
                Ok(self.of_the_load().map(|v| v * (-1.0 / thickness)))
            }
            Direction::Constant(k) => {
                let moved = [step, -step].map(|by| {
                    let mut state = self.at.clone();
                    state.shared.constants[k] += by;
                    state
                });
                self.solved(moved, 2.0 * step)
            }
            Direction::Amplitude(effect, k) => {
                let moved = [step, -step].map(|by| self.at.raised(effect, k, by, weights));
                match effect.scope() {
                    Scope::Mechanical => self.solved(moved, 2.0 * step),
                    Scope::Force if !self.loaded.beyond.is_empty() => {
                        self.solved(moved, 2.0 * step)
                    }
                    _ => Ok(self.pictured(moved.each_ref(), 2.0 * step)),
                }
            }
        }
    }

    /// In proportion to the load.
    fn softened(&self, softening: Softening<'_>) -> Result<Vec<StepStack>> {
        let AtPlaces {
            experiment, sight, ..
        } = self.observing;
        let about = self.anchor.as_ref();
        let fields = experiment.softened(about, &self.at.shared, sight, softening)?;
        Ok(fields.iter().map(|u| self.with_the_load(u)).collect())
    }

    fn with_the_load(&self, field: &[[f64; 2]]) -> StepStack {
        let AtPlaces { places, counts, .. } = self.observing;
        let average = rigid_free(places, counts, &self.observing.average(field));
        let loads = self.at.acting_loads(self.observing.experiment.scene());
        let steps = loads.iter().map(|f| {
            let scaled = average.iter().map(|u| u.map(|u| f * u));
            scaled.collect::<Vec<[f64; 2]>>()
        });
        stacked(&steps.collect::<Vec<_>>())
    }

    fn of_steps(&self) -> Vec<Column> {
        let AtPlaces { steps, .. } = self.observing;
        let all = 0..steps.loads.len();
        let unknown = all
            .clone()
            .filter(|s| !steps.known[*s] && !self.observing.is_relative(*s));
        let forces = unknown.map(|step| self.unknown_force(step));
        forces
            .chain(self.force_errors())
            .chain(all.flat_map(|step| self.motion(step)))
            .chain(self.phases())
            .collect()
    }
}
