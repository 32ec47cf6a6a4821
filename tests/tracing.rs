//! Tracing undeclared effects: each effect of the dictionary at a clear size, none, and structure that is in no dictionary.

use std::path::Path;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use plychain::effect::{Acting, Kind};
use plychain::field::matrices::write_matrices;
use plychain::infer::Model;
use plychain::infer::simulate::{Truth, simulate};
use plychain::progress::Unwatched;
use plychain::trace::{State, Tracing, attribute, extended, prepare};

use crate::program::{fresh, model, workplace};

/// Constants of the simulated specimens.
const TRUTH: [f64; 4] = [150.0, 7.9, 0.33, 4.8];

/// Noise of the simulated measurements.
#[derive(Clone, Copy)]
pub enum Noise {
    /// 10 nm a point, white.
    White,
    /// 10 nm a point, correlated over this length, mm.
    Correlated(f64),
    /// 10 nm, white, and a smooth Gaussian field of this sd (nm) and length (mm) that is in no dictionary.
    Field(f64, f64),
}

/// A simulated measurement of the default model with some effects (`name=a,b`).
pub fn measured(effects: &[&str], noise: Noise, seed: u64) -> Model {
    let nominal = Model::load(Path::new(&model("openhole.json"))).unwrap();
    let acting: Vec<Acting> = effects
        .iter()
        .map(|text| Acting::parse("test", text).unwrap())
        .collect();
    let (noise_nm, correlation_mm) = match noise {
        Noise::White => (10.0, 0.0),
        Noise::Correlated(length) => (10.0, length),
        Noise::Field(sd, length) => (sd, length),
    };
    let mut grid = simulate(
        &nominal,
        &Truth {
            constants: TRUTH.to_vec(),
            thickness_mm: 0.78,
            effects: acting,
            noise_nm,
            correlation_mm,
            grid: 121,
            seed,
        },
    )
    .unwrap();
    if let Noise::Field(..) = noise {
        let mut rng = Pcg64Dxsm::seed_from_u64(1000 + seed);
        for u in grid.displacement.iter_mut().flatten() {
            let z: f64 = StandardNormal.sample(&mut rng);
            *u += 10e-6 * z;
        }
    }
    let folder = fresh("field");
    std::fs::create_dir_all(&folder).unwrap();
    write_matrices(&folder, &grid).unwrap();
    let mut model = nominal;
    model.file.measurement = model.file.measurement.with_path(folder);
    model
}

/// Trace until nothing more is accepted, without chains; what was accepted, with its alias group, and the last tracing.
pub fn traced(model: &Model) -> (Vec<(&'static str, Vec<&'static str>)>, Tracing) {
    let cache = workplace().join("runs/.cache");
    let mut prepared = prepare(model, &cache, &Unwatched).unwrap();
    let mut model = model.clone();
    let mut state = State {
        constants: model.marginals().iter().map(|m| m.mean).collect(),
        acting: Vec::new(),
    };
    let mut accepted = Vec::new();
    loop {
        let tracing = attribute(&model, &prepared, state.clone(), &Unwatched).unwrap();
        let Some(effect) = tracing.accepted.filter(|_| accepted.len() < 5) else {
            return (accepted, tracing);
        };
        let group = tracing.groups.iter().find(|g| g.leader == effect.name());
        accepted.push((effect.name(), group.unwrap().members.clone()));
        let amplitude = tracing.accepted_amplitude.clone();
        state.constants = tracing.averaged.iter().map(|a| a.mean).collect();
        model = extended(&model, effect, &amplitude, &tracing.averaged);
        if effect.kind() == Kind::Recorded {
            // corrected in the field, which the reduced model does not depend on
            let mut bare = model.clone();
            bare.effects
                .retain(|e| e.kind() == Kind::Recorded || e.name() == "rigid_translation");
            prepared = prepare(&bare, &cache, &Unwatched).unwrap();
        } else {
            state.set(effect, amplitude.iter().map(|a| a.0).collect());
        }
    }
}

/// `PLYCHAIN_TRACE="load_misalignment=1;none" cargo test --release tracing::survey -- --ignored --nocapture`
#[test]
#[ignore = "prints a table"]
fn survey() {
    let cases = std::env::var("PLYCHAIN_TRACE").unwrap_or_else(|_| "none".into());
    let noise = match std::env::var("PLYCHAIN_NOISE").as_deref() {
        Ok("field") => Noise::Field(50.0, 4.0),
        Ok(length) => Noise::Correlated(length.parse().unwrap()),
        Err(_) => Noise::White,
    };
    let first: u64 = std::env::var("PLYCHAIN_FIRST").map_or(1, |t| t.parse().unwrap());
    let seeds: u64 = std::env::var("PLYCHAIN_SEEDS").map_or(1, |t| t.parse().unwrap());
    for case in cases.split(';') {
        for seed in first..first + seeds {
            let effects: Vec<&str> = case.split('+').filter(|e| *e != "none").collect();
            let start = std::time::Instant::now();
            let model = measured(&effects, noise, seed);
            let (accepted, tracing) = traced(&model);
            println!(
                "{case} seed {seed}: accepted {accepted:?} undecided {:?} P(discrepancy) {:.2} l {:?} holdout {:.2} nm, {:.1} s",
                tracing.undecided,
                tracing.discrepancy,
                tracing.length_mm,
                tracing.holdout_rms_nm,
                start.elapsed().as_secs_f64()
            );
            for g in &tracing.groups {
                println!(
                    "    group {:?} P {:.3} drop {:.1} predicts {}",
                    g.members, g.probability, g.drop_nats, g.predicts
                );
            }
            for (a, truth) in tracing.averaged.iter().zip(TRUTH) {
                println!(
                    "    {} {:.4} +- {:.4} z {:.2}",
                    a.name,
                    a.mean,
                    a.sd,
                    (a.mean - truth) / a.sd
                );
            }
        }
    }
}
