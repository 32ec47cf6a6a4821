//! A figure as PNG, at three pixels a unit: 300 dots an inch at the size of a column.

use std::sync::Arc;

use resvg::{tiny_skia, usvg};

use super::canvas::Figure;
use crate::error::{Error, Result};

/// Pixels a unit of the SVG.
const SCALE: f32 = 3.0;

/// The figure on white, as the bytes of a PNG file.
///
/// # Errors
/// The program's fault if the drawing cannot be read back or encoded.
pub fn png(figure: &Figure) -> Result<Vec<u8>> {
    let failed = |what: &dyn std::fmt::Display| {
        Error::program(format!("figure {}", figure.name), "an image").found(what)
    };
    // The type comes with the program, so that the image is the same on every machine.
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    let family = fonts
        .faces()
        .find_map(|f| f.families.first().map(|n| n.0.clone()));
    if let Some(family) = family {
        fonts.set_sans_serif_family(family);
    }
    let options = usvg::Options {
        fontdb: Arc::new(fonts),
        ..usvg::Options::default()
    };
    let tree = usvg::Tree::from_str(&figure.svg, &options).map_err(|e| failed(&e))?;
    let [width, height] = [figure.size.0, figure.size.1].map(|n| (n as f32 * SCALE) as u32);
    let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or_else(|| failed(&"no size"))?;
    pixels.fill(tiny_skia::Color::WHITE);
    let transform = tiny_skia::Transform::from_scale(SCALE, SCALE);
    resvg::render(&tree, transform, &mut pixels.as_mut());
    pixels.encode_png().map_err(|e| failed(&e))
}
