//! Whether the forces of a series go with its fields. A field has a size ([`super::agreement`]), which yielding adds to and never takes
//! from as long as the force does not sink: that fixes what is a contradiction and what may be the specimen's doing.

use std::path::Path;

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

/// Of two steps, the larger force must not have the smaller size. Least differences of force and of size, as shares of the
/// largest force and of the range of sizes, that make a contradiction and a warning; and the least difference of size in
/// multiples of what the fields' other differences may make of it (a lens under millimetres of motion: 2e-4).
const CONTRADICTION: [f64; 3] = [0.15, 0.05, 2.0];
const DOUBT: [f64; 3] = [0.03, 0.02, 1.0];

/// Strain that a picture may add to a step a mm that it has moved more than another: three times the usual tilt of a camera (1e-4 a mm)
/// gave steel 40 % less of it. What may be the picture's is no contradiction.
const PICTURE_PER_MM: f64 = 3e-4;

/// Ranges of sizes below these multiples of that tell nothing of their order, or of their proportions.
const ORDERED: f64 = 5.0;
const PROPORTIONAL: f64 = 10.0;

/// Forces this many times apart are different.
const FACTOR: f64 = 1.5;

/// The other steps are proportional to their forces within this share of the range of sizes.
const STRAIGHT: f64 = 0.1;

/// A force below this share of the largest is too small to be far off by a factor, and a smaller difference is none.
const MUCH: f64 = 0.2;

/// A step with its force, N, if it is known, and its size.
#[derive(Clone, Copy)]
pub(super) struct LoadedStep {
    pub step: usize,
    pub force: Option<f64>,
    pub size: f64,
    /// How far the step has moved in the plane, mm.
    pub shift_mm: [f64; 2],
}

impl LoadedStep {
    /// What a picture may make of the difference of two sizes.
    fn optical(&self, other: &Self) -> f64 {
        let [a, b] = [0, 1].map(|k| self.shift_mm[k] - other.shift_mm[k]);
        PICTURE_PER_MM * a.hypot(b)
    }
}

/// The sizes against the forces, all forces at least 0.
pub(super) struct Forces {
    steps: Vec<LoadedStep>,
    /// Largest force and range of sizes, of the steps whose force is known.
    largest: f64,
    range: f64,
    /// A size that noise may make.
    noise: f64,
    /// Whether tension and compression occur.
    mixed: bool,
    /// What the forces were multiplied by to be tension.
    sign: f64,
}

