//! Fringe images of a displacement field, as a camera would take them: steps with errors, flicker, a response, noise, 8 or 16 bit.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::picture::write_png;
use super::spec::{FirstRow, FringeImages, Images, PhaseSteps, SCHEMA};
use crate::error::{Error, Result};
use crate::field::frame::Frame;
use crate::field::grid::Grid;
use crate::field::reader::unwritable;
use crate::files;

/// How the pictures are taken. Intensities are in grey levels of 8 bit.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RenderPlan {
    pub frames: usize,
    /// Nominal step from frame to frame, degrees (360 / frames where it is not given, 90 of four).
    pub step_deg: Option<f64>,
    /// Relative error of all steps: a phase shifter that is miscalibrated.
    pub step_error: f64,
    /// Sd of every frame's own phase error, degrees.
    pub jitter_deg: f64,
    /// Relative sd of every frame's brightness.
    pub flicker: f64,
    /// The detector records the light's power `gamma`.
    pub gamma: f64,
    /// Sd of an intensity.
    pub noise: f64,
    /// Brightest background, and modulation over background.
    pub background: f64,
    pub contrast: f64,
    /// Fringes over the picture in the initial state.
    pub initial_fringes: f64,
    pub bits: u8,
    pub fringe_frequency_per_mm: f64,
}

impl Default for RenderPlan {
    fn default() -> Self {
        Self {
            frames: 4,
            step_deg: None,
            step_error: 0.0,
            jitter_deg: 0.0,
            flicker: 0.0,
            gamma: 1.0,
            noise: 1.4,
            background: 110.0,
            contrast: 0.75,
            initial_fringes: 8.0,
            bits: 8,
            fringe_frequency_per_mm: 2400.0,
        }
    }
}

/// Background without a surface.
const DARK: f64 = 8.0;

impl RenderPlan {
    /// From `KEY=VALUE,...`; an empty text is the default.
    ///
    /// # Errors
    /// Of the input, at `place`: unknown keys, values that no picture can have.
    pub fn parse(place: &str, text: &str) -> Result<Self> {
        let mut keys = serde_json::Map::new();
        for part in text.split(',').filter(|p| !p.trim().is_empty()) {
            let pair = part.split_once('=').and_then(|(key, value)| {
                let value: serde_json::Number = serde_json::from_str(value.trim()).ok()?;
                Some((key.trim().to_string(), value.into()))
            });
            let (key, value) =
                pair.ok_or_else(|| Error::input(place, "KEY=NUMBER,...").found(part))?;
            keys.insert(key, value);
        }
        let plan: Self = serde_json::from_value(keys.into())
            .map_err(|e| Error::input(place, "known keys with numbers").found(e))?;
        plan.check().map_err(|e| e.within(place))?;
        Ok(plan)
    }

    fn check(&self) -> Result<()> {
        let ranges = [
            ("step_error", self.step_error, -0.5..=0.5),
            ("jitter_deg", self.jitter_deg, 0.0..=45.0),
            ("flicker", self.flicker, 0.0..=0.5),
            ("gamma", self.gamma, 0.2..=5.0),
            ("noise", self.noise, 0.0..=100.0),
            ("background", self.background, 1.0..=1000.0),
            ("contrast", self.contrast, 0.0..=1.0),
            ("initial_fringes", self.initial_fringes, 0.0..=1e4),
            (
                "fringe_frequency_per_mm",
                self.fringe_frequency_per_mm,
                1.0..=1e5,
            ),
        ];
        for (key, value, range) in ranges {
            if !range.contains(&value) {
                let expected = format!("a number from {} to {}", range.start(), range.end());
                return Err(Error::input(key, expected).found(value));
            }
        }
        if !(3..=64).contains(&self.frames) {
            return Err(Error::input("frames", "3 to 64").found(self.frames));
        }
        if self.bits != 8 && self.bits != 16 {
            return Err(Error::input("bits", "8 or 16").found(self.bits));
        }
        Ok(())
    }

    fn nominal_step_deg(&self) -> f64 {
        self.step_deg.unwrap_or(360.0 / self.frames as f64)
    }
}

/// The images of one component in one state.
struct Shots<'a> {
    plan: &'a RenderPlan,
    rows: usize,
    cols: usize,
    /// Phase at every pixel, rad; NaN without a surface.
    phase: Vec<f64>,
    /// Phase and brightness of every frame.
    frames: Vec<(f64, f64)>,
}

