//! The steps of a load series in `report.json`, and the table and the sentences that are made of them.

use serde::{Deserialize, Serialize};

use super::json::or_nan;
use super::residual::ByComponent;
use crate::quantity::chance;
use crate::section::{Table, TableCell, row};
use crate::trace::NOT_LINEAR;

/// One step of a load series; the numbers of what is left are root mean squares of block averages.
#[derive(Debug, Serialize, Deserialize)]
pub struct StepReport {
    pub name: String,
    /// Force over the nominal one, as declared or as the size of the field has it.
    pub load: f64,
    pub force_known: bool,
    /// What the declared model leaves.
    pub rms_nm: ByComponent<f64>,
    /// What is left with the effects that tracing found.
    pub explained_rms_nm: ByComponent<f64>,
    /// Noise of the step over the steps' typical one.
    pub noise_scale: f64,
    /// The step as the others predict it, where enough steps know the noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutReport>,
}

/// Prediction of a step by a model that was fitted to all other steps; the step's own motion in the plane, a force that is not known, and
/// free amplitudes are fitted to itself.
#[derive(Debug, Serialize, Deserialize)]
pub struct HeldOutReport {
    /// Error of the declared model.
    pub rms_nm: ByComponent<f64>,
    /// With the effects that tracing found.
    pub explained_rms_nm: ByComponent<f64>,
    /// By how many sds the step's misfit is larger than the declared model expects.
    #[serde(deserialize_with = "or_nan")]
    pub z: f64,
}

/// The test of a response that is proportional to the load, apart from motion and from what is common to all steps.
#[derive(Debug, Serialize, Deserialize)]
pub struct LinearityReport {
    /// Mean square of what goes as the load's square over that of what goes by no law.
    pub ratio: f64,
    /// Degrees of freedom of both.
    pub freedom: [usize; 2],
    /// Probability of so large a ratio for a linear specimen.
    pub p: f64,
    pub linear: bool,
}

impl LinearityReport {
    /// What is said of a response that fails the test.
    pub fn words(&self) -> Option<String> {
        (self.p < NOT_LINEAR).then(|| {
            format!(
                "The response is not proportional to the load: yielding, slip or damage ({}).",
                chance(self.p)
            )
        })
    }
}

/// The columns of the table of steps: what is left of each, and what is left of it when it is held out.
const HEADER: [&str; 12] = [
    "step",
    "load",
    "u1 nm before",
    "u2 nm before",
    "u1 nm after",
    "u2 nm after",
    "held out u1 before",
    "u2 before",
    "u1 after",
    "u2 after",
    "z after",
    "noise scale",
];

/// What the first and the last round leave of every step, and whether a force is not known (`?`).
pub fn table(first: &[StepReport], last: &[StepReport]) -> Table {
    let rows = first.iter().zip(last).map(|(a, b)| {
        let both = |r: Option<&ByComponent<f64>>| {
            [r.map(|r| r.u1), r.map(|r| r.u2)].map(|v| TableCell::fixed(v, 1))
        };
        let [before, after] = [&a.held_out, &b.held_out].map(Option::as_ref);
        let left = [
            both(Some(&a.rms_nm)),
            both(Some(&b.explained_rms_nm)),
            both(before.map(|h| &h.rms_nm)),
            both(after.map(|h| &h.explained_rms_nm)),
        ];
        let load = match a.force_known {
            true => format!("{:.3}", a.load),
            false => format!("{:.3}?", a.load),
        };
        let z = TableCell::signed(after.map(|h| h.z), 1);
        let end = [z, TableCell::fixed(a.noise_scale, 2)];
        let cells = [load.into()].into_iter().chain(left.into_iter().flatten());
        row(&a.name, cells.chain(end))
    });
    let caption = "what is left of each step (RMS of block averages, without its motion in the plane), and of each step as all others predict it";
    Table::new(caption, HEADER, rows)
}
