//! Choices of the reference's share and of a rival, each with all that the evidence of any model needs.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::frame_noise::{FoundNoise, FrameNoise, Search, SpatialNoise, steps as steps_of_noise};
use super::frames::{Frames, Growth};
use super::in_frames::{FrameColumns, InFrames};
use super::rivals::{LENGTHS, RATIOS, Rival, RivalModes};
use super::slices::Slices;
use crate::dense::{product, tr_product};
use crate::error::{Error, Result};
use crate::noise::NormalEquations;

/// Shares r of the reference picture's noise in each frame's own, with their prior probabilities: it is a picture like the others
/// (r = 1), unless several were averaged or it was taken in another light.
pub const REFERENCES: [(f64, f64); 7] = [
    (0.0, 0.05),
    (0.15, 0.05),
    (0.4, 0.1),
    (0.7, 0.2),
    (1.0, 0.4),
    (1.5, 0.15),
    (2.5, 0.05),
];

/// Prior probability of a smooth discrepancy of a single field, or of a rival of a series, shared equally by its laws, lengths and sizes.
/// With it the prototype study called 38 of 38 smooth random fields outside the dictionary unexplained, and none of 500 fields of noise alone.
pub const DISCREPANCY: f64 = 0.07;

/// Log evidence of all columns below that of the best setting of its class with which a setting is left out.
const WORTH: f64 = 60.0;

/// What distinguishes one setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct At {
    /// Share r of the reference picture's noise.
    pub reference: f64,
    /// A discrepancy beside the noise.
    pub rival: Option<Rival>,
}

/// One choice of the covariance of all values of both components.
#[derive(Debug, Clone)]
pub struct Setting {
    pub at: At,
    /// Log prior probability.
    pub log_prior: f64,
    /// log det of the covariance of both components.
    pub log_det: f64,
    /// X' C^-1 X of all columns and, last, the data; both components summed.
    pub gram: DMatrix<f64>,
    /// Log evidence of all columns at unit prior, with the log prior; up to the constant of all values.
    pub log_all: f64,
}

/// The noise of a series, and the settings worth weighing.
#[derive(Debug, Clone)]
pub struct SeriesNoise {
    pub noise: FrameNoise,
    pub settings: Vec<Setting>,
    /// What every column does in each frame.
    pub in_frames: Arc<InFrames>,
    /// Eigenvectors of the rivals under this noise.
    modes: Arc<ModesByLength>,
}

/// Eigenvectors of the rivals of every length under each component's noise; one for both where that is shared.
type ModesByLength = Vec<Vec<RivalModes>>;

/// How often [`settings`] calls its `step`.
pub fn steps(frames: &Frames<'_>) -> usize {
    steps_of_noise(frames) + LENGTHS.len()
}

/// Search for the noise. `columns` of u1 and of u2: (frames x blocks) x (p + 1), row = frame * blocks + block, the p columns of everything
/// that may act, each for one prior sd, and last the data minus the prediction, mm. `step` is called on the way.
///
/// # Errors
/// Of the input: too few blocks or frames for the columns. Of the program: columns of another size or not finite, a factorisation
/// that fails.
pub fn found_noise(
    frames: &Frames<'_>,
    columns: [&DMatrix<f64>; 2],
    step: &(dyn Fn() + Sync),
) -> Result<FoundNoise> {
    frames.check()?;
    check(frames, columns)?;
    let [first, second] = slices(frames, columns);
    Search::new(frames, [&first, &second], step)?.best(&references(frames))
}

/// Search for the noise and weigh all settings under it: [`found_noise`], then [`settings_under`].
///
/// # Errors
/// Those of [`found_noise`].
pub fn settings(
    frames: &Frames<'_>,
    columns: [&DMatrix<f64>; 2],
    step: &(dyn Fn() + Sync),
) -> Result<SeriesNoise> {
    let found = found_noise(frames, columns, step)?;
    settings_under(frames, columns, found.over(frames)?, step)
}

