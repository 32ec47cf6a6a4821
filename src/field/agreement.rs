//! Whether the steps of a series are what they are said to be: no field stands twice, every field is of the same specimen, and the
//! forces go with the fields ([`super::forces`]).
//!
//! The size of a step is the difference of its mean strains along and across the load: a lens, a temperature or a
//! motion towards the camera strains a picture alike in all directions and does not enter.

use std::path::Path;

use rayon::prelude::*;

use super::forces::{Forces, LoadedStep};
use super::measured::bounds;
use super::rigid;
use crate::error::{Error, Result};
use crate::numeric::median;

/// Displacements this close together relative to the largest are the same, written with other decimals.
const COPY: f64 = 1e-6;

/// A step below this share of the largest size has too little of a field to be judged.
const LOADED: f64 = 0.2;

/// Cosine of a step's field (without its mean strain) and the others': below the first it is another specimen's, below the second
/// it is worth a word. Both only if what the others do not explain is so many times larger than theirs.
const OTHER_SPECIMEN: (f64, f64) = (0.6, 3.0);
const ODD: (f64, f64) = (0.85, 5.0);
/// The others must agree among themselves to this cosine.
const ALIKE: f64 = 0.9;

/// The pattern of a step, over that of the others in proportion to the mean strain: among themselves they agree within the first, beyond
/// the second it is worth a word, beyond the third another specimen's; if it is so many standard errors off by noise of points, and as many
/// times as far as the others are off among themselves, whose noise may be smooth.
const LIKE: f64 = 1.2;
const NEAR: f64 = 1.3;
const FAR: f64 = 1.6;
const SURE: f64 = 8.0;
const BEYOND_OTHERS: f64 = 4.0;

/// A step as it is judged.
pub(super) struct Judged<'a> {
    pub file: &'a Path,
    /// Force, N, if it is known.
    pub force_n: Option<f64>,
    /// Displacements, mm, at the points of the series.
    pub displacement: &'a [[f64; 2]],
}

/// No two steps have the same displacements.
///
/// # Errors
/// Of the input, naming both files.
pub(super) fn check_different(steps: &[Judged]) -> Result<()> {
    let largest = |u: &[[f64; 2]]| u.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    for (t, later) in steps.iter().enumerate() {
        let bound = COPY * largest(later.displacement);
        let copied = steps[..t].iter().position(|earlier| {
            let pairs = earlier.displacement.iter().zip(later.displacement);
            let mut pairs = pairs.flat_map(|(a, b)| [a[0] - b[0], a[1] - b[1]]);
            pairs.all(|d| d.abs() <= bound)
        });
        if let Some(s) = copied {
            return Err(Error::input(
                format!("steps[{t}].file"),
                "another field than every other step's",
            )
            .found(format!(
                "the displacements of steps[{s}].file, {}, again in {}",
                steps[s].file.display(),
                later.file.display()
            ))
            .hint("one state of the test stands in two files: leave one of them out"));
        }
    }
    Ok(())
}

/// A field with its rigid motion and mean strain taken out, and what these were.
struct PairShape {
    /// Mean strain along the load less that across it.
    size: f64,
    /// Mean displacement, mm.
    shift_mm: [f64; 2],
    /// What is left, mm.
    rest: Vec<[f64; 2]>,
}

/// Check the fields against each other and against their forces; what is odd but possible is returned as warnings.
///
/// # Errors
/// Of the input, naming the files: a field of another specimen, forces that contradict the fields.
pub(super) fn check(points: &[[f64; 2]], steps: &[Judged]) -> Result<Vec<String>> {
    let shapes: Option<Vec<PairShape>> = steps
        .par_iter()
        .map(|step| PairShape::new(points, step.displacement))
        .collect();
    // points on one line have no strain
    let Some(shapes) = shapes else {
        return Ok(Vec::new());
    };
    let files: Vec<&Path> = steps.iter().map(|s| s.file).collect();
    let likeness = Likeness::new(&shapes);
    let mut warnings = likeness.check(&files)?;
    let [low, high] = bounds(points);
    let extent = (0..2)
        .map(|k| high[k] - low[k])
        .fold(f64::INFINITY, f64::min);
    let known = steps.iter().zip(&shapes).enumerate();
    let known = known.map(|(step, (s, shape))| LoadedStep {
        step,
        force: s.force_n,
        size: shape.size,
        shift_mm: shape.shift_mm,
    });
    // a residual over half the window looks like this strain at most
    let noise = likeness.residual() / (0.5 * extent);
    warnings.extend(Forces::new(known.collect(), noise).check(&files)?);
    Ok(warnings)
}

