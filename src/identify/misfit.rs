//! Whether noise explains what a fit leaves. One probability a fit: verdict and warnings ask for it here, and
//! agree. For the last fit of a loop, effects on which the data do not decide may take part in it.

use super::inverse::InverseProblem;
use super::residual::Residual;
use crate::field::rigid;
use crate::quantity::{NM_PER_MM, URAD_PER_RAD};

/// Smallest probability of a misfit that noise may have made.
pub const MISFIT: f64 = 1e-3;

/// A noise scale above this is more than the data show.
const LARGE_SCALE: f64 = 1.3;

/// What is left against the noise.
#[derive(Debug, Clone)]
pub struct AgainstNoise {
    /// Probability of one as large from noise alone.
    pub p: f64,
    /// Whether the frames of a series have measured that noise.
    pub of_series: bool,
    /// Whether noise explains it only together with effects on which the data do not decide.
    pub with_undecided: bool,
    /// What is said of it; nothing where noise explains it.
    pub warnings: Vec<String>,
}

impl AgainstNoise {
    /// Of what a fit leaves at a point of its posterior.
    pub(super) fn of(
        inverse: &InverseProblem,
        residual: &Residual,
        mean: &[f64],
        noise_is_declared: bool,
    ) -> Self {
        let p = residual.p_chi2;
        let mut warnings = Vec::new();
        if p < MISFIT {
            warnings.extend(structure(inverse, residual));
            let scale = inverse.posed.density.noise_scale(mean);
            if scale > LARGE_SCALE && !noise_is_declared {
                warnings.push(format!("The fit calls for {scale:.1} times the noise that the data show: the model cannot follow the data."));
            }
        }
        Self {
            p,
            of_series: false,
            with_undecided: false,
            warnings,
        }
    }

    /// Of a series by the noise of its frames.
    pub(super) fn of_series(inverse: &InverseProblem, residual: &Residual, p: f64) -> Self {
        let warnings = if p < MISFIT {
            structure(inverse, residual)
        } else {
            Vec::new()
        };
        Self {
            p,
            of_series: true,
            with_undecided: false,
            warnings,
        }
    }

    /// The same held against noise and effects on which the data do not decide, with the probability of a larger one by both. Unchanged where
    /// these do not explain it either.
    #[must_use]
    pub(super) fn with_effects(self, p: f64) -> Self {
        if p < MISFIT {
            return self;
        }
        Self {
            p,
            of_series: false,
            with_undecided: true,
            warnings: Vec::new(),
        }
    }

    /// Whether noise does not explain it.
    pub fn is_too_large(&self) -> bool {
        self.p < MISFIT
    }
}

/// What is said of structure that is left.
fn structure(inverse: &InverseProblem, r: &Residual) -> Vec<String> {
    let mut said = vec!["The model leaves structure that is not noise: the intervals of the model alone do not include what it does to the constants.".to_string()];
    let field = &inverse.prepared.observation.field;
    let motion = rigid::fit(&field.points, &r.field);
    let square = |f: &dyn Fn(usize) -> [f64; 2]| {
        (0..field.len())
            .map(|i| f(i)[0].powi(2) + f(i)[1].powi(2))
            .sum::<f64>()
    };
    let share = square(&|i| motion.at(field.points[i])) / square(&|i| r.field[i]);
    if share > 0.5 {
        let handedness = field.frame.handedness();
        said.push(format!(
            "{:.0} % of the residual is a rigid motion (rotation {:.3} urad, translation {:.1} and {:.1} nm): declare rigid_translation and rigid_rotation.",
            100.0 * share,
            handedness * motion.angle * URAD_PER_RAD,
            motion.shift[0] * NM_PER_MM,
            motion.shift[1] * NM_PER_MM
        ));
    }
    said
}
