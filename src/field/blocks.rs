//! Block averages: square tiles over the field, means over the same points for data and model columns.

use std::collections::BTreeMap;

use nalgebra::DVector;

use super::measured::{Field, bounds};
use super::places::BlockPoints;

/// Square blocks and the points in them.
#[derive(Debug, Clone)]
pub struct Blocks {
    /// Side of a block, mm.
    pub size_mm: f64,
    /// Number of points n_b of each block.
    pub count: Vec<usize>,
    /// How many points of mean variance each block's average is worth: n_b where all points are alike.
    pub worth: Vec<f64>,
    /// How much each point counts in its block's average, 1 on average of the precision; `None` where all are alike.
    pub weight: Option<Vec<f64>>,
    /// Mean (s, t) of the points of each block, mm: a linear function averages to its value here.
    pub centroid: Vec<[f64; 2]>,
    /// Variance of the points' place in each block along both directions, mm^2.
    pub spread: Vec<[f64; 2]>,
    /// The points of each block, where they are so few that their places count.
    pub places: BlockPoints,
    /// The block of each point of the field; `None` outside of all blocks.
    pub of_point: Vec<Option<u32>>,
    /// Longest correlation length that counts as noise, mm: two subsets where they are declared, or a tenth of the
    /// window's shorter side. In a single field nothing tells longer noise from an error of the model.
    pub noise_length_mm: f64,
}

/// Noise is correlated over at most so many subsets, or so much of the window.
const SUBSETS: f64 = 2.0;
const WINDOWS: f64 = 0.1;

impl Blocks {
    /// At most about this many blocks: the covariance of a component is a dense matrix over them.
    pub const MOST: usize = 900;
    /// A typical block of at most so many points is not taken for evenly covered: a lattice of 4 x 4 points that is makes
    /// a correlation length of 1 mm 0.5 % too long.
    const FEW: f64 = 16.0;
    /// Blocks that a field should have.
    const FEWEST: usize = 150;
    /// At least about this many points in a full block, where that leaves enough blocks.
    pub const FEWEST_POINTS: usize = 4;

    /// The block size for a field: as small as [`Blocks::MOST`] blocks and [`Blocks::FEWEST_POINTS`] points a block
    /// allow (0.8 mm for a window of 24.3 mm; 1.3 mm for 80 x 20 mm).
    pub fn size_for(field: &Field) -> f64 {
        let spacing = field.spacing_mm();
        if spacing <= 0.0 {
            return 1.0;
        }
        // measured area from tiles of some sixteen points; tiles at the border count by half
        let tile = 4.0 * spacing;
        let full = tile_members(&field.points, tile, |_| true);
        let typical = typical_count(full.values().map(Vec::len).collect());
        let area: f64 = full
            .values()
            .map(|m| (m.len() as f64 / typical).min(1.0) * tile * tile)
            .sum();
        let per_point = area / field.len() as f64;
        // of a small field every point counts: effects must be told from noise by more blocks than they have columns
        let enough = field.len() >= Self::FEWEST_POINTS * Self::FEWEST;
        let fewest = if enough { Self::FEWEST_POINTS } else { 1 };
        (area / Self::MOST as f64)
            .sqrt()
            .max((fewest as f64 * per_point).sqrt() * 1.05)
    }

    /// Blocks of side `size_mm` over the points of `field` for which `used(index)` holds (for instance those beyond
    /// 1.2 hole radii). Blocks with less than half the typical number of points are dropped.
    pub fn new(field: &Field, size_mm: f64, used: impl Fn(usize) -> bool) -> Self {
        let mut members = tile_members(&field.points, size_mm, used);
        let typical = typical_count(members.values().map(Vec::len).collect());
        members.retain(|_, m| m.len() as f64 >= 0.5 * typical);
        let mut of_point = vec![None; field.len()];
        for (block, m) in members.values().enumerate() {
            m.iter().for_each(|&i| of_point[i] = Some(block as u32));
        }
        let weight = field.weights();
        let of = |i: usize| weight.as_ref().map_or(1.0, |w| w[i]);
        let worth: Vec<f64> = members
            .values()
            .map(|m| m.iter().map(|&i| of(i)).sum())
            .collect();
        let mean = |m: &[usize], worth: f64, value: &dyn Fn(usize) -> f64| {
            m.iter().map(|&i| of(i) * value(i)).sum::<f64>() / worth
        };
        let all = members.values().zip(&worth);
        let centroid: Vec<[f64; 2]> = all
            .clone()
            .map(|(m, &worth)| [0, 1].map(|k| mean(m, worth, &|i| field.points[i][k])))
            .collect();
        let spread: Vec<[f64; 2]> = all
            .zip(&centroid)
            .map(|((m, &worth), c)| {
                [0, 1].map(|k| mean(m, worth, &|i| (field.points[i][k] - c[k]).powi(2)))
            })
            .collect();
        // of a block with far more points than the others, some stand for all
        let points = |m: &Vec<usize>| {
            let every = (m.len() as f64 / (4.0 * Self::FEW)).ceil() as usize;
            m.iter()
                .step_by(every.max(1))
                .map(|&i| field.points[i])
                .collect()
        };
        let places = if typical <= Self::FEW {
            BlockPoints::of_few(members.values().map(points).collect())
        } else {
            BlockPoints::Many
        };
        let [low, high] = bounds(&field.points);
        let shorter = (high[0] - low[0]).min(high[1] - low[1]);
        Self {
            size_mm,
            noise_length_mm: (SUBSETS * field.subset_mm.unwrap_or(0.0)).max(WINDOWS * shorter),
            spread,
            places,
            worth,
            weight,
            count: members.values().map(Vec::len).collect(),
            centroid,
            of_point,
        }
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.count.len()
    }

