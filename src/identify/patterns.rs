//! What stationary noise does not do: break out in one place. That is sought without any model of what makes it, so that an effect that is in no
//! dictionary does not go unsaid.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, DiscreteCDF, Normal, Poisson};

use crate::field::Field;
use crate::noise::Noise;

/// Block averages of one component that the noise does not explain, close to each other or not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Exceedance {
    /// `u1` or `u2`.
    pub component: String,
    /// Number of block averages more than 4 sds away from what the noise and the blocks before them allow.
    pub blocks: usize,
    /// Of how many.
    pub of: usize,
    /// How many the noise alone would have.
    pub expected: f64,
    /// Probability of as many by noise alone.
    pub p: f64,
    /// Where the largest is, in the data's coordinates.
    pub place_in_data_mm: [f64; 2],
    /// How many sds the largest is away.
    pub sds: f64,
}

/// What has to be said of a residual beside its smooth structure.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Patterns {
    /// Where the residual breaks out of the noise.
    #[serde(rename = "breakout")]
    pub exceedance: Option<Exceedance>,
}

/// Patterns more probable than this by noise alone are not spoken of.
const IMPROBABLE: f64 = 1e-4;

/// Sds of a block average that is far out: 0.1 of 1800 by chance.
const FAR: f64 = 4.0;

impl Patterns {
    /// Sought in the residual (mm) at the points of `field`, where `clear` says so: at a hole's edge, optics and meshes are worst.
    pub fn of(
        field: &Field,
        residual: &[[f64; 2]],
        noise: &Noise,
        clear: &dyn Fn([f64; 2]) -> bool,
    ) -> Self {
        let exceedances = [0, 1].map(|c| exceedance(field, residual, noise, c, clear));
        let exceedances = exceedances.into_iter().flatten();
        Self {
            exceedance: exceedances.min_by(|a, b| a.p.total_cmp(&b.p)),
        }
    }

    /// Whether there is any.
    pub fn any(&self) -> bool {
        self.exceedance.is_some()
    }
}

/// Each block average is compared with what those before it predict: the whitened averages are independent and of unit variance.
fn exceedance(
    field: &Field,
    residual: &[[f64; 2]],
    noise: &Noise,
    c: usize,
    clear: &dyn Fn([f64; 2]) -> bool,
) -> Option<Exceedance> {
    let blocks = &noise.blocks;
    let values: Vec<f64> = residual.iter().map(|r| r[c]).collect();
    let averages = DMatrix::from_columns(&[blocks.average(&values)]);
    let white = noise.whiten(&averages, c);
    let whitened_size = |b: &usize| white[(*b, 0)].abs();
    let looked_at: Vec<usize> = (0..blocks.len())
        .filter(|&b| clear(blocks.centroid[b]))
        .collect();
    let count = looked_at.iter().filter(|b| whitened_size(b) > FAR).count();
    let largest = looked_at
        .iter()
        .copied()
        .max_by(|a, b| whitened_size(a).total_cmp(&whitened_size(b)))?;
    let expected = 2.0 * Normal::standard().sf(FAR) * looked_at.len() as f64;
    let p = match count {
        0 => 1.0,
        // both components are looked at
        count => (2.0 * Poisson::new(expected).ok()?.sf(count as u64 - 1)).min(1.0),
    };
    (p < IMPROBABLE).then_some(Exceedance {
        component: ["u1", "u2"][c].into(),
        blocks: count,
        of: looked_at.len(),
        expected,
        p,
        place_in_data_mm: field.frame.data_point(blocks.centroid[largest]),
        sds: whitened_size(&largest),
    })
}
