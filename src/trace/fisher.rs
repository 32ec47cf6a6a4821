//! What a field would say of the constants before it is measured: the Fisher information of the test linearised at the prior means.

use nalgebra::{DMatrix, DVector};

use super::blind_spot::{detectable, prior_odds};
use crate::effect::Scope;
use crate::error::{Error, Result};
use crate::experiment::predict;
use crate::experiment::series::SeriesState;
use crate::infer::{EffectUnderLaw, Model, experiment_over};
use crate::linearise::candidates;
use crate::linearise::{AtPoints, Column, Forward, Slopes};
use crate::noise::NormalEquations;

/// What an experiment would say of the constants, all in prior sds from the prior means.
#[derive(Debug, Clone)]
pub struct Information {
    /// Precision that it adds to the prior's where nothing acts that is not declared, and where every effect of the dictionary may act
    /// at its plausible size.
    pub alone: DMatrix<f64>,
    pub with_effects: DMatrix<f64>,
    /// Effects that are not declared.
    pub hidden: Vec<Hidden>,
}

/// An effect's parameter that the model lacks.
#[derive(Debug, Clone)]
pub struct Hidden {
    /// `effect.parameter`.
    pub parameter: String,
    /// Its plausible size, border units.
    pub plausible: f64,
    /// What it would do to the constants at that size, undeclared.
    pub shift: DVector<f64>,
    /// The amplitude that the residual would show.
    pub detectable: f64,
}

impl Information {
    /// An experiment to which no effect of the dictionary is known.
    pub fn plain(precision: DMatrix<f64>) -> Self {
        Self {
            alone: precision.clone(),
            with_effects: precision,
            hidden: Vec::new(),
        }
    }
}

/// The information of a field of a model at points ((s, t), mm) whose displacements have a sd of `sd_mm` each.
///
/// # Errors
/// A specimen that cannot be meshed; too few points on it.
pub fn field_information(model: &Model, points: &[[f64; 2]], sd_mm: f64) -> Result<Information> {
    let experiment = experiment_over(model, crate::field::bounds(points), 1.0)?;
    let (_, inside) = experiment.locate(points, &[]);
    let kept = points.iter().zip(&inside).filter(|(_, inside)| **inside);
    let kept: Vec<[f64; 2]> = kept.map(|(p, _)| *p).collect();
    let (sight, _) = experiment.locate(&kept, &[]);
    let state = model.state(&|_| None);
    let field = predict(&*experiment, &state, &sight)?.field;
    let square: f64 = field.iter().flatten().map(|u| u * u).sum();
    let forward = Forward {
        model,
        observing: Box::new(AtPoints {
            experiment: &*experiment,
            size_mm: (square / kept.len().max(1) as f64).sqrt(),
            slopes: Slopes::Points(&sight),
        }),
        solves_width: false,
        step: &|| (),
    };
    let (mut effects, _) = candidates(model);
    // of one field to be measured the force is that of the load's scale
    effects.retain(|e| e.scope() != Scope::Force);
    let sought = EffectUnderLaw::without_laws(&effects);
    let state = SeriesState::of_one_step(state);
    let found = forward.sensitivities(&state, &forward.declared(), &sought)?;
    // where the specimen stands is nobody's account
    let sought = found.candidates.iter().flat_map(|c| &c.columns);
    let (rigid, sought): (Vec<&Column>, Vec<&Column>) = sought.partition(|c| c.is_rigid());
    let own: Vec<&Column> = found.base.iter().chain(rigid).collect();
    let all: Vec<&Column> = own.iter().chain(&sought).copied().collect();
    let gram = gram(&all) / (sd_mm * sd_mm);
    let n = found.constants;
    let p = own.len();
    let block = |i: usize, j: usize, rows: usize, columns: usize| {
        gram.view((i, j), (rows, columns)).into_owned()
    };
    let fail = || Error::program("trace::fisher", "finite columns");
    let beside = |count: usize| {
        let others = NormalEquations::with_unit_prior(
            block(n, n, count - n, count - n),
            DVector::zeros(count - n),
        );
        let across = block(n, 0, count - n, n);
        let others = others.ok_or_else(fail)?;
        Ok::<_, Error>(block(0, 0, n, n) - across.tr_mul(&others.solve(&across)))
    };
    let base = NormalEquations::with_unit_prior(block(0, 0, p, p), DVector::zeros(p));
    let across = block(0, p, p, sought.len());
    let shift = base.ok_or_else(fail)?.solve(&across);
    let odds = prior_odds(found.candidates.len());
    let hidden = sought.iter().enumerate().map(|(k, column)| {
        let seen = gram[(p + k, p + k)] - across.column(k).dot(&shift.column(k));
        Hidden {
            parameter: column.name.clone(),
            plausible: column.sd,
            shift: shift.view((0, k), (n, 1)).column(0).into_owned(),
            detectable: column.sd * detectable(seen, odds),
        }
    });
    Ok(Information {
        hidden: hidden.collect(),
        alone: beside(p)?,
        with_effects: beside(all.len())?,
    })
}

/// X'X of columns over both components.
fn gram(columns: &[&Column]) -> DMatrix<f64> {
    let of = |c: usize| {
        let values: Vec<DVector<f64>> = columns.iter().map(|k| k.values[c].clone()).collect();
        DMatrix::from_columns(&values)
    };
    let [first, second] = [of(0), of(1)];
    first.tr_mul(&first) + second.tr_mul(&second)
}
