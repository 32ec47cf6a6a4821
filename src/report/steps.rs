//! The steps of a load series in `report.json`, and the table and the sentences that are made of them.

use std::iter::once;

use serde::{Deserialize, Serialize};

use super::residual::ByComponent;
use crate::trace::NOT_LINEAR;

/// One step of a load series; the numbers of what is left are root mean squares of block averages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutReport>,
}

/// Prediction of a step by a model that was fitted to all other steps; the step's own motion in the plane, a force that is not known, and
/// free amplitudes are fitted to itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldOutReport {
    /// Error of the declared model.
    pub rms_nm: ByComponent<f64>,
    /// With the effects that tracing found.
    pub explained_rms_nm: ByComponent<f64>,
    /// By how many sds the step's misfit is larger than the declared model expects.
    pub z: Option<f64>,
}

/// The test of a response that is proportional to the load, apart from motion and from what is common to all steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
                "The response is not proportional to the load: yielding, slip or damage (p = {:.0e}).",
                self.p
            )
        })
    }
}

/// The columns of the table of steps: what is left of each, and what is left of it when it is held out.
pub const HEADER: [&str; 12] = [
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

/// What the columns are, in a sentence.
pub const CAPTION: &str = "What is left of each step (RMS of block averages, without its motion in the plane), and of each step as all others predict it";

/// What the first and the last round leave of every step, and whether a force is not known (`?`).
pub fn rows(first: &[StepReport], last: &[StepReport]) -> Vec<Vec<String>> {
    let pairs = first.iter().zip(last);
    pairs
        .map(|(a, b)| {
            let both = |r: &ByComponent<f64>| [r.u1, r.u2].map(|v| format!("{v:.1}"));
            let held =
                |r: Option<&ByComponent<f64>>| r.map_or_else(|| ["-", "-"].map(String::from), both);
            let known = if a.force_known { "" } else { "?" };
            let z = b.held_out.as_ref().and_then(|h| h.z);
            once(a.name.clone())
                .chain([format!("{:.3}{known}", a.load)])
                .chain(both(&a.rms_nm))
                .chain(both(&b.explained_rms_nm))
                .chain(held(a.held_out.as_ref().map(|h| &h.rms_nm)))
                .chain(held(b.held_out.as_ref().map(|h| &h.explained_rms_nm)))
                .chain([z.map_or("-".into(), |z| format!("{z:+.1}"))])
                .chain([format!("{:.2}", a.noise_scale)])
                .collect()
        })
        .collect()
}
