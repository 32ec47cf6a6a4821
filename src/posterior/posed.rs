//! A density with what its draws need to be completed and to be held against the full model.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::complete::GivenChoice;
use super::density::{ConstantsPrior, MixtureChoice, PosteriorDensity};
use super::equations::Equations;
use super::expansion::TestExpansion;
use super::noise_choices::{NoiseChoices, NoisePair};
use super::space::{LinearRole, Space, linear, shown, stacked};
use crate::error::Result;
use crate::infer::Model;
use crate::linearise::{Measured, StepStack};

/// What a density is of: linear columns, choices of the noise, and the parts that are summed.
pub struct Composition {
    /// Which of the linear columns take part, and whose they are.
    pub kept: Vec<usize>,
    pub whose: Vec<LinearRole>,
    /// Their largest prior sds, over their own.
    pub largest: DVector<f64>,
    pub pairs: Vec<NoisePair>,
    pub parts: Vec<MixtureChoice>,
}

/// A density with its test.
pub struct Posed {
    pub density: PosteriorDensity,
    pub expanded: Arc<TestExpansion>,
    pub measured: Arc<Measured>,
    pub noise: Arc<dyn NoiseChoices>,
    /// Which of the linear columns take part.
    pub kept: Vec<usize>,
    pub pairs: Vec<NoisePair>,
    /// Columns of [`stacked`], (u1, u2).
    pub columns: [DMatrix<f64>; 2],
    /// X' C^-1 X of those under each of the pairs.
    pub grams: Vec<DMatrix<f64>>,
}

impl Posed {
    /// Of an account of a test that was expanded.
    ///
    /// # Errors
    /// Of the program: columns that are not finite.
    pub fn new(
        model: &Model,
        (expanded, measured): (Arc<TestExpansion>, Arc<Measured>),
        noise: Arc<dyn NoiseChoices>,
        account: Composition,
    ) -> Result<Self> {
        let Composition {
            kept,
            whose,
            largest,
            pairs,
            parts,
        } = account;
        let here = &expanded.here;
        // of the columns as they are here: at another point other combinations are not seen
        let own = [0, 1].map(|c| shown(here, &kept, c));
        let blocks = &measured.blocks;
        let mut gram = DMatrix::zeros(kept.len(), kept.len());
        for of_pair in noise.grams(blocks, [&own[0], &own[1]], &pairs)? {
            gram += of_pair;
        }
        let space = Space::new(whose, largest, &gram);
        let columns = [0, 1].map(|c| stacked(here, &expanded, &measured, &space, &kept, c));
        let grams = noise.grams(blocks, [&columns[0], &columns[1]], &pairs)?;
        let directions = space.directions();
        let equations = |g: &DMatrix<f64>| Equations::new(g, directions, here.constants);
        let prior = ConstantsPrior {
            material: model.material(),
            marginals: model.marginals(),
            known: model.known.clone(),
        };
        let surface = expanded.surface.clone();
        let equations = grams.iter().map(equations).collect();
        Ok(Self {
            density: PosteriorDensity::new(prior, surface, space, equations, parts),
            expanded,
            measured,
            noise,
            kept,
            pairs,
            columns,
            grams,
        })
    }

    /// How many values the density can follow, and under the first noise what is left orthogonally to all of them.
    fn projected(&self) -> (usize, f64) {
        let Some(gram) = self.grams.first() else {
            return (0, 0.0);
        };
        let tail = (1 + self.expanded.here.constants) * self.density.space.directions();
        // the data stand behind the columns in the directions
        let own: Vec<usize> = (0..gram.nrows()).filter(|k| *k != tail).collect();
        let scale: Vec<f64> = own
            .iter()
            .map(|&k| gram[(k, k)].max(f64::MIN_POSITIVE).sqrt())
            .collect();
        let n = own.len();
        let unit = DMatrix::from_fn(n, n, |i, j| gram[(own[i], own[j])] / (scale[i] * scale[j]));
        let right = DVector::from_fn(n, |i, _| gram[(own[i], tail)] / scale[i]);
        let eigen = SymmetricEigen::new(unit);
        let along = eigen.eigenvectors.tr_mul(&right);
        let largest = eigen.eigenvalues.amax();
        let each = eigen.eigenvalues.iter().zip(along.iter());
        let seen: Vec<f64> = each
            .filter(|(v, _)| **v > RANK * largest)
            .map(|(v, a)| a * a / v)
            .collect();
        (seen.len(), gram[(tail, tail)] - seen.iter().sum::<f64>())
    }

    /// How many values the density can follow.
    pub fn followed(&self) -> usize {
        self.projected().0
    }

    /// The same without what of the data is orthogonal to all that the density can follow: the noise's own contrasts know of that.
    #[must_use]
    pub fn without_contrasts(mut self) -> Self {
        let (_, left) = self.projected();
        self.density.take_from_rest(left);
        self
    }

    /// Amplitudes of all linear columns, prior sds from their means, from those that take part; zeros of the others.
    pub fn amplitudes(&self, own: &DVector<f64>) -> Vec<f64> {
        let mut all = vec![0.0; linear(&self.expanded.here).len()];
        for (&k, a) in self.kept.iter().zip(own.iter()) {
            if let Some(amplitude) = all.get_mut(k) {
                *amplitude = *a;
            }
        }
        all
    }

