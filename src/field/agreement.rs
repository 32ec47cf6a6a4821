//! Whether the steps of a series are what they are said to be: no field stands twice, every field is of the same specimen, and the
//! forces go with the fields.
//!
//! What is compared is the size of a step, the difference of its mean strains along and across the load: a lens, a
//! temperature or a motion towards the camera strains a picture alike in all directions and does not enter. Yielding
//! adds to the size and never takes from it as long as the force does not sink, which fixes what a contradiction is.

use std::path::Path;

use rayon::prelude::*;

use super::rigid;
use super::series::Series;
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

/// Of two steps, the larger force must not have the smaller size. Least differences of force and of size, as shares of the
/// largest force and of the range of sizes, that make a contradiction and a warning.
const CONTRADICTION: [f64; 2] = [0.15, 0.05];
const DOUBT: [f64; 2] = [0.03, 0.02];

/// Forces this many times apart are different.
const FACTOR: f64 = 1.5;

/// The other steps are proportional to their forces within this share of the range of sizes.
const STRAIGHT: f64 = 0.1;

/// No two steps have the same displacements.
///
/// # Errors
/// Of the input, naming both files.
pub(super) fn check_different(series: &Series, files: &[&Path]) -> Result<()> {
    let largest = |u: &[[f64; 2]]| u.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    for (t, later) in series.steps.iter().enumerate() {
        let bound = COPY * largest(&later.displacement);
        let copied = series.steps[..t].iter().position(|earlier| {
            let pairs = earlier.displacement.iter().zip(&later.displacement);
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
                files[s].display(),
                files[t].display()
            ))
            .hint("one state of the test stands in two files: leave one of them out"));
        }
    }
    Ok(())
}

/// A field with its rigid motion and mean strain taken out, and what these were.
struct Shape {
    /// Mean strain along the load less that across it.
    size: f64,
    /// What is left, mm.
    rest: Vec<[f64; 2]>,
}

/// Check the fields against each other and against their forces; what is odd but possible is returned as warnings.
///
/// # Errors
/// Of the input, naming the files: a field of another specimen, forces that contradict the fields.
pub(super) fn check(series: &Series, files: &[&Path]) -> Result<Vec<String>> {
    let points = &series.field.points;
    let shapes: Option<Vec<Shape>> = series
        .steps
        .par_iter()
        .map(|step| Shape::new(points, &step.displacement))
        .collect();
    // points on one line have no strain
    let Some(shapes) = shapes else {
        return Ok(Vec::new());
    };
    let likeness = Likeness::new(&shapes);
    let mut warnings = likeness.check(files)?;
    let [low, high] = series.field.bounds();
    let extent = (0..2)
        .map(|k| high[k] - low[k])
        .fold(f64::INFINITY, f64::min);
    let known: Vec<Loaded> = series
        .steps
        .iter()
        .zip(&shapes)
        .enumerate()
        .map(|(step, (s, shape))| Loaded {
            step,
            force: s.force_n,
            size: shape.size,
        })
        .collect();
    // a residual over half the window looks like this strain at most
    let noise = likeness.residual() / (0.5 * extent);
    warnings.extend(Forces::new(known, noise).check(files)?);
    Ok(warnings)
}

impl Shape {
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
    fn new(shapes: &[Shape]) -> Self {
        let largest = shapes.iter().map(|s| s.size.abs()).fold(0.0, f64::max);
        let loaded = |k: &usize| shapes[*k].size.abs() > LOADED * largest;
        let steps: Vec<usize> = (0..shapes.len()).filter(loaded).collect();
        let dot = |a: &Shape, b: &Shape| -> f64 {
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
                    .hint("a step of another specimen, or after failure? leave it out of steps"));
            }
            if cosine < ODD.0 && ratio > ODD.1 {
                warnings.push(format!(
                    "{file}: the field differs in kind from the other steps' (cosine {cosine:.2} without rigid motion and mean strain): another specimen, or something that acts in this step alone?"
                ));
            }
        }
        Ok(warnings)
    }
}

/// A step with its force, N, if it is known, and its size.
#[derive(Clone, Copy)]
struct Loaded {
    step: usize,
    force: Option<f64>,
    size: f64,
}

/// The sizes against the forces, all forces at least 0.
struct Forces {
    steps: Vec<Loaded>,
    /// Largest force and range of sizes, of the steps whose force is known.
    largest: f64,
    range: f64,
    /// A size that noise may make.
    noise: f64,
}

