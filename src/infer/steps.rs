//! A load series at the points of an observation, and the one field that holds what grows with the load.

use crate::experiment::StepForces;
use crate::field::Series;
use crate::field::rigid::{self, RigidMotion};

/// The steps of a series.
#[derive(Clone)]
pub struct Steps {
    pub names: Vec<String>,
    /// Force of each step over the nominal one: as declared, or as the size of the step's field has it.
    pub loads: Vec<f64>,
    /// Whether the force is declared.
    pub known: Vec<bool>,
    /// Sd of the error of a declared force in its own step, percent of it.
    pub force_sd_percent: f64,
    /// Displacement of each step as it was reported, mm, one a point of the observation.
    pub displacement: Vec<Vec<[f64; 2]>>,
    /// Motion of the specimen in the plane in each step, by least squares.
    pub rigid: Vec<RigidMotion>,
    /// What is odd about the files.
    pub warnings: Vec<String>,
}

/// Loads that vary by less over a series than this part of the largest do not tell a constant from what grows with the load.
const VARIES: f64 = 0.05;

/// Weights of steps of some loads in the field that grows with the load.
pub fn with_the_load(loads: &[f64]) -> Vec<f64> {
    let count = loads.len() as f64;
    let mean = loads.iter().sum::<f64>() / count;
    let largest = loads.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    let spread = loads.iter().map(|f| (f - mean).powi(2)).sum::<f64>();
    let about = if (spread / count).sqrt() > VARIES * largest {
        mean
    } else {
        0.0
    };
    let norm: f64 = loads.iter().map(|f| (f - about) * f).sum();
    loads.iter().map(|f| (f - about) / norm).collect()
}

impl Steps {
    /// The steps of a series at the points that are `kept`.
    pub fn new(series: &Series, forces: StepForces, kept: &[bool]) -> Self {
        let held = |all: &[[f64; 2]]| -> Vec<[f64; 2]> {
            let pairs = all.iter().zip(kept);
            pairs.filter(|(_, kept)| **kept).map(|(u, _)| *u).collect()
        };
        let points = held(&series.field.points);
        let displacement: Vec<Vec<[f64; 2]>> =
            series.steps.iter().map(|s| held(&s.displacement)).collect();
        let rigid: Vec<RigidMotion> = displacement
            .iter()
            .map(|u| rigid::fit(&points, u))
            .collect();
        let mut steps = Self {
            names: series.steps.iter().map(|s| s.name.clone()).collect(),
            loads: series
                .steps
                .iter()
                .map(|s| s.force_n.unwrap_or(0.0) / forces.nominal_n)
                .collect(),
            known: series.steps.iter().map(|s| s.force_n.is_some()).collect(),
            force_sd_percent: forces.sd_percent,
            displacement,
            rigid,
            warnings: series.warnings.clone(),
        };
        steps.guess_loads(&points, series.reference);
        steps
    }

    /// Forces that are not known, from the size of each field along that of the reference step.
    fn guess_loads(&mut self, points: &[[f64; 2]], reference: usize) {
        let pattern = self.strained(points, reference);
        let product = |a: &[[f64; 2]], b: &[[f64; 2]]| -> f64 {
            a.iter()
                .zip(b)
                .map(|(a, b)| a[0] * b[0] + a[1] * b[1])
                .sum()
        };
        let size = product(&pattern, &pattern).max(f64::MIN_POSITIVE);
        if !self.known[reference] {
            self.loads[reference] = 1.0;
        }
        for step in (0..self.loads.len()).filter(|s| *s != reference) {
            if !self.known[step] {
                let share = product(&self.strained(points, step), &pattern) / size;
                self.loads[step] = share * self.loads[reference];
            }
        }
    }

    /// Count a rotation, rad under the nominal force, for the load's.
    pub fn turn_by_the_load(&mut self, own: f64) {
        for (motion, load) in self.rigid.iter_mut().zip(&self.loads) {
            *motion = motion.with_own(load * own);
        }
    }

    /// The displacement in a step without its rigid motion, turned back into the axes of the reference picture, mm.
    pub fn strained(&self, points: &[[f64; 2]], step: usize) -> Vec<[f64; 2]> {
        let motion = &self.rigid[step];
        let pairs = points.iter().zip(&self.displacement[step]);
        pairs.map(|(p, u)| motion.released(*p, *u)).collect()
    }

    /// Weights of the steps in the field that grows with the load: free of whatever is the same in all of them where the loads vary.
    pub fn weights(&self) -> Vec<f64> {
        with_the_load(&self.loads)
    }

    /// The displacement under the nominal force, mm: that weighted sum of the steps.
    pub fn combined(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut sum = vec![[0.0; 2]; points.len()];
        for (step, weight) in self.weights().into_iter().enumerate() {
            for (sum, u) in sum.iter_mut().zip(self.strained(points, step)) {
                *sum = [sum[0] + weight * u[0], sum[1] + weight * u[1]];
            }
        }
        sum
    }

    /// Keep the points for which `keep(index)` holds.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        for displacement in &mut self.displacement {
            let mut index = 0..;
            displacement.retain(|_| index.next().is_some_and(&keep));
        }
    }
}
