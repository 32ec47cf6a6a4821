//! Sensitivities of a load series: what every parameter does to what each step shows, at places that are averages over points.
//!
//! Values are stacked step by step. The recipe and its figures are those of a prototype study on 28 + 28 series of image correlation
//! (right in 28 and 27, no wrong name): the whole chain of the camera is differenced, the reference picture's noise is common to all
//! steps, and every step has its own motion in the plane.

use nalgebra::DVector;
use rayon::prelude::*;

use super::column::FORCE;
use super::{Acts, Amplitude, Column, Model, Steps};
use crate::effect::{LOAD_SCALE, Scene, Scope, amplitude_name};
use crate::error::Result;
use crate::experiment::series::{Average, Loaded, SeriesState, Solver, report, rigid_free};
use crate::experiment::{FieldSolver, Sight, Softening, State};
use crate::fem::Anchor;
use crate::laminate::MeanSd;
use crate::reduce::THICKNESS;

/// A series, ready to be linearised.
pub struct Stepped<'a> {
    pub model: &'a Model,
    pub experiment: &'a dyn FieldSolver,
    pub sight: &'a Sight,
    pub steps: &'a Steps,
    /// Where the averages lie, mm, and how much each counts.
    pub places: &'a [[f64; 2]],
    pub counts: &'a [usize],
    /// Averages of values at the sight's points.
    pub average: &'a Average<'a>,
    pub step: &'a (dyn Fn() + Sync),
}

/// The effect whose centre has no column of its own while its strength is below this many prior sds.
pub const LENS: &str = "lens_distortion";
pub const WEAK: f64 = 0.1;

/// Steps of central differences: of a constant over its value, of an amplitude in prior sds, of a load over the nominal one.
const CONSTANT_STEP: f64 = 0.01;
const AMPLITUDE_STEP: f64 = 0.5;
const LOAD_STEP: f64 = 0.01;

/// Prior sd of the camera's axis and of the lens' centre about the middle of the picture, mm: 3 mm is too little where they lie 11 mm off,
/// and 6 found them (prototype study).
pub const AXIS_MM: f64 = 6.0;

/// Prior sd of the distance between the origin and the axis about which a specimen turns, mm.
pub const PIVOT_MM: f64 = 10.0;

/// Prior sd of a motion in the plane, mm and, over the picture, rad: as good as none.
pub(super) const FREE_MM: f64 = 10.0;

/// Prior sd of a force that is not known, over the nominal one and over its own size.
const UNKNOWN: [f64; 2] = [0.05, 0.5];

impl Stepped<'_> {
    /// What all steps measured, free of rigid motion, mm.
    pub fn measured(&self) -> Stack {
        let steps = self.steps.displacement.iter();
        let free = |u: &Vec<[f64; 2]>| rigid_free(self.places, self.counts, &(self.average)(u));
        stacked(&steps.map(free).collect::<Vec<_>>())
    }

    /// Where a series starts: shared constants and effects, the steps' own loads and motions.
    pub fn start(&self, shared: State) -> SeriesState {
        SeriesState {
            shared,
            loads: self.steps.loads.clone(),
            rigid: self.steps.rigid.clone(),
            moving: Vec::new(),
        }
    }

    pub(super) fn scene(&self) -> &Scene {
        self.experiment.scene()
    }

    fn loaded(&self, about: Option<&Anchor>, at: &SeriesState) -> Result<Loaded> {
        let solver = Solver {
            experiment: self.experiment,
            sight: self.sight,
            average: self.average,
        };
        solver.loaded(about, &at.shared, &at.loads)
    }

    /// All steps as the camera reports them.
    fn seen(&self, state: &SeriesState, of: &State, loaded: &Loaded, scene: &Scene) -> Stack {
        stacked(&report(state, of, loaded, scene, self.places, self.counts))
    }

    /// What all steps show at a state, mm.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn shown(&self, at: &SeriesState) -> Result<Stack> {
        Ok(self.seen(at, &at.shared, &self.loaded(None, at)?, self.scene()))
    }

    /// The point about which to linearise.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn here<'a>(&'a self, at: &'a SeriesState) -> Result<Here<'a>> {
        Ok(Here {
            stepped: self,
            loaded: self.loaded(None, at)?,
            anchor: self.experiment.anchor(&at.shared)?,
            at,
        })
    }
}

/// Values of both components, step by step, mm.
pub type Stack = [DVector<f64>; 2];