    /// Products of some errors of the prediction, mm, with all columns under one of the noises, columns x errors.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn products(&self, errors: &[&StepStack], noise: usize) -> Result<DMatrix<f64>> {
        let width = self.columns[0].ncols();
        let with = [0, 1].map(|c| {
            let mut all = self.columns[c]
                .clone()
                .resize_horizontally(width + errors.len(), 0.0);
            for (k, error) in errors.iter().enumerate() {
                all.set_column(width + k, &error[c]);
            }
            all
        });
        let blocks = &self.measured.blocks;
        let own = &self.pairs[noise..=noise];
        let grams = self.noise.grams(blocks, [&with[0], &with[1]], own)?;
        let shape = (width, errors.len());
        let products = |g: &DMatrix<f64>| g.view((0, width), shape).into_owned();
        Ok(grams
            .first()
            .map_or_else(|| DMatrix::zeros(shape.0, shape.1), products))
    }

    /// Change of the log likelihood at a point where the prediction gains an error of such products with the columns, to first order.
    fn change_with(&self, x: &[f64], products: &DVector<f64>, choice: &MixtureChoice) -> f64 {
        let (coordinates, factors) = self.density.place(x);
        let n = self.density.space.directions();
        let mut own = DVector::zeros(n);
        for (a, by) in coordinates.iter().enumerate() {
            own.axpy(*by, &products.rows(a * n, n), 1.0);
        }
        let tail = coordinates.len() * n;
        let left = DVector::from_column_slice(&factors).dot(&products.rows(tail, factors.len()));
        let precision = self.density.noise_scale(x).powi(-2);
        let given = GivenChoice::at(&self.density, x, choice);
        precision * (left - given.along(&own))
    }

    /// By how much an error of the prediction with some [`Posed::products`] at a draw moves the mode of the constants, sds: it changes the
    /// posterior's gradient by g = grad (log L(error) - log L), by central differences over a tenth of an sd, and the mode by one Newton step,
    /// Sigma g.
    pub fn shift_with(
        &self,
        (x, choice): (&[f64], &MixtureChoice),
        products: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> DVector<f64> {
        const STEP: f64 = 0.1;
        let sd = covariance.diagonal().map(f64::sqrt);
        let at = |k: usize, by: f64| {
            let mut moved = x.to_vec();
            moved[k] += by * sd[k];
            self.change_with(&moved, products, choice)
        };
        let slope = |k: usize, sd: f64| (at(k, STEP) - at(k, -STEP)) / (2.0 * STEP * sd);
        let gradient = DVector::from_fn(sd.len(), |k, _| slope(k, sd[k]));
        (covariance * gradient).component_div(&sd)
    }

    /// The amplitudes at a point under the first part.
    fn given(&self, x: &[f64]) -> GivenChoice<'_> {
        GivenChoice::at(&self.density, x, self.density.choice(0))
    }

    /// Square of what is left at a point with the amplitudes at their likeliest, by noise and priors, and of how many values it is. Of a
    /// linear model with normal priors the whole has as many degrees of freedom as values.
    pub fn misfit(&self, x: &[f64]) -> (f64, usize) {
        let (_, factors) = self.density.place(x);
        let left = DVector::from_column_slice(&factors);
        let tail = (1 + self.expanded.here.constants) * self.density.space.directions();
        let gram = self.grams[0].view((tail, tail), (left.len(), left.len()));
        let rest = left.dot(&(gram * &left));
        let precision = self.density.noise_scale(x).powi(-2);
        let values = self.measured.averages.iter().map(DVector::len).sum();
        (precision * rest - self.given(x).explained(), values)
    }

    /// Mean and covariance of the amplitudes of the columns that take part, prior sds from their means, at a point.
    pub fn amplitudes_at(&self, x: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let all: Vec<usize> = (0..self.kept.len()).collect();
        let (mean, covariance) = self.given(x).moments(&all);
        let largest = &self.density.space.largest;
        let scaled = DMatrix::from_fn(all.len(), all.len(), |i, j| {
            covariance[(i, j)] * largest[i] * largest[j]
        });
        (mean.component_mul(largest), scaled)
    }

    /// What is left of the block averages at a point and amplitudes of the columns that take part, mm.
    pub fn left(&self, x: &[f64], own: &DVector<f64>) -> StepStack {
        self.left_by(&self.columns, x, own)
    }

    /// The same by columns on another mesh.
    pub(super) fn left_by(
        &self,
        columns: &[DMatrix<f64>; 2],
        x: &[f64],
        own: &DVector<f64>,
    ) -> StepStack {
        let space = &self.density.space;
        let gamma = space.seen.tr_mul(&own.component_div(&space.largest));
        let (coordinates, factors) = self.density.place(x);
        let directions = coordinates
            .iter()
            .flat_map(|x| gamma.iter().map(move |g| -x * g));
        let all = directions.chain(factors.iter().copied());
        let coefficients = DVector::from_vec(all.collect());
        [0, 1].map(|c| &columns[c] * &coefficients)
    }
}

/// Columns of unit length are independent to this share of the largest eigenvalue of their products.
const RANK: f64 = 1e-9;
