//! Where the points of blocks lie, for the mean of a function of distance over the points of two blocks.

/// Coordinates this close to whole steps lie on a lattice, in steps: files round them.
const ROUNDING: f64 = 1e-3;

/// Coordinates this close together, relative to their extent, are the same.
const SAME: f64 = 1e-6;

/// A lattice may have this many sites for each point: more would be empty.
const MOST_SITES: f64 = 4.0;

/// The points of each block.
#[derive(Debug, Clone)]
pub enum BlockPoints {
    /// So many that they cover their blocks evenly.
    Many,
    /// Few, anywhere: their coordinates (s, t) in mm.
    Anywhere(Vec<Vec<[f64; 2]>>),
    /// Few, on a lattice: many pairs of points are the same distance apart.
    OnLattice(PointLattice),
}

/// Points on a rectangular lattice.
#[derive(Debug, Clone)]
pub struct PointLattice {
    step_mm: [f64; 2],
    /// Rows, and twice the sites of one: the difference of two numbers of sites is that of no other offset.
    shape: [usize; 2],
    /// Number of each point's site, of each block; row by row.
    pub sites: Vec<Vec<u32>>,
}

impl BlockPoints {
    /// The places of few points, block by block; (s, t) in mm.
    pub fn of_few(blocks: Vec<Vec<[f64; 2]>>) -> Self {
        match PointLattice::new(&blocks) {
            Some(lattice) => Self::OnLattice(lattice),
            None => Self::Anywhere(blocks),
        }
    }
}

impl PointLattice {
    fn new(blocks: &[Vec<[f64; 2]>]) -> Option<Self> {
        let points = || blocks.iter().flatten();
        let axes = [0, 1].map(|k| StepSizes::new(points().map(|p| p[k]).collect()));
        let [rows, columns] = [0, 1].map(|k| axes[k].last + 1.0);
        if rows * columns > MOST_SITES * points().count() as f64 {
            return None;
        }
        let to = |p: &[f64; 2]| [0, 1].map(|k| (p[k] - axes[k].low) / axes[k].step);
        let between = |p| to(p).iter().any(|x| (x - x.round()).abs() > ROUNDING);
        if points().any(between) {
            return None;
        }
        let shape = [rows as usize, 2 * columns as usize];
        let site = |p| {
            let [row, column] = to(p).map(|x| x.round() as u32);
            row * shape[1] as u32 + column
        };
        let sites = blocks.iter().map(|b| b.iter().map(site).collect());
        Some(Self {
            step_mm: [axes[0].step, axes[1].step],
            sites: sites.collect(),
            shape,
        })
    }

    /// `f` of the distance (mm) of two sites, by the absolute difference of their numbers.
    pub fn tabulate(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        self.tabulate_offsets(|[row, column]| f(row.hypot(column)))
    }

    /// `f` of the offset (mm, in both directions) of two sites, by the absolute difference of their numbers; `f` is even.
    pub fn tabulate_offsets(&self, f: impl Fn([f64; 2]) -> f64) -> Vec<f64> {
        let [rows, width] = self.shape;
        let value = |difference: usize| {
            let row = (difference + width / 2) / width;
            let column = difference as f64 - (row * width) as f64;
            f([self.step_mm[0] * row as f64, self.step_mm[1] * column])
        };
        (0..rows * width).map(value).collect()
    }
}

/// Equal steps over coordinates.
struct StepSizes {
    low: f64,
    step: f64,
    /// Number of steps to the last coordinate.
    last: f64,
}

impl StepSizes {
    /// As many as the smallest gaps ask for.
    fn new(mut values: Vec<f64>) -> Self {
        values.sort_unstable_by(f64::total_cmp);
        let low = values.first().copied().unwrap_or(0.0);
        let extent = values.last().map_or(0.0, |high| high - low);
        let gaps = values.windows(2).map(|pair| pair[1] - pair[0]);
        let gaps: Vec<f64> = gaps.filter(|gap| *gap > SAME * extent).collect();
        let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
        let single = gaps.iter().filter(|gap| **gap < 1.5 * smallest);
        let (count, sum) = single.fold((0.0, 0.0), |(n, sum), gap| (n + 1.0, sum + gap));
        let last = if count > 0.0 {
            (extent * count / sum).round()
        } else {
            0.0
        };
        let step = if last > 0.0 { extent / last } else { 1.0 };
        Self { low, step, last }
    }
}