    /// Whether there is no block.
    pub fn is_empty(&self) -> bool {
        self.count.is_empty()
    }

    /// The same blocks with some points standing for all: `of_point` says whose they are. `None` if a block has none of them.
    pub fn thinned(&self, of_point: Vec<Option<u32>>) -> Option<Self> {
        let mut count = vec![0; self.len()];
        for block in of_point.iter().flatten() {
            count[*block as usize] += 1;
        }
        (!count.contains(&0)).then(|| Self {
            worth: count.iter().map(|n| *n as f64).collect(),
            weight: None,
            count,
            of_point,
            ..self.clone()
        })
    }

    /// Mean number of points of a block; the covariance's white part refers to it.
    pub fn mean_count(&self) -> f64 {
        self.count.iter().sum::<usize>() as f64 / self.len().max(1) as f64
    }

    /// Block means of one value a point (`values.len()` is the number of points of the field).
    pub fn average(&self, values: &[f64]) -> DVector<f64> {
        let mut sums = DVector::zeros(self.len());
        for (i, (value, block)) in values.iter().zip(&self.of_point).enumerate() {
            if let Some(block) = block {
                let weight = self.weight.as_ref().map_or(1.0, |w| w[i]);
                sums[*block as usize] += weight * value;
            }
        }
        for (sum, worth) in sums.iter_mut().zip(&self.worth) {
            *sum /= worth;
        }
        sums
    }
}

/// Where the square tiles of side `size_mm` over some points begin, mm.
pub fn origin(points: &[[f64; 2]], size_mm: f64) -> [f64; 2] {
    let [low, high] = bounds(points);
    [0, 1].map(|k| {
        let extent = high[k] - low[k];
        // whole tiles, unless a thin strip would be left over
        let tiles = (extent / size_mm).round().max(1.0);
        low[k] - 0.5 * (tiles * size_mm - extent)
    })
}

/// Members of the square tiles of side `size_mm`, laid symmetrically over the bounds, in order of the tiles.
fn tile_members(
    points: &[[f64; 2]],
    size_mm: f64,
    used: impl Fn(usize) -> bool,
) -> BTreeMap<[i64; 2], Vec<usize>> {
    let origin = origin(points, size_mm);
    let mut members: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for (i, p) in points.iter().enumerate().filter(|(i, _)| used(*i)) {
        members
            .entry([0, 1].map(|k| ((p[k] - origin[k]) / size_mm).floor() as i64))
            .or_default()
            .push(i);
    }
    members
}

/// Which points stand for the square tiles of side `size_mm`: of each the one nearest to the middle of its points.
pub fn one_a_tile(points: &[[f64; 2]], size_mm: f64) -> Vec<bool> {
    let mut kept = vec![false; points.len()];
    for members in tile_members(points, size_mm, |_| true).values() {
        let middle = [0, 1].map(|k| {
            let sum: f64 = members.iter().map(|&i| points[i][k]).sum();
            sum / members.len() as f64
        });
        let off = |i: &usize| (points[*i][0] - middle[0]).hypot(points[*i][1] - middle[1]);
        let nearest = members.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.into_iter().for_each(|&i| kept[i] = true);
    }
    kept
}

/// Number of points of a typical full tile: the upper quartile, since tiles at borders and holes hold fewer.
fn typical_count(mut counts: Vec<usize>) -> f64 {
    counts.sort_unstable();
    counts.get(counts.len() * 3 / 4).map_or(0.0, |n| *n as f64)
}
