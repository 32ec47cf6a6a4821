//! What a change of one parameter does to the prediction.

use nalgebra::DVector;

use serde::{Deserialize, Serialize};

use crate::effect::{Effect, find, width_error};
use crate::parameter::{Parameter, ParameterKind};

/// Values of both components, step by step, mm.
pub type StepStack = [DVector<f64>; 2];

/// A parameter of the linearised prediction.
#[derive(Clone, Serialize, Deserialize)]
pub struct Column {
    /// `E1_GPa`, `thickness_mm`, `load_misalignment.angle_deg`.
    pub name: String,
    /// Prior mean, border units.
    pub mean: f64,
    /// Prior sd, border units.
    pub sd: f64,
    /// Value at which the test was linearised.
    pub at: f64,
    /// Whether the parameter cannot be negative.
    pub positive: bool,
    /// Whether it is a product of an amplitude with what is not known of the camera, or of a lens' strength with its centre, which has no size
    /// of its own.
    pub product: bool,
    /// Change of the values of (u1, u2) for one prior sd, mm.
    pub values: StepStack,
}

/// Own names of the shifts of a wave in one step, along the data's axes.
pub(super) const PHASES: [&str; 2] = ["phase_x_px", "phase_y_px"];

/// Share of an effect's bound beyond which no linearisation goes.
const INSIDE: f64 = 0.9;

/// A place that was solved for as a product is taken at most so many prior sds from where it was.
const FARTHEST: f64 = 3.0;

/// Turn a linear solution for an effect's `columns` into amplitudes, border units: what was solved for as a product with the first of them,
/// the centre of a lens, is divided by that.
pub fn divide(columns: &[Column], solution: &mut [f64]) {
    let Some(by) = solution.first().map(|strength| columns[0].sd / strength) else {
        return;
    };
    let products = columns.iter().zip(solution).skip(1);
    for (column, value) in products.filter(|(c, _)| c.product) {
        let moved = column.at + by * (*value - column.at);
        let reach = FARTHEST * column.sd;
        *value = if moved.is_nan() {
            column.at
        } else {
            moved.clamp(-reach, reach)
        };
    }
}

impl Column {
    /// Of a prior mean and sd, with the value about which it is linearised and its slope.
    pub(super) fn new(name: String, [mean, sd]: [f64; 2], at: f64, slope: StepStack) -> Self {
        Self {
            name,
            mean,
            sd,
            at,
            positive: false,
            product: false,
            values: slope.map(|values| values * sd),
        }
    }

    /// Of a product of one prior sd of each factor.
    pub(super) fn product(name: String, slope: StepStack) -> Self {
        Self {
            product: true,
            ..Self::new(name, [0.0, 1.0], 0.0, slope)
        }
    }

    /// A value for it, parameter `k` of an effect, kept inside the bound for which the effect is modelled.
    pub fn within(&self, wanted: f64, effect: &dyn Effect, k: usize) -> f64 {
        let reach = INSIDE * effect.parameters()[k].bound;
        wanted.clamp(-reach, reach)
    }

    /// The effect of which it is an amplitude.
    pub fn effect(&self) -> Option<&'static dyn Effect> {
        let name = Parameter::read(&self.name).effect?;
        find("column", &name).ok()
    }

    /// Whether it is an amplitude of such an effect.
    fn is_of(&self, such: impl Fn(&dyn Effect) -> bool) -> bool {
        self.effect().is_some_and(such)
    }

    /// Whether it moves the specimen as a whole.
    pub fn is_rigid(&self) -> bool {
        self.is_of(|effect| effect.is_rigid())
            || Parameter::read(&self.name).is(ParameterKind::Motion)
    }

    /// Whether it is the shift of a wave in one step.
    pub fn is_phase(&self) -> bool {
        PHASES.contains(&&*Parameter::read(&self.name).own)
    }

    /// Whether it is a force that is not declared.
    pub fn is_force(&self) -> bool {
        Parameter::read(&self.name).is(ParameterKind::Load)
    }

    /// Whether it is the error of a declared force.
    pub fn is_force_error(&self) -> bool {
        Parameter::read(&self.name).is(ParameterKind::LoadError)
    }

    /// Whether it is the error of the plate's width.
    pub fn is_width(&self) -> bool {
        self.is_of(|effect| effect.name() == width_error().name())
    }

    /// Whether it is the scale of all forces.
    pub fn is_load(&self) -> bool {
        self.is_of(|effect| effect.is_force_scale())
    }
}