impl Forces {
    /// Compression is turned into tension. Where both occur nothing is judged.
    fn new(mut steps: Vec<Loaded>, noise: f64) -> Self {
        let known = |steps: &[Loaded]| -> Vec<(f64, f64)> {
            let both = steps.iter().filter_map(|s| Some((s.force?, s.size)));
            both.collect()
        };
        let forces = known(&steps);
        let negative = forces.iter().any(|(f, _)| *f < 0.0);
        if negative && forces.iter().any(|(f, _)| *f > 0.0) {
            steps.clear();
        }
        if negative {
            for s in &mut steps {
                s.force = s.force.map(|f| -f);
                s.size = -s.size;
            }
        }
        let forces = known(&steps);
        let fold = |start: f64, pick: fn(f64, f64) -> f64| {
            forces.iter().map(|(_, size)| *size).fold(start, pick)
        };
        let range = fold(f64::NEG_INFINITY, f64::max) - fold(f64::INFINITY, f64::min);
        Self {
            largest: forces.iter().map(|(f, _)| *f).fold(0.0, f64::max),
            range: if range.is_finite() { range } else { 0.0 },
            steps,
            noise,
        }
    }

    fn check(&self, files: &[&Path]) -> Result<Vec<String>> {
        if self.largest <= 0.0 || self.range <= 10.0 * self.noise {
            return Ok(Vec::new());
        }
        let said = |s: &Loaded| {
            let force = s.force.unwrap_or(0.0);
            format!(
                "{} ({force} N, strain {:.6})",
                files[s.step].display(),
                s.size
            )
        };
        if let Some((less, more)) = self.contradiction(CONTRADICTION) {
            let place = format!("steps[{}].force_N", more.step);
            return Err(Error::input(place, "forces that go with the fields")
                .found(format!("a larger force with a smaller strain: {} and {}", said(more), said(less)))
                .hint("forces or files in another order? Strain here is along the load less across it; it grows with a tensile force if loading_axis is right and displacements are deformed minus reference"));
        }
        let mut warnings = Vec::new();
        if let Some((less, more)) = self.contradiction(DOUBT) {
            warnings.push(format!(
                "a larger force has the smaller strain: {} and {}; forces of two steps interchanged?",
                said(more),
                said(less)
            ));
        }
        for s in &self.steps {
            let Some((force, implied)) = s.force.zip(self.implied(s)) else {
                continue;
            };
            let file = files[s.step].display();
            if force > LOADED * self.largest && implied < force / FACTOR {
                let place = format!("steps[{}].force_N", s.step);
                return Err(Error::input(place, format!("about {implied:.0}, by the field of {file} and the other steps"))
                    .found(force)
                    .hint("a wrong force, a step of another specimen, or a field in another unit? null if the force is not known"));
            }
            if implied > FACTOR * force && implied - force > LOADED * self.largest {
                warnings.push(format!(
                    "{file}: the field is that of {implied:.0} N rather than {force} N, by the other steps: yielding, or a wrong force?"
                ));
            }
        }
        Ok(warnings)
    }

    /// Two steps of which the larger force has the smaller size: the step with the smaller force first.
    ///
    /// Plastic strain never shrinks under tension: a later step with the larger force is larger whatever came between, an
    /// earlier one if no larger force came between.
    fn contradiction(&self, [gap, reversed]: [f64; 2]) -> Option<(&Loaded, &Loaded)> {
        let by = (reversed * self.range).max(3.0 * self.noise);
        let contradicts = |less: &Loaded, more: &Loaded| {
            let forces = less.force.zip(more.force);
            forces.is_some_and(|(a, b)| b - a > gap * self.largest) && less.size - more.size > by
        };
        let pairs = (0..self.steps.len()).flat_map(|t| (0..t).map(move |s| (s, t)));
        for (s, t) in pairs {
            let (earlier, later) = (&self.steps[s], &self.steps[t]);
            if contradicts(earlier, later) {
                return Some((earlier, later));
            }
            let between = &self.steps[s + 1..t];
            let peak = |b: &Loaded| b.force.is_none_or(|f| earlier.force.is_some_and(|e| f > e));
            if contradicts(later, earlier) && !between.iter().any(peak) {
                return Some((later, earlier));
            }
        }
        None
    }

    /// The force that the size of step `s` has by a straight line through at least three others, if they lie on one.
    fn implied(&self, s: &Loaded) -> Option<f64> {
        const FEWEST: usize = 3;
        let others = self.steps.iter().filter(|o| o.step != s.step);
        let others: Vec<(f64, f64)> = others.filter_map(|o| Some((o.force?, o.size))).collect();
        let n = others.len() as f64;
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| others.iter().map(f).sum::<f64>() / n;
        let (force, size) = (mean(&|o| o.0), mean(&|o| o.1));
        let variance = mean(&|o| (o.0 - force).powi(2));
        let slope = mean(&|o| (o.0 - force) * (o.1 - size)) / variance;
        if others.len() < FEWEST || !(slope.is_finite() && slope > 0.0) {
            return None;
        }
        let spread = others.iter().map(|o| o.1);
        let range =
            spread.clone().fold(f64::NEG_INFINITY, f64::max) - spread.fold(f64::INFINITY, f64::min);
        let off = |o: &(f64, f64)| (o.1 - size - slope * (o.0 - force)).abs();
        let straight = others.iter().all(|o| off(o) <= STRAIGHT * range);
        (straight && range > 10.0 * self.noise).then(|| force + (s.size - size) / slope)
    }
}