impl Forces {
    /// Compression is turned into tension. Where both occur only signs are judged.
    pub fn new(mut steps: Vec<LoadedStep>, noise: f64) -> Self {
        let known = |steps: &[LoadedStep]| -> Vec<(f64, f64)> {
            let both = steps.iter().filter_map(|s| Some((s.force?, s.size)));
            both.collect()
        };
        let forces = known(&steps);
        let negative = forces.iter().any(|(f, _)| *f < 0.0);
        let mixed = negative && forces.iter().any(|(f, _)| *f > 0.0);
        if negative && !mixed {
            for s in &mut steps {
                s.force = s.force.map(|f| -f);
                s.size = -s.size;
            }
        }
        let sign = if negative && !mixed { -1.0 } else { 1.0 };
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
            mixed,
            sign,
        }
    }

    /// What contradicts and what is odd.
    ///
    /// # Errors
    /// Of the input: forces that contradict the fields.
    pub fn check(&self, files: &[&Path]) -> Result<Vec<String>> {
        if self.mixed {
            return self.check_signs(files).map(|()| Vec::new());
        }
        self.check_increments()?;
        if self.largest <= 0.0 || self.range <= ORDERED * self.noise {
            return Ok(Vec::new());
        }
        let said = |s: &LoadedStep| {
            // without a negative zero
            let [force, size] = [s.force.unwrap_or(0.0), s.size].map(|v| self.sign * v + 0.0);
            format!("{} ({force} N, strain {size:.6})", files[s.step].display())
        };
        if let Some((less, more)) = self.contradiction(CONTRADICTION, |a, b| self.excused(a, b)) {
            let place = format!("steps[{}].force_N", more.step);
            return Err(Error::input(place, "forces that go with the fields")
                .found(format!("a larger force with a smaller strain{}: {} and {}", if self.sign < 0.0 { ", both as compression" } else { "" }, said(more), said(less)))
                .hint("forces or files in another order, one file in another unit, or uy that counts against y (\"uy\": \"-NAME\")? Strain here is along the load less across it; it grows with a tensile force if loading_axis is right and displacements are deformed minus reference"));
        }
        let mut warnings = Vec::new();
        if let Some((less, more)) = self.contradiction(DOUBT, |_, _| 0.0) {
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
            let far = force > MUCH * self.largest && implied < force / FACTOR;
            let strain = (force - implied) * self.range / self.largest;
            if far && self.steps.iter().any(|o| s.optical(o) > strain) {
                warnings.push(format!(
                    "{file}: the field is that of {implied:.0} N rather than {force} N, by the other steps. Is the force wrong, or does the camera look at an angle?"
                ));
            } else if far {
                let place = format!("steps[{}].force_N", s.step);
                return Err(Error::input(place, format!("about {implied:.0}, by the field of {file} and the other steps"))
                    .found(force)
                    .hint("a wrong force, a step of another specimen, or a field in another unit? null if the force is not known"));
            }
            if implied > FACTOR * force && implied - force > MUCH * self.largest {
                warnings.push(format!(
                    "{file}: the field is that of {implied:.0} N rather than {force} N, by the other steps. Is the force wrong, or is it yielding?"
                ));
            }
        }
        Ok(warnings)
    }

    /// Sizes that go as the difference of a step's force from the one before, and not as the force.
    fn check_increments(&self) -> Result<()> {
        const FEWEST: usize = 3;
        const AGREE: f64 = 0.1;
        const DISAGREE: f64 = 0.3;
        let known: Vec<(f64, f64)> = self
            .steps
            .iter()
            .filter_map(|s| Some((s.force?, s.size)))
            .collect();
        let largest = known.iter().map(|(_, size)| size.abs()).fold(0.0, f64::max);
        if known.len() < FEWEST || largest <= ORDERED * self.noise {
            return Ok(());
        }
        // share of the sizes that is not in proportion
        let misfit = |of: &dyn Fn(usize) -> f64| {
            let sum = |f: &dyn Fn(usize, f64) -> f64| {
                known
                    .iter()
                    .enumerate()
                    .map(|(k, (_, s))| f(k, *s))
                    .sum::<f64>()
            };
            let slope = sum(&|k, s| of(k) * s) / sum(&|k, _| of(k).powi(2)).max(f64::MIN_POSITIVE);
            (sum(&|k, s| (s - slope * of(k)).powi(2)) / sum(&|_, s| s * s)).sqrt()
        };
        let before = |k: usize| if k == 0 { 0.0 } else { known[k - 1].0 };
        if misfit(&|k| known[k].0 - before(k)) > AGREE || misfit(&|k| known[k].0) < DISAGREE {
            return Ok(());
        }
        let list = |of: &dyn Fn(&(f64, f64)) -> String| {
            known.iter().map(of).collect::<Vec<_>>().join(", ")
        };
        Err(Error::input("steps", "strains that grow with the force")
            .found(format!("strains {} at {} N", list(&|k| format!("{:.6}", self.sign * k.1)), list(&|k| (self.sign * k.0).to_string())))
            .hint("displacements from picture to picture (incremental)? Correlate every picture with one reference picture, or add the displacements up"))
    }

    fn check_signs(&self, files: &[&Path]) -> Result<()> {
        let Some((odd, like)) = self.reversed() else {
            return Ok(());
        };
        let [file, like] = [odd, like].map(|s| files[s.step].display());
        let place = format!("steps[{}].force_N", odd.step);
        let expected = format!("the sign that the field of {file} has beside that of {like}");
        let found = odd.force.unwrap_or(0.0);
        Err(Error::input(place, expected).found(found).hint(
            "forces are positive in tension and count from the reference picture; a field changes its sign with its force",
        ))
    }

    /// A step whose field is at least half of what its force would make were its sign the other, and the step with the largest field of
    /// the rest: plastic strain that outlasts a reversal is less. The odd sign is that of fewer steps.
    fn reversed(&self) -> Option<(&LoadedStep, &LoadedStep)> {
        const HALF: f64 = 0.5;
        let forces = || self.steps.iter().filter_map(|s| Some((s.force?, s)));
        let peak = forces().map(|(f, _)| f.abs()).fold(0.0, f64::max);
        let judged = || forces().filter(|(f, _)| f.abs() > MUCH * peak);
        let by_size = |a: &(f64, &LoadedStep), b: &(f64, &LoadedStep)| {
            a.1.size.abs().total_cmp(&b.1.size.abs())
        };
        let (force, largest) = judged().max_by(by_size)?;
        if largest.size.abs() <= ORDERED * self.noise {
            return None;
        }
        let per_force = largest.size / force;
        let (mut odd, mut rest): (Vec<_>, Vec<_>) =
            judged().partition(|(f, s)| s.size / f / per_force < -HALF);
        if odd.len() > rest.len() {
            std::mem::swap(&mut odd, &mut rest);
        }
        Some((odd.first()?.1, rest.into_iter().max_by(by_size)?.1))
    }

    /// Two steps of which the larger force has the smaller size: the step with the smaller force first.
    ///
    /// Plastic strain never shrinks under tension: a later step with the larger force is larger whatever came between, an
    /// earlier one if no larger force came between.
    fn contradiction(
        &self,
        [gap, reversed, multiple]: [f64; 3],
        excused: impl Fn(&LoadedStep, &LoadedStep) -> f64,
    ) -> Option<(&LoadedStep, &LoadedStep)> {
        let by = (reversed * self.range).max(multiple * self.noise);
        let contradicts = |less: &LoadedStep, more: &LoadedStep| {
            let forces = less.force.zip(more.force);
            forces.is_some_and(|(a, b)| b - a > gap * self.largest)
                && less.size - more.size > by.max(excused(less, more))
        };
        let pairs = (0..self.steps.len()).flat_map(|t| (0..t).map(move |s| (s, t)));
        for (s, t) in pairs {
            let (earlier, later) = (&self.steps[s], &self.steps[t]);
            if contradicts(earlier, later) {
                return Some((earlier, later));
            }
            let between = &self.steps[s + 1..t];
            let peak =
                |b: &LoadedStep| b.force.is_none_or(|f| earlier.force.is_some_and(|e| f > e));
            if contradicts(later, earlier) && !between.iter().any(peak) {
                return Some((later, earlier));
            }
        }
        None
    }

    /// What a picture may make of the difference of two sizes, 0 where interchanged forces go better with the series.
    fn excused(&self, a: &LoadedStep, b: &LoadedStep) -> f64 {
        let given = |s: &LoadedStep| s.force;
        let interchanged = |s: &LoadedStep| match s.step {
            k if k == a.step => b.force,
            k if k == b.step => a.force,
            _ => s.force,
        };
        if self.misfit(given) <= self.misfit(interchanged) {
            a.optical(b)
        } else {
            0.0
        }
    }

    /// Sum of squares that is left of the sizes by what goes as the force and what goes as the motion, for these forces.
    fn misfit(&self, force: impl Fn(&LoadedStep) -> Option<f64>) -> f64 {
        let known = self.steps.iter().filter_map(|s| Some((force(s)?, s)));
        let known: Vec<(f64, &LoadedStep)> = known.collect();
        let columns = DMatrix::from_fn(known.len(), 3, |i, k| match (k, known[i]) {
            (0, (force, _)) => force / self.largest,
            (k, (_, s)) => s.shift_mm[k - 1],
        });
        let sizes = DVector::from_fn(known.len(), |i, _| known[i].1.size);
        let basis = columns.svd(true, false);
        let kept = basis.singular_values.max() * 1e-9;
        let made = basis.u.map_or(0.0, |u| {
            let along = u.tr_mul(&sizes);
            let each = along.iter().zip(basis.singular_values.iter());
            each.filter(|(_, s)| **s > kept).map(|(a, _)| a * a).sum()
        });
        sizes.norm_squared() - made
    }

    /// The force that the size of step `s` has by a straight line through at least three others, if they lie on one.
    fn implied(&self, s: &LoadedStep) -> Option<f64> {
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
        (straight && range > PROPORTIONAL * self.noise).then(|| force + (s.size - size) / slope)
    }
}
