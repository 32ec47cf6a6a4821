//! The `mask` of a measurement: parts of the data that are not to be used, such as paint that has come off.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// One part, in the data's coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskShape {
    Circle(MaskedCircle),
    Polygon(MaskedPolygon),
}

/// `{"circle": {"center_mm": [9.3, 4.6], "radius_mm": 2}}`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaskedCircle {
    pub center_mm: [f64; 2],
    pub radius_mm: f64,
}

/// `{"polygon": {"points_mm": [[0, 0], [2, 0], [2, 3]]}}`, closed from the last corner to the first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaskedPolygon {
    pub points_mm: Vec<[f64; 2]>,
}

impl MaskShape {
    /// Whether a point of the data is left out.
    pub fn covers(&self, [x, y]: [f64; 2]) -> bool {
        match self {
            Self::Circle(MaskedCircle {
                center_mm: [cx, cy],
                radius_mm,
            }) => (x - cx).hypot(y - cy) <= *radius_mm,
            Self::Polygon(polygon) => {
                let corners = &polygon.points_mm;
                let next = corners.iter().cycle().skip(1);
                // a ray along x crosses the border an odd number of times
                let crossed = |(a, b): (&[f64; 2], &[f64; 2])| {
                    (a[1] > y) != (b[1] > y)
                        && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
                };
                corners.iter().zip(next).filter(|e| crossed(*e)).count() % 2 == 1
            }
        }
    }

    /// As it is written in a model file.
    pub fn text(&self) -> Option<String> {
        serde_json::to_string(self).ok()
    }

    fn check(&self, k: usize) -> Result<()> {
        let finite = |points: &[[f64; 2]]| points.iter().flatten().all(|x| x.is_finite());
        let place = |key: &str| format!("mask[{k}].{key}");
        match self {
            Self::Circle(circle) => {
                if !finite(&[circle.center_mm]) {
                    let found = format!("{:?}", circle.center_mm);
                    return Err(
                        Error::input(place("circle.center_mm"), "two finite numbers").found(found),
                    );
                }
                // written so that a NaN fails too
                if !(circle.radius_mm > 0.0 && circle.radius_mm.is_finite()) {
                    let expected = "a positive length in mm";
                    let place = place("circle.radius_mm");
                    return Err(Error::input(place, expected).found(circle.radius_mm));
                }
            }
            Self::Polygon(polygon) => {
                let corners = &polygon.points_mm;
                if corners.len() < 3 || !finite(corners) {
                    let expected = "at least three corners [x, y], finite numbers in mm";
                    return Err(Error::input(place("polygon.points_mm"), expected)
                        .found(format!("{corners:?}")));
                }
            }
        }
        Ok(())
    }
}

/// Refuse a mask that is none.
///
/// # Errors
/// Of the input, at the shape that is wrong.
pub(super) fn check(mask: &[MaskShape]) -> Result<()> {
    let mut shapes = mask.iter().enumerate();
    shapes.try_for_each(|(k, shape)| shape.check(k))
}
