//! What a reduced model is built for: the test, the parameters that vary, and where the field is seen.

use std::sync::Arc;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use super::design::{Dimension, enough_samples};
use super::modes::Modes;
use super::supplied::SuppliedSpec;
use crate::error::{Error, Result};
use crate::experiment::{FieldSolver, Given, State};
use crate::laminate::Material;

/// The `reduced_model` object of a model file.
#[skip_serializing_none]
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedSpec {
    pub snapshots: SnapshotsSpec,
    /// POD modes kept for each displacement component: a number, or `"auto"`.
    pub modes: Modes,
    /// Total degree of the response surfaces.
    pub degree: usize,
    /// Bounds by parameter name, in place of those that follow from the priors.
    pub doe: Option<std::collections::BTreeMap<String, [f64; 2]>>,
    /// What earlier versions compared a build with: read, and without effect.
    #[serde(default, skip_serializing)]
    pub reference: IgnoredAny,
    /// Solve the finite elements for every prediction instead of answering from a reduced basis or correcting a solution nearby.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub full_order: bool,
}

/// Where the snapshots come from.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SnapshotsSpec {
    /// So many of the own finite elements.
    Count(usize),
    /// Those of another program.
    Supplied(SuppliedSpec),
}

/// Predictions by the surfaces through supplied snapshots, where an effect widens their design.
const PREDICTED: usize = 200;

impl ReducedSpec {
    /// So many snapshots of the own finite elements, and nothing else declared.
    pub fn of(count: usize, modes: Modes, degree: usize) -> Self {
        Self {
            snapshots: SnapshotsSpec::Count(count),
            modes,
            degree,
            doe: None,
            reference: IgnoredAny,
            full_order: false,
        }
    }

    /// Predictions that a reduced model is made of, where they are not given.
    pub fn count(&self) -> usize {
        match &self.snapshots {
            SnapshotsSpec::Count(count) => *count,
            SnapshotsSpec::Supplied(_) => PREDICTED,
        }
    }

    /// The snapshots of another program, if they are.
    pub fn supplied(&self) -> Option<&SuppliedSpec> {
        match &self.snapshots {
            SnapshotsSpec::Count(_) => None,
            SnapshotsSpec::Supplied(supplied) => Some(supplied),
        }
    }

    /// Check the numbers; errors name the key.
    pub fn validate(&self) -> Result<()> {
        let check = |key: &str, value: usize, low: usize, high: usize| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::input(
                format!("reduced_model.{key}"),
                format!("a whole number from {low} to {high}"),
            )
            .found(value))
        };
        match &self.snapshots {
            SnapshotsSpec::Count(count) => check("snapshots", *count, 10, 5_000)?,
            SnapshotsSpec::Supplied(_) if self.doe.is_some() => {
                let expected =
                    "no bounds beside snapshots of another program, whose rows are the box";
                return Err(Error::input("reduced_model.doe", expected));
            }
            SnapshotsSpec::Supplied(_) => {}
        }
        if let Modes::Count(modes) = self.modes {
            check("modes", modes, 1, 30)?;
        }
        check("degree", self.degree, 1, 6)
    }
}

/// Everything that determines the snapshots.
#[derive(Clone)]
pub struct Problem {
    /// What is predicted.
    pub experiment: Arc<dyn FieldSolver>,
    /// The DoE box: elastic constants, and last the thickness if it is uncertain.
    pub dimensions: Vec<Dimension>,
    pub spec: ReducedSpec,
}

impl Problem {
    /// How the stiffness is parameterised.
    pub fn material(&self) -> Material {
        self.experiment.scene().material
    }

    /// The rows of a supplied design and their fields, where they are all of this problem's box.
    pub fn given(&self) -> Option<Given<'_>> {
        let given = self.experiment.given()?;
        let reaches = |(k, d): (usize, &Dimension)| {
            let side = |end: f64| given.rows.iter().any(|row| row.get(k) == Some(&end));
            side(d.low) && side(d.high)
        };
        let whole = self.dimensions.iter().enumerate().all(reaches);
        whole.then_some(given)
    }

    /// Number of elastic constants.
    pub fn constants(&self) -> usize {
        self.material().constants().len()
    }

    /// Whether the thickness is a parameter of the design: its last.
    pub fn varies_thickness(&self) -> bool {
        self.dimensions.len() > self.constants()
    }

    /// The point of the design with elastic constants `theta`, at a thickness of `h` mm.
    pub fn point(&self, theta: &[f64], h: f64) -> Vec<f64> {
        let mut point = theta.to_vec();
        if self.varies_thickness() {
            point.push(h);
        }
        point
    }

    /// The nominal thickness, mm.
    pub fn thickness_mm(&self) -> f64 {
        self.experiment.scene().setup.thickness
    }

    /// The state of the experiment at a point of the design, or at constants alone with the nominal thickness.
    pub fn state(&self, point: &[f64]) -> State {
        let thickness = point.get(self.constants()).copied();
        State::new(
            &point[..self.constants()],
            thickness.unwrap_or(self.thickness_mm()),
        )
    }

    /// Check, before anything is solved, that every corner of the box has an admissible ply and every side some length,
    /// and that the snapshots determine the response surfaces.
    pub fn validate(&self) -> Result<()> {
        enough_samples(
            self.given()
                .map_or(self.spec.count(), |given| given.rows.len()),
            self.spec.degree,
            self.dimensions.len(),
        )?;
        for d in &self.dimensions {
            if !(d.low.is_finite() && d.high.is_finite() && d.low < d.high) {
                return Err(Error::input(
                    format!("reduced_model.doe.{}", d.name),
                    "a lower bound below the upper bound",
                )
                .found(format!("[{}, {}]", d.low, d.high)));
            }
        }
        let thickness = self.dimensions.get(self.constants());
        if let Some(low) = thickness.map(|d| d.low).filter(|low| *low <= 0.0) {
            let expected = "a thickness above 0";
            return Err(Error::input("reduced_model.doe.thickness_mm", expected).found(low));
        }
        let constants = self.constants();
        for corner in 0..1usize << constants {
            let point: Vec<f64> = (0..constants)
                .map(|k| {
                    let d = &self.dimensions[k];
                    if corner >> k & 1 == 1 { d.high } else { d.low }
                })
                .collect();
            self.material().ply(&point).admissible("a corner of the DoE box").map_err(|e| {
                e.hint("narrow the priors or give reduced_model.doe bounds whose corners keep E, G > 0 and nu12^2 < E1/E2")
            })?;
        }
        Ok(())
    }
}