impl PairShape {
    /// Least-squares plane through each component; `None` where the points do not determine it.
    fn new(points: &[[f64; 2]], displacement: &[[f64; 2]]) -> Option<Self> {
        let n = points.len() as f64;
        let rigid = rigid::fit(points, displacement);
        let [cs, ct] = rigid.center;
        let (mut ss, mut st, mut tt) = (0.0, 0.0, 0.0);
        let mut moments = [[0.0; 2]; 2];
        for (p, u) in points.iter().zip(displacement) {
            let d = [p[0] - cs, p[1] - ct];
            ss += d[0] * d[0];
            st += d[0] * d[1];
            tt += d[1] * d[1];
            for (row, (u, mean)) in moments.iter_mut().zip(u.iter().zip(rigid.shift)) {
                row[0] += d[0] * (u - mean);
                row[1] += d[1] * (u - mean);
            }
        }
        let determinant = ss * tt - st * st;
        if determinant.is_nan() || determinant <= 1e-9 * (ss + tt).powi(2) || n < 3.0 {
            return None;
        }
        let slope = moments.map(|[a, b]| {
            [
                (tt * a - st * b) / determinant,
                (ss * b - st * a) / determinant,
            ]
        });
        let rest = points.iter().zip(displacement).map(|(p, u)| {
            let d = [p[0] - cs, p[1] - ct];
            [0, 1].map(|k| u[k] - rigid.shift[k] - slope[k][0] * d[0] - slope[k][1] * d[1])
        });
        Some(Self {
            size: slope[0][0] - slope[1][1],
            shift_mm: rigid.shift,
            rest: rest.collect(),
        })
    }
}

/// Scalar products of the fields of loaded steps without their mean strains.
struct Likeness {
    /// Numbers of the loaded steps.
    steps: Vec<usize>,
    size: Vec<f64>,
    gram: Vec<Vec<f64>>,
    points: f64,
}

impl Likeness {
    fn new(shapes: &[PairShape]) -> Self {
        let largest = shapes.iter().map(|s| s.size.abs()).fold(0.0, f64::max);
        let loaded = |k: &usize| shapes[*k].size.abs() > LOADED * largest;
        let steps: Vec<usize> = (0..shapes.len()).filter(loaded).collect();
        let dot = |a: &PairShape, b: &PairShape| -> f64 {
            let pairs = a.rest.iter().zip(&b.rest);
            pairs.map(|(a, b)| a[0] * b[0] + a[1] * b[1]).sum()
        };
        let row = |&s: &usize| steps.iter().map(|&t| dot(&shapes[s], &shapes[t])).collect();
        Self {
            size: steps.iter().map(|&k| shapes[k].size).collect(),
            gram: steps.par_iter().map(row).collect(),
            points: shapes.first().map_or(0.0, |s| s.rest.len() as f64),
            steps,
        }
    }

    /// Of step `s`, and the sum of the steps `of` in proportion to their sizes: their cosine, and the RMS of what is left of the
    /// step without it, mm.
    fn against(&self, s: usize, of: &[usize]) -> (f64, f64) {
        let along: f64 = of.iter().map(|&t| self.size[t] * self.gram[s][t]).sum();
        let square: f64 = of
            .iter()
            .map(|&t| {
                let row = of.iter().map(|&v| self.size[v] * self.gram[t][v]);
                self.size[t] * row.sum::<f64>()
            })
            .sum();
        let own = self.gram[s][s];
        if square <= 0.0 || own <= 0.0 {
            return (0.0, (own.max(0.0) / self.points).sqrt());
        }
        let left = (own - along * along / square).max(0.0);
        let sign = self.size[s].signum();
        (
            sign * along / (square * own).sqrt(),
            (left / self.points).sqrt(),
        )
    }

    /// The loaded steps without some.
    fn others(&self, without: &[usize]) -> Vec<usize> {
        (0..self.steps.len())
            .filter(|t| !without.contains(t))
            .collect()
    }

