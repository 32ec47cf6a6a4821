//! The kind `field`: the displacement field of a loaded specimen, and `mock`, the same in closed form.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;

use super::{
    Experiment, ExperimentReader, ExperimentSection, Measuring, Observed, SharedConstants,
};
use crate::chain::Draws;
use crate::error::Result;
use crate::experiment::simulate::HALF_WINDOW;
use crate::identify::{Identification, Options, identify};
use crate::infer::{ExperimentEntry, Marginal, Member, Model, ModelOutline};
use crate::posterior::{GivenChoice, linear};
use crate::progress::Progress;
use crate::quantity::NM_PER_MM;
use crate::reduce::THICKNESS;
use crate::trace::{Information, field_information};

pub const FIELD: ExperimentReader = ExperimentReader {
    name: "field",
    read,
};

pub const MOCK: ExperimentReader = ExperimentReader { name: "mock", read };

/// A field with its model.
pub struct MeasuredField {
    pub model: Model,
}

fn read(
    outline: &ModelOutline,
    entry: &ExperimentEntry,
    path: &Path,
) -> Result<Arc<dyn Experiment>> {
    let model = Model::field_of(outline, entry, path)?;
    Ok(Arc::new(MeasuredField { model }))
}

/// Points along each side of the window at which a planned field is looked at: each stands for all of its tile.
const TILES: usize = 25;

/// Factor on the mesh of a planned field: a sensitivity need not be as good as a prediction.
const COARSER: f64 = 0.5;

impl Experiment for MeasuredField {
    fn name(&self) -> &str {
        &self.model.experiment().name
    }

    fn json(&self, absolute: bool) -> Result<Value> {
        let file = match absolute {
            true => self.model.resolved_file()?,
            false => self.model.file.clone(),
        };
        super::json(&file.experiments[0])
    }

    fn files(&self) -> Result<Vec<PathBuf>> {
        self.model.measurement_files()
    }

    fn information(&self, _shared: &SharedConstants, measuring: Measuring) -> Result<Information> {
        let mut model = self.model.clone();
        model.experiment_mut().mesh_density *= COARSER;
        let half = HALF_WINDOW * model.experiment().specimen.width_mm;
        let place = |k: usize| half * ((2 * k + 1) as f64 / TILES as f64 - 1.0);
        let rows = (0..TILES).flat_map(|i| (0..TILES).map(move |j| [i, j]));
        let points: Vec<[f64; 2]> = rows.map(|[i, j]| [place(i), place(j)]).collect();
        // of the points of a tile those count that lie in subsets of their own
        let tile = 2.0 * half / TILES as f64;
        let side = model.subsets().map_or(0.0, |s| s.side_mm);
        let points_in_tile = (measuring.grid as f64 / TILES as f64).powi(2);
        let worth = points_in_tile.min((tile / side).powi(2));
        let sd_mm = measuring.noise_nm / NM_PER_MM / worth.sqrt();
        field_information(&model, &points, sd_mm)
    }

    fn simulate(&self, _: &SharedConstants, _: &[f64], _: u64) -> Result<Arc<dyn Experiment>> {
        // its measurement is a file, which whoever simulates writes first
        Ok(Arc::new(Self {
            model: self.model.clone(),
        }))
    }

    fn observed(
        &self,
        _shared: &SharedConstants,
        options: &Options<'_>,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Observed>> {
        let found = identify(&self.model, options, progress)?;
        Ok(Box::new(IdentifiedField {
            name: self.name().to_string(),
            found,
            owners: self.owners(),
        }))
    }

    fn owners(&self) -> Vec<String> {
        let experiment = self.model.experiment();
        let specimen = super::json(&experiment.specimen).unwrap_or_default();
        let load_cell = format!("load cell {}", experiment.load_cell);
        vec![format!("specimen {specimen}"), load_cell]
    }

    fn field(&self) -> Option<&Model> {
        Some(&self.model)
    }
}

/// A field that was identified without any other experiment.
struct IdentifiedField {
    name: String,
    found: Identification,
    /// Whose its specimen and its load cell are.
    owners: Vec<String>,
}

impl IdentifiedField {
    /// Linear parameters that other experiments may share, by whose they are: thickness and width of the specimen, the scale of the load cell. Two
    /// specimens that are declared alike in every key are one; fields of a file share a load cell, unless they name two.
    fn owned(&self) -> Vec<(String, usize)> {
        let posed = &self.found.inverse.posed;
        let columns = linear(&posed.expanded.here);
        let kept = posed.kept.iter().enumerate();
        let owned = kept.filter_map(|(place, &k)| {
            let column = columns.get(k)?;
            let owner = match () {
                () if column.name == THICKNESS || column.is_width() => self.owners.first()?,
                () if column.is_load() => self.owners.last()?,
                () => return None,
            };
            Some((format!("{} {} of {owner}", column.name, column.sd), place))
        });
        owned.collect()
    }
}

impl Observed for IdentifiedField {
    fn member(&self, shared: &SharedConstants) -> Member {
        let names: Vec<String> = shared.constants.iter().map(|c| c.0.clone()).collect();
        let rows = &self.found.verdict.rows;
        let start = rows.iter().map(|row| (row.mean, row.sd)).unzip();
        let density = &self.found.inverse.posed.density;
        let each = density.constant_names().iter().zip(density.marginals());
        let marginals = each.map(|(name, m)| match names.contains(name) {
            true => Marginal::flat(m.mean),
            false => *m,
        });
        let own = Box::new(density.with_marginals(marginals.collect()));
        let member = Member::new(&self.name, own, start);
        let (owners, places): (Vec<String>, Vec<usize>) = self.owned().into_iter().unzip();
        let density = density.clone();
        let given =
            move |x: &[f64]| GivenChoice::at(&density, x, density.choice(0)).moments(&places);
        member.owning(owners, Box::new(given))
    }

    fn section(&self, _draws: &Draws) -> Result<ExperimentSection> {
        // a field has a report of its own
        Ok(ExperimentSection {
            name: self.name.clone(),
            ..ExperimentSection::default()
        })
    }

    fn draws(&self) -> Option<&Draws> {
        Some(&self.found.draws)
    }

    fn into_field(self: Box<Self>) -> Option<Identification> {
        Some(self.found)
    }
}
