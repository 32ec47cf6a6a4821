//! Phase-shifted fringe images by an implementation of the test's own, with the truth of every pixel.

use crate::common::pictures::{Format, Raster};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use serde_json::json;

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// How a set is taken. Intensities are in grey levels.
#[derive(Clone)]
pub struct Camera {
    pub size: usize,
    pub frames: usize,
    pub step_deg: f64,
    pub step_error: f64,
    pub jitter_deg: f64,
    pub flicker: f64,
    pub gamma: f64,
    pub noise: f64,
    pub background: f64,
    /// Variance of an intensity for each unit of light.
    pub shot: f64,
    /// What the detector takes off every intensity before it cuts at zero.
    pub black: f64,
    /// Relative change of background and modulation between the states, smooth over the picture.
    pub background_change: f64,
    pub modulation_change: f64,
    /// Fringes over the picture in the initial state, and a pixel of the displacement.
    pub initial_fringes: f64,
    pub density: f64,
    /// Recorded values per grey level, and the largest one.
    pub unit: f64,
    pub full: f64,
    pub ending: &'static str,
    pub steps: &'static str,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            size: 240,
            frames: 4,
            step_deg: 90.0,
            step_error: 0.0,
            jitter_deg: 0.0,
            flicker: 0.0,
            gamma: 1.0,
            noise: 1.4,
            background: 100.0,
            shot: 0.0,
            black: 0.0,
            background_change: 0.0,
            modulation_change: 0.0,
            initial_fringes: 12.0,
            density: 0.2,
            unit: 1.0,
            full: 255.0,
            ending: "png",
            steps: "auto",
        }
    }
}

/// Radius of the hole over the picture's side.
const HOLE: f64 = 0.08;
/// Share of pixels with dust on them.
const DUST: f64 = 5e-4;

/// What was pictured: of U and of V.
pub struct Pictured {
    pub file: PathBuf,
    pub phase: [Vec<f64>; 2],
    /// Floor of the difference, rad: sqrt(2 / N) sd(I) / I_m of both states, with the modulation as recorded.
    pub floor: [f64; 2],
    /// Whether there is a surface at a pixel.
    pub surface: Vec<bool>,
}

impl Camera {
    /// Background, modulation and hole at a pixel, in shares of the picture from its middle.
    fn beam(&self, u: f64, v: f64) -> (f64, f64) {
        let b =
            self.background * (1.0 - 0.9 * (u * u + v * v)) * (1.0 + 0.05 * (9.0 * u + 1.0).sin());
        let m = 0.78 * b * (1.0 - 0.3 * (u + 0.3).powi(2)) * (1.0 + 0.1 * (7.0 * v).cos());
        (b, m)
    }

    /// Phases of the two states.
    fn phases(&self, component: usize, u: f64, v: f64) -> [f64; 2] {
        let n = self.size as f64;
        let turn = [0.0, 1.3][component];
        let (x, y) = (
            u * f64::cos(turn) - v * f64::sin(turn),
            u * f64::sin(turn) + v * f64::cos(turn),
        );
        let initial = TAU * self.initial_fringes * (0.8 * x + 0.6 * y) + 0.3 * (3.0 * y).sin();
        let about_hole = 0.01 * x / (0.05 + u * u + v * v);
        let moved = TAU * self.density * n * 0.9 * (x + about_hole) + 20.0 * u * v;
        [initial, initial + moved]
    }

    /// Take the images into a folder.
    pub fn take(&self, folder: &Path, seed: u64) -> Pictured {
        std::fs::create_dir_all(folder).unwrap();
        let mut rng = Pcg64::seed_from_u64(seed);
        let n = self.size;
        let place = |i: usize| {
            let of = |k: usize| k as f64 / n as f64 - 0.5;
            (of(i % n), of(i / n))
        };
        let mut pictured = Pictured {
            file: folder.join("fringes.json"),
            phase: [vec![f64::NAN; n * n], vec![f64::NAN; n * n]],
            floor: [0.0; 2],
            surface: (0..n * n)
                .map(|i| place(i).0.hypot(place(i).1) >= HOLE)
                .collect(),
        };
        for c in 0..2 {
            self.take_component(folder, c, &place, &mut rng, &mut pictured);
        }
        let file = json!({
            "schema": "plychain-fringes/1",
            "images": format!("{{component}}_{{state}}_{{n}}.{}", self.ending),
            "frames": self.frames, "step_deg": self.step_deg, "steps": self.steps,
            "fringe_frequency_per_mm": 2400, "pixel_mm": 0.05, "first_row": "low_y", "U_along": "y",
        });
        std::fs::write(&pictured.file, file.to_string()).unwrap();
        pictured
    }

