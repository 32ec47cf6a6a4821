//! Fine waves in a residual: shorter than the blocks of the noise model can see, in a direction that noise does not have: Welch's periodograms, compared with each other.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Gamma};

use crate::field::{Blocks, Field};
use crate::noise::NormalEquations;
use crate::numeric::median;
use crate::quantity::NM_PER_MM;

/// A wave in one part of one component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Wave {
    /// `u1` or `u2`.
    pub component: String,
    /// Its length, mm. A wave shorter than two spacings of the points shows as a longer one.
    pub length_mm: f64,
    /// Shortest and longest that a part of this size tells from it, mm: half a period more or less in the part.
    pub length_range_mm: [f64; 2],
    /// Direction in which it runs: unit vector in the data's coordinates.
    pub direction_in_data: [f64; 2],
    /// Its amplitude at one wave number, nm: less than the wave's own where its length drifts or lies between two.
    pub amplitude_nm: f64,
    /// Centre of the part where it is clearest, in the data's coordinates.
    pub place_in_data_mm: [f64; 2],
    /// Share of the parts looked at (0 to 1) in which it stands out of the noise.
    pub share: f64,
    /// Probability of one as large in noise without a preferred direction.
    pub p: f64,
}

/// Patterns more probable than this by noise alone are not spoken of.
pub const IMPROBABLE: f64 = 1e-4;

/// Side of a part in which waves are sought, in spacings of the points.
pub const PART: f64 = 24.0;

/// Parts looked at, at most.
const MOST_PARTS: usize = 64;

/// Waves that pass fewer times through a part are smooth structure, which the blocks see.
const FEWEST_PERIODS: f64 = 3.0;

/// Half-width in periods a part of the ring of wave numbers whose typical power is the noise's.
const RING: f64 = 0.35;

/// The power of a wave at which the noise's own, whose ring is not known exactly, may be too large.
const RING_ERROR: f64 = 1.25;

/// Distances in periods a part of the wave numbers about one, beyond the width of its own peak.
const ABOUT: std::ops::Range<f64> = 1.8..4.0;

/// Amplitudes below this share of the residual's RMS are not worth mentioning: the side lobes of noise that square subsets have
/// averaged, which all parts have alike, reach a fifth.
const WORTHY: f64 = 0.3;

/// A residual in parts in which waves are sought.
struct WaveParts<'a> {
    field: &'a Field,
    residual: &'a [[f64; 2]],
    /// Side of a part, mm.
    side: f64,
    /// Points of each part.
    members: Vec<Vec<usize>>,
    /// Parts that are looked at.
    chosen: Vec<usize>,
    numbers: Vec<[f64; 2]>,
}

/// The periodograms of one component over the parts.
struct Spectra {
    component: usize,
    /// Number of each part, and its power at each wave number, in units in which the noise expects 1.
    relative: Vec<(usize, Vec<f64>)>,
    /// What most parts have at each wave number, in the same units, but at least 1.
    common: Vec<f64>,
    /// Amplitude (mm) of a lone wave over the root of its relative power, by wave number.
    unit: Vec<f64>,
    /// Root mean square of the component, mm.
    rms: f64,
}

/// A candidate for the clearest wave.
struct WavePeak {
    component: usize,
    number: usize,
    amplitude: f64,
    part: usize,
    share: f64,
    p: f64,
}

