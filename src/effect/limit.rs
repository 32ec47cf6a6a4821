//! How far an amplitude may go in a given test.

use super::{Acting, Kind, amplitude_name};
use crate::error::{Error, Result};
use crate::fem::Setup;

/// Halvings of the interval in which an amplitude's limit is sought.
const HALVINGS: usize = 60;

/// Let the mechanical effects among `acting` change a test, one after the other.
///
/// # Errors
/// An amplitude for which the plate could not be: the hole touches an edge, or some part has no stiffness. The error
/// says how far the amplitude may go.
pub fn alter_checked(place: &str, acting: &[Acting], setup: &mut Setup) -> Result<()> {
    for a in acting
        .iter()
        .filter(|a| a.effect.kind() == Kind::Mechanical)
    {
        let at = |share: f64| {
            let amplitude: Vec<f64> = a.amplitude.iter().map(|x| share * x).collect();
            let mut altered = setup.clone();
            a.effect.alter(&amplitude, &mut altered);
            altered
        };
        let altered = at(1.0);
        if let Err(reason) = altered.validate() {
            let mut range = [0.0, 1.0];
            for _ in 0..HALVINGS {
                let middle = 0.5 * (range[0] + range[1]);
                range[usize::from(at(middle).validate().is_err())] = middle;
            }
            return Err(refusal(place, a, range[0], &reason));
        }
        *setup = altered;
    }
    Ok(())
}

fn refusal(place: &str, acting: &Acting, share: f64, reason: &Error) -> Error {
    let parameters = acting.effect.parameters();
    let list = |share: f64| {
        let values = parameters.iter().zip(&acting.amplitude);
        let text =
            values.map(|(p, x)| format!("{} = {:.4}", amplitude_name(acting.effect, p), share * x));
        text.collect::<Vec<_>>().join(", ")
    };
    Error::input(
        place,
        format!("an amplitude within the bound {}", list(share)),
    )
    .found(list(1.0))
    .hint(reason.to_string())
}