    fn take_component(
        &self,
        folder: &Path,
        c: usize,
        place: &dyn Fn(usize) -> (f64, f64),
        rng: &mut Pcg64,
        pictured: &mut Pictured,
    ) {
        let n = self.size;
        let mut frames = [Vec::new(), Vec::new()];
        for state in &mut frames {
            for k in 1..=self.frames {
                let step = self.step_deg * k as f64 * (1.0 + self.step_error)
                    + self.jitter_deg * normal(rng);
                state.push((step.to_radians(), 1.0 + self.flicker * normal(rng)));
            }
        }
        let mut recorded = vec![vec![0u16; n * n]; 2 * self.frames];
        let (mut sum, mut count) = (0.0, 0.0);
        let surface = pictured.surface.clone();
        for (i, has_surface) in surface.into_iter().enumerate() {
            let (u, v) = place(i);
            let ((b, m), phases) = (self.beam(u, v), self.phases(c, u, v));
            let dust = (rng.random::<f64>() < DUST).then(|| 255.0 * rng.random::<f64>());
            let mut clipped = [0; 2];
            for (s, state) in frames.iter().enumerate() {
                let later = s as f64;
                let b =
                    b * (1.0 + later * self.background_change * (2.2 * u + 1.3 * v + 0.3).sin());
                let m = m * (1.0 + later * self.modulation_change * (2.0 * u - 1.7 * v).cos());
                for (k, (step, gain)) in state.iter().enumerate() {
                    let light = match (has_surface, dust) {
                        (false, _) => 12.0,
                        (_, Some(level)) => level,
                        _ => gain * (b + m * (phases[s] + step).cos()),
                    };
                    let light = 255.0 * (light.max(0.0) / 255.0).powf(self.gamma);
                    let sd = (self.noise.powi(2) + self.shot * light).sqrt();
                    let value = ((light + sd * normal(rng) - self.black) * self.unit).round();
                    let cut = value >= self.full || (self.black > 0.0 && value <= 0.0);
                    clipped[s] += usize::from(cut);
                    recorded[s * self.frames + k][i] = value.clamp(0.0, self.full) as u16;
                }
            }
            let able = clipped.iter().all(|n| self.frames - n >= 3);
            if has_surface && dust.is_none() && able {
                pictured.phase[c][i] = phases[1] - phases[0];
            }
            if has_surface && dust.is_none() && clipped == [0; 2] {
                let variance =
                    self.noise.powi(2) + self.shot * b + 1.0 / (12.0 * self.unit.powi(2));
                let recorded = m * self.gamma * (b / 255.0).powf(self.gamma - 1.0);
                sum += 2.0 * 2.0 / self.frames as f64 * variance / recorded.powi(2);
                count += 1.0;
            }
        }
        pictured.floor[c] = f64::sqrt(sum / count);
        for (k, values) in recorded.into_iter().enumerate() {
            let state = ["initial", "final"][k / self.frames];
            let name = format!(
                "{}_{state}_{}.{}",
                ["U", "V"][c],
                k % self.frames + 1,
                self.ending
            );
            save(&folder.join(name), n as u32, values, self.full > 255.0);
        }
    }
}

fn normal(rng: &mut Pcg64) -> f64 {
    StandardNormal.sample(rng)
}

fn save(path: &Path, side: u32, values: Vec<u16>, deep: bool) {
    let format = match path.extension().and_then(|e| e.to_str()) {
        Some("png") => Format::Png,
        _ => Format::Tiff,
    };
    let (size, channels) = ([side; 2], 1);
    let file = if deep {
        let whole = Raster {
            size,
            channels,
            values,
        };
        whole.file(format)
    } else {
        let values = values.into_iter().map(|v| v as u8).collect();
        let whole: Raster<u8> = Raster {
            size,
            channels,
            values,
        };
        whole.file(format)
    };
    std::fs::write(path, file).unwrap();
}
