//! A measurement that cannot be meant.

use crate::error::{Error, Result};
use crate::experiment::{Gauge, Sight, gauged};
use crate::field::Field;

/// Largest ratio of the measured displacements to the model's that is not a mistake in the units.
const MOST_RATIO: f64 = 5.0;

/// Fields of a smaller cosine differ by more than a factor, which no mistake in the units makes.
const SIMILAR: f64 = 0.8;

/// A field many times too large, too small, or of the wrong sign for what the model's own constants make it is a mistake in the units, the
/// axes or the load, and no posterior should come of it.
///
/// # Errors
/// Of the input, naming the component and its ratio to the model's.
pub fn check_size(field: &Field, predicted: &[[f64; 2]]) -> Result<()> {
    let points = Sight::anywhere(&field.points, &[]);
    let [predicted, measured] =
        [predicted, &field.displacement].map(|u| gauged(Gauge::Window, &points, u));
    for (c, direction) in ["u1, along the load", "u2, across it"].iter().enumerate() {
        let dot = |a: &[[f64; 2]]| {
            a.iter()
                .zip(&predicted)
                .map(|(a, b)| a[c] * b[c])
                .sum::<f64>()
        };
        let square: f64 = measured.iter().map(|u| u[c] * u[c]).sum();
        let cosine = dot(&measured) / (square * dot(&predicted)).sqrt();
        if cosine.abs() < SIMILAR {
            // another field altogether: what the model lacks may be larger than what it has
            continue;
        }
        let ratio = dot(&measured) / dot(&predicted);
        if (1.0 / MOST_RATIO..MOST_RATIO).contains(&ratio) {
            continue;
        }
        let place = match &field.files[..] {
            [_, _, u, v] if field.grid.is_some() => [u, v][c].display().to_string(),
            files => files
                .first()
                .map_or_else(|| "measurement".into(), |f| f.display().to_string()),
        };
        let size = format!("{:.1} to {MOST_RATIO}", 1.0 / MOST_RATIO);
        // of constants that are known to some tens of percent
        let near = |factor: f64| {
            [ratio, 1.0 / ratio]
                .iter()
                .any(|r| (0.5..2.0).contains(&(r / factor)))
        };
        let hint = if near(1000.0) {
            "a factor of about a thousand: a force in kN, coordinates or displacements in m or um, or moduli in MPa?"
        } else if near(25.4) || near(1000.0 / 25.4) {
            "a factor of about 25.4 or 39.4: displacements, coordinates, the width or the thickness in inches (25.4 mm) or in mils (0.0254 mm)?"
        } else if ratio < 0.0 {
            "check the signs and directions of the axes, and which file or column is which"
        } else {
            "check the units, the loading axis, which file or column is which, the layup, the load and the thickness"
        };
        return Err(Error::input(
            place,
            format!("displacements {size} times those the model predicts for its prior means"),
        )
        .found(format!(
            "displacements ({direction}) {ratio:.3} times as large"
        ))
        .hint(hint));
    }
    Ok(())
}
