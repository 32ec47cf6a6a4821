//! The file of a set of fringe images, schema `plychain-fringes/1`: where they are, their steps, and what a fringe and a pixel are worth.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::field::frame::Axis;
use crate::field::text::read_settings;
use crate::files;

/// Name of the schema.
pub const SCHEMA: &str = "plychain-fringes/1";

/// The two displacements and the two states, as they stand in the images' names.
pub const COMPONENTS: [&str; 2] = ["U", "V"];
pub const STATES: [&str; 2] = ["initial", "final"];

/// Frames of a state: at least as many as unknowns at a pixel, and no more than anyone takes.
const FRAMES: std::ops::RangeInclusive<usize> = 3..=64;

/// Gratings and pixels that there are: lines per mm of displacement, and mm.
const FREQUENCIES: std::ops::RangeInclusive<f64> = 1e-3..=1e6;
const PIXELS_MM: std::ops::RangeInclusive<f64> = 1e-6..=1e3;

/// Steps beyond a turn are others within it; origins beyond this lie in no picture's frame.
const FULL_TURN_DEG: f64 = 360.0;
const FARTHEST_PX: f64 = 1e6;

/// A set of fringe images.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FringeImages {
    pub schema: String,
    /// The images, relative to the file.
    pub images: Images,
    /// Frames of a state, N.
    pub frames: usize,
    /// Nominal phase from a frame to the next, degrees; frame n of 1 to N is at n times as much.
    pub step_deg: f64,
    #[serde(default)]
    pub steps: PhaseSteps,
    /// Frequency f_s of the virtual grating, lines per mm of displacement: twice that of the specimen's grating.
    pub fringe_frequency_per_mm: f64,
    /// Size of a pixel on the specimen, mm.
    pub pixel_mm: f64,
    /// Where the images' first row lies.
    #[serde(default)]
    pub first_row: FirstRow,
    /// The axis of the data along which U is the displacement; V is along the other.
    #[serde(rename = "U_along")]
    pub u_along: Axis,
    /// Column and row, counted from 0, of the point that is the origin of X and Y (default: the picture's centre).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin_px: Option<[f64; 2]>,
}

/// Names of the images: one with `{component}` (U, V), `{state}` (initial, final) and `{n}` (1 to N), or lists of them by component and state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a pattern with {component}, {state} and {n}, or lists of names for U and V"
)]
pub enum Images {
    Pattern(String),
    Named(Components<States>),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Components<T> {
    #[serde(rename = "U")]
    u: T,
    #[serde(rename = "V")]
    v: T,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct States {
    initial: Vec<PathBuf>,
    #[serde(rename = "final")]
    loaded: Vec<PathBuf>,
}

/// Whether the frames are at their nominal steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PhaseSteps {
    /// As the images say.
    #[default]
    Auto,
    /// They are.
    Nominal,
    /// They are estimated from the images.
    #[serde(alias = "unknown")]
    Estimated,
}

/// Where the images' first row lies.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FirstRow {
    /// At the smallest y.
    LowY,
    /// At the largest y, as pictures are shown.
    #[default]
    HighY,
}

impl FringeImages {
    /// Read and check the file.
    ///
    /// # Errors
    /// Of the input: a file that cannot be read, a key that is wrong, a value that nothing can have.
    pub fn load(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let spec: Self = files::parse_json(&read_settings(path)?, &file)?;
        spec.check().map_err(|e| e.within(&file))?;
        Ok(spec)
    }

