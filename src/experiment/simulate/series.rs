//! A simulated load series, by the forward model with which series are analysed: mechanics at each step's force, motion of the step,
//! camera at the total displacement, recording; then the noise of every picture.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::pictures::Pictures;
use super::{Truth, Window, fill, refuse_obstacles};
use crate::error::Result;
use crate::experiment::series::{Moving, SeriesState, Solver, reported};
use crate::experiment::{FieldSolver, State, Subsets, record};
use crate::field::Grid;
use crate::field::rigid::RigidMotion;
use crate::quantity::NM_PER_MM;

/// What to simulate.
pub struct SeriesTruth {
    /// What all steps share. The noise is that of one step's displacements, half of whose variance is the reference picture's.
    pub shared: Truth,
    /// Force of each step over the nominal one of the experiment.
    pub loads: Vec<f64>,
    /// Effects whose amplitude is another in each step.
    pub moving: Vec<Moving>,
    /// Sd of a random translation of the specimen in each step, in either direction, mm.
    pub motion_mm: f64,
    /// Subsets over which the pictures' white noise is averaged.
    pub subsets: Option<Subsets>,
}

/// A simulated series.
pub struct SimulatedSeries {
    /// One grid a step.
    pub grids: Vec<Grid>,
    /// Motion of the specimen in the plane in each step.
    pub rigid: Vec<RigidMotion>,
}

/// Simulate a series in the model's frame over the square of half-side `half` (mm) about the origin, with NaN where the specimen is not.
///
/// # Errors
/// Those of [`super::simulate`].
pub fn simulate_series(
    experiment: &dyn FieldSolver,
    truth: &SeriesTruth,
    half: f64,
) -> Result<SimulatedSeries> {
    let scene = experiment.scene();
    for moving in &truth.moving {
        refuse_obstacles(&[moving.acting()], scene)?;
    }
    let shared = truth.shared.state(scene)?;
    let Window {
        grid,
        inside,
        shown,
    } = Window::new(experiment, &shared, half, truth.shared.grid)?;
    let mut seeds = Pcg64Dxsm::seed_from_u64(truth.shared.seed);
    // a seed each, so that one step more leaves the others as they are
    let [of_reference, of_motion, of_steps]: [u64; 3] = [(); 3].map(|()| seeds.random());
    let rigid = truth.rigid(experiment, of_motion);
    let clean = observed(experiment, truth, shared, &rigid, &shown)?;
    let pictures = Pictures {
        grid: &grid,
        subsets: truth.subsets,
        correlation_mm: truth.shared.correlation_mm,
        sd_mm: truth.shared.noise_nm / NM_PER_MM * 0.5_f64.sqrt(),
    };
    let reference = pictures.noise(of_reference);
    let mut seeds = Pcg64Dxsm::seed_from_u64(of_steps);
    let step = |mut u: Vec<[f64; 2]>| {
        let own = pictures.noise(seeds.random());
        let measured = (0..inside.len()).filter(|&i| inside[i]);
        for (u, i) in u.iter_mut().zip(measured) {
            *u = [0, 1].map(|c| u[c] + own[i][c] - reference[i][c]);
        }
        let mut grid = grid.clone();
        fill(&mut grid, &inside, u);
        grid
    };
    Ok(SimulatedSeries {
        grids: clean.into_iter().map(step).collect(),
        rigid,
    })
}

/// The displacement of every step at points, mm, before noise.
fn observed(
    experiment: &dyn FieldSolver,
    truth: &SeriesTruth,
    shared: State,
    rigid: &[RigidMotion],
    points: &[[f64; 2]],
) -> Result<Vec<Vec<[f64; 2]>>> {
    let scene = experiment.scene();
    let solver = Solver {
        experiment,
        sight: &experiment.sight(points),
        average: &|u| u[..points.len()].to_vec(),
    };
    let moving = truth.moving.iter().filter(|m| !is_in_the_plane(m));
    let state = SeriesState {
        shared,
        loads: truth.loads.clone(),
        rigid: rigid.to_vec(),
        moving: moving.cloned().collect(),
        shifts: Vec::new(),
    };
    let loads = state.acting_loads(scene);
    let loaded = solver.loaded(None, &state.shared, &loads)?;
    let mut steps = reported(&state, &state.shared, &loaded, scene, points);
    for (step, motion) in steps.iter_mut().zip(rigid) {
        if scene.fringe_frequency_per_mm.is_some() {
            // fringes are counted on the specimen, wherever that moves
            for (u, p) in step.iter_mut().zip(points) {
                let rigid = motion.turned([p[0] + u[0], p[1] + u[1]]);
                *u = [u[0] + rigid[0], u[1] + rigid[1]];
            }
        }
        record(state.shared.acting(), scene, points, step);
    }
    Ok(steps)
}

/// Whether an effect is a part of the steps' finite motion in the plane.
fn is_in_the_plane(moving: &Moving) -> bool {
    moving.effect.is_rigid()
}

impl SeriesTruth {
    /// Motion of each step in the plane about the origin: what effects say, and a random translation.
    fn rigid(&self, experiment: &dyn FieldSolver, seed: u64) -> Vec<RigidMotion> {
        let scene = experiment.scene();
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let one = |step: usize| {
            let mut motion = RigidMotion::NONE;
            motion.shift = [(); 2].map(|()| {
                let z: f64 = StandardNormal.sample(&mut rng);
                self.motion_mm * z
            });
            for m in self.moving.iter().filter(|m| is_in_the_plane(m)) {
                let amplitude: Vec<f64> = m.amplitude.iter().map(|a| m.weights[step] * a).collect();
                let at = |p: [f64; 2]| m.effect.displacement(&amplitude, scene, p);
                let (origin, beside) = (at([0.0; 2]), at([1.0, 0.0]));
                motion.shift = [0, 1].map(|c| motion.shift[c] + origin[c]);
                motion.angle += beside[1] - origin[1];
            }
            motion
        };
        (0..self.loads.len()).map(one).collect()
    }
}