/// The clearest wave in the residual: one that is improbable in its part, or in the mean over all parts, and worth mentioning.
pub fn clearest(
    field: &Field,
    residual: &[[f64; 2]],
    used: impl Fn(usize) -> bool,
) -> Option<Wave> {
    let side = PART * field.spacing_mm();
    if side.is_nan() || side <= 0.0 {
        return None;
    }
    let blocks = Blocks::new(field, side, used);
    let mut members = vec![Vec::new(); blocks.len()];
    for (i, part) in blocks.of_point.iter().enumerate() {
        if let Some(part) = part {
            members[*part as usize].push(i);
        }
    }
    let stride = blocks.len().div_ceil(MOST_PARTS).max(1);
    let chosen: Vec<usize> = (0..blocks.len())
        .step_by(stride)
        .filter(|&part| members[part].len() >= FEWEST_POINTS)
        .collect();
    if chosen.is_empty() {
        return None;
    }
    let parts = WaveParts {
        field,
        residual,
        side,
        members,
        chosen,
        numbers: wave_numbers(),
    };
    let tried = (2 * parts.numbers.len()) as f64;
    let peak = [0, 1]
        .map(|c| {
            let spectra = Spectra::new(&parts, c);
            [spectra.sharpest(tried), spectra.steadiest(tried)]
        })
        .into_iter()
        .flatten()
        .flatten()
        .min_by(|a, b| a.p.total_cmp(&b.p))?;
    let [a, b] = parts.numbers[peak.number];
    let number = a.hypot(b);
    Some(Wave {
        component: ["u1", "u2"][peak.component].into(),
        length_mm: side / number,
        length_range_mm: [side / (number + 0.5), side / (number - 0.5)],
        direction_in_data: field.frame.vector([a / number, b / number]),
        amplitude_nm: peak.amplitude * NM_PER_MM,
        place_in_data_mm: field.frame.data_point(blocks.centroid[peak.part]),
        share: peak.share,
        p: peak.p,
    })
}

impl WaveParts<'_> {
    /// Power of component `c` over one part at all wave numbers, after a quadratic and under a Hann window, which keeps what is
    /// smooth in its place; and the amplitude of a lone wave over the root of its power.
    fn periodogram(&self, part: usize, c: usize) -> (Vec<f64>, f64) {
        let (field, residual, side) = (self.field, self.residual, self.side);
        let members = &self.members[part];
        let n = members.len();
        let low = [0, 1].map(|k| {
            members
                .iter()
                .map(|&i| field.points[i][k])
                .fold(f64::INFINITY, f64::min)
        });
        let high = [0, 1].map(|k| {
            members
                .iter()
                .map(|&i| field.points[i][k])
                .fold(f64::NEG_INFINITY, f64::max)
        });
        let place = |i: usize, k: usize| (field.points[i][k] - 0.5 * (low[k] + high[k])) / side;
        let basis = DMatrix::from_fn(n, TERMS, |row, term| {
            let [s, t] = [place(members[row], 0), place(members[row], 1)];
            [1.0, s, t, s * s, s * t, t * t][term]
        });
        let values = DVector::from_iterator(n, members.iter().map(|&i| residual[i][c]));
        let fit = NormalEquations::new(basis.tr_mul(&basis), basis.tr_mul(&values));
        let left = fit.map_or_else(|| values.clone(), |f| &values - &basis * f.mean());
        let window: Vec<f64> = members
            .iter()
            .map(|&i| {
                let half = |k: usize| (std::f64::consts::PI * place(i, k)).cos().powi(2);
                half(0) * half(1)
            })
            .collect();
        let square: f64 = window.iter().map(|w| w * w).sum();
        let sum: f64 = window.iter().sum();
        let power = self
            .numbers
            .iter()
            .map(|&[a, b]| {
                let mut total = [0.0; 2];
                for (row, &i) in members.iter().enumerate() {
                    let phase = 2.0 * std::f64::consts::PI * (a * place(i, 0) + b * place(i, 1));
                    let (sin, cos) = phase.sin_cos();
                    let value = window[row] * left[row];
                    total = [total[0] + value * cos, total[1] + value * sin];
                }
                (total[0] * total[0] + total[1] * total[1]) / square
            })
            .collect();
        (power, 2.0 * square.sqrt() / sum.max(f64::MIN_POSITIVE))
    }
}

