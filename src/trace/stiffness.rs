//! The rival of a discrepancy that grows with the load: a relative change of the membrane stiffness that varies smoothly over the window.
//!
//! Where the smooth discrepancy of a series grows with the load, the material itself may be softer in some places than in others, for
//! which the dictionary has no name. Its stiffness is a sum of bumps, whose amplitudes are weighed by evidence against the discrepancy of no
//! mechanics (SERIES: 5 mm between bumps of 4 mm sd in a window of some 30 mm).

use nalgebra::DVector;

use super::averaged::{AveragedPart, LEAST_MULTIPLE, MULTIPLES, mixtures, part, rival_of};
use super::evidence::Evidence;
use super::tracing::{StiffnessAt, StiffnessField};
use crate::error::Result;
use crate::experiment::Softening;
use crate::experiment::series::SeriesState;
use crate::fem::Bump;
use crate::field::bounds;
use crate::linearise::Forward;
use crate::noise::series::DISCREPANCY;
use crate::numeric::log_sum_exp;
use crate::posterior::NoisePair;
use crate::posterior::Weighing;

/// Bumps along the window's shorter side, and their sd over the distance between them.
const ALONG: f64 = 6.0;
const WIDTH: f64 = 0.8;

/// Prior sds of the bumps' amplitudes, equally probable.
const SIZES: [f64; 5] = [0.02, 0.05, 0.1, 0.2, 0.4];

/// Share of the prior probability of a discrepancy that one growing with the load has.
const WITH_THE_LOAD: f64 = 0.5;

/// Weigh a field of the stiffness against the discrepancy that the evidence prefers, beside the best subset of effects; none where the
/// discrepancy explains more.
///
/// # Errors
/// Those of finite-element solutions and of the noise.
pub fn stiffness_field(
    forward: &Forward<'_>,
    evidence: &Evidence,
    state: &SeriesState,
) -> Result<Option<StiffnessField>> {
    let measured = &evidence.measured;
    let places = &measured.blocks.centroid;
    let bumps = bumps(places);
    let mut sensitivities = evidence.with_best();
    sensitivities.near_edge = forward.about(state)?.softened(Softening::Bumps(&bumps))?;
    let weighing = Weighing::new(measured, &sensitivities, &|| ())?;
    let mut soft: Vec<(AveragedPart, [f64; 2], NoisePair)> = Vec::new();
    let mut other = Vec::new();
    let one_of = (WITH_THE_LOAD * DISCREPANCY / (1.0 - DISCREPANCY) / SIZES.len() as f64).ln();
    for pair in &weighing.pairs {
        for multiple in MULTIPLES.into_iter().filter(|m| *m >= LEAST_MULTIPLE) {
            if pair.discrepancy {
                other.push(part(&weighing, &sensitivities, pair, [multiple, 0.0])?);
                continue;
            }
            for size in SIZES {
                let mut own = part(&weighing, &sensitivities, pair, [multiple, size])?;
                own.log_weight += one_of;
                soft.push((own, [multiple, size], *pair));
            }
        }
    }
    let [with, without] = [
        log_sum_exp(soft.iter().map(|s| s.0.log_weight)),
        log_sum_exp(other.iter().map(|p| p.log_weight)),
    ];
    let probability = 1.0 / (1.0 + (without - with).exp());
    let likeliest = soft
        .iter()
        .max_by(|a, b| a.0.log_weight.total_cmp(&b.0.log_weight));
    let Some((_, sizes, pair)) = likeliest.filter(|_| probability > 0.5) else {
        return Ok(None);
    };
    let (mean, covariance) = rival_of(&weighing, &sensitivities, pair, *sizes)?;
    let place = |&at_mm: &[f64; 2]| {
        let weights = DVector::from_iterator(bumps.len(), bumps.iter().map(|b| b.at(at_mm)));
        StiffnessAt {
            at_mm,
            change: weights.dot(&mean),
            sd: weights.dot(&(&covariance * &weights)).max(0.0).sqrt(),
        }
    };
    let map: Vec<StiffnessAt> = places.iter().map(place).collect();
    let sure = |p: &StiffnessAt| (p.change / p.sd).abs();
    let surest = map.iter().max_by(|a, b| sure(a).total_cmp(&sure(b)));
    let Some(&surest) = surest else {
        return Ok(None);
    };
    let size = sizes[1];
    let all: Vec<AveragedPart> = soft.into_iter().map(|s| s.0).chain(other).collect();
    Ok(Some(StiffnessField {
        probability,
        size,
        surest,
        map,
        constants: mixtures(&sensitivities, &all),
    }))
}

/// Bumps all over the window.
fn bumps(places: &[[f64; 2]]) -> Vec<Bump> {
    let [low, high] = bounds(places);
    let side = [0, 1].map(|k| high[k] - low[k]);
    let apart = side[0].min(side[1]) / (ALONG - 1.0);
    let count = side.map(|side| (side / apart).round() as usize + 1);
    let at = |k: usize, i: usize| low[k] + side[k] * i as f64 / (count[k] - 1).max(1) as f64;
    (0..count[0])
        .flat_map(|i| (0..count[1]).map(move |j| [i, j]))
        .map(|[i, j]| Bump {
            center_mm: [at(0, i), at(1, j)],
            sd_mm: WIDTH * apart,
        })
        .collect()
}
