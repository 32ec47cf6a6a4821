//! The strain that a single field's rotation leaves: it does not tell where the camera's axis and the specimen's pivot are
//! ([`crate::linearise`]), and a strain stands for both.

use crate::effect::{EFFECTS, Effect, amplitude_name};
use crate::infer::Model;
use crate::linearise::{AXIS_MM, PIVOT_MM};

/// Take the strain that the unknown axes leave into the model of a field whose specimen was found to turn, with the size that they may give
/// it: fitted without it, fields turned by 1.25 mrad were never described by the rotation alone.
pub(super) fn entail_strain(
    model: &mut Model,
    effect: &'static dyn Effect,
    amplitude: &[(f64, f64)],
) {
    let Some(strain) = effect.entails() else {
        return;
    };
    let declared = model.effects.iter().any(|e| e.name() == strain.name());
    let distance_mm = model.scene().camera_distance_mm;
    let Some(distance_mm) = distance_mm.filter(|_| !declared) else {
        return;
    };
    let parameters = effect.parameters().len();
    let amplitude: Vec<f64> = amplitude[..parameters].iter().map(|(a, _)| *a).collect();
    let sd = effect.entailed_sd(&amplitude, AXIS_MM.hypot(PIVOT_MM), distance_mm);
    let experiment = model.experiment_mut();
    experiment.effects.push(strain.name().into());
    for parameter in strain.parameters() {
        let name = amplitude_name(strain, parameter);
        experiment.plausible.entry(name).or_insert(sd);
    }
    let place = |e: &&'static dyn Effect| EFFECTS.iter().position(|k| k.name() == e.name());
    model.effects.push(strain);
    model.effects.sort_by_key(place);
}

/// What is said of it, and of a camera whose distance is not declared.
pub fn words(model: &Model) -> String {
    beside(model).unwrap_or_default() + &assumed(model).unwrap_or_default()
}

fn assumed(model: &Model) -> Option<String> {
    let images = model.experiment().measurement.image_correlation?;
    let mut names = model.effects.iter().map(|e| e.name());
    let out_of_plane = names.any(|name| name.starts_with("out_of_plane_"));
    let distance_mm = model.scene().camera_distance_mm?;
    (out_of_plane && images.camera_distance_mm.is_none()).then(|| {
        format!(
            " The distance of the camera is not declared: {distance_mm:.0} mm is assumed. The amplitudes out of the plane depend on it."
        )
    })
}

fn beside(model: &Model) -> Option<String> {
    let entailed = model.effects.iter().find_map(|e| e.entails())?;
    let declared = model.effects.iter().any(|e| e.name() == entailed.name());
    let name = amplitude_name(entailed, &entailed.parameters()[0]);
    let strain = model.experiment().plausible.get(&name)?;
    (declared && model.experiment().steps.is_none()).then(|| {
        format!(
            " Beside the rotation a uniform strain of +- {strain:.0} microstrain takes part: about an axis off the hole, or before a camera whose \
             axis is off the middle of the picture, a rotation leaves one, and a single field does not tell where the axes are; a load series does."
        )
    })
}
