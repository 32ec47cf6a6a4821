//! One displacement from its frames: calibration, phase difference, unwrapping.

use serde::Serialize;

use super::calibrate::{Calibration, ChosenSteps, calibrate};
use super::clear::StateFrames;
use super::images::ImageStack;
use super::phase::{Analysis, Pixel};
use super::spec::FringeImages;
use super::unwrap::unwrap;
use crate::error::{Error, Result};
use crate::quantity::NM_PER_MM;

/// One displacement, pixel by pixel and row by row.
pub struct DisplacementMap {
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
    /// Measured pixels of which some frames are clipped.
    pub partly_clipped: usize,
    /// First frame of either state.
    pub first: [Vec<u16>; 2],
    /// Sizes of connected parts, largest first; whole orders between them are not known.
    pub parts: Vec<usize>,
    pub frames: Calibration,
    pub chosen: ChosenSteps,
}

/// One component from its frames.
///
/// # Errors
/// Of the input: pictures without fringes.
pub fn component(
    spec: &FringeImages,
    stack: &ImageStack,
    states: [&StateFrames; 2],
) -> Result<DisplacementMap> {
    let none = || {
        let what = "fringes that stand out of the noise in both states";
        Error::input("images", what)
            .found("none, or too few pixels of them")
            .hint("check the images' order, the exposure (clipped pictures show nothing) and step_deg")
    };
    let (frames, chosen) = calibrate(states, spec, stack).ok_or_else(none)?;
    let analysis = Analysis::new(states, &frames, &stack.clear).ok_or_else(none)?;
    let mut phase = analysis.phase(stack.rows, stack.cols);
    let wrapped_rad = phase.difference.clone();
    let parts = unwrap(&mut phase);
    if parts.is_empty() {
        return Err(none());
    }
    let scale = spec.mm_per_rad();
    let measured = |values: &[f64]| -> Vec<f64> {
        let of = |(i, value): (usize, &f64)| phase.is_measured(i).then_some(value * scale);
        let all = values.iter().enumerate();
        all.map(|v| of(v).unwrap_or(f64::NAN)).collect()
    };
    Ok(DisplacementMap {
        displacement_mm: measured(&phase.difference),
        sd_mm: measured(&phase.sd),
        ripple_rad: analysis.ripple(&phase),
        partly_clipped: analysis.partly_clipped(&phase),
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
#[derive(Debug, Serialize)]
pub struct Counts {
    pub measured: usize,
    pub clipped: usize,
    pub dark: usize,
    pub spoiled: usize,
    pub too_fine: usize,
    pub isolated: usize,
}

impl DisplacementMap {
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
