//! What the data added to a prior. An interval that is the prior's is no measurement: it is said wherever an interval stands.

use serde::{Deserialize, Serialize};

use super::json::Keyed;
use super::round::MeanAndSd;
use crate::infer::{Marginal, Model};
use crate::parameter::{Parameter, is_modulus};
use crate::section::TableCell;

/// What the data added to the prior of a constant.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Learned {
    /// Mean and sd of the prior, border units.
    pub prior: MeanAndSd,
    /// 1 - sd^2 / prior sd^2: 0 where the data said nothing, 1 where the prior does not matter.
    pub from_data: f64,
    /// Posterior mean less the prior's, prior sds.
    pub shift_prior_sd: f64,
    /// Whether it is of a common factor that only a force would tell, and none is known: the data say nothing then.
    #[serde(default)]
    pub lacks_force: bool,
}

/// Share of the prior variance that the data must have taken away before an interval is called measured.
const MEASURED: f64 = 0.5;

impl Learned {
    pub fn new(prior: MeanAndSd, found: MeanAndSd) -> Self {
        Self {
            prior,
            from_data: 1.0 - (found.sd / prior.sd).powi(2),
            shift_prior_sd: (found.mean - prior.mean) / prior.sd,
            lacks_force: false,
        }
    }

    /// The same constant where it is of a common factor of which no force is known.
    fn without_force(self) -> Self {
        Self {
            from_data: 0.0,
            lacks_force: true,
            ..self
        }
    }

    /// The same constant as another posterior has it.
    pub fn of(&self, found: MeanAndSd) -> Self {
        let other = Self::new(self.prior, found);
        match self.lacks_force {
            true => other.without_force(),
            false => other,
        }
    }

    /// Whether the interval is mostly the prior's.
    pub fn is_mostly_prior(&self) -> bool {
        self.from_data < MEASURED
    }

    /// The prior, and what of its variance the data took away.
    pub fn cells(learned: Option<&Self>) -> [TableCell; 2] {
        let share = learned.map_or(TableCell::Blank, |l| {
            let percent = format!("{:.0} %", 100.0 * l.from_data.max(0.0));
            match l.is_mostly_prior() {
                true if l.lacks_force => format!("{percent}: no force is known").into(),
                true => format!("{percent}: mostly the prior").into(),
                false => percent.into(),
            }
        });
        [TableCell::published(learned.map(|l| l.prior)), share]
    }
}

/// What the data added to the priors of a model's constants.
pub fn learned(model: &Model, found: &Keyed<MeanAndSd>) -> Keyed<Learned> {
    let priors = model.constants().iter().zip(model.marginals());
    let one = |(name, prior): (&&str, Marginal)| {
        let prior = (prior.mean, prior.sd).into();
        let learned = Learned::new(prior, *found.get(*name)?);
        let lacks_force = model.experiment().lacks_force() && is_modulus(name);
        let learned = if lacks_force {
            learned.without_force()
        } else {
            learned
        };
        Some(((*name).to_string(), learned))
    };
    priors.filter_map(one).collect()
}

/// Headers of [`Learned::cells`].
pub const HEADERS: [&str; 2] = ["prior", "from the data"];

/// What is said of constants whose intervals are mostly the prior's.
pub fn not_measured(learned: &Keyed<Learned>) -> Option<String> {
    let weak = learned.iter().filter(|(_, l)| l.is_mostly_prior());
    let names: Vec<String> = weak
        .map(|(name, _)| Parameter::read(name).symbol().to_string())
        .collect();
    let all = names.len() == learned.len();
    (!names.is_empty()).then(|| {
        let which = match all {
            true => "every constant".to_string(),
            false => names.join(", "),
        };
        format!(
            "Not measured: {which}. These intervals are mostly the prior's. Do not quote them as results of this test."
        )
    })
}