fn stacked(steps: &[Vec<[f64; 2]>]) -> Stack {
    let count = steps.iter().map(Vec::len).sum();
    [0, 1].map(|c| DVector::from_iterator(count, steps.iter().flatten().map(|u| u[c])))
}

/// The point about which a series is linearised.
pub struct Here<'a> {
    pub(super) stepped: &'a Stepped<'a>,
    loaded: Loaded,
    anchor: Option<Anchor>,
    pub(super) at: &'a SeriesState,
}

impl Here<'_> {
    /// What all steps show, mm.
    pub fn predicted(&self) -> Stack {
        let scene = self.stepped.scene();
        self.stepped
            .seen(self.at, &self.at.shared, &self.loaded, scene)
    }

    /// The same without the effects that are `declared`.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn without(&self, declared: &[Acts]) -> Result<Stack> {
        let mut state = self.at.clone();
        state.moving.clear();
        for acts in declared {
            let none = vec![0.0; acts.effect.parameters().len()];
            state.shared.set(acts.effect, none);
        }
        let mut scopes = declared.iter().map(|a| a.effect.scope());
        let scene = self.stepped.scene();
        if scopes.any(|s| s == Scope::Mechanical) {
            let loaded = self.stepped.loaded(None, &state)?;
            return Ok(self.stepped.seen(&state, &state.shared, &loaded, scene));
        }
        Ok(self
            .stepped
            .seen(&state, &self.at.shared, &self.loaded, scene))
    }

    /// The difference quotient of two states that share this one's load displacements.
    pub(super) fn slope(&self, [high, low]: [&SeriesState; 2], over: f64, scene: &Scene) -> Stack {
        let see = |state| {
            self.stepped
                .seen(state, &self.at.shared, &self.loaded, scene)
        };
        quotient([see(high), see(low)], over)
    }

    /// The same of two states that are solved for.
    fn solved(&self, [high, low]: [SeriesState; 2], over: f64) -> Result<Stack> {
        let see = |state: &SeriesState| -> Result<Stack> {
            let own = self.stepped.loaded(self.anchor.as_ref(), state)?;
            Ok(self
                .stepped
                .seen(state, &state.shared, &own, self.stepped.scene()))
        };
        Ok(quotient([see(&high)?, see(&low)?], over))
    }

    /// What varies in every account: constants, thickness, load, forces that are not known, motion in the plane.
    pub fn always(&self) -> Result<Vec<Column>> {
        let Stepped { model, steps, .. } = self.stepped;
        let names = model.constants();
        let constants = names.par_iter().zip(model.marginals()).enumerate();
        let mut columns: Vec<Column> = constants
            .map(|(k, (name, prior))| {
                let step = CONSTANT_STEP * prior.mean.abs();
                let moved = [step, -step].map(|by| {
                    let mut state = self.at.clone();
                    state.shared.constants[k] += by;
                    state
                });
                (self.stepped.step)();
                let slope = self.solved(moved, 2.0 * step)?;
                Ok(column(
                    (*name).into(),
                    [prior.mean, prior.sd],
                    self.at.shared.constants[k],
                    slope,
                ))
            })
            .collect::<Result<_>>()?;
        let loads_times = |factor: f64| {
            let mut state = self.at.clone();
            state.loads.iter_mut().for_each(|f| *f *= factor);
            state
        };
        let of_load = self.slope(
            [&loads_times(1.0 + LOAD_STEP), &loads_times(1.0 - LOAD_STEP)],
            2.0 * LOAD_STEP,
            self.stepped.scene(),
        );
        let MeanSd { mean, sd } = model.experiment().specimen.thickness_mm;
        let thickness = self.at.shared.thickness_mm;
        if sd > 0.0 {
            // a field under a force goes with their ratio
            let slope = of_load.each_ref().map(|v| v * (-1.0 / thickness));
            columns.push(column(THICKNESS.into(), [mean, sd], thickness, slope));
        }
        let percent = self.stepped.prior_sd(LOAD_SCALE, 0);
        let name = amplitude_name(LOAD_SCALE, &LOAD_SCALE.parameters()[0]);
        columns.push(column(name, [0.0, percent], 0.0, of_load.map(|v| v * 0.01)));
        for step in (0..steps.loads.len()).filter(|s| !steps.known[*s]) {
            columns.extend(self.unknown_force(step));
        }
        columns.extend((0..steps.loads.len()).flat_map(|step| self.rigid(step)));
        Ok(columns)
    }

    /// The column of a force that is not declared. Where none is, that of the largest is what all constants are relative to.
    fn unknown_force(&self, step: usize) -> Option<Column> {
        let steps = self.stepped.steps;
        let guess = steps.loads[step];
        let largest = steps.loads.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        if !steps
            .known
            .iter()
            .zip(&steps.loads)
            .any(|(known, f)| *known && *f != 0.0)
            && guess.abs() == largest
        {
            return None;
        }
        let moved = [LOAD_STEP, -LOAD_STEP].map(|by| {
            let mut state = self.at.clone();
            state.loads[step] += by;
            state
        });
        let slope = self.slope(
            [&moved[0], &moved[1]],
            2.0 * LOAD_STEP,
            self.stepped.scene(),
        );
        let sd = UNKNOWN[0].hypot(UNKNOWN[1] * guess);
        let name = format!("{FORCE}{}", steps.names[step]);
        Some(column(name, [guess, sd], self.at.loads[step], slope))
    }

    /// Columns of the motion in the plane in one step.
    fn rigid(&self, step: usize) -> [Column; 3] {
        let places = self.stepped.places;
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
            column("rigid_motion".into(), [0.0, FREE_MM], 0.0, slope)
        })
    }

    /// The columns of an effect: its amplitudes', then their products with what is not known of the camera and of the pivot.
    pub fn columns(&self, acts: &Acts) -> Result<Vec<Column>> {
        let effect = acts.effect;
        let amplitudes = acts.amplitudes(&self.at.loads, &self.stepped.steps.names);
        let mut columns = Vec::new();
        for Amplitude {
            name,
            parameter: k,
            weights,
        } in &amplitudes
        {
            let sd = self.stepped.prior_sd(effect, *k);
            let step = AMPLITUDE_STEP * sd;
            let moved = [step, -step].map(|by| self.at.raised(effect, *k, by, weights));
            let slope = if effect.scope() == Scope::Mechanical {
                self.solved(moved, 2.0 * step)?
            } else {
                self.slope([&moved[0], &moved[1]], 2.0 * step, self.stepped.scene())
            };
            let value = self.amplitude(acts, *k, weights);
            let mut own = column(name.clone(), [0.0, sd], value, slope);
            own.positive = effect.parameters()[*k].positive;
            columns.push(own);
        }
        match effect.name() {
            LENS => self.of_the_lens_center(effect, &mut columns),
            "out_of_plane_rotation" => self.of_the_axis(acts, &amplitudes, &mut columns),
            _ => self.of_the_bent(acts, &amplitudes, &mut columns)?,
        }
        Ok(columns)
    }

    /// The stated amplitude of an effect's parameter in the state, of a motion by that law.
    fn amplitude(&self, acts: &Acts, k: usize, weights: &[f64]) -> f64 {
        if acts.effect.scope() != Scope::Motion {
            return self.at.shared.amplitude(acts.effect)[k];
        }
        self.at.moved(acts.effect, weights)[k]
    }

    /// What all steps show of a field at the sight's points that grows with the load, mm under a full one.
    pub(super) fn with_the_load(&self, field: &[[f64; 2]]) -> Stack {
        let Stepped {
            places,
            counts,
            average,
            ..
        } = self.stepped;
        let average = rigid_free(places, counts, &average(field));
        let steps = self.at.loads.iter().map(|f| {
            let scaled = average.iter().map(|u| u.map(|u| f * u));
            scaled.collect::<Vec<[f64; 2]>>()
        });
        stacked(&steps.collect::<Vec<_>>())
    }

    /// What changes of the stiffness do: in proportion to the load.
    ///
    /// # Errors
    /// Those of [`Mechanics::softened`].
    pub fn softened(&self, softening: Softening<'_>) -> Result<Vec<Stack>> {
        let Stepped {
            experiment, sight, ..
        } = self.stepped;
        let about = self.anchor.as_ref();
        let fields = experiment.softened(about, &self.at.shared, sight, softening)?;
        Ok(fields
            .iter()
            .map(|field| self.with_the_load(field))
            .collect())
    }
}

pub(super) fn quotient([high, low]: [Stack; 2], over: f64) -> Stack {
    let [a, b] = high;
    let [c, d] = low;
    [(a - c) / over, (b - d) / over]
}

/// A parameter of a prior mean and sd, with the value about which it is linearised and its slope.
pub(super) fn column(name: String, [mean, sd]: [f64; 2], at: f64, slope: Stack) -> Column {
    Column {
        name,
        mean,
        sd,
        at,
        positive: false,
        product: false,
        values: slope.map(|values| values * sd),
    }
}