/// Weigh all settings under the noise that was found with the same `columns`; kept are those within 60 nats of the best of their class
/// (no rival, constant, with the load), by the evidence of all columns. `step` is called on the way.
///
/// # Errors
/// Those of [`found_noise`].
pub fn settings_under(
    frames: &Frames<'_>,
    columns: [&DMatrix<f64>; 2],
    noise: FrameNoise,
    step: &(dyn Fn() + Sync),
) -> Result<SeriesNoise> {
    let references = references(frames);
    let references = match noise.walks {
        true => vec![(0.0, 0.0)],
        false => references,
    };
    let in_frames = InFrames::new(frames, &noise, slices(frames, columns));
    let modes = Arc::new(modes(frames, &noise, &lengths_mm(frames), step)?);
    let weighed = WeighedSetting::new(frames, &noise, &in_frames, &modes);
    let choices = choices(frames, &references, &weighed.lengths_mm);
    let all = choices
        .into_par_iter()
        .map(|(at, log_prior)| weighed.setting(at, log_prior));
    let all: Vec<Result<Setting>> = all.collect();
    let all = all.into_iter().collect::<Result<Vec<Setting>>>()?;
    Ok(SeriesNoise {
        noise,
        settings: worth_weighing(all),
        in_frames: Arc::new(in_frames),
        modes,
    })
}

/// X' C^-1 X of other columns than those of the settings, both components summed, for some of the settings; `columns` of u1 and of u2
/// as those of [`found_noise`].
///
/// # Errors
/// Those of [`found_noise`].
pub fn grams(
    frames: &Frames<'_>,
    noise: &SeriesNoise,
    columns: [&DMatrix<f64>; 2],
    which: &[usize],
) -> Result<Vec<DMatrix<f64>>> {
    check(frames, columns)?;
    let in_frames = InFrames::new(frames, &noise.noise, slices(frames, columns));
    let weighed = WeighedSetting::new(frames, &noise.noise, &in_frames, &noise.modes);
    let of = |k: &usize| weighed.equations(noise.settings[*k].at).0;
    Ok(which.par_iter().map(of).collect())
}

/// The columns of both components, frame by frame.
fn slices(frames: &Frames<'_>, columns: [&DMatrix<f64>; 2]) -> [Slices; 2] {
    let n = frames.blocks.len();
    let (first, second) = rayon::join(|| Slices::new(columns[0], n), || Slices::new(columns[1], n));
    [first, second]
}

fn check(frames: &Frames<'_>, columns: [&DMatrix<f64>; 2]) -> Result<()> {
    let rows = frames.len() * frames.blocks.len();
    let shape = (rows, columns[0].ncols());
    if columns.iter().any(|c| c.shape() != shape) || shape.1 == 0 {
        let expected = format!("columns of {rows} values, and the data, of both components");
        return Err(Error::program("noise::series", expected).found(format!(
            "{:?}, {:?}",
            columns[0].shape(),
            columns[1].shape()
        )));
    }
    let whole = columns.iter().flat_map(|c| c.column_iter().enumerate());
    let mut lacking = whole.filter(|(_, column)| column.iter().any(|v| !v.is_finite()));
    if let Some((k, _)) = lacking.next() {
        return Err(Error::program("noise::series", "finite columns and data")
            .found(format!("column {k} of {}", shape.1)));
    }
    Ok(())
}

/// Shares of the reference with their log prior probabilities. In one frame its noise is the frame's own.
fn references(frames: &Frames<'_>) -> Vec<(f64, f64)> {
    if frames.len() < 2 {
        return vec![(0.0, 0.0)];
    }
    REFERENCES.map(|(r, p)| (r, p.ln())).to_vec()
}

/// Every share of the reference without and with every rival.
fn choices(frames: &Frames<'_>, references: &[(f64, f64)], lengths_mm: &[f64]) -> Vec<(At, f64)> {
    let laws = frames.laws();
    let equal = (laws.len() * lengths_mm.len() * RATIOS.len()) as f64;
    let mut rivals = vec![(None, (1.0 - DISCREPANCY).ln())];
    for &law in &laws {
        for &length_mm in lengths_mm {
            for ratio in RATIOS {
                let rival = Rival {
                    law,
                    length_mm,
                    ratio,
                };
                rivals.push((Some(rival), (DISCREPANCY / equal).ln()));
            }
        }
    }
    let with = |(rival, p): (Option<Rival>, f64)| {
        references
            .iter()
            .map(move |&(reference, q)| (At { reference, rival }, p + q))
    };
    rivals.into_iter().flat_map(with).collect()
}

