//! Parameters of all frames of a component: steps and gains of both states, the detector's response, and how bright the final state is.

use super::response::Response;
use super::shifts::Shifts;

/// Prior sds: of a step, rad, of a gain, of the logarithm of the response's exponent and of its cubic part. Shifters miss by degrees,
/// lasers flicker by percents, cameras have gammas near 1.
const STEP_SD_RAD: f64 = 0.2;
const GAIN_SD: f64 = 0.05;
const RESPONSE_SD: f64 = 0.3;
const RATIO_SD: f64 = 1.0;

#[derive(Debug, Clone)]
pub struct ShiftParameters {
    /// Of the initial and of the final state.
    pub shifts: [Shifts; 2],
    pub response: Response,
    /// Logarithms of the final state's background and modulation over the initial one's.
    pub ln_ratio: [f64; 2],
}

impl ShiftParameters {
    /// Frames as they should be.
    pub fn nominal(frames: usize, step_rad: f64) -> Self {
        let nominal = Shifts::nominal(frames, step_rad);
        Self {
            shifts: [nominal.clone(), nominal],
            response: Response::STRAIGHT,
            ln_ratio: [0.0; 2],
        }
    }

    pub fn frames(&self) -> usize {
        self.shifts[0].gain.len()
    }

    /// Steps and gains of one state, then of the other, the response, the two ratios.
    pub fn count(&self) -> usize {
        4 * self.frames() + 4
    }

    /// Where the gains of a state begin.
    pub fn gains_of(&self, state: usize) -> usize {
        (2 * state + 1) * self.frames()
    }

    pub fn at(&mut self, k: usize) -> &mut f64 {
        let n = self.frames();
        match k {
            k if k < 4 * n && (k / n).is_multiple_of(2) => {
                &mut self.shifts[k / (2 * n)].step_rad[k % n]
            }
            k if k < 4 * n => &mut self.shifts[k / (2 * n)].gain[k % n],
            k if k == 4 * n => &mut self.response.ln_exponent,
            k if k == 4 * n + 1 => &mut self.response.cubic,
            k => &mut self.ln_ratio[k - 4 * n - 2],
        }
    }

    /// Prior sd of a parameter.
    pub fn sd(&self, k: usize) -> f64 {
        let n = self.frames();
        match k {
            k if k < 4 * n && (k / n).is_multiple_of(2) => STEP_SD_RAD,
            k if k < 4 * n => GAIN_SD,
            k if k < 4 * n + 2 => RESPONSE_SD,
            _ => RATIO_SD,
        }
    }

    /// Whether a parameter is one of the two ratios, which are free whatever is known of the frames.
    pub fn is_ratio(&self, k: usize) -> bool {
        k >= 4 * self.frames() + 2
    }
}
