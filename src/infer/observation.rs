//! The measured field seen by the reduced model: the modes' and declared effects' columns at the measured points.

use super::steps::Steps;
use crate::error::{Error, Result};
use crate::experiment::{FieldSolver, PointSet, StepForces};
use crate::field::deviant::deviant_points;
use crate::field::{Field, Reason, Series};
use crate::noise::residual_of_fit;

/// The measured points on the plate.
#[derive(Clone)]
pub struct Observation {
    /// The field, without points outside the plate.
    pub field: Field,
    /// Its points, and the outliers' places that the gauge counts.
    pub sight: PointSet,
    /// Declared effects of the recording, which have been taken out of the field.
    pub recorded: Vec<RecordedAmplitude>,
    /// The steps of a load series, where it is one.
    pub steps: Option<Steps>,
}

/// One amplitude of a declared effect of the recording, in its border unit.
#[derive(Debug, Clone)]
pub struct RecordedAmplitude {
    /// `effect.parameter`.
    pub name: String,
    pub mean: f64,
    pub sd: f64,
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

    /// Drop points whose residual from a least-squares fit of some modes (u1's, then u2's) and any affine displacement contradicts the
    /// residuals around them. Returns how many went.
    pub fn drop_deviant_points(&mut self, modes: &[Vec<[f64; 2]>]) -> usize {
        let residual = residual_of_fit(&self.field, modes);
        let deviant = deviant_points(&self.field.points, &residual);
        self.drop_outliers(|i| !deviant[i])
    }
}
