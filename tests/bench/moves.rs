//! What the default mixture of moves rests on: ESS per evaluation of moves and mixtures on targets of known answers.
//!
//! `cargo bench --bench moves`.

#[path = "../unit/targets.rs"]
#[allow(dead_code)]
mod targets;

use rayon::prelude::*;

use plychain::diagnose::{Rule, diagnose};
use plychain::sample::{
    De, Ensemble, Independence, Mixture, Move, Quiet, Sampler, Schedule, Snooker, Start, Stretch,
    run,
};

use targets::Known;

/// Weights of independence (with its degrees of freedom), DE, stretch and snooker.
struct Recipe(&'static str, usize, [f64; 4]);

const RECIPES: &[Recipe] = &[
    Recipe("stretch", 5, [0.0, 0.0, 1.0, 0.0]),
    Recipe("de", 5, [0.0, 1.0, 0.0, 0.0]),
    Recipe("snooker", 5, [0.0, 0.0, 0.0, 1.0]),
    Recipe("ind t50", 50, [1.0, 0.0, 0.0, 0.0]),
    Recipe("ind t5", 5, [1.0, 0.0, 0.0, 0.0]),
    Recipe("0.7t50 0.25 0.05", 50, [0.7, 0.25, 0.05, 0.0]),
    Recipe("0.7t5 0.25 0.05", 5, [0.7, 0.25, 0.05, 0.0]),
    Recipe("0.5t5 0.4 0 0.1", 5, [0.5, 0.4, 0.0, 0.1]),
    Recipe("0.5t5 0.25 0 0.25", 5, [0.5, 0.25, 0.0, 0.25]),
];

fn build(recipe: &Recipe, walkers: usize) -> Ensemble {
    let moves: [Box<dyn Move>; 4] = [
        Box::new(Independence { dof: recipe.1 }),
        Box::new(De::default()),
        Box::new(Stretch::default()),
        Box::new(Snooker::default()),
    ];
    let parts = moves.into_iter().zip(recipe.2).filter(|(_, w)| *w > 0.0);
    Ensemble {
        mixture: Mixture::new(parts.collect()).unwrap(),
        walkers: Some(walkers),
    }
}

/// Smallest bulk and tail ESS per 1000 evaluations of a run of fixed length.
fn efficiency(sampler: &dyn Sampler, target: &Known) -> (f64, f64) {
    let covariance = target.diagonal();
    let start = Start::Ball {
        centre: &target.mean,
        covariance: &covariance,
        spread: 1.0,
    };
    let schedule = Schedule {
        warmup: Some(1000),
        thin: Some(1),
        max_draws: 4 * sampler.walkers(target.mean.len()) * 1500,
        ..Schedule::default()
    };
    let never = Rule {
        lengths: f64::INFINITY,
        ..Rule::default()
    };
    let draws = run(target, sampler, &start, &schedule, &never, &Quiet)
        .unwrap()
        .draws;
    let verdict = diagnose(&draws, &Rule::default());
    let scale = 1000.0 / draws.info.evaluations as f64;
    (
        verdict.ess_bulk_min() * scale,
        verdict.ess_tail_min() * scale,
    )
}

fn main() {
    for walkers in [32, 64] {
        let rows: Vec<String> = RECIPES
            .par_iter()
            .map(|recipe| {
                let mut row = format!("{walkers:3} {:18}", recipe.0);
                for target in targets::all() {
                    let (bulk, tail) = efficiency(&build(recipe, walkers), &target);
                    row += &format!(" | {:5.0} {:5.0}", bulk, tail);
                }
                row
            })
            .collect();
        println!(
            "ESS bulk, tail per 1000 evaluations: correlated | bounded | bimodal | Student-t | banana"
        );
        rows.iter().for_each(|row| println!("{row}"));
    }
}