impl Shots<'_> {
    /// Intensities of a frame in grey levels of 8 bit, without noise.
    fn clean(&self, frame: usize) -> impl Iterator<Item = f64> + '_ {
        let (step, gain) = self.frames[frame];
        let plan = self.plan;
        self.phase.iter().enumerate().map(move |(i, phase)| {
            let u = (i % self.cols) as f64 / self.cols as f64 - 0.5;
            let v = (i / self.cols) as f64 / self.rows as f64 - 0.5;
            // an expanded beam: bright in the middle, with the rings of its optics
            let background = plan.background
                * (1.0 - 0.8 * (u * u + v * v))
                * (1.0 + 0.04 * (11.0 * u + 7.0 * v).sin());
            let modulation = plan.contrast * background * (1.0 - 0.3 * (u + 0.2).powi(2));
            let light = if phase.is_nan() {
                DARK
            } else {
                gain * (background + modulation * (phase + step).cos())
            };
            255.0 * (light.max(0.0) / 255.0).powf(plan.gamma)
        })
    }

    /// Write one frame.
    fn write(&self, frame: usize, seed: u64, path: &Path) -> Result<()> {
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let unit = if self.plan.bits == 8 { 1.0 } else { 257.0 };
        let full = 255.0 * unit;
        let values = self.clean(frame).map(|light| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            ((light + self.plan.noise * noise) * unit)
                .round()
                .clamp(0.0, full) as u16
        });
        let values: Vec<u16> = values.collect();
        write_png(path, [self.cols, self.rows], &values, self.plan.bits != 8)
    }
}

/// Write the images of `grid`, whose displacements are along the loading axis of `frame` and across it, beside the file `path`, which
/// says what they are.
///
/// # Errors
/// Of the input: points that are no pixels, a place that cannot be written.
pub fn write(path: &Path, grid: &Grid, frame: Frame, plan: &RenderPlan, seed: u64) -> Result<()> {
    let spec = described(grid, frame, plan)?;
    let base = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(base).map_err(|e| unwritable(base, &e))?;
    let mut seeds = Pcg64Dxsm::seed_from_u64(seed);
    let nominal = plan.nominal_step_deg().to_radians();
    for (c, states) in spec.paths(base).iter().enumerate() {
        for (s, paths) in states.iter().enumerate() {
            let mut normal = || -> f64 { StandardNormal.sample(&mut seeds) };
            let frames = (1..=plan.frames).map(|n| {
                let jitter = plan.jitter_deg.to_radians() * normal();
                let step = n as f64 * nominal * (1.0 + plan.step_error) + jitter;
                (step, 1.0 + plan.flicker * normal())
            });
            let frames = frames.collect();
            let shots = Shots {
                plan,
                rows: grid.rows,
                cols: grid.cols,
                phase: phase(grid, plan, c, s),
                frames,
            };
            let of_frames: Vec<(PathBuf, u64)> = paths
                .iter()
                .map(|path| (path.clone(), seeds.next_u64()))
                .collect();
            of_frames
                .par_iter()
                .enumerate()
                .try_for_each(|(n, (path, seed))| shots.write(n, *seed, path))?;
        }
    }
    files::write_json(path, &spec)
}

/// Phase of a component in a state: a carrier, other in U and V, and in the final state the displacement's.
fn phase(grid: &Grid, plan: &RenderPlan, component: usize, state: usize) -> Vec<f64> {
    let (across, along) = [(0.3, 0.8), (0.9, -0.2)][component];
    let per_mm = TAU * plan.fringe_frequency_per_mm;
    grid.displacement
        .iter()
        .enumerate()
        .map(|(i, u)| {
            let x = (i % grid.cols) as f64 / grid.cols as f64;
            let y = (i / grid.cols) as f64 / grid.rows as f64;
            let bowed = 0.4 * (3.0 * y + 2.0 * x).sin();
            let carrier = TAU * plan.initial_fringes * (across * x + along * y) + bowed;
            let moved = if state == 1 {
                per_mm * u[component]
            } else {
                0.0
            };
            // no surface in either state where the field has none
            carrier + moved + 0.0 * u[component]
        })
        .collect()
}

/// The file that goes with the images.
fn described(grid: &Grid, frame: Frame, plan: &RenderPlan) -> Result<FringeImages> {
    let step = |other: usize, k: usize| grid.points[other][k] - grid.points[0][k];
    let (pixel, rise) = (step(1, 0), step(grid.cols.min(grid.points.len() - 1), 1));
    if !(pixel > 0.0 && (rise / pixel - 1.0).abs() < 1e-6) {
        let found = format!("{pixel} x {rise} mm");
        return Err(Error::input("--fringes", "a grid of square pixels").found(found));
    }
    let [x, y] = grid.points[0];
    Ok(FringeImages {
        schema: SCHEMA.into(),
        images: Images::Pattern("{component}_{state}_{n}.png".into()),
        frames: plan.frames,
        step_deg: plan.nominal_step_deg(),
        steps: PhaseSteps::Auto,
        fringe_frequency_per_mm: plan.fringe_frequency_per_mm,
        pixel_mm: pixel,
        first_row: FirstRow::LowY,
        u_along: frame.loading_axis,
        origin_px: Some([-x / pixel, -y / pixel]),
    })
}