/// The best of each class, and what comes near it, in order of the choices.
fn worth_weighing(mut all: Vec<Setting>) -> Vec<Setting> {
    let class = |s: &Setting| s.at.rival.map(|r| r.law);
    for law in [None, Some(Growth::Constant), Some(Growth::WithLoad)] {
        let own = all.iter().filter(|s| class(s) == law);
        let best = own.map(|s| s.log_all).fold(f64::NEG_INFINITY, f64::max);
        all.retain(|s| class(s) != law || s.log_all >= best - WORTH);
    }
    all
}

/// One component's columns, whitened by its noise.
struct WhitenedColumns {
    /// X' (diag(d)^-1 (x) N^-1) X.
    own: DMatrix<f64>,
    /// X' (D^-1 1 1' D^-1 (x) N^-1) X: of the whitened columns summed over the frames, weighted by 1 / d_s.
    common: DMatrix<f64>,
    /// log det of diag(d) (x) N.
    log_det: f64,
    /// Whitened columns summed over the frames, weighted by 1 / d_s and by f_s / d_s, in the eigenvectors of the rivals, by length.
    rotated: Vec<[DMatrix<f64>; 2]>,
}

/// Everything that settings differ in is a few numbers from here on.
struct WeighedSetting<'a> {
    components: [WhitenedColumns; 2],
    modes: &'a ModesByLength,
    lengths_mm: Vec<f64>,
    /// 1' D^-1 1, 1' D^-1 f, f' D^-1 f of D = diag(d); of a random walk of what 1 and f add in each frame.
    products: [f64; 3],
    blocks: usize,
}

/// Lengths of the rivals, mm.
fn lengths_mm(frames: &Frames<'_>) -> Vec<f64> {
    LENGTHS.map(|share| share * frames.window_mm()).to_vec()
}

impl<'a> WeighedSetting<'a> {
    fn new(
        frames: &Frames<'_>,
        noise: &FrameNoise,
        in_frames: &InFrames,
        modes: &'a ModesByLength,
    ) -> Self {
        let inverse = DVector::from_iterator(frames.len(), noise.scales.iter().map(|d| 1.0 / d));
        let laws = [Growth::Constant, Growth::WithLoad].map(|l| noise.seen(&frames.direction(l)));
        let weights = laws.each_ref().map(|law| inverse.component_mul(law));
        let component = |c: usize| {
            let modes: Vec<&RivalModes> = modes.iter().map(|m| &m[c.min(m.len() - 1)]).collect();
            let (spatial, part) = (&noise.spatial[c], &in_frames.parts[c]);
            WhitenedColumns::new(spatial, part, &weights, &noise.scales, &modes)
        };
        let (first, second) = rayon::join(|| component(0), || component(1));
        let [constant, loaded] = &weights;
        Self {
            components: [first, second],
            modes,
            lengths_mm: lengths_mm(frames),
            products: [
                constant.dot(&laws[0]),
                loaded.dot(&laws[0]),
                loaded.dot(&laws[1]),
            ],
            blocks: frames.blocks.len(),
        }
    }

    fn setting(&self, at: At, log_prior: f64) -> Result<Setting> {
        let (gram, log_det) = self.equations(at);
        let log_all = log_prior + log_evidence(&gram, log_det)?;
        Ok(Setting {
            at,
            log_prior,
            log_det,
            gram,
            log_all,
        })
    }

