//! The evidence of accounts beside that of the full finite elements.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;

use plychain::identify::{Begun, InverseProblem, forward, inverse_problem, prepare};
use plychain::infer::{EffectUnderLaw, Model};
use plychain::noise::NormalEquations;
use plychain::numeric::log_sum_exp;
use plychain::posterior::{Full, LinearisationPoint, with_data};
use plychain::progress::Silent;
use plychain::trace::{LinearisedEvidence, attribute, extended};

use crate::common::coarse;
use crate::tracing::{Noise, measured_with};

/// Draws that weigh the difference between a linearisation at the mode and the full model.
const DRAWS: usize = 256;

/// Log evidence of an account under the traced noise without the linearisation that tracing weighs by: linearised at the account's own mode, with
/// all its effects in the state, and weighed there by draws of the full finite elements (importance sampling; Kass and Raftery 1995,
/// section 4.2). With the effective share of the draws.
fn of_full_model(
    model: &Model,
    inverse: &InverseProblem,
    traced: &LinearisedEvidence,
    own: &[usize],
) -> (f64, f64) {
    let evidence = &traced.evidence;
    let measured = &inverse.measured;
    let pair = evidence.weighing.pairs[evidence.subsets.best_pair];
    let forward = forward(model, &inverse.prepared, measured, &|| ());
    let mut point = traced.point.clone();
    point
        .declared
        .extend(own.iter().map(|k| traced.point.sought[*k]));
    // what tracing took into the state beside
    let sought = std::mem::take(&mut point.sought);
    let acts = |e: &EffectUnderLaw| {
        point
            .declared
            .iter()
            .any(|d| d.effect.name() == e.effect.name())
    };
    for other in sought.iter().filter(|e| !acts(e)) {
        point.state.remove(other.effect);
    }
    let mut last = None;
    for _ in 0..4 {
        let here = forward
            .sensitivities(&point.state, &point.declared, &[])
            .unwrap();
        let fields = [0, 1].map(|c| with_data(measured, &here, c));
        let both = [&fields[0], &fields[1]];
        let grams = evidence
            .weighing
            .noise
            .grams(&measured.blocks, both, &[pair])
            .unwrap();
        let gram: DMatrix<f64> = grams.into_iter().sum();
        let data = gram.ncols() - 1;
        let columns: Vec<(usize, f64)> = (0..data).map(|k| (k, 1.0)).collect();
        let fit = NormalEquations::of_columns(&gram, |k| gram[(k, data)], &columns).unwrap();
        let log = fit.log_evidence() - 0.5 * gram[(data, data)];
        let mean = fit.mean();
        let at = point.state.clone();
        forward.moved(
            &mut point.state,
            &point.declared,
            (&here, mean.as_slice()),
            3.0,
        );
        last = Some((at, here, fields, fit, log));
    }
    let (state, here, fields, fit, log) = last.unwrap();
    let point = LinearisationPoint { state, ..point };
    let full = Full {
        forward: &forward,
        point: &point,
        here: &here,
    };
    let origin = full.origin().unwrap();
    let (mean, root) = (fit.mean(), fit.covariance().cholesky().unwrap().l());
    let mut rng = Pcg64Dxsm::seed_from_u64(7);
    let mut draw = || {
        let z = DVector::from_fn(mean.len(), |_, _| StandardNormal.sample(&mut rng));
        &mean + &root * z
    };
    let draws: Vec<DVector<f64>> = (0..DRAWS).map(|_| draw()).collect();
    let all: Vec<_> = here.columns().collect();
    let weight = |x: &DVector<f64>| {
        let constants = all[..here.constants].iter().zip(x);
        let constants: Vec<f64> = constants.map(|(c, x)| c.mean + c.sd * x).collect();
        let amplitudes = &x.as_slice()[here.constants..];
        let Ok(change) = full.change(&full.drawn(&constants, amplitudes), &origin) else {
            return f64::NEG_INFINITY;
        };
        let data = all.len();
        let linear = [0, 1].map(|c| fields[c].column(data) - fields[c].columns(0, data) * x);
        let own = [0, 1].map(|c| {
            let mut beyond = change[c].clone();
            for (column, x) in all.iter().zip(x) {
                let by = x - (column.at - column.mean) / column.sd;
                beyond.axpy(-by, &column.values[c], 1.0);
            }
            &linear[c] - beyond
        });
        let norms = evidence
            .weighing
            .norms(measured, &pair, &[linear, own])
            .unwrap();
        0.5 * (norms[0].powi(2) - norms[1].powi(2))
    };
    let logs: Vec<f64> = draws.par_iter().map(weight).collect();
    let total = log_sum_exp(logs.iter().copied());
    let squares = log_sum_exp(logs.iter().map(|l| 2.0 * l));
    let share = (2.0 * total - squares).exp() / DRAWS as f64;
    (log + total - (DRAWS as f64).ln(), share)
}

