//! Fringe images to displacements (the article's section 2.1, Eq. 1 to 3): calibration of the frames, phase difference of the two states,
//! unwrapping, mask and standard deviations. Nothing is smoothed.

mod calibrate;
mod images;
mod parameters;
mod phase;
mod render;
mod residuals;
mod response;
mod shifts;
mod spec;
mod unwrap;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::frame::Frame;
use super::grid::Grid;
use super::measured::Field;
use super::reader::{ColumnMap, Reader};
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};
use crate::quantity::NM_PER_MM;
pub use calibrate::Calibration;
use calibrate::{Chosen, Frames, calibrate};
use images::Stack;
use phase::Phase;
pub use phase::Pixel;
pub use render::{RenderPlan, write};
pub use spec::{COMPONENTS, FirstRow, FringeImages, Images, SCHEMA, STATES, Steps};

/// The displacements of a set of images.
pub struct Fringes {
    pub spec: FringeImages,
    pub files: Vec<PathBuf>,
    pub rows: usize,
    pub cols: usize,
    /// U and V.
    pub components: [Component; 2],
    /// What a user should know before believing them.
    pub warnings: Vec<String>,
}

/// One displacement, pixel by pixel and row by row.
pub struct Component {
    /// Displacement, mm, up to whole orders; NaN where nothing is measured.
    pub displacement_mm: Vec<f64>,
    /// Its sd, mm.
    pub sd_mm: Vec<f64>,
    /// Amplitudes of what remains at once, twice and three times the frequency of the fringes of each state, rad.
    pub ripple_rad: [[f64; 3]; 2],
    /// Phase difference before unwrapping, rad.
    pub wrapped_rad: Vec<f64>,
    /// Modulation of the initial state, in the recorded unit.
    pub modulation: Vec<f64>,
    /// Why a pixel is measured or not.
    pub pixel: Vec<Pixel>,
    /// First frame of either state.
    pub first: [Vec<u16>; 2],
    /// Sizes of connected parts, largest first; whole orders between them are not known.
    pub parts: Vec<usize>,
    pub frames: Calibration,
    pub chosen: Chosen,
}

impl Fringes {
    /// Measure the images of a file.
    ///
    /// # Errors
    /// Of the input: whatever is wrong with the file or an image, and pictures without fringes.
    pub fn measure(path: &Path, progress: &dyn Progress) -> Result<Self> {
        let spec = FringeImages::load(path)?;
        let base = path.parent().unwrap_or(Path::new("."));
        let paths = spec.paths(base);
        progress.begin("reading images", None);
        let stack = Stack::read(&paths)?;
        progress.end();
        progress.begin("phases", Some(2));
        let found: Vec<Result<Component>> = stack
            .frames
            .par_iter()
            .enumerate()
            .map(|(c, states)| {
                let place = format!("{}: {}", path.display(), COMPONENTS[c]);
                let found = component(&spec, &stack, [&states[0], &states[1]]);
                progress.step();
                found.map_err(|e| e.within(place))
            })
            .collect();
        progress.end();
        let mut found = found.into_iter().collect::<Result<Vec<_>>>()?.into_iter();
        let (Some(u), Some(v)) = (found.next(), found.next()) else {
            return Err(Error::program("field::fringes", "two components"));
        };
        let components = [u, v];
        let mut files = vec![path.to_path_buf()];
        files.extend(paths.into_iter().flatten().flatten());
        Ok(Self {
            warnings: warnings(&spec, &components),
            spec,
            files,
            rows: stack.rows,
            cols: stack.cols,
            components,
        })
    }

    /// The two displacements on the pixels' grid, U and V as they are, in mm; and their sds.
    pub fn grid(&self) -> (Grid, Vec<[f64; 2]>) {
        let shape = [self.rows, self.cols];
        let both = |i: usize| [0, 1].map(|c| self.components[c].displacement_mm[i]);
        let count = self.rows * self.cols;
        let grid = Grid {
            rows: self.rows,
            cols: self.cols,
            points: (0..count)
                .map(|i| self.spec.point(shape, i / self.cols, i % self.cols))
                .collect(),
            displacement: (0..count).map(both).collect(),
        };
        let sd = (0..count).map(|i| [0, 1].map(|c| self.components[c].sd_mm[i]));
        let sd = sd.collect();
        (grid, sd)
    }

    /// As a field in `frame`.
    ///
    /// # Errors
    /// Of the input: no pixel at which both displacements are measured.
    fn field(self, frame: Frame) -> Result<Field> {
        let (mut grid, sd) = self.grid();
        let sd = sd.iter().map(|[u, v]| (u * v).sqrt()).collect::<Vec<_>>();
        if self.spec.u_along != frame.loading_axis {
            grid.displacement.iter_mut().for_each(|u| u.swap(0, 1));
        }
        let mut field = grid.field(frame);
        if field.is_empty() {
            let place = self.files[0].display().to_string();
            return Err(
                Error::input(place, "pixels at which both U and V are measured").found("none"),
            );
        }
        let index = field
            .grid
            .as_ref()
            .map(|g| g.index.clone())
            .unwrap_or_default();
        field.sigma = Some(index.iter().map(|&i| sd[i]).collect());
        field.fringe_frequency_per_mm = Some(self.spec.fringe_frequency_per_mm);
        field.files = self.files;
        Ok(field)
    }
}

