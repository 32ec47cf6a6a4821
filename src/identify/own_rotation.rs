//! How far the load itself turns a specimen whose supports hold it.
//!
//! A strip that is pulled across its fibres shears, and between grips its middle turns: by 1.3 mrad under 1 % of strain (an off-axis ply,
//! measured). Linear finite elements have that rotation as they have strains, to first order. Taken for a motion of the camera it would turn
//! the strains, which is a shear of 9 microstrain there.

use crate::error::Result;
use crate::experiment::{FieldSolver, State};
use crate::field::Field;
use crate::field::rigid;
use crate::infer::{Model, Observation};
use crate::linearise::{AtPoints, CandidateColumns, Forward, Measured, Slopes};

/// The rotation of the measured points, rad, that the nominal force causes at the constants that fit a field best; none of a specimen that
/// nothing holds, whose solution has no rotation of its own.
///
/// # Errors
/// Those of finite-element solutions.
pub(super) fn own_rotation(
    model: &Model,
    experiment: &dyn FieldSolver,
    observation: &Observation,
    field: &Field,
) -> Result<f64> {
    if !experiment.is_held() || model.experiment().measurement.image_correlation.is_none() {
        return Ok(0.0);
    }
    let sight = &observation.sight;
    let measured = Measured::new(field, experiment, (sight, None), |_| true);
    let forward = Forward {
        model,
        observing: Box::new(AtPoints {
            experiment,
            slopes: Slopes::new(experiment, sight, &measured.blocks),
            size_mm: measured.size_mm,
        }),
        solves_width: false,
        step: &|| (),
    };
    let mut state = forward.beginning(model.state(&|_| None));
    let declared = forward.declared();
    forward.at_ridge(
        &measured,
        &mut state,
        &declared,
        &[],
        CandidateColumns::Here,
    )?;
    // as the supports leave it, and a plain camera sees it
    let plain = State::new(&state.shared.constants, state.shared.thickness_mm);
    let look = experiment.look(&plain, sight, false)?;
    Ok(rigid::fit(sight.all(), &look.loaded).angle)
}
