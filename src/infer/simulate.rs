//! Test data: a field from a finer mesh than any reduced model uses, with effects and noise, in the article's format.

use rand::RngExt;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::model::Model;
use crate::effect::limit::alter_checked;
use crate::effect::{Acting, Kind, Scene, Seen};
use crate::error::{Error, Result};
use crate::experiment::{Gauge, ZeroAt, remove_rigid_motion, settle};
use crate::fem::{Locator, Plate, Setup};
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
    /// Effects that act.
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

/// Refinement against the reduced model's mesh.
const FINER: f64 = 1.5;

/// Side of the default window as a fraction of the plate's width: the article's 24.3 mm of 25 mm.
const WINDOW: f64 = 24.3 / 25.0;

/// Simulate a field in the model's frame, with NaN where the hole is.
pub fn simulate(model: &Model, truth: &Truth) -> Result<Grid> {
    let scene = model.scene();
    let frame = scene.frame;
    refuse_obstacles(&truth.effects, &scene)?;
    let experiment = model.experiment();
    let mut setup = Setup::nominal(&experiment.specimen, &experiment.load, frame.handedness());
    // The gauge's point belongs to the nominal plate.
    let nominal = Plate::new(setup.outline, experiment.density().scaled(FINER))?;
    setup.thickness = truth.thickness_mm;
    alter_checked("--effect", &truth.effects, &mut setup)?;
    let ply = model.material().ply(&truth.constants).admissible("--set")?;
    let mut solution = nominal.solve(&setup, &ply)?;
    let half = 0.5 * WINDOW * experiment.specimen.width_mm;
    match ZeroAt::new(experiment.gauge, &frame, &nominal)? {
        Some(zero) => zero.apply(&mut solution),
        None => settle(&mut solution, [[-half; 2], [half; 2]]),
    }
    let seen = Seen::new(&truth.effects, &scene);
    let [cx, cy] = frame.hole_center_mm;
    let corners = [[cx - half, cy - half], [cx + half, cy + half]];
    let mut grid = Grid::regular(corners, truth.grid, truth.grid);
    let points: Vec<[f64; 2]> = grid.points.iter().map(|&p| frame.point(p)).collect();
    let places: Vec<[f64; 2]> = points.iter().map(|&p| seen.true_point(p)).collect();
    let (observer, inside) = Locator::new(&solution.mesh).observe(&places);
    let reported: Vec<[f64; 2]> = points
        .iter()
        .zip(&inside)
        .filter(|(_, inside)| **inside)
        .map(|(p, _)| *p)
        .collect();
    if reported.is_empty() {
        return Err(Error::input("--grid", "a grid with points on the plate").found(truth.grid));
    }
    let mut u = observer.displacement(&solution.nodal);
    for (u, &p) in u.iter_mut().zip(&reported) {
        *u = seen.components(p, *u);
    }
    if experiment.gauge == Gauge::Window {
        remove_rigid_motion(&reported, &mut u);
    }
    add_and_record(&truth.effects, &scene, &reported, &mut u);
    add_noise(&grid, &inside, &mut u, truth);
    let mut measured = u.into_iter();
    for (slot, inside) in grid.displacement.iter_mut().zip(&inside) {
        *slot = if *inside {
            measured.next().unwrap_or([f64::NAN; 2])
        } else {
            [f64::NAN; 2]
        };
    }
    Ok(grid)
}

/// Effects that cannot act in this test.
fn refuse_obstacles(effects: &[Acting], scene: &Scene) -> Result<()> {
    for acting in effects {
        if let Some(why) = acting.effect.obstacle(scene) {
            return Err(
                Error::input("--effect", "effects that can act in this test")
                    .found(acting.effect.name())
                    .hint(why),
            );
        }
    }
    Ok(())
}

/// Add the additive effects, then let the instrument record what is there.
fn add_and_record(effects: &[Acting], scene: &Scene, points: &[[f64; 2]], u: &mut [[f64; 2]]) {
    let of = |kind: Kind| effects.iter().filter(move |a| a.effect.kind() == kind);
    for acting in of(Kind::Additive) {
        for (u, &p) in u.iter_mut().zip(points) {
            let added = acting.effect.displacement(&acting.amplitude, scene, p);
            u[0] += added[0];
            u[1] += added[1];
        }
    }
    for acting in of(Kind::Recorded) {
        for (u, &p) in u.iter_mut().zip(points) {
            *u = acting.effect.recorded(&acting.amplitude, scene, p, *u);
        }
    }
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
