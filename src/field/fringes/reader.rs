//! Fringe images as a measurement of a model: `"format": "fringes"`.

use std::path::{Path, PathBuf};

use super::measure::Fringes;
use super::render::{RenderPlan, write};
use super::spec::FringeImages;
use crate::error::{Error, Result};
use crate::field::frame::Frame;
use crate::field::grid::Grid;
use crate::field::measured::Field;
use crate::field::reader::{ColumnMap, Reader};
use crate::progress::Silent;

impl Fringes {
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