    /// X' C^-1 X of all columns and, last, the data, and log det C.
    fn equations(&self, at: At) -> (DMatrix<f64>, f64) {
        let [square, mixed, loaded] = self.products;
        let r = at.reference;
        let share = r / (1.0 + r * square);
        let p = self.components[0].own.nrows();
        let (mut all, mut log_det) = (DMatrix::zeros(p, p), 0.0);
        for (c, component) in self.components.iter().enumerate() {
            all += &component.own;
            all -= share * &component.common;
            log_det += component.log_det + self.blocks as f64 * (r * square).ln_1p();
            let Some(rival) = at.rival else { continue };
            let Some(k) = self.lengths_mm.iter().position(|l| *l == rival.length_mm) else {
                continue;
            };
            // Phi^-1 w = by_0 D^-1 1 + by_1 D^-1 f, alpha = w' Phi^-1 w
            let (alpha, by) = match rival.law {
                Growth::Constant => (square / (1.0 + r * square), [1.0 / (1.0 + r * square), 0.0]),
                Growth::WithLoad => (loaded - share * mixed * mixed, [-share * mixed, 1.0]),
            };
            let modes = &self.modes[k][c.min(self.modes[k].len() - 1)];
            let [common, with_load] = &component.rotated[k];
            let size = rival.ratio * alpha;
            all -= modes.explained(size, [common, with_load], by.map(|b| b / alpha.sqrt()));
            log_det += modes.log_det(size);
        }
        (all, log_det)
    }
}

/// Eigenvectors of the rivals of every length under the noise of each component, or of both.
fn modes(
    frames: &Frames<'_>,
    noise: &FrameNoise,
    lengths_mm: &[f64],
    step: &(dyn Fn() + Sync),
) -> Result<ModesByLength> {
    let distinct = if noise.is_shared() { 1 } else { 2 };
    let pairs: Vec<(f64, usize)> = lengths_mm
        .iter()
        .flat_map(|&l| (0..distinct).map(move |c| (l, c)))
        .collect();
    let found = pairs.par_iter().map(|&(length_mm, c)| {
        let modes = RivalModes::new(frames.blocks, length_mm, &noise.spatial[c].covariance);
        if c == 0 {
            step();
        }
        modes
    });
    let found: Vec<Result<RivalModes>> = found.collect();
    let mut found = found.into_iter();
    let own = |_| found.by_ref().take(distinct).collect();
    lengths_mm.iter().map(own).collect()
}

impl WhitenedColumns {
    fn new(
        noise: &SpatialNoise,
        part: &FrameColumns,
        weights: &[DVector<f64>; 2],
        scales: &[f64],
        modes: &[&RivalModes],
    ) -> Self {
        let FrameColumns {
            slices,
            white,
            inner,
        } = part;
        let (count, n) = (slices.frames.len() as f64, white.nrows() as f64);
        let p = slices.frames.first().map_or(0, DMatrix::ncols);
        let mut own = DMatrix::zeros(p, p);
        for (t, scale) in slices.frames.iter().zip(scales) {
            own += tr_product(t, &product(inner, t)) / *scale;
        }
        let sums = weights.each_ref().map(|w| slices.combined(w));
        let log_scales: f64 = scales.iter().map(|d| d.ln()).sum();
        let rotated = modes.iter().map(|m| {
            let basis = m.rotate(white);
            [0, 1].map(|k: usize| product(&basis, &sums[k]))
        });
        Self {
            rotated: rotated.collect(),
            common: tr_product(&sums[0], &product(inner, &sums[0])),
            own,
            log_det: count * (noise.covariance.log_det() + n * noise.scale2.ln()) + n * log_scales,
        }
    }
}

/// Log evidence of all columns of prior N(0, 1) each.
fn log_evidence(gram: &DMatrix<f64>, log_det: f64) -> Result<f64> {
    let last = gram.nrows() - 1;
    let (inside, right) = (
        gram.view((0, 0), (last, last)),
        gram.view((0, last), (last, 1)),
    );
    let equations =
        NormalEquations::with_unit_prior(inside.into_owned(), right.column(0).into_owned())
            .ok_or_else(|| Error::program("noise::series", "finite columns"))?;
    Ok(equations.log_evidence() - 0.5 * (log_det + gram[(last, last)]))
}
