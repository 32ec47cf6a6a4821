//! The images of a set.

use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::clear::{Clear, StateFrames};
use super::picture::{COLOURS, ImageFile, clearest_colour, decode};
use crate::error::{Error, Result};

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
    /// The colour that is taken of a colour camera's pictures.
    pub colour: Option<&'static str>,
}

impl ImageStack {
    /// Read the images at `paths`, by component, state and frame.
    ///
    /// # Errors
    /// Of the input, with the file: an image that is missing, mangled, or unlike the others.
    pub fn read(paths: &[[Vec<PathBuf>; 2]; 2]) -> Result<Self> {
        let all: Vec<&PathBuf> = paths.iter().flatten().flatten().collect();
        let Some(first) = all.first() else {
            return Err(Error::program("field::fringes", "images"));
        };
        // one colour for all pictures
        let colour = picture(first, clearest_colour)?;
        let of = |path: &&PathBuf| picture(path, |bytes| decode(bytes, colour));
        let read: Vec<Result<ImageFile>> = all.par_iter().map(of).collect();
        let pictures = read.into_iter().collect::<Result<Vec<_>>>()?;
        let first = &pictures[0];
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
            colour: colour.map(|k| COLOURS[k]),
        })
    }
}

/// What is made of the bytes of one image.
fn picture<T>(path: &Path, of: impl Fn(&[u8]) -> std::result::Result<T, String>) -> Result<T> {
    let bytes = fs::read(path).map_err(|e| {
        Error::input(path.display(), "a readable image")
            .found(e)
            .hint("names are relative to the file that lists them")
    })?;
    of(&bytes).map_err(|what| {
        let expected = "a PNG, TIFF, JPEG or BMP image of 8 or 16 bit, grey as the first one or of a colour camera as that";
        Error::input(path.display(), expected).found(what)
    })
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
