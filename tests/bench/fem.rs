//! Cost of one finite-element solution, in its parts and whole, for three meshes of the article's plate; with the argument `bases`, a
//! table of what reduced bases cost.

#[path = "../common/article.rs"]
#[allow(dead_code)]
mod article;

use std::hint::black_box;
use std::time::Instant;

use plychain::effect::{EFFECTS, Effect, Kind};
use plychain::error::Result;
use plychain::fem::{Plate, Setup, end_forces, span};
use plychain::geometry::Density;
use plychain::laminate::Ply;
use plychain::reduce::latin_hypercube;

const NOMINAL: Ply = Ply {
    e1: 140e3,
    e2: 7.9e3,
    nu12: 0.33,
    g12: 5e3,
};

/// Counts relative to the default mesh: unknowns grow with the square.
const FACTORS: [f64; 3] = [0.5, 1.0, 2.0];

fn main() -> Result<()> {
    if std::env::args().any(|argument| argument == "bases") {
        return bases();
    }
    parts();
    for effect in EFFECTS.iter().filter(|e| e.kind() == Kind::Mechanical) {
        of_effect(*effect);
    }
    Ok(())
}

/// Quickest and median of some runs, ms.
fn timed<T>(what: &str, mut run: impl FnMut() -> T) {
    let once = |_| {
        let begin = Instant::now();
        black_box(run());
        1e3 * begin.elapsed().as_secs_f64()
    };
    let mut all: Vec<f64> = (0..10).map(once).collect();
    all.sort_by(f64::total_cmp);
    println!("{what:40} {:9.3} {:9.3}", all[0], all[5]);
}

fn setup() -> Setup {
    article::setup(4.0, [0.0; 2], 1.0)
}

fn plate(factor: f64) -> Plate {
    Plate::new(&setup(), Density::DEFAULT.scaled(factor)).expect("a plate that meshes")
}

/// The parts of a solution, for each mesh.
fn parts() {
    println!("{:40} {:>9} {:>9}", "ms", "quickest", "median");
    for factor in FACTORS {
        let (plate, setup) = (plate(factor), setup());
        let a = setup.membrane(&NOMINAL);
        let unknowns = plate.mesh.unknowns();
        let said = |what: &str| format!("{what}, {unknowns} unknowns");
        let mut values = vec![0.0; plate.assembly.stored()];
        let integrals = plate.assembly.nominal();
        timed(&said("refill"), || {
            plate
                .assembly
                .refill(integrals, black_box(&[a]), &mut values);
        });
        let mut work = plate.factor();
        timed(&said("refill and factor"), || work.factorise(black_box(&a)));
        let load = end_forces(&plate.mesh, &setup.load);
        timed(&said("solve"), || {
            let mut u = load.clone();
            work.solve(&mut u);
            u
        });
        // what every mesh of another shape costs before anything is solved
        timed(&said("integrals"), || {
            plate.assembly.integrals(black_box(&plate.mesh), &|_| 1.0)
        });
        let field = vec![1e-3; plate.mesh.unknowns()];
        timed(&said("product with a field"), || {
            plate.assembly.multiply(integrals, &[a], black_box(&field))
        });
    }
    let (plate, setup) = (plate(1.0), setup());
    timed("snapshot", || nodal(&plate, black_box(&setup)));
}

fn nodal(plate: &Plate, setup: &Setup) -> Result<Vec<f64>> {
    plate.solve(setup, &NOMINAL).map(|solution| solution.nodal)
}

/// Tests over a box of 20 % about the nominal ply.
fn tests() -> Vec<(Setup, Ply)> {
    let setup = setup();
    let unit = latin_hypercube(200, 4, 1);
    let test = |x: &Vec<f64>| {
        let factor = |k: usize| 0.8 + 0.4 * x[k];
        let ply = Ply {
            e1: factor(0) * NOMINAL.e1,
            e2: factor(1) * NOMINAL.e2,
            nu12: factor(2) * NOMINAL.nu12,
            g12: factor(3) * NOMINAL.g12,
        };
        (setup.clone(), ply)
    };
    unit.iter().map(test).collect()
}

/// From 8,000 to 800,000 unknowns.
const BASES: [f64; 4] = [0.4, 1.0, 2.0, 4.0];

/// A reduced basis for all of them on meshes of growing size, as a table of Markdown; a solution and an answer are the quickest of a few.
fn bases() -> Result<()> {
    println!(
        "| unknowns | solutions | building it, in solutions of the solver | one solution, ms | one answer, ms | its coordinates and bound, us |"
    );
    println!("|---|---|---|---|---|---|");
    let quickest = |count: usize, run: &dyn Fn() -> Result<()>| -> Result<f64> {
        let mut least = f64::INFINITY;
        for _ in 0..count {
            let begin = Instant::now();
            run()?;
            least = least.min(begin.elapsed().as_secs_f64());
        }
        Ok(least)
    };
    for factor in BASES {
        let (plate, tests) = (plate(factor), tests());
        let (setup, ply) = &tests[17];
        let solution = quickest(3, &|| plate.solve_full_order(setup, ply).map(drop))?;
        let begin = Instant::now();
        span(&plate, &tests, 1)?;
        let build = begin.elapsed().as_secs_f64();
        let answer = quickest(20, &|| plate.solve(setup, ply).map(drop))?;
        let coordinates = quickest(200, &|| {
            black_box(plate.coordinates(setup, ply));
            Ok(())
        })?;
        println!(
            "| {} | {} | {:.1} | {:.1} | {:.2} | {:.0} |",
            plate.mesh.unknowns(),
            plate.nominal_basis().map_or(0, |b| b.size()),
            build / solution,
            1e3 * solution,
            1e3 * answer,
            1e6 * coordinates,
        );
    }
    Ok(())
}

/// One test with a mechanical effect at its plausible amplitude, from the nominal plate's mesh.
fn of_effect(effect: &dyn Effect) {
    let plate = plate(1.0);
    let mut setup = setup();
    let plausible = effect
        .parameters()
        .iter()
        .map(|p| p.prior_sd.unwrap_or(1.0));
    effect.alter(&plausible.collect::<Vec<f64>>(), &mut setup);
    timed(effect.name(), || nodal(&plate, black_box(&setup)));
}
