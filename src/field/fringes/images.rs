//! The images of a set: PNG or TIFF, of 8 or 16 bit, grey or of a palette.

use std::fs;
use std::path::{Path, PathBuf};

use image::{ColorType, DynamicImage, ImageReader, Limits};
use rayon::prelude::*;

use super::calibrate::Frames;
use crate::error::{Error, Result};
use crate::field::reader::unreadable;

/// A picture of more pixels is refused, and so is what would need more memory, bytes.
const MOST_PIXELS: u64 = 64 << 20;
const MOST_BYTES: u64 = 1 << 30;

/// All images of a set.
pub struct Stack {
    pub rows: usize,
    pub cols: usize,
    /// By component and state.
    pub frames: [[Frames; 2]; 2],
    /// Largest value that the images can hold, and the one at which they are clipped.
    pub full_scale: u16,
    pub saturated: u16,
}

struct Picture {
    size: [usize; 2],
    values: Vec<u16>,
    full_scale: u16,
}

impl Stack {
    /// Read the images at `paths`, by component, state and frame.
    ///
    /// # Errors
    /// Of the input, with the file: an image that is missing, mangled, coloured, or unlike the others.
    pub fn read(paths: &[[Vec<PathBuf>; 2]; 2]) -> Result<Self> {
        let all: Vec<&PathBuf> = paths.iter().flatten().flatten().collect();
        let read: Vec<Result<Picture>> = all.par_iter().map(|path| picture(path)).collect();
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
        let saturated = clipped_at(&pictures, full_scale);
        let mut values = pictures.into_iter().map(|p| p.values);
        let mut of = |list: &Vec<PathBuf>| -> Frames { values.by_ref().take(list.len()).collect() };
        let [u, v] = paths;
        let frames = [[of(&u[0]), of(&u[1])], [of(&v[0]), of(&v[1])]];
        Ok(Self {
            rows,
            cols,
            frames,
            full_scale,
            saturated,
        })
    }
}

/// One image.
fn picture(path: &Path) -> Result<Picture> {
    let bytes = fs::read(path).map_err(|e| unreadable(path, &e))?;
    decode(&bytes).map_err(|what| {
        Error::input(path.display(), "a grey PNG or TIFF image of 8 or 16 bit").found(what)
    })
}

/// The picture in the bytes of a file, or what is wrong with it.
fn decode(bytes: &[u8]) -> std::result::Result<Picture, String> {
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
    Ok(Picture {
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

/// The value at which the detector clips: the largest one where it occurs far more often than those below it, as in
/// pictures of a 12-bit camera in files of 16 bit; or else full scale.
fn clipped_at(pictures: &[Picture], full_scale: u16) -> u16 {
    const OFTEN: usize = 20;
    let mut counts = vec![0usize; usize::from(full_scale) + 1];
    for picture in pictures {
        for value in picture.values.iter().step_by(3) {
            counts[usize::from(*value)] += 1;
        }
    }
    let Some(most) = counts.iter().rposition(|n| *n > 0) else {
        return full_scale;
    };
    // those that occur next below it: values of 12 bits leave gaps in 16
    let below: Vec<usize> = counts[..most]
        .iter()
        .rev()
        .filter(|n| **n > 0)
        .take(8)
        .copied()
        .collect();
    let typical = below.iter().sum::<usize>() / below.len().max(1);
    if counts[most] > OFTEN.max(5 * typical) {
        most as u16
    } else {
        full_scale
    }
}

#[cfg(test)]
#[path = "../../../tests/unit/fringe_images.rs"]
mod tests;
