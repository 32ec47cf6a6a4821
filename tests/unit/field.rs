//! The measured field: readers, frame, outliers, noise, blocks and their covariance.

mod fringe_images;
mod programs;
mod readers;
mod statistics;
mod units;

use plychain::field::{Axis, Field, Frame, Grid, MeasurementSpec};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// A measurement from its JSON text.
pub fn spec(json: &str) -> MeasurementSpec {
    serde_json::from_str(json).unwrap()
}

pub const STEEL: &str = r#"{ "format": "csv", "file": "displacements_raw.csv",
    "columns": {"x": "x-coordinate [mm]", "y": "y-coordinate [mm]", "ux": "x-displacement [mm]", "uy": "y-displacement [mm]"},
    "units": {"coordinates": "mm", "displacements": "mm"}, "loading_axis": "x", "hole_center_in_data_mm": [39.8, 10.2] }"#;

pub fn normal(rng: &mut Pcg64) -> f64 {
    rng.sample(StandardNormal)
}

pub fn rng(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// A smooth displacement (mm) like that of a plate with a hole of radius 2 mm: uniform strain and decaying terms.
pub fn open_hole([s, t]: [f64; 2]) -> [f64; 2] {
    let (r2, strain) = ((s * s + t * t) / 4.0, 6e-4);
    let (c, d) = (s / r2, t / r2);
    [
        strain * (s + 0.9 * c + 0.4 * (s * s - 3.0 * t * t) * c / (4.0 * r2 * r2)),
        -strain * (0.6 * t + 0.5 * d + 0.3 * (3.0 * s * s - t * t) * d / (4.0 * r2 * r2)),
    ]
}

/// A field of n x n points over 24.3 x 24.3 mm with a hole of radius 2 mm, loaded along x, and white noise (mm).
pub fn simulated(n: usize, sd_mm: f64, seed: u64) -> Field {
    let mut rng = rng(seed);
    let mut grid = Grid::regular([[-12.15; 2], [12.15; 2]], n, n);
    for (p, u) in grid.points.iter().zip(&mut grid.displacement) {
        if p[0].hypot(p[1]) > 2.0 {
            *u = open_hole(*p).map(|u| u + sd_mm * normal(&mut rng));
        }
    }
    grid.field(Frame {
        loading_axis: Axis::X,
        hole_center_mm: [0.0; 2],
    })
}
