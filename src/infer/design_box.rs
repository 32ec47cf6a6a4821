//! The box of the design of experiments, drawn in where a corner holds no ply that can be.

use super::model::Model;
use crate::error::{Error, Result};
use crate::laminate::Material;
use crate::parameter::is_modulus;
use crate::reduce::{Dimension, THICKNESS};

/// How near to the limit nu12^2 = E1/E2, where the stiffness is infinite, the box comes: nu12^2 E2/E1 at most.
const NEAREST: f64 = 0.8;

/// Halvings of the share of the way to the box's sides.
const HALVINGS: u32 = 40;

/// Half-width of the default DoE box in prior standard deviations.
const BOX_SDS: f64 = 3.0;

/// Smallest modulus of the default DoE box as a fraction of its prior mean.
const SMALLEST_MODULUS: f64 = 0.25;

/// What is drawn in of the constants' box because a ply could not be there; none if nothing is.
pub fn drawn_in(model: &Model) -> Option<String> {
    let mut sides = wide_box(model);
    declare(model, &mut sides);
    draw_in_undeclared(model, &mut sides)
}

/// Draw in sides for which no bounds are declared.
fn draw_in_undeclared(model: &Model, sides: &mut [Dimension]) -> Option<String> {
    let declared = model.file.reduced_model.doe.iter().flatten();
    let declared: Vec<&String> = declared.map(|(name, _)| name).collect();
    let is_fixed = |name: &str| declared.iter().any(|d| *d == name);
    draw_in(model.material(), &model.means(), sides, &is_fixed)
}

/// Give sides the bounds that are declared for them.
fn declare(model: &Model, sides: &mut [Dimension]) {
    let declared = model.file.reduced_model.doe.iter().flatten();
    for (name, [low, high]) in declared {
        for side in sides.iter_mut().filter(|d| d.name == *name) {
            (side.low, side.high) = (*low, *high);
        }
    }
}

/// The constants' box as the priors have it.
fn wide_box(model: &Model) -> Vec<Dimension> {
    model
        .constants()
        .iter()
        .zip(model.marginals())
        .map(|(name, m)| {
            let low = m.mean - BOX_SDS * m.sd;
            let floor = if is_modulus(name) {
                SMALLEST_MODULUS * m.mean
            } else {
                f64::NEG_INFINITY
            };
            Dimension {
                name: (*name).into(),
                low: low.max(floor),
                high: m.mean + BOX_SDS * m.sd,
            }
        })
        .collect()
}

/// Whether the DoE box may have a side of this name.
pub fn may_have_side(model: &Model, name: &str) -> bool {
    name == THICKNESS || model.constants().contains(&name)
}

/// The DoE box: declared bounds, or those of [`prior_box`], and the thickness' mean +- 4 sd.
pub(super) fn dimensions(model: &Model) -> Result<Vec<Dimension>> {
    let mut dimensions = wide_box(model);
    let thickness = model.experiment().specimen.thickness_mm;
    if thickness.sd > 0.0 {
        dimensions.push(Dimension {
            name: THICKNESS.into(),
            low: thickness.mean - 4.0 * thickness.sd,
            high: thickness.mean + 4.0 * thickness.sd,
        });
    }
    let known: Vec<&str> = dimensions.iter().map(|d| &d.name[..]).collect();
    let mut declared = model.file.reduced_model.doe.iter().flatten();
    if let Some((name, _)) = declared.find(|(name, _)| !known.contains(&&name[..])) {
        return Err(Error::input(
            format!("{}: reduced_model.doe", model.path.display()),
            format!("one of {}", known.join(", ")),
        )
        .found(name));
    }
    declare(model, &mut dimensions);
    draw_in_undeclared(model, &mut dimensions);
    Ok(dimensions)
}

/// Draw the sides about `middle` (the priors' means; the dimensions begin with the constants) in until every corner is admissible with a
/// margin: all that have a part in the corners that are not, by one share of the way from the middle. Sides for which `is_fixed` holds
/// stay. Returns what was drawn in, none if nothing was or if that is not enough.
fn draw_in(
    material: Material,
    middle: &[f64],
    sides: &mut [Dimension],
    is_fixed: &dyn Fn(&str) -> bool,
) -> Option<String> {
    let count = middle.len();
    let at = |share: f64| -> Vec<[f64; 2]> {
        let one = |(side, &middle): (&Dimension, &f64)| {
            let share = if is_fixed(&side.name) { 1.0 } else { share };
            [side.low, side.high].map(|end| middle + share * (end - middle))
        };
        sides.iter().zip(middle).map(one).collect()
    };
    if sides.len() < count || fits(material, &at(1.0)) || !fits(material, &at(0.0)) {
        return None;
    }
    let mut range = [0.0, 1.0];
    for _ in 0..HALVINGS {
        let half = 0.5 * (range[0] + range[1]);
        range[usize::from(!fits(material, &at(half)))] = half;
    }
    let inner = at(range[0]);
    let mut drawn: Vec<[f64; 2]> = sides[..count].iter().map(|s| [s.low, s.high]).collect();
    let mut said = Vec::new();
    for k in 0..count {
        for end in 0..2 {
            // an end that has no part in it goes back to where it was
            let mut tried = inner.clone();
            tried[..k].copy_from_slice(&drawn[..k]);
            tried[k][..end].copy_from_slice(&drawn[k][..end]);
            let outer = drawn[k][end];
            tried[k][end] = outer;
            if !fits(material, &tried) {
                drawn[k][end] = inner[k][end];
            }
        }
    }
    for (side, [low, high]) in sides.iter_mut().zip(drawn) {
        if [low, high] == [side.low, side.high] {
            continue;
        }
        said.push(format!(
            "{} from [{:.4}, {:.4}] to [{low:.4}, {high:.4}]",
            side.name, side.low, side.high
        ));
        (side.low, side.high) = (low, high);
    }
    Some(said.join(", "))
}

/// Whether every corner of a box holds an admissible ply, not too near to the limit.
fn fits(material: Material, sides: &[[f64; 2]]) -> bool {
    (0..1usize << sides.len()).all(|corner| {
        let ends = sides.iter().enumerate();
        let point: Vec<f64> = ends.map(|(k, ends)| ends[corner >> k & 1]).collect();
        let ply = material.ply(&point);
        ply.is_admissible() && ply.nu12 * ply.nu12 * ply.e2 <= NEAREST * ply.e1
    })
}
