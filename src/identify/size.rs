//! A measurement that cannot be meant.

use crate::error::{Error, Result};
use crate::experiment::{Gauge, PointSet, gauged};
use crate::field::Field;

/// Largest ratio of the measured displacements to the model's that is not a mistake in the units.
const MOST_RATIO: f64 = 5.0;

/// Fields of a smaller cosine differ by more than a factor, which no mistake in the units makes.
const SIMILAR: f64 = 0.8;

/// How many times as large as predicted each component is; nothing of one that is another field altogether: what the model lacks may be larger
/// than what it has.
fn ratios(field: &Field, predicted: &[[f64; 2]]) -> [Option<f64>; 2] {
    let points = PointSet::anywhere(&field.points, &[]);
    let [predicted, measured] =
        [predicted, &field.displacement].map(|u| gauged(Gauge::Window, &points, u));
    [0, 1].map(|c: usize| {
        let dot = |a: &[[f64; 2]], b: &[[f64; 2]]| {
            let products = a.iter().zip(b).map(|(a, b)| a[c] * b[c]);
            products.sum::<f64>()
        };
        let (both, square) = (dot(&measured, &predicted), dot(&predicted, &predicted));
        let cosine = both / (dot(&measured, &measured) * square).sqrt();
        (cosine.abs() >= SIMILAR).then_some(both / square)
    })
}

fn is_right(ratio: f64) -> bool {
    (1.0 / MOST_RATIO..MOST_RATIO).contains(&ratio)
}

/// Whether a field is what is predicted on another scale.
pub fn is_on_another_scale(field: &Field, predicted: &[[f64; 2]]) -> bool {
    let all = ratios(field, predicted);
    let mut known = all.iter().flatten();
    let is_turned = all.iter().flatten().any(|r| *r < 0.0);
    !is_turned && known.any(|r| !is_right(*r))
}

/// A field many times too large, too small, or of the wrong sign for what the model's own constants make it is a mistake in the units, the
/// axes or the load, and no posterior should come of it.
///
/// # Errors
/// Of the input, naming the component and its ratio to the model's.
pub fn check_size(field: &Field, predicted: &[[f64; 2]]) -> Result<()> {
    let all = ratios(field, predicted);
    for (c, direction) in ["u1, along the load", "u2, across it"].iter().enumerate() {
        let Some(ratio) = all[c].filter(|r| !is_right(*r)) else {
            continue;
        };
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
