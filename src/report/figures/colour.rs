//! Colour maps: viridis for fields, blue-white-red for differences, and images in 255 of their colours.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use plotters::style::RGBColor;

use crate::error::{Error, Result};

#[derive(Debug, Clone, Copy)]
pub enum Palette {
    /// Viridis, perceptually uniform (van der Walt and Smith), for a field.
    Field,
    /// Blue to white to red (ColorBrewer RdBu), for a difference about zero.
    Difference,
}

/// Viridis at sixteenths.
const VIRIDIS: [u32; 17] = [
    0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c,
    0x1fa088, 0x28ae80, 0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725,
];

/// `RdBu`, turned so that positive values are red.
const DIFFERENCE: [u32; 11] = [
    0x053061, 0x2166ac, 0x4393c3, 0x92c5de, 0xd1e5f0, 0xf7f7f7, 0xfddbc7, 0xf4a582, 0xd6604d,
    0xb2182b, 0x67001f,
];

/// Colours of an image; index 0 is kept for "nothing there".
const SHADES: usize = 255;

impl Palette {
    /// The colour at `at` in [0, 1].
    pub fn at(self, at: f64) -> RGBColor {
        let list: &[u32] = match self {
            Self::Field => &VIRIDIS,
            Self::Difference => &DIFFERENCE,
        };
        let place = at.clamp(0.0, 1.0) * (list.len() - 1) as f64;
        let k = (place as usize).min(list.len() - 2);
        let t = place - k as f64;
        let mix = |shift: u32| {
            let [a, b] = [list[k], list[k + 1]].map(|c| f64::from((c >> shift) & 0xff));
            (a * (1.0 - t) + b * t).round() as u8
        };
        RGBColor(mix(16), mix(8), mix(0))
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
