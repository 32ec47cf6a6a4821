//! The kind `frequencies`: the natural frequencies of a plate.

mod disturbed;
mod found;
mod information;
mod peaks;
mod section;

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

pub use information::plate_information;
pub use peaks::Peaks;

use super::{
    Experiment, ExperimentReader, ExperimentSection, Measuring, Observed, SharedConstants,
    Undeclared,
};
use crate::chain::Draws;
use crate::error::Result;
use crate::experiment::frequencies::FrequenciesSpec;
use crate::identify::Options;
use crate::infer::{ConstantsLikelihood, ExperimentEntry, Member, ModelOutline};
use crate::laminate::Material;
use crate::progress::Progress;
use crate::trace::Information;

pub const FREQUENCIES: ExperimentReader = ExperimentReader {
    name: "frequencies",
    read,
};

/// A plate whose peaks were measured, or could be.
pub struct PlateTest {
    pub spec: FrequenciesSpec,
}

fn read(
    outline: &ModelOutline,
    entry: &ExperimentEntry,
    _path: &Path,
) -> Result<Arc<dyn Experiment>> {
    let spec: FrequenciesSpec = entry.read()?;
    let isotropic = outline.material.kind == Material::Isotropic;
    spec.validate(isotropic).map_err(|e| entry.refuse(e))?;
    Ok(Arc::new(PlateTest { spec }))
}

impl Experiment for PlateTest {
    fn name(&self) -> &str {
        &self.spec.name
    }

    fn json(&self, _absolute: bool) -> Result<Value> {
        super::json(&self.spec)
    }

    fn information(&self, shared: &SharedConstants, _measuring: Measuring) -> Result<Information> {
        plate_information(&self.spec, shared.material, &shared.constants).map(Information::plain)
    }

    fn simulate(
        &self,
        shared: &SharedConstants,
        constants: &[f64],
        seed: u64,
    ) -> Result<Arc<dyn Experiment>> {
        let ply = shared.material.ply(constants).admissible("--set")?;
        let spec = self.spec.simulated(ply, seed)?;
        Ok(Arc::new(Self { spec }))
    }

    fn observed(
        &self,
        shared: &SharedConstants,
        _options: &Options<'_>,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Observed>> {
        progress.begin("likely assignments of the peaks", None);
        let peaks = Peaks::new(&self.spec, shared.material, &shared.constants)
            .map_err(|e| e.within(&self.spec.name))?;
        progress.end();
        Ok(Box::new(peaks))
    }
}

impl Observed for Peaks {
    fn member(&self, _shared: &SharedConstants) -> Member {
        Member::new(&self.spec.name, Box::new(self.clone()), self.start())
    }

    fn section(&self, draws: &Draws) -> Result<ExperimentSection> {
        let plate = found::found(self, draws)?;
        let warnings = found::warnings(self, &plate, draws);
        section::section(&plate, warnings)
    }

    fn correction(&self, point: &[f64]) -> f64 {
        let seen = self.seen(point);
        seen.map_or(f64::NEG_INFINITY, |seen| self.exact_over_near(point, &seen))
    }

    fn undeclared(&self, mean: &[f64], _others: Option<&ConstantsLikelihood>) -> Vec<Undeclared> {
        self.disturbed(mean)
    }
}
