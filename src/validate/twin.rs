//! A simulated measurement of a model: fields over a lattice of points, with known constants and known noise.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use crate::effect::{Acting, Effect};
use crate::error::{Error, Result};
use crate::experiment::State;
use crate::field::Field;
use crate::identify::{InverseProblem, Prepared, inverse_problem};
use crate::infer::{Model, Observation};
use crate::noise::matern_pair;
use crate::numeric::add_scaled;
use crate::progress::Silent;
use crate::quantity::NM_PER_MM;

/// What is true of one simulated measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct TwinTruth {
    /// Constants, then amplitudes of effects with fields of their own, border units.
    pub theta: Vec<f64>,
    pub thickness_mm: f64,
    /// Amplitudes of the declared closed-form effects, border units.
    pub additive: Vec<f64>,
    /// Noise sd of a point, nm.
    pub noise_nm: f64,
}

/// A model with a lattice of points in place of its measurement.
pub struct Twin {
    /// Problem, reduced model; the observation has the lattice's points and no displacement.
    pub prepared: Prepared,
    /// Declared effects that need fields of their own, and those that add a known one.
    effects: [Vec<&'static dyn Effect>; 2],
    shape: [usize; 2],
    spacing: [f64; 2],
    /// Place of each point in the lattice.
    index: Vec<usize>,
}

impl Twin {
    /// A lattice of `side` x `side` points over the measured window of `prepared`, without those in the hole.
    ///
    /// # Errors
    /// Of the input, if too few points are left.
    pub fn new(model: &Model, prepared: Prepared, side: usize) -> Result<Self> {
        if !(8..=1000).contains(&side) {
            return Err(Error::input("--grid", "8 to 1000 points along a side").found(side));
        }
        let [low, high] = prepared.problem.experiment.window();
        let spacing = [0, 1].map(|k| (high[k] - low[k]) / (side - 1) as f64);
        let at = |i: usize| [i / side, i % side];
        let points: Vec<[f64; 2]> = (0..side * side)
            .map(|i| [0, 1].map(|k| low[k] + spacing[k] * at(i)[k] as f64))
            .collect();
        let experiment = prepared.problem.experiment.clone();
        let (sight, inside) = experiment.locate(&points, &[]);
        let index: Vec<usize> = (0..points.len()).filter(|&i| inside[i]).collect();
        let points = sight.points().to_vec();
        let field = Field {
            displacement: vec![[0.0; 2]; points.len()],
            points,
            ..Field::empty(experiment.scene().frame)
        };
        let prepared = Prepared {
            observation: Observation::new(field, &*experiment)?,
            ..prepared
        };
        Ok(Self {
            effects: [model.sampled(), model.additive()],
            prepared,
            shape: [side, side],
            spacing,
            index,
        })
    }

    /// The posterior of a field `u` (mm) with noise on it.
    ///
    /// # Errors
    /// Those of [`inverse_problem`].
    pub fn posterior(
        &self,
        model: &Model,
        mut u: Vec<[f64; 2]>,
        noise: &[[f64; 2]],
    ) -> Result<InverseProblem> {
        add_scaled(&mut u, noise, 1.0);
        let mut prepared = self.prepared.clone();
        prepared.observation.field.displacement = u;
        inverse_problem(model, prepared, &Silent)
    }

    /// The noise-free field (mm) by the finite elements.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn finite_elements(&self, truth: &TwinTruth) -> Result<Vec<[f64; 2]>> {
        let constants = self.prepared.problem.constants();
        let (own, amplitudes) = truth.theta.split_at(constants);
        let mut amplitudes = amplitudes.iter().chain(&truth.additive).copied();
        let acting = |effect: &&'static dyn Effect| Acting {
            effect: *effect,
            amplitude: amplitudes
                .by_ref()
                .take(effect.parameters().len())
                .collect(),
        };
        let acting: Vec<Acting> = self.effects.iter().flatten().map(acting).collect();
        let state = State::new(own, truth.thickness_mm).with(acting);
        Ok(self.prepared.predict(&state)?.field)
    }

    /// Noise (mm) of sd `noise_nm` a point: white, or with a Matern-3/2 correlation of length `correlation_mm`.
    pub fn noise(&self, noise_nm: f64, correlation_mm: f64, seed: u64) -> Vec<[f64; 2]> {
        let sd = noise_nm / NM_PER_MM;
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        if correlation_mm == 0.0 {
            let mut one = || -> f64 {
                let z: f64 = StandardNormal.sample(&mut rng);
                sd * z
            };
            return (0..self.index.len()).map(|_| [one(), one()]).collect();
        }
        let [a, b] = matern_pair(self.shape, self.spacing, correlation_mm, &mut rng);
        let value = |&i: &usize| [sd * a[i], sd * b[i]];
        self.index.iter().map(value).collect()
    }
}
