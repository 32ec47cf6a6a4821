//! The measured field seen by the reduced model: the modes' and declared effects' columns at the measured points.

use rayon::prelude::*;

use super::model::Model;
use super::recorded::RecordedAmplitude;
use crate::effect::{Effect, Scene, amplitude_name};
use crate::error::{Error, Result};
use crate::experiment::{Gauge, remove_rigid_motion_over};
use crate::fem::{Locator, Mesh, Observer};
use crate::field::deviant::deviant_points;
use crate::field::{Field, Reason};
use crate::noise::residual_of_fit;
use crate::reduce::ReducedModel;

/// The measured points on the plate.
pub struct Observation {
    /// The field, without points outside the plate.
    pub field: Field,
    /// Where its points lie in the mesh.
    pub observer: Observer,
    /// Declared effects of the recording, which have been taken out of the field.
    pub recorded: Vec<RecordedAmplitude>,
}

/// Columns at the measured points: `columns[k][i]` = (u1, u2) in mm of unit amplitude of column k at point i.
pub struct Columns {
    /// POD modes of u1, then of u2, for one mm of coefficient.
    pub modes: Vec<Vec<[f64; 2]>>,
    /// Declared additive effects, for one border unit of amplitude.
    pub effects: Vec<Vec<[f64; 2]>>,
    /// Name of each effect column, `effect.parameter`.
    pub names: Vec<String>,
    /// Prior standard deviation of each effect column's amplitude; `None` is flat.
    pub prior_sd: Vec<Option<f64>>,
}

/// Share of points outside the plate above which the geometry cannot be right.
const MOST_OUTSIDE: f64 = 0.2;

impl Observation {
    /// Locate the points of a field; those outside the plate or in the hole are dropped and counted.
    pub fn new(mut field: Field, mesh: &Mesh) -> Result<Self> {
        let count = field.len();
        let locator = Locator::new(mesh);
        let (observer, inside) = locator.observe(&field.points);
        let (_, on_plate) = locator.observe(&field.outlying);
        let mut on_plate = on_plate.into_iter();
        field.outlying.retain(|_| on_plate.next() == Some(true));
        let dropped = field.retain(Reason::OutsidePlate, |i| inside[i]);
        if dropped as f64 > MOST_OUTSIDE * count as f64 {
            return Err(Error::input("measurement", "points on the plate")
                .found(format!("{dropped} of {count} points outside the plate or in the hole"))
                .hint(format!(
                    "the plate spans {:?} mm along the load and {:?} mm across it, from the hole's centre; check loading_axis, hole_center_in_data_mm, the units and the specimen's dimensions",
                    mesh.outline.s, mesh.outline.t
                )));
        }
        Ok(Self {
            field,
            observer,
            recorded: Vec::new(),
        })
    }

    /// Drop points whose residual from a least-squares fit of the modes and any affine displacement contradicts the
    /// residuals around them, and count them as outliers. Returns how many went.
    pub fn drop_strays(&mut self, reduced: &ReducedModel, mesh: &Mesh) -> usize {
        let modes = reduced.columns(&self.observer, mesh.nodes.len());
        let residual = residual_of_fit(&self.field, &modes);
        let deviant = deviant_points(&self.field.points, &residual);
        self.observer.retain(|i| !deviant[i]);
        self.field.retain(Reason::Outlier, |i| !deviant[i])
    }

    /// Where the outliers lie in the mesh, if there are any: the gauge over the measured points counts them.
    pub fn outlying(&self, mesh: &Mesh) -> Option<Observer> {
        let outlying = &self.field.outlying;
        (!outlying.is_empty()).then(|| Locator::new(mesh).observe(outlying).0)
    }

    /// Evaluate modes and the model's additive effects at the points, under its gauge.
    pub fn columns(&self, reduced: &ReducedModel, mesh: &Mesh, model: &Model) -> Columns {
        let mut modes = reduced.columns(&self.observer, mesh.nodes.len());
        if model.experiment().gauge == Gauge::Window {
            let (points, further) = (&self.field.points, &self.field.outlying);
            let mut there = match self.outlying(mesh) {
                Some(observer) => reduced.columns(&observer, mesh.nodes.len()),
                None => vec![Vec::new(); modes.len()],
            };
            for (column, there) in modes.iter_mut().zip(&mut there) {
                remove_rigid_motion_over(points, column, further, there);
            }
        }
        let mut columns = Columns {
            modes,
            effects: Vec::new(),
            names: Vec::new(),
            prior_sd: Vec::new(),
        };
        let scene = model.scene();
        for effect in model.additive() {
            for (k, parameter) in effect.parameters().iter().enumerate() {
                columns.effects.push(self.additive(effect, k, &scene));
                columns.names.push(amplitude_name(effect, parameter));
                columns.prior_sd.push(model.prior_sd(effect, k));
            }
        }
        columns
    }

    /// Field of one border unit of an additive effect's parameter `k`.
    pub fn additive(&self, effect: &dyn Effect, k: usize, scene: &Scene) -> Vec<[f64; 2]> {
        let mut unit = vec![0.0; effect.parameters().len()];
        unit[k] = 1.0;
        self.field
            .points
            .par_iter()
            .map(|&p| effect.displacement(&unit, scene, p))
            .collect()
    }
}