    fn check(&self) -> Result<()> {
        if self.schema != SCHEMA {
            return Err(Error::input("schema", SCHEMA).found(&self.schema));
        }
        if !FRAMES.contains(&self.frames) {
            let hint = "background, modulation and phase are three unknowns at each pixel";
            return Err(Error::input("frames", "3 to 64 frames of each state")
                .found(self.frames)
                .hint(hint));
        }
        let sizes = [
            (
                "fringe_frequency_per_mm",
                self.fringe_frequency_per_mm,
                FREQUENCIES,
            ),
            ("pixel_mm", self.pixel_mm, PIXELS_MM),
        ];
        for (key, value, range) in sizes {
            if !range.contains(&value) {
                let expected = format!(
                    "a number above 0, from {:e} to {:e}",
                    range.start(),
                    range.end()
                );
                return Err(Error::input(key, expected).found(value));
            }
        }
        if !(self.step_deg.abs() <= FULL_TURN_DEG && self.nominal_fits()) {
            let expected = "a phase from frame to frame that tells background, modulation and phase apart, such as 90";
            return Err(Error::input("step_deg", expected).found(self.step_deg));
        }
        let far = |v: &f64| v.is_nan() || v.abs() > FARTHEST_PX;
        if let Some([col, row]) = self.origin_px.filter(|o| o.iter().any(far)) {
            let found = format!("[{col}, {row}]");
            return Err(
                Error::input("origin_px", "two numbers of at most 1e6 pixels").found(found),
            );
        }
        self.check_images()
    }

    fn nominal_fits(&self) -> bool {
        super::shifts::Shifts::nominal(self.frames, self.step_deg.to_radians())
            .fit()
            .is_some()
    }

    /// Names stand for all images, each once.
    fn check_images(&self) -> Result<()> {
        if let Images::Pattern(pattern) = &self.images {
            for part in ["{component}", "{state}", "{n}"] {
                if !pattern.contains(part) {
                    let expected = format!("a name with {part}, or lists by component and state");
                    return Err(Error::input("images", expected).found(pattern));
                }
            }
            if pattern.matches('{').count() > 3 {
                let expected =
                    "no other part in braces than {component}, {state} and {n}, each once";
                return Err(Error::input("images", expected).found(pattern));
            }
        }
        let all = self.paths(Path::new(""));
        let mut seen = std::collections::BTreeMap::new();
        for (c, states) in all.iter().enumerate() {
            for (s, frames) in states.iter().enumerate() {
                let key = format!("images.{}.{}", COMPONENTS[c], STATES[s]);
                if frames.len() != self.frames {
                    let expected = format!("{} names, one a frame", self.frames);
                    return Err(Error::input(key, expected).found(frames.len()));
                }
                for path in frames {
                    if let Some(other) = seen.insert(path.clone(), key.clone()) {
                        let expected = format!("another image than that of {other}");
                        return Err(Error::input(key, expected).found(path.display()));
                    }
                }
            }
        }
        Ok(())
    }

    /// Files of the images by component, state and frame.
    pub fn paths(&self, base_dir: &Path) -> [[Vec<PathBuf>; 2]; 2] {
        let of = |c: usize, s: usize| -> Vec<PathBuf> {
            match &self.images {
                Images::Pattern(pattern) => (1..=self.frames)
                    .map(|n| {
                        let name = pattern
                            .replace("{component}", COMPONENTS[c])
                            .replace("{state}", STATES[s])
                            .replace("{n}", &n.to_string());
                        base_dir.join(name)
                    })
                    .collect(),
                Images::Named(named) => {
                    let states = if c == 0 { &named.u } else { &named.v };
                    let list = if s == 0 {
                        &states.initial
                    } else {
                        &states.loaded
                    };
                    list.iter().map(|name| base_dir.join(name)).collect()
                }
            }
        };
        [0, 1].map(|c| [0, 1].map(|s| of(c, s)))
    }

    /// Displacement of a radian of phase difference, mm.
    pub fn mm_per_rad(&self) -> f64 {
        1.0 / (std::f64::consts::TAU * self.fringe_frequency_per_mm)
    }

    /// The point (x, y) of the pixel at `row` and `col` of a picture of that size, mm.
    pub fn point(&self, [rows, cols]: [usize; 2], row: usize, col: usize) -> [f64; 2] {
        let centre = [cols, rows].map(|n| 0.5 * (n as f64 - 1.0));
        let [col0, row0] = self.origin_px.unwrap_or(centre);
        let y = (row as f64 - row0) * self.pixel_mm;
        let y = match self.first_row {
            FirstRow::LowY => y,
            FirstRow::HighY => -y,
        };
        [(col as f64 - col0) * self.pixel_mm, y]
    }
}
