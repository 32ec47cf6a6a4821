//! The images of a set: PNG or TIFF, of 8 or 16 bit, grey or of a palette.

use std::fs;
use std::path::{Path, PathBuf};

use image::{ColorType, DynamicImage, ImageReader, Limits};
use rayon::prelude::*;

use super::clear::{Clear, StateFrames};
use crate::error::{Error, Result};

/// A picture of more pixels is refused, and so is what would need more memory, bytes.
const MOST_PIXELS: u64 = 64 << 20;
const MOST_BYTES: u64 = 1 << 30;

/// All images of a set.
pub struct ImageStack {
    pub rows: usize,
    pub cols: usize,
    /// By component and state.
    pub frames: [[StateFrames; 2]; 2],
    /// Largest value that occurs: cameras of 10 or 12 bits leave much of a file's 16 empty.
    pub largest: u16,
    /// Which values are not clipped.
    pub clear: Clear,
}

struct ImageFile {
    size: [usize; 2],
    values: Vec<u16>,
    full_scale: u16,
}

impl ImageStack {
    /// Read the images at `paths`, by component, state and frame.
    ///
    /// # Errors
    /// Of the input, with the file: an image that is missing, mangled, coloured, or unlike the others.
    pub fn read(paths: &[[Vec<PathBuf>; 2]; 2]) -> Result<Self> {
        let all: Vec<&PathBuf> = paths.iter().flatten().flatten().collect();
        let read: Vec<Result<ImageFile>> = all.par_iter().map(|path| picture(path)).collect();
        let pictures = read.into_iter().collect::<Result<Vec<_>>>()?;
        let Some(first) = pictures.first() else {
            return Err(Error::program("field::fringes", "images"));
        };
        let ([cols, rows], full_scale) = (first.size, first.full_scale);
        for (path, picture) in all.iter().zip(&pictures) {
            let [w, h] = picture.size;
            if picture.size != first.size {
                let expected = format!("{cols} x {rows} pixels as in {}", all[0].display());
                return Err(Error::input(path.display(), expected).found(format!("{w} x {h}")));
            }
            if picture.full_scale != full_scale {
                let expected = format!("values up to {full_scale} as in {}", all[0].display());
                let found = format!("up to {}", picture.full_scale);
                return Err(Error::input(path.display(), expected).found(found));
            }
        }
        let clear = Clear::new(&counts(&pictures, full_scale), full_scale);
        let all_values = pictures.iter().flat_map(|p| p.values.iter());
        let largest = all_values.copied().max().unwrap_or(full_scale).max(1);
        let mut values = pictures.into_iter().map(|p| p.values);
        let mut of =
            |list: &Vec<PathBuf>| -> StateFrames { values.by_ref().take(list.len()).collect() };
        let [u, v] = paths;
        let frames = [[of(&u[0]), of(&u[1])], [of(&v[0]), of(&v[1])]];
        Ok(Self {
            rows,
            cols,
            frames,
            largest,
            clear,
        })
    }
}

/// One image.
fn picture(path: &Path) -> Result<ImageFile> {
    let place = || path.display();
    let bytes = fs::read(path).map_err(|e| {
        Error::input(place(), "a readable image")
            .found(e)
            .hint("names are relative to the file that lists them")
    })?;
    decode(&bytes).map_err(|what| {
        Error::input(place(), "a grey PNG or TIFF image of 8 or 16 bit").found(what)
    })
}

/// The picture in the bytes of a file (of several, the first), or what is wrong with it.
fn decode(bytes: &[u8]) -> std::result::Result<ImageFile, String> {
    let mut reader = ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    limits.max_image_width = Some(1 << 16);
    limits.max_image_height = Some(1 << 16);
    reader.limits(limits);
    let image = reader.decode().map_err(|e| e.to_string())?;
    let size = [image.width() as usize, image.height() as usize];
    if u64::from(image.width()) * u64::from(image.height()) > MOST_PIXELS {
        return Err(format!("{} x {} pixels", size[0], size[1]));
    }
    if image.color().has_color() && !is_grey(&image) {
        return Err("a coloured image".into());
    }
    let deep = matches!(
        image.color(),
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16
    );
    let (values, full_scale) = if deep {
        (image.into_luma16().into_raw(), u16::MAX)
    } else {
        let values = image.into_luma8().into_raw();
        (values.into_iter().map(u16::from).collect(), 255)
    };
    Ok(ImageFile {
        size,
        values,
        full_scale,
    })
}

/// Whether a picture of colours, as a palette gives, has none.
fn is_grey(image: &DynamicImage) -> bool {
    image
        .to_rgb16()
        .pixels()
        .all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2])
}

/// How often each value occurs, of some pixels.
fn counts(pictures: &[ImageFile], full_scale: u16) -> Vec<usize> {
    const STRIDE: usize = 3;
    let mut counts = vec![0; usize::from(full_scale) + 1];
    for picture in pictures {
        for value in picture.values.iter().step_by(STRIDE) {
            counts[usize::from(*value)] += 1;
        }
    }
    counts
}

#[cfg(test)]
#[path = "../../../tests/unit/fringe_images.rs"]
mod tests;
