//! Phase shifts of a state's frames: I_n = g_n (I_b + I_m cos(phi + delta_n)) (the article's Eq. 1, with a gain for each frame, because
//! lasers flicker), and the least squares that give I_b and I_m exp(i phi) at a pixel.

use nalgebra::{Matrix3, Vector3};

/// Steps and gains of the frames of one state.
#[derive(Debug, Clone)]
pub struct Shifts {
    /// Phase of each frame, rad.
    pub step_rad: Vec<f64>,
    /// Brightness of each frame, 1 on average.
    pub gain: Vec<f64>,
}

/// Background, I_m cos(phi), I_m sin(phi).
pub type Fringe = [f64; 3];

/// The least squares of one state.
#[derive(Debug)]
pub struct StateFit {
    /// Rows of the design: frame by (I_b, I_m cos phi, I_m sin phi).
    design: Vec<[f64; 3]>,
    /// Its pseudo-inverse, column by frame.
    inverse: Vec<[f64; 3]>,
    /// Covariance of the three for noise of sd 1.
    pub covariance: Matrix3<f64>,
}

impl Shifts {
    /// Frames n = 1..N at n times `step_rad`.
    pub fn nominal(frames: usize, step_rad: f64) -> Self {
        Self {
            step_rad: (1..=frames).map(|n| n as f64 * step_rad).collect(),
            gain: vec![1.0; frames],
        }
    }

    /// Some of the frames.
    pub fn of(&self, frames: &[usize]) -> Self {
        Self {
            step_rad: frames.iter().map(|k| self.step_rad[*k]).collect(),
            gain: frames.iter().map(|k| self.gain[*k]).collect(),
        }
    }

    /// The least squares of these frames; `None` where they do not tell phase from background.
    pub fn fit(&self) -> Option<StateFit> {
        let design: Vec<[f64; 3]> = self
            .step_rad
            .iter()
            .zip(&self.gain)
            .map(|(step, gain)| [*gain, gain * step.cos(), -gain * step.sin()])
            .collect();
        let mut normal = Matrix3::zeros();
        for row in &design {
            let row = Vector3::from(*row);
            normal += row * row.transpose();
        }
        let covariance = normal.try_inverse()?;
        let well_posed = covariance.trace() < 50.0;
        let inverse = design
            .iter()
            .map(|row| (covariance * Vector3::from(*row)).into())
            .collect();
        well_posed.then_some(StateFit {
            design,
            inverse,
            covariance,
        })
    }
}

impl StateFit {
    /// The fringe at a pixel from its intensities.
    pub fn fringe(&self, intensity: impl Iterator<Item = f64>) -> Fringe {
        let mut sum = [0.0; 3];
        for (column, value) in self.inverse.iter().zip(intensity) {
            for k in 0..3 {
                sum[k] += column[k] * value;
            }
        }
        sum
    }

    /// What the frames hold beyond a fringe.
    pub fn residual<'a>(
        &'a self,
        fringe: Fringe,
        intensity: impl Iterator<Item = f64> + 'a,
    ) -> impl Iterator<Item = f64> + 'a {
        self.design.iter().zip(intensity).map(move |(row, value)| {
            value - row[0] * fringe[0] - row[1] * fringe[1] - row[2] * fringe[2]
        })
    }
}

/// Variances of modulation and phase at a fringe of that covariance (delta method).
pub fn variances(covariance: &Matrix3<f64>, fringe: Fringe) -> (f64, f64) {
    let [_, c, s] = fringe;
    let m = c.hypot(s).max(f64::MIN_POSITIVE);
    let along = Vector3::new(0.0, c / m, s / m);
    let across = Vector3::new(0.0, -s / m, c / m);
    let of = |v: Vector3<f64>| (v.transpose() * covariance * v)[0];
    (of(along), of(across) / (m * m))
}