/// One component from its frames.
fn component(spec: &FringeImages, stack: &Stack, states: [&Frames; 2]) -> Result<Component> {
    let found = calibrate(states, spec, stack.full_scale, stack.saturated).ok_or_else(|| {
        Error::input(
            "images",
            "fringes that stand out of the noise in both states",
        )
        .found("none, or too few pixels of them")
        .hint("check the images' order, the exposure (clipped pictures show nothing) and step_deg")
    })?;
    let (frames, chosen) = found;
    let mut phase = Phase::new([stack.rows, stack.cols], states, &frames, stack.saturated)
        .ok_or_else(|| Error::program("field::fringes", "steps that can be solved for"))?;
    let wrapped_rad = phase.difference.clone();
    let parts = unwrap::unwrap(&mut phase);
    let scale = spec.mm_per_rad();
    let measured = |values: &[f64]| -> Vec<f64> {
        let of = |i: usize| {
            if phase.is_measured(i) {
                values[i] * scale
            } else {
                f64::NAN
            }
        };
        (0..values.len()).map(of).collect()
    };
    Ok(Component {
        displacement_mm: measured(&phase.difference),
        sd_mm: measured(&phase.sd),
        ripple_rad: phase::ripple(states, &frames, &phase, stack.saturated),
        wrapped_rad,
        modulation: phase.modulation,
        pixel: phase.pixel,
        first: states.map(|frames| frames[0].clone()),
        parts,
        frames,
        chosen,
    })
}

/// What is said of all pixels together.
#[derive(Debug, Clone, Serialize)]
pub struct Counts {
    pub measured: usize,
    pub clipped: usize,
    pub dark: usize,
    pub spoiled: usize,
    pub too_fine: usize,
    pub isolated: usize,
}

impl Component {
    pub fn counts(&self) -> Counts {
        let of = |what: Pixel| self.pixel.iter().filter(|p| **p == what).count();
        Counts {
            measured: of(Pixel::Measured),
            clipped: of(Pixel::Clipped),
            dark: of(Pixel::Dark),
            spoiled: of(Pixel::Spoiled),
            too_fine: of(Pixel::TooFine),
            isolated: of(Pixel::Isolated),
        }
    }

    /// Root mean square of the sds, nm.
    pub fn sd_nm(&self) -> f64 {
        let squares = self.sd_mm.iter().filter(|s| s.is_finite()).map(|s| s * s);
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), s| (sum + s, n + 1.0));
        (sum / f64::max(count, 1.0)).sqrt() * NM_PER_MM
    }
}

/// What a user should know before believing the displacements.
fn warnings(spec: &FringeImages, components: &[Component; 2]) -> Vec<String> {
    /// Shares of the picture above which clipping, and of the measured pixels above which fine fringes, are worth a word.
    const CLIPPED: f64 = 0.02;
    const FINE: f64 = 1e-3;
    let mut said = Vec::new();
    for (component, name) in components.iter().zip(COMPONENTS) {
        let counts = component.counts();
        let share = |n: usize| n as f64 / component.pixel.len() as f64;
        if share(counts.clipped) > CLIPPED {
            let percent = 100.0 * share(counts.clipped);
            said.push(format!(
                "{name}: {percent:.1} % of the picture is clipped by the detector and left out: expose less"
            ));
        }
        if counts.too_fine as f64 > FINE * counts.measured as f64 {
            said.push(format!("{name}: at {} pixels the fringes are finer than {} a pixel and left out; where they are finer than 0.5 they cannot be told from coarser ones: magnify, or load less", counts.too_fine, phase::FINEST));
        }
        if component.parts.len() > 1 {
            said.push(format!("{name}: the field falls into {} parts; whole orders ({:.0} nm) between them are not known: the effect fringe_order_jump measures them", component.parts.len(), NM_PER_MM / spec.fringe_frequency_per_mm));
        }
        let noise_rad = component.sd_nm() / NM_PER_MM / spec.mm_per_rad();
        if component.frames.left_rad > 0.5 * noise_rad {
            said.push(format!("{name}: the steps are known no better than {:.3} rad of phase, a good part of the noise: take more frames, or some ten fringes in the initial state", component.frames.left_rad));
        }
    }
    said
}

/// The reader of this format.
pub struct FringeFile;

impl Reader for FringeFile {
    fn format(&self) -> &'static str {
        "fringes"
    }

    fn is_directory(&self) -> bool {
        false
    }

    fn file_name(&self) -> &'static str {
        "fringes.json"
    }

    fn has_columns(&self) -> bool {
        false
    }

    fn files(&self, path: &Path) -> Vec<PathBuf> {
        let base = path.parent().unwrap_or(Path::new("."));
        let images = FringeImages::load(path).map(|spec| spec.paths(base));
        let images = images.into_iter().flatten().flatten().flatten();
        std::iter::once(path.to_path_buf()).chain(images).collect()
    }

    fn read(&self, path: &Path, _: Option<&ColumnMap>, frame: Frame) -> Result<Field> {
        Fringes::measure(path, &Silent)?.field(frame)
    }

    fn write(&self, path: &Path, grid: &Grid, frame: Frame) -> Result<Option<ColumnMap>> {
        write(path, grid, frame, &RenderPlan::default(), 1)?;
        Ok(None)
    }
}