impl Spectra {
    fn new(parts: &WaveParts<'_>, component: usize) -> Self {
        let WaveParts {
            field,
            residual,
            side,
            chosen,
            numbers,
            ..
        } = parts;
        let raw: Vec<(Vec<f64>, f64)> = chosen
            .par_iter()
            .map(|&part| parts.periodogram(part, component))
            .collect();
        let shape = field.subset_mm.map(|w| of_subsets(numbers, w / side));
        let (expected, common) = expected(numbers, &raw, shape.as_deref());
        let relative = |power: &Vec<f64>| {
            let relative: Vec<f64> = power.iter().zip(&expected).map(|(p, e)| p / e).collect();
            // parts may be noisier than others
            let level = median(&mut relative.clone()) / std::f64::consts::LN_2;
            relative
                .iter()
                .map(|r| r / level.max(f64::MIN_POSITIVE))
                .collect()
        };
        let lone = raw.iter().map(|(_, lone)| lone).sum::<f64>() / raw.len() as f64;
        let square: f64 = residual.iter().map(|r| r[component] * r[component]).sum();
        Self {
            component,
            relative: chosen
                .iter()
                .zip(&raw)
                .map(|(&part, (power, _))| (part, relative(power)))
                .collect(),
            common,
            unit: expected.iter().map(|e| lone * e.sqrt()).collect(),
            rms: (square / residual.len() as f64).sqrt(),
        }
    }

    /// The largest power of any wave number in any part, over what most parts have there.
    fn sharpest(&self, tried: f64) -> Option<WavePeak> {
        let tried = tried * self.relative.len() as f64;
        let largest = |power: &[f64]| {
            let whitened = power.iter().zip(&self.common).map(|(p, common)| p / common);
            let power: Vec<f64> = whitened.collect();
            let best = (0..power.len()).max_by(|&a, &b| power[a].total_cmp(&power[b]))?;
            Some((best, power[best]))
        };
        let p = |power: f64| (tried * (-power / RING_ERROR).exp()).min(1.0);
        let all: Vec<(usize, usize, f64)> = self
            .relative
            .iter()
            .filter_map(|(part, power)| {
                largest(power).map(|(number, power)| (*part, number, power))
            })
            .collect();
        let &(part, number, power) = all.iter().max_by(|a, b| a.2.total_cmp(&b.2))?;
        let clear = all
            .iter()
            .filter(|(.., power)| p(*power) < IMPROBABLE)
            .count();
        self.worthy(WavePeak {
            component: self.component,
            number,
            amplitude: self.unit[number] * (self.common[number] * (power - 1.0).max(0.0)).sqrt(),
            part,
            share: clear as f64 / all.len() as f64,
            p: p(power),
        })
    }

    /// The largest mean power over all parts: a sum of as many exponential variables in noise.
    fn steadiest(&self, tried: f64) -> Option<WavePeak> {
        let n = self.relative.len() as f64;
        let sum = |k: usize| self.relative.iter().map(|(_, power)| power[k]).sum::<f64>();
        let number = (0..self.unit.len()).max_by(|&a, &b| sum(a).total_cmp(&sum(b)))?;
        let gamma = Gamma::new(n, 1.0).ok()?;
        let p = (tried * gamma.sf(sum(number) / RING_ERROR)).min(1.0);
        let power_at = |entry: &&(usize, Vec<f64>)| entry.1[number];
        let clearest = self
            .relative
            .iter()
            .max_by(|a, b| power_at(a).total_cmp(&power_at(b)))?;
        // one in five parts of noise alone has more
        let clear = self
            .relative
            .iter()
            .filter(|entry| power_at(entry) > 5_f64.ln())
            .count() as f64
            / n;
        self.worthy(WavePeak {
            component: self.component,
            number,
            amplitude: self.unit[number] * (sum(number) / n - 1.0).max(0.0).sqrt(),
            part: clearest.0,
            share: ((clear - 0.2) / 0.8).max(0.0),
            p,
        })
    }

    fn worthy(&self, peak: WavePeak) -> Option<WavePeak> {
        let worthy = peak.p < IMPROBABLE && peak.amplitude > WORTHY * self.rms;
        worthy.then_some(peak)
    }
}

