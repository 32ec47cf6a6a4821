//! Single fields of the default open-hole test as image correlation has them: what is wrong with ordinary fields.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Dxsm;

use super::camera::Pinhole;
use super::cases::{Draw, bare};
use super::causes::{Cause, Law};
use super::mechanics::Specimen;
use super::noise::Noise;
use super::series::Series;
use super::subsets::{Cut, Layout, Shape};

/// What is wrong with a field.
#[derive(Debug, Clone, Copy)]
pub enum Ordinary {
    /// Subsets of so many mm, dropped at the hole or cut.
    Subsets(f64, Cut),
    /// Mrad out of the plane before a camera at 500 mm.
    Turned(f64),
    /// A lens of 0.1 % at 12 mm under a millimetre of translation.
    Lens,
    /// Nothing but noise over the subset.
    Plain,
}

/// Such a field by a seed: 25 mm wide with a hole of 4 mm, under 700 N, noise of `noise_nm` a subset.
pub fn ordinary(what: Ordinary, noise_nm: f64, seed: u64) -> Series {
    let mut draw = Draw(Pcg64Dxsm::seed_from_u64(seed));
    let mut series = bare(true, &mut draw);
    series.specimen = Specimen {
        length_mm: 200.0,
        width_mm: 25.0,
        diameter_mm: 4.0,
        ..Specimen::laminate()
    };
    series.load_error = 0.0;
    series.forces_n = vec![700.0];
    series.rigid = vec![([0.0; 2], 0.0)];
    series.noise = Noise {
        sd_mm: 1e-6 * noise_nm / 2_f64.sqrt(),
        ..Noise::default()
    };
    series.layout = match what {
        Ordinary::Subsets(mm, cut) => layout(mm, cut),
        _ => layout(1.0, Cut::Dropped),
    };
    series.declared_distance_mm = 500.0;
    series.pinhole = Pinhole {
        distance_mm: 500.0 * (1.0 + 0.006 * draw.normal()),
        principal_mm: [0.0; 2].map(|_: f64| 6.0 * draw.normal()),
    };
    match what {
        Ordinary::Turned(mrad) => {
            series.causes = vec![Cause::Turn(draw.vector(mrad), [0.0; 2], Law::Constant)];
        }
        Ordinary::Lens => {
            series.rigid = vec![(draw.vector(1.0), 0.0)];
            series.causes = vec![Cause::Lens(0.1 * draw.sign(), series.pinhole.principal_mm)];
        }
        Ordinary::Subsets(..) | Ordinary::Plain => {}
    }
    let name = match what {
        Ordinary::Subsets(mm, cut) => format!("subsets-{mm}-{cut:?}"),
        Ordinary::Turned(mrad) => format!("turned-{mrad}"),
        Ordinary::Lens => "lens".into(),
        Ordinary::Plain => "plain".into(),
    };
    series.name = format!("ordinary-{}-{seed}", name.to_lowercase());
    series.seed = draw.0.random();
    series
}

/// Subsets of a side over the plate's width; an odd number of pixels has a middle one.
fn layout(subset_mm: f64, cut: Cut) -> Layout {
    let (pixel_mm, step) = (0.05, 8);
    let side = 2 * (subset_mm / pixel_mm / 2.0) as usize + 1;
    let step_mm = pixel_mm * step as f64;
    // subsets stay on the plate
    let reach = 12.45 - 0.5 * side as f64 * pixel_mm;
    let count = 2 * (reach / step_mm) as usize + 1;
    Layout {
        pixel_mm,
        side,
        step,
        first_mm: [-0.5 * (count - 1) as f64 * step_mm; 2],
        count: [count; 2],
        shape: Shape::Affine,
        cut,
    }
}

/// The ordinary fields of the design.
pub const ORDINARY: [Ordinary; 9] = [
    Ordinary::Subsets(1.0, Cut::Dropped),
    Ordinary::Subsets(1.5, Cut::Dropped),
    Ordinary::Subsets(2.0, Cut::Dropped),
    Ordinary::Subsets(1.0, Cut::Kept),
    Ordinary::Subsets(2.0, Cut::Kept),
    Ordinary::Turned(1.25),
    Ordinary::Turned(5.0),
    Ordinary::Lens,
    Ordinary::Plain,
];
