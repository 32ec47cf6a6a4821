//! The measured field seen by the reduced model: the modes' and declared effects' columns at the measured points.

use super::model::Model;
use super::steps::Steps;
use crate::effect::{amplitude_name, one_unit};
use crate::error::{Error, Result};
use crate::experiment::{FieldSolver, Sight, StepForces};
use crate::field::deviant::deviant_points;
use crate::field::{Field, Reason, Series};
use crate::laminate::MeanSd;
use crate::noise::residual_of_fit;
use crate::reduce::ReducedModel;

/// The measured points on the plate.
#[derive(Clone)]
pub struct Observation {
    /// The field, without points outside the plate.
    pub field: Field,
    /// Its points, and the outliers' places that the gauge counts.
    pub sight: Sight,
    /// Declared effects of the recording, which have been taken out of the field.
    pub recorded: Vec<RecordedAmplitude>,
    /// The steps of a load series, where it is one.
    pub steps: Option<Steps>,
    /// What declared effects do to the field of a series.
    pub stepped: Vec<SteppedColumn>,
}

/// A parameter of a declared effect of a series, with its field.
#[derive(Clone)]
pub struct SteppedColumn {
    pub name: String,
    /// Prior, border units.
    pub prior: MeanSd,
    /// For one border unit, mm, at the measured points.
    pub field: Vec<[f64; 2]>,
}

/// One amplitude of a declared effect of the recording, in its border unit.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedAmplitude {
    /// `effect.parameter`.
    pub name: String,
    pub mean: f64,
    pub sd: f64,
}

/// Columns at the measured points: `columns[k][i]` = (u1, u2) in mm of unit amplitude of column k at point i.
pub struct UnitColumns {
    /// POD modes of u1, then of u2, for one mm of coefficient.
    pub modes: Vec<Vec<[f64; 2]>>,
    /// Declared additive effects, for one border unit of amplitude.
    pub effects: Vec<Vec<[f64; 2]>>,
    /// Name of each effect column, `effect.parameter`.
    pub names: Vec<String>,
    /// Prior mean of each effect column's amplitude, and standard deviation; `None` is flat.
    pub prior_mean: Vec<f64>,
    pub prior_sd: Vec<Option<f64>>,
}

/// Share of points outside the plate above which the geometry cannot be right.
const MOST_OUTSIDE: f64 = 0.2;

impl Observation {
    /// Locate the points of a field; those outside the plate or in the hole are dropped and counted.
    ///
    /// # Errors
    /// Of the input: a field of which much lies beside the plate.
    pub fn new(field: Field, experiment: &dyn FieldSolver) -> Result<Self> {
        Ok(Self::located(field, experiment)?.0)
    }

    /// The same of a load series.
    ///
    /// # Errors
    /// Those of [`Observation::new`].
    pub fn of_series(
        series: &Series,
        forces: StepForces,
        experiment: &dyn FieldSolver,
    ) -> Result<Self> {
        let (own, kept) = Self::located(series.field.clone(), experiment)?;
        Ok(Self {
            steps: Some(Steps::new(series, forces, &kept)),
            ..own
        })
    }

    /// The points on the plate, and which of the field's those are.
    fn located(mut field: Field, experiment: &dyn FieldSolver) -> Result<(Self, Vec<bool>)> {
        let count = field.len();
        let (sight, inside) = experiment.locate(&field.points, &field.outlying);
        let dropped = field.retain(Reason::OutsidePlate, |i| inside[i]);
        field.outlying = sight.all()[field.len()..].to_vec();
        if dropped as f64 > MOST_OUTSIDE * count as f64 {
            let [s, t] = experiment.scene().setup.geometry.extents();
            return Err(Error::input("measurement", "points on the plate")
                .found(format!("{dropped} of {count} points outside the plate or in the hole"))
                .hint(format!(
                    "the plate spans {s:?} mm along the load and {t:?} mm across it, from the hole's centre; check loading_axis, hole_center_in_data_mm, the units and the specimen's dimensions"
                )));
        }
        let own = Self {
            field,
            sight,
            recorded: Vec::new(),
            steps: None,
            stepped: Vec::new(),
        };
        Ok((own, inside))
    }

    /// Drop points as outliers and count them. Returns how many went.
    pub fn drop_outliers(&mut self, keep: impl Fn(usize) -> bool) -> usize {
        self.sight.set_aside(&keep);
        if let Some(steps) = &mut self.steps {
            steps.retain(&keep);
        }
        self.field.retain(Reason::Outlier, &keep)
    }

    /// Drop points whose residual from a least-squares fit of the modes and any affine displacement contradicts the
    /// residuals around them. Returns how many went.
    pub fn drop_deviant_points(
        &mut self,
        reduced: &ReducedModel,
        experiment: &dyn FieldSolver,
    ) -> usize {
        let modes = reduced.columns(experiment, &self.sight);
        let residual = residual_of_fit(&self.field, &modes);
        let deviant = deviant_points(&self.field.points, &residual);
        self.drop_outliers(|i| !deviant[i])
    }

    /// Evaluate modes and the model's additive effects at the points, under the gauge.
    ///
    /// # Errors
    /// Those of [`crate::experiment::Mechanics::added`].
    pub fn columns(
        &self,
        reduced: &ReducedModel,
        experiment: &dyn FieldSolver,
        model: &Model,
    ) -> Result<UnitColumns> {
        let mut columns = UnitColumns {
            modes: reduced.columns(experiment, &self.sight),
            effects: Vec::new(),
            names: Vec::new(),
            prior_mean: Vec::new(),
            prior_sd: Vec::new(),
        };
        for effect in model.additive() {
            for (k, parameter) in effect.parameters().iter().enumerate() {
                let field = experiment.added(effect, &one_unit(effect, k), &self.sight)?;
                columns.effects.push(field);
                columns.names.push(amplitude_name(effect, parameter));
                columns.prior_mean.push(0.0);
                columns.prior_sd.push(model.prior_sd(effect, k));
            }
        }
        for stepped in &self.stepped {
            columns.effects.push(stepped.field.clone());
            columns.names.push(stepped.name.clone());
            columns.prior_mean.push(stepped.prior.mean);
            columns.prior_sd.push(Some(stepped.prior.sd));
        }
        Ok(columns)
    }
}
