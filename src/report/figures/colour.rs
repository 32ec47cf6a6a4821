//! Colour maps: viridis for fields, blue-white-red for differences, and images in 255 of their colours.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use plotters::style::RGBColor;

use crate::error::{Error, Result};

/// Colours of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Palette {
    /// Viridis, perceptually uniform (van der Walt and Smith), for a field.
    Field,
    /// Blue to white to red (ColorBrewer RdBu), for a difference about zero.
    Difference,
}

/// Viridis at sixteenths.
const VIRIDIS: [[u8; 3]; 17] = [
    [68, 1, 84],
    [72, 24, 106],
    [71, 45, 123],
    [66, 64, 134],
    [59, 82, 139],
    [51, 99, 141],
    [44, 114, 142],
    [38, 130, 142],
    [33, 145, 140],
    [31, 160, 136],
    [40, 174, 128],
    [63, 188, 115],
    [94, 201, 98],
    [132, 212, 75],
    [173, 220, 48],
    [216, 226, 25],
    [253, 231, 37],
];

/// `RdBu`, turned so that positive values are red.
const DIFFERENCE: [[u8; 3]; 11] = [
    [5, 48, 97],
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
    [103, 0, 31],
];

/// Colours of an image; index 0 is kept for "nothing there".
const SHADES: usize = 255;

impl Palette {
    /// The colour at `at` in [0, 1].
    pub fn at(self, at: f64) -> RGBColor {
        let list: &[[u8; 3]] = match self {
            Self::Field => &VIRIDIS,
            Self::Difference => &DIFFERENCE,
        };
        let place = at.clamp(0.0, 1.0) * (list.len() - 1) as f64;
        let k = (place as usize).min(list.len() - 2);
        let t = place - k as f64;
        let mix = |c: usize| {
            (f64::from(list[k][c]) * (1.0 - t) + f64::from(list[k + 1][c]) * t).round() as u8
        };
        RGBColor(mix(0), mix(1), mix(2))
    }

    /// A PNG as a data URI: `values`, row by row from the top, coloured between `low` and `high`; NaN is transparent.
    ///
    /// # Errors
    /// The program's fault if the image cannot be encoded.
    pub fn image(self, values: &[f64], width: usize, [low, high]: [f64; 2]) -> Result<String> {
        let mut colours = vec![255, 255, 255];
        for shade in 0..SHADES {
            let RGBColor(r, g, b) = self.at(shade as f64 / (SHADES - 1) as f64);
            colours.extend([r, g, b]);
        }
        let index = |v: f64| {
            let at = ((v - low) / (high - low)).clamp(0.0, 1.0);
            if at.is_nan() {
                0
            } else {
                1 + (at * (SHADES - 1) as f64).round() as u8
            }
        };
        let pixels: Vec<u8> = values.iter().map(|v| index(*v)).collect();
        let mut bytes = Vec::new();
        let failed = |e: png::EncodingError| Error::program("figure", "an image").found(e);
        let height = values.len() / width.max(1);
        let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(colours);
        encoder.set_trns(vec![0]);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(&pixels).map_err(failed)?;
        writer.finish().map_err(failed)?;
        Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
    }
}
