//! Patches: places where the residual is not noise though it is noise as a whole. Paint that has come off, over 3 mm and by a micrometre, passes
//! every test of all blocks together.

mod masked;
pub mod parts;
mod scan;
mod templates;

use serde::{Deserialize, Serialize};

use crate::field::MaskShape;
use crate::quantity::plus_minus;

pub use masked::Account;
pub use parts::PatchPart;
pub(super) use parts::largest_part;
pub use scan::{FoundPatch, Scanned};
pub use templates::{PatchFamily, PatchedPoints};

/// Share lost, from and to which a surface that does not follow is what paint or film leaves.
const LIKE_PAINT: [f64; 2] = [0.3, 1.3];

/// A patch of the residual, in the data's coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LocalPatch {
    pub part: PatchPart,
    pub family: PatchFamily,
    pub center_mm: [f64; 2],
    /// The same in the pictures, where coordinates are pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center_px: Option<[f64; 2]>,
    pub radius_mm: f64,
    /// Largest displacement of a block's average, um.
    pub largest_um: f64,
    pub z: f64,
    /// Share of the strain that is lost, with its sd, where the surface does not follow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share_lost: Option<[f64; 2]>,
    /// Whether it is clear enough for a verdict.
    pub found: bool,
    /// Whether it lies where a metal yields first of which no yield stress is declared.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub yields: bool,
    /// The step, of a patch in one frame alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<String>,
    /// What `measurement.mask` would need to leave it out.
    pub mask: MaskShape,
}

/// All patches of a residual.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Patches {
    /// The clearest first.
    pub all: Vec<LocalPatch>,
    /// The constants without what a mask of all that were found would leave out: change in percent, and in sds.
    #[serde(default)]
    pub masked: Vec<MaskedConstant>,
}

/// What a mask does to a constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaskedConstant {
    pub name: String,
    pub percent: f64,
    pub sds: f64,
}

impl Patches {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Those that are clear enough for a verdict.
    pub fn found(&self) -> impl Iterator<Item = &LocalPatch> {
        self.all.iter().filter(|p| p.found)
    }

    /// Why the residual is not noise, for every patch that was found.
    pub fn objections(&self) -> Vec<String> {
        self.found().map(LocalPatch::objection).collect()
    }

    /// What is said of them all beside the objections.
    pub fn words(&self) -> Vec<String> {
        let mut said = Vec::new();
        if self.found().next().is_some() {
            let masks: Vec<String> = self.found().filter_map(|p| p.mask.text()).collect();
            said.push(format!(
                "To leave the patch out, add \"mask\": [{}] to measurement.",
                masks.join(", ")
            ));
            let change = |by: &MaskedConstant| {
                format!("{} by {:+.2} % ({:+.1} sd)", by.name, by.percent, by.sds)
            };
            let changes: Vec<String> = self.masked.iter().map(change).collect();
            if !changes.is_empty() {
                said.push(format!("This mask changes {}.", changes.join(", ")));
            }
        }
        let faint: Vec<&LocalPatch> = self.all.iter().filter(|p| !p.found).collect();
        if let Some(first) = faint.first() {
            said.push(format!(
                "The clearest of {} weaker patches (z = {:.1}) is {}. They are not clear enough for a verdict.",
                faint.len(),
                first.z,
                first.place()
            ));
        }
        said
    }
}

impl LocalPatch {
    fn place(&self) -> String {
        let [x, y] = self.center_mm;
        let pixels = self
            .center_px
            .map_or_else(String::new, |[x, y]| format!(", pixel ({x:.0}, {y:.0})"));
        let part = match (self.part, &self.step) {
            (PatchPart::Load, _) => "it grows with the load".to_string(),
            (PatchPart::Common, _) => {
                "all frames have it, so it is the reference picture's".to_string()
            }
            (PatchPart::Whole, _) => {
                "one load does not tell whether it is on the specimen or in the pictures"
                    .to_string()
            }
            (PatchPart::Own(_), Some(step)) => format!("{step} alone has it"),
            (PatchPart::Own(k), None) => format!("frame {} alone has it", k + 1),
        };
        format!(
            "about {:.1} mm in radius at ({x:.1}, {y:.1}) mm of the data{pixels}, at most {:.2} um ({part})",
            self.radius_mm, self.largest_um
        )
    }

    fn objection(&self) -> String {
        let [low, high] = LIKE_PAINT;
        let lost = self.share_lost.filter(|s| (low..=high).contains(&s[0]));
        let cause = match lost {
            Some([mean, sd]) => format!(
                "as paint or film would leave that does not follow the surface (it loses {} of the strain beneath it)",
                plus_minus(mean, sd)
            ),
            None if self.yields => {
                "as yielding beside the hole would leave. Declare material.yield_MPa".into()
            }
            None => "its cause is not known".into(),
        };
        format!(
            "the residual holds a patch (z = {:.1}), {}: {cause}",
            self.z,
            self.place()
        )
    }
}