/// The same by what tracing was linearised to.
fn of_tracing(traced: &LinearisedEvidence, own: &[usize]) -> f64 {
    let evidence = &traced.evidence;
    let gram = evidence
        .weighing
        .gram(&evidence.weighing.pairs[evidence.subsets.best_pair]);
    let (base, data) = (evidence.sensitivities.base.len(), gram.ncols() - 1);
    let own = evidence.subsets.layout.columns(&own.to_vec());
    let columns = (0..base).chain(own.iter().map(|k| base + k));
    let columns: Vec<(usize, f64)> = columns.map(|k| (k, 1.0)).collect();
    let fit = NormalEquations::of_columns(&gram, |k| gram[(k, data)], &columns).unwrap();
    fit.log_evidence() - 0.5 * gram[(data, data)]
}

/// The account of one effect, however loud, is the likeliest where it is the truth, and its evidence that of the full model within .2 nat; of two,
/// taken in one after the other, within 1 nat. Bending of a plate is judged by whole loops, which bend it by the constants that they found.
#[test]
#[ignore = "slow: run by .ci/run"]
fn evidence_is_that_of_the_full_model() {
    for effects in [
        &[][..],
        &["hole_size=0.3"],
        &["hole_size=5"],
        &["hole_edge_damage=35,0"],
        &["thermal_strain=4.5"],
        &["magnification=2"],
        &["shear_nonlinearity=0.0000002"],
        &["load_misalignment=0.6", "in_plane_bending=-0.1"],
        &["ply_misorientation=1.2", "registration_offset=-0.09,0"],
        &["camera_rotation=0.4", "magnification=1"],
    ] {
        let mut model = measured_with(&coarse(), 121, effects, Noise::White, 8);
        let mut prepared = prepare(&model, &Silent).unwrap();
        let acting = effects.iter().map(|e| e.split_once('=').unwrap().0);
        let acting: Vec<&str> = acting.collect();
        for round in 0..=effects.len() {
            let inverse = inverse_problem(&model, prepared.clone(), &Silent).unwrap();
            let (tracing, traced) = attribute(&model, &inverse, &|_| true, &Silent).unwrap();
            let own = traced.evidence.subsets.best();
            let name = |k: &usize| traced.point.sought[*k].effect.name();
            let names: Vec<_> = own.iter().map(name).collect();
            let (full, share) = of_full_model(&model, &inverse, &traced, own);
            let differs = of_tracing(&traced, own) - full;
            let said = format!(
                "{acting:?}, round {round}: {names:?} {differs:+.2} nats, share {share:.2}"
            );
            println!("{said}");
            let error = ((1.0 / share - 1.0) / DRAWS as f64).sqrt();
            let most = if effects.len() < 2 { 0.2 } else { 1.0 };
            if effects.len() < 2 || round == effects.len() {
                assert!(differs.abs() < most + 2.0 * error, "{said}");
                assert_eq!(names, acting[round..], "{said}");
            }
            let Some(called_for) = tracing.accepted.clone() else {
                assert_eq!(round, effects.len(), "{said}");
                break;
            };
            assert!(acting.contains(&called_for.effect.name()), "{said}");
            model = extended(&model, &called_for, &tracing.averaged);
            prepared.begun = Some(Begun {
                workbench: prepared.workbench.clone(),
                state: traced.point.state,
                weighing: inverse.weighing.clone(),
            });
        }
    }
}
