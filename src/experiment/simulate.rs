//! Test data: a field from a finer mesh than any reduced model uses, with effects and noise, in the article's format.

mod pictures;
pub mod series;

use rand::RngExt;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::{FieldSolver, State, predict, record};
use crate::effect::limit::alter_checked;
use crate::effect::{Acting, Scene, why_not};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::noise::matern_pair;
use crate::quantity::NM_PER_MM;

/// What to simulate.
#[derive(Clone)]
pub struct Truth {
    /// Elastic constants in border units, in their canonical order.
    pub constants: Vec<f64>,
    /// Total thickness, mm.
    pub thickness_mm: f64,
    pub effects: Vec<Acting>,
    /// Total noise sd of a point, nm.
    pub noise_nm: f64,
    /// Correlation length of the noise (Matern-3/2), mm; 0 for white noise.
    pub correlation_mm: f64,
    /// Points along each side of the square window.
    pub grid: usize,
    /// Seed of the noise.
    pub seed: u64,
}

/// Refinement of a simulating experiment's mesh against that of reduced models: beside the noise, all that distinguishes
/// simulated data from the analyst's model.
pub const FINER: f64 = 1.5;

/// Half the side of the default window over the plate's width (the smaller extent of an imported mesh): the article's 24.3 mm of 25 mm.
pub const HALF_WINDOW: f64 = 0.5 * 24.3 / 25.0;

/// Simulate a field in the model's frame over the square of half-side `half` (mm) about the origin, with NaN where the
/// specimen is not.
///
/// # Errors
/// Effects that cannot act, amplitudes or constants that cannot be; a grid without a point on the specimen.
pub fn simulate(experiment: &dyn FieldSolver, truth: &Truth, half: f64) -> Result<Grid> {
    let state = truth.state(experiment.scene())?;
    let Window {
        mut grid,
        inside,
        shown,
    } = Window::new(experiment, &state, half, truth.grid)?;
    let mut u = predict(experiment, &state, &experiment.sight(&shown))?.field;
    record(state.acting(), experiment.scene(), &shown, &mut u);
    add_noise(&grid, &inside, &mut u, truth);
    fill(&mut grid, &inside, u);
    Ok(grid)
}

impl Truth {
    /// The state of an experiment.
    fn state(&self, scene: &Scene) -> Result<State> {
        refuse_obstacles(&self.effects, scene)?;
        alter_checked("--effect", &self.effects, &mut scene.setup.clone())?;
        scene.material.ply(&self.constants).admissible("--set")?;
        Ok(State::new(&self.constants, self.thickness_mm).with(self.effects.clone()))
    }
}

/// A regular grid of points, and which of them show the specimen.
struct Window {
    grid: Grid,
    inside: Vec<bool>,
    /// Those that do, (s, t) mm.
    shown: Vec<[f64; 2]>,
}

impl Window {
    /// Over the square of half-side `half` about the origin, `count` points along each side.
    fn new(experiment: &dyn FieldSolver, state: &State, half: f64, count: usize) -> Result<Self> {
        let frame = experiment.scene().frame;
        let [cx, cy] = frame.hole_center_mm;
        let corners = [[cx - half, cy - half], [cx + half, cy + half]];
        let grid = Grid::regular(corners, count, count);
        let points: Vec<[f64; 2]> = grid.points.iter().map(|&p| frame.point(p)).collect();
        let inside = experiment.shows(state, &points)?;
        let shown = points.iter().zip(&inside).filter(|(_, inside)| **inside);
        let shown: Vec<[f64; 2]> = shown.map(|(p, _)| *p).collect();
        if shown.is_empty() {
            return Err(Error::input("--grid", "a grid with points on the plate").found(count));
        }
        Ok(Self {
            grid,
            inside,
            shown,
        })
    }
}

/// Put a field into the places of a grid that show the specimen.
fn fill(grid: &mut Grid, inside: &[bool], u: Vec<[f64; 2]>) {
    let mut measured = u.into_iter();
    for (slot, inside) in grid.displacement.iter_mut().zip(inside) {
        let u = if *inside { measured.next() } else { None };
        *slot = u.unwrap_or([f64::NAN; 2]);
    }
}

/// Effects that cannot act in this test.
fn refuse_obstacles(effects: &[Acting], scene: &Scene) -> Result<()> {
    for acting in effects {
        if let Some(why) = why_not(acting.effect, scene) {
            return Err(
                Error::input("--effect", "effects that can act in this test")
                    .found(acting.effect.name())
                    .hint(why),
            );
        }
    }
    Ok(())
}

fn add_noise(grid: &Grid, inside: &[bool], u: &mut [[f64; 2]], truth: &Truth) {
    let sd = truth.noise_nm / NM_PER_MM;
    if sd == 0.0 {
        return;
    }
    let mut seeds = Pcg64Dxsm::seed_from_u64(truth.seed);
    if truth.correlation_mm == 0.0 {
        for c in 0..2 {
            let mut rng = Pcg64Dxsm::seed_from_u64(seeds.random());
            for u in u.iter_mut() {
                let z: f64 = StandardNormal.sample(&mut rng);
                u[c] += sd * z;
            }
        }
        return;
    }
    let mut rng = Pcg64Dxsm::seed_from_u64(seeds.random());
    let step = |k: usize, stride: usize| {
        let next = grid.points.get(stride);
        next.map_or(1.0, |p| p[k] - grid.points[0][k])
    };
    let spacing = [step(1, grid.cols), step(0, 1)];
    let [a, b] = matern_pair(
        [grid.rows, grid.cols],
        spacing,
        truth.correlation_mm,
        &mut rng,
    );
    let measured = (0..inside.len()).filter(|&i| inside[i]);
    for (u, i) in u.iter_mut().zip(measured) {
        *u = [u[0] + sd * a[i], u[1] + sd * b[i]];
    }
}