/// What the noise has at each wave number: the median over all parts of waves of nearly the same length in all directions, or
/// of those about it where that is more, as in noise that prefers some directions; and what most parts have there in units of it,
/// but at least 1: noise that square subsets have averaged has side lobes along its axes. Where the subset is known, its lobes' `shape`, as
/// high as the main one makes them, is expected at least.
fn expected(
    numbers: &[[f64; 2]],
    spectra: &[(Vec<f64>, f64)],
    shape: Option<&[f64]>,
) -> (Vec<f64>, Vec<f64>) {
    let length = |k: usize| numbers[k][0].hypot(numbers[k][1]);
    let typical = |near: &dyn Fn(usize) -> bool| {
        let ring = (0..numbers.len()).filter(|&j| near(j));
        let mut powers: Vec<f64> = ring
            .flat_map(|j| spectra.iter().map(move |(power, _)| power[j]))
            .collect();
        median(&mut powers) / std::f64::consts::LN_2
    };
    let height = shape.map_or(0.0, |shape| {
        let main = (0..shape.len()).filter(|&k| shape[k] > MAIN_LOBE);
        let mut over: Vec<f64> = main
            .flat_map(|k| spectra.iter().map(move |(power, _)| power[k] / shape[k]))
            .collect();
        if over.is_empty() {
            0.0
        } else {
            median(&mut over) / std::f64::consts::LN_2
        }
    });
    (0..numbers.len())
        .map(|k| {
            let lobe = shape.map_or(0.0, |shape| height * shape[k]);
            let apart = |j: usize| {
                let by = |sign: f64| {
                    (numbers[j][0] - sign * numbers[k][0])
                        .hypot(numbers[j][1] - sign * numbers[k][1])
                };
                by(1.0).min(by(-1.0))
            };
            let ring = typical(&|j| (length(j) - length(k)).abs() < RING);
            let about = typical(&|j| ABOUT.contains(&apart(j)));
            let expected = ring.max(about).max(lobe).max(f64::MIN_POSITIVE);
            let nearby = typical(&|j| apart(j) < ABOUT.start);
            (expected, (nearby / expected).max(1.0))
        })
        .unzip()
}

/// The power that white pixel noise has at each wave number after averages over square subsets of this width, in parts of 1, under a Hann
/// window: of the main lobe's top.
pub fn of_subsets(numbers: &[[f64; 2]], width: f64) -> Vec<f64> {
    let sinc2 = |x: f64| {
        let x = std::f64::consts::PI * x;
        if x == 0.0 { 1.0 } else { (x.sin() / x).powi(2) }
    };
    // a wave shorter than two spacings of the points shows as a longer one
    let folded = |number: f64| -> f64 {
        let fold = |k: i32| sinc2(width * (number + f64::from(k) * PART));
        (-FOLDS..=FOLDS).map(fold).sum()
    };
    // the Hann window's spectrum is 1/2, 1, 1/2 at whole numbers: its power
    let smeared = |number: f64| {
        let folded_by = |by: f64| folded(number + by);
        (0.25 * folded_by(-1.0) + folded_by(0.0) + 0.25 * folded_by(1.0)) / 1.5
    };
    let smeared_both = |[a, b]: &[f64; 2]| smeared(*a) * smeared(*b);
    numbers.iter().map(smeared_both).collect()
}

/// Multiples of the points' own wave number that are folded back.
const FOLDS: i32 = 3;

/// Wave numbers with more of the main lobe's top are of it.
const MAIN_LOBE: f64 = 0.3;

/// Periods a part along s and t of all waves sought: a half plane, up to two points a period, where waves of both
/// directions are one.
fn wave_numbers() -> Vec<[f64; 2]> {
    let most = (PART / 2.0) as i32;
    let mut numbers = Vec::new();
    for a in 0..=most {
        for b in -most..=most {
            let number = f64::from(a).hypot(f64::from(b));
            let upper = a > 0 || b > 0;
            if upper && number >= FEWEST_PERIODS && number < f64::from(most) {
                numbers.push([f64::from(a), f64::from(b)]);
            }
        }
    }
    numbers
}

/// Terms of the quadratic that is taken out of a part, and points that a part needs.
const TERMS: usize = 6;
const FEWEST_POINTS: usize = 100;
