//! Pictures of pixels on the specimen: fringe images, phases, displacements.

use super::canvas::{Figure, draw};
use super::maps::{Raster, Scale, map, panel};
use crate::error::Result;

/// Values of pixels, row by row.
pub struct PixelPicture<'a> {
    /// File stem.
    pub name: String,
    pub title: String,
    pub size: [usize; 2],
    /// The point (x, y) of a pixel at row and column, mm.
    pub point: &'a dyn Fn(usize, usize) -> [f64; 2],
    /// Its value; NaN where there is none.
    pub value: &'a dyn Fn(usize, usize) -> f64,
    pub scale: Scale,
    /// Show the middle at full resolution instead of everything at less: what varies from pixel to pixel cannot be thinned.
    pub middle: bool,
}

/// Pixels to a side that are shown.
const SHOWN: usize = 360;

impl PixelPicture<'_> {
    /// First row and column, pixels to the next that is shown, and how many are.
    fn shown(&self) -> [(usize, usize, usize); 2] {
        self.size.map(|n| {
            if n <= SHOWN {
                (0, 1, n)
            } else if self.middle {
                ((n - SHOWN) / 2, 1, SHOWN)
            } else {
                let stride = n.div_ceil(SHOWN);
                (0, stride, n.div_ceil(stride))
            }
        })
    }

    pub fn draw(&self) -> Result<Figure> {
        let [rows, cols] = self.shown();
        let row = |k: usize| rows.0 + k * rows.1;
        let col = |k: usize| cols.0 + k * cols.1;
        let mut order: Vec<usize> = (0..rows.2).collect();
        // rasters begin at the lowest y
        let y = |k: usize| (self.point)(row(k), col(0))[1];
        if rows.2 > 1 && y(0) > y(1) {
            order.reverse();
        }
        let of_row = |k: &usize| {
            let row = row(*k);
            (0..cols.2).map(move |c| (self.value)(row, col(c)))
        };
        let raster = Raster {
            x: (0..cols.2)
                .map(|k| (self.point)(row(0), col(k))[0])
                .collect(),
            y: order.iter().map(|k| y(*k)).collect(),
            values: order.iter().flat_map(of_row).collect(),
        };
        let part = self.middle && self.size.iter().any(|n| *n > SHOWN);
        let title = if part {
            format!("{} (middle)", self.title)
        } else {
            self.title.clone()
        };
        let size = panel(&raster, 250);
        draw(&self.name, title.clone(), size, |root, images| {
            map(root, images, &raster, self.scale, &title)
        })
    }
}
