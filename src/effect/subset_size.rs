//! The subsets that were correlated are larger or smaller than declared.

use super::optics::displacements_are_imaged;
use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::quantity::{plus_minus, significant};

pub struct SubsetSize;

impl Effect for SubsetSize {
    fn entry(&self) -> Entry {
        Entry {
            name: "subset_size",
            kind: Kind::Averaged,
            parameters: const { &[EffectParameter::new("side_percent", 25.0, 95.0)] },
            about: "The fields are smoothed more or less than the declared subset does it, as by one whose side is larger by this percentage. Another subset than the declared one does that, or a filter of the displacements.",
            confirm: "Read the size of the subset, and of any filter, from the project of the correlation. Correlate again with half the subset.",
        }
    }

    fn smoothing(&self, amplitude: &[f64], power: i32) -> f64 {
        (1.0 + 0.01 * amplitude[0]).powi(power) - 1.0
    }

    fn meaning(&self, amplitude: &[[f64; 2]], scene: &Scene) -> Option<String> {
        let declared = scene.subset_mm?;
        let [percent, sd] = *amplitude.first()?;
        let factor = 1.0 + 0.01 * percent;
        let side = declared * factor;
        if factor < SMALLEST {
            return Some("The fields are hardly smoothed at all: they were not correlated by subsets, or the declared subset is far too large".into());
        }
        let side_sd = declared * 0.01 * sd;
        let words = |side: f64, sd: f64, unit: &str, declared: f64| {
            let side = plus_minus(side, sd);
            let declared = significant(declared, 0.1 * declared);
            format!(
                "The fields are smoothed as by a subset of {side} {unit}; {declared} {unit} are declared"
            )
        };
        Some(match scene.pixel_mm {
            Some(pixel) => words(side / pixel, side_sd / pixel, "px", declared / pixel),
            None => words(side, side_sd, "mm", declared),
        })
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        if !displacements_are_imaged(scene) || scene.subset_mm.is_none() {
            return Some("no images are correlated: measurement.image_correlation is not given");
        }
        None
    }
}

/// Share of the declared side below which nothing is said of the size.
const SMALLEST: f64 = 0.2;
