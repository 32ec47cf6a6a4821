//! Calibration by many processes: shares of the replicates, whose records make one table.

use serde::Deserialize;

use crate::error::{Error, Result};

/// The `calibration` object of a campaign file. Unknown keys are errors.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationSpec {
    /// Replicates for each correlation length.
    pub replicates: u32,
    /// Processes among which they are divided.
    pub shares: u32,
    /// Correlation lengths of the noise, mm.
    #[serde(default)]
    pub correlation_mm: Vec<f64>,
    /// Points along a side of a simulated field.
    pub grid: Option<u16>,
    /// Of the whole loop.
    #[serde(default, rename = "loop")]
    pub whole_loop: bool,
    /// With `loop`: up to how many effects act, in place of as many as the loop expects.
    #[serde(default)]
    pub effects: Option<u16>,
    /// With `loop`: one that acts is not in the dictionary.
    #[serde(default)]
    pub withheld: bool,
}

impl CalibrationSpec {
    /// As arguments of `validate`, but for the share.
    ///
    /// # Errors
    /// The input's fault, with the key.
    pub fn arguments(&self) -> Result<Vec<String>> {
        let refuse = |key: &str, expected: &str| {
            Err(Error::input(
                format!("calibration.{key}"),
                expected.to_string(),
            ))
        };
        if self.replicates == 0 {
            return refuse("replicates", "a number above 0");
        }
        if !(1..=self.replicates).contains(&self.shares) {
            return refuse("shares", "a number from 1 to that of the replicates");
        }
        let of_loop = [
            ("withheld", self.withheld),
            ("effects", self.effects.is_some()),
        ];
        if let Some((key, _)) = of_loop.iter().find(|(_, is)| *is && !self.whole_loop) {
            return refuse(key, "\"loop\": true beside it");
        }
        let mut all = vec!["--calibrate".to_string(), self.replicates.to_string()];
        if !self.correlation_mm.is_empty() {
            let lengths = self.correlation_mm.iter().map(f64::to_string);
            let lengths = lengths.collect::<Vec<_>>().join(",");
            all.push(format!("--correlation-mm={lengths}"));
        }
        if let Some(grid) = self.grid {
            all.extend(["--grid".into(), grid.to_string()]);
        }
        if let Some(effects) = self.effects {
            all.extend(["--effects".into(), effects.to_string()]);
        }
        let flags = [(self.whole_loop, "--loop"), (self.withheld, "--withheld")];
        let flags = flags.iter().filter(|(on, _)| *on);
        all.extend(flags.map(|(_, flag)| (*flag).to_string()));
        Ok(all)
    }
}
