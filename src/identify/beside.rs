//! A field and the frequencies of plates of the same material: each by itself, how far they disagree, and what the frequencies say to
//! whoever identifies the field.

use std::sync::Arc;

use super::frequencies::{FrequenciesFound, identify_frequencies};
use super::solve::{Options, identify};
use crate::chain::Draws;
use crate::error::{Error, Result};
use crate::infer::{FrequenciesModel, Known, Model, Moments, Tension};
use crate::progress::Progress;

/// Frequencies beside a field.
pub struct Beside {
    pub model: FrequenciesModel,
    pub found: FrequenciesFound,
    /// Constants by the frequencies alone, and by the field alone with the effects that its model declares.
    pub frequencies: Moments,
    pub field: Moments,
    /// None where a posterior has no covariance.
    pub tension: Option<Tension>,
}

/// Identify the constants of a model from the frequencies that stand beside its field, and from the field alone; the model knows
/// afterwards what the frequencies say. None where there are no frequencies.
///
/// What they say is passed on as a normal density (moments of the sampled posterior without its prior): exact where that is normal.
///
/// # Errors
/// Those of either identification.
pub fn beside(
    model: &mut Model,
    [of_frequencies, of_field]: [&Options<'_>; 2],
    progress: &dyn Progress,
) -> Result<Option<Beside>> {
    let Some(plate) = FrequenciesModel::beside(model) else {
        return Ok(None);
    };
    let found = identify_frequencies(&plate, of_frequencies, progress)?;
    let frequencies = know(model, &found.draws)?;
    let alone = Model {
        known: None,
        ..model.clone()
    };
    let field = identify(&alone, of_field, progress)?;
    let field = Moments::of(field.draws.points(), model.constants().len());
    let tension = Tension::between(&field, &frequencies, &model.marginals());
    Ok(Some(Beside {
        model: plate,
        found,
        frequencies,
        field,
        tension,
    }))
}

/// Let a model know what draws of the frequencies' posterior say of its constants, which stand first in them; their moments.
///
/// # Errors
/// Of the program: draws that do not vary.
pub fn know(model: &mut Model, draws: &Draws) -> Result<Moments> {
    let moments = Moments::of(draws.points(), model.constants().len());
    let mean: Vec<f64> = moments.mean.iter().copied().collect();
    let known = Known::beyond_prior(&mean, &moments.covariance, &model.marginals());
    let known = known.ok_or_else(|| Error::program("frequencies", "draws that vary"))?;
    model.known = Some(Arc::new(known));
    Ok(moments)
}