    /// Median over the steps of what the others do not explain, RMS in mm.
    fn residual(&self) -> f64 {
        if self.steps.len() < 2 {
            return 0.0;
        }
        let of = |s: usize| self.against(s, &self.others(&[s])).1;
        median(&mut (0..self.steps.len()).map(of).collect::<Vec<_>>())
    }

    /// How many times as large the field of step `s` is, without its mean strain, as in the others in proportion to that strain, where that
    /// is odd: a hole of another size does it.
    fn odd_pattern(&self, s: usize, others: &[usize]) -> Option<f64> {
        let times = |s: usize, of: &[usize]| {
            let along: f64 = of.iter().map(|&t| self.size[t] * self.gram[s][t]).sum();
            let square: f64 = of
                .iter()
                .flat_map(|&t| of.iter().map(move |&v| (t, v)))
                .map(|(t, v)| self.size[t] * self.size[v] * self.gram[t][v])
                .sum();
            let sizes: f64 = of.iter().map(|&t| self.size[t].powi(2)).sum();
            let error = self.against(s, of).1 * sizes / (square.sqrt() * self.size[s].abs());
            (along / square * sizes / self.size[s], error)
        };
        let (own, error) = times(s, others);
        let among: Vec<f64> = others
            .iter()
            .map(|&t| times(t, &self.others(&[s, t])).0)
            .collect();
        // the others agree among themselves
        let alike = among.iter().all(|times| (1.0 / LIKE..LIKE).contains(times));
        // the same noise is off by less in a larger field
        let off = among.iter().zip(others);
        let off = off.map(|(times, &t)| ((times - 1.0) * self.size[t] / self.size[s]).powi(2));
        let scatter = (off.sum::<f64>() / others.len() as f64).sqrt();
        let sure = (SURE * error).max(BEYOND_OTHERS * scatter);
        let odd = !(1.0 / NEAR..NEAR).contains(&own) && (own - 1.0).abs() > sure;
        (odd && alike && others.len() >= 2).then_some(own)
    }

    /// Every field looks like the others. Two fields cannot tell which is odd.
    fn check(&self, files: &[&Path]) -> Result<Vec<String>> {
        let mut warnings = Vec::new();
        if self.steps.len() < 3 {
            return Ok(warnings);
        }
        for s in 0..self.steps.len() {
            let others = self.others(&[s]);
            let (cosine, left) = self.against(s, &others);
            let of = |&t: &usize| self.against(t, &self.others(&[s, t]));
            let (mut alike, mut theirs): (Vec<f64>, Vec<f64>) = others.iter().map(of).unzip();
            let ratio = left / median(&mut theirs).max(f64::MIN_POSITIVE);
            if median(&mut alike) < ALIKE {
                continue;
            }
            let file = files[self.steps[s]].display();
            if cosine < OTHER_SPECIMEN.0 && ratio > OTHER_SPECIMEN.1 {
                return Err(Error::input(file, "a field like those of the other steps")
                    .found(format!("one whose cosine with theirs is {cosine:.2}, once rigid motion and mean strain are taken out"))
                    .hint("a step of another specimen, or after failure: leave it out of steps; or many points that failed to correlate (zeros, outliers): map columns.correlation or columns.sigma, or leave them empty in the file"));
            }
            if let Some(times) = self.odd_pattern(s, &others) {
                let said = format!(
                    "a pattern {times:.2} times as large for its mean strain as in the other steps"
                );
                let is_largest = others
                    .iter()
                    .all(|&t| self.size[t].abs() < self.size[s].abs());
                let far = !(1.0 / FAR..FAR).contains(&times);
                // yielding and damage make it larger, and more so under the largest load
                if far && !(is_largest && times > 1.0) {
                    return Err(Error::input(file, "a field like those of the other steps")
                        .found(said)
                        .hint(
                            "a step of another specimen, with another hole? leave it out of steps",
                        ));
                }
                warnings.push(format!(
                    "{file}: {said}: another specimen, or yielding or damage?"
                ));
            }
            if cosine < ODD.0 && ratio > ODD.1 {
                warnings.push(format!(
                    "{file}: the field differs in kind from the other steps' (cosine {cosine:.2} without rigid motion and mean strain). Is it of another specimen, or does something act in this step alone?"
                ));
            }
        }
        Ok(warnings)
    }
}
