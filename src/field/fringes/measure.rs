//! Both displacements of a set of images.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::component::{DisplacementMap, component};
use super::copies;
use super::images::ImageStack;
use super::spec::{COMPONENTS, FringeImages};
use super::warnings;
use crate::error::{Error, Result};
use crate::field::grid::Grid;
use crate::progress::Progress;

/// The displacements of a set of images.
pub struct Fringes {
    pub spec: FringeImages,
    pub files: Vec<PathBuf>,
    pub rows: usize,
    pub cols: usize,
    /// U and V.
    pub components: [DisplacementMap; 2],
    /// What a user should know before believing them.
    pub warnings: Vec<String>,
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
        let stack = ImageStack::read(&paths)?;
        copies::check(&paths, &stack, spec.step_deg)?;
        progress.end();
        progress.begin("phases", Some(2));
        let found: Vec<Result<DisplacementMap>> = stack
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
        let of_colour = |colour: &str| {
            format!(
                "pictures of a colour camera: {colour} is used, which varies most; if the light has another colour, save that one as grey"
            )
        };
        let mut warnings: Vec<String> = stack.colour.map(of_colour).into_iter().collect();
        warnings.extend(warnings::of(&spec, &components));
        Ok(Self {
            warnings,
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
}
