//! The reduced basis of the finite elements: its bound holds and is sharp, what it answers is what the solver answers, and what it cannot
//! answer is solved.

use plychain::experiment::State;
use plychain::fem::{Annulus, Certificate, EndLoad, Plate, Profile, TOLERANCE};
use plychain::geometry::Density;
use plychain::infer::Model;
use plychain::laminate::Ply;
use plychain::reduce::{Problem, spread_over};
use serde_json::{Value, json};

use crate::program::{changed, coarse, identify, posterior, set_coarse};

fn problem(file: &str) -> Problem {
    let model = Model::load(file.as_ref()).unwrap();
    model.problem([[-5.0; 2], [5.0; 2]]).unwrap()
}

fn states(problem: &Problem, count: usize, seed: u64) -> Vec<State> {
    let points = spread_over(problem, count, seed);
    points.iter().map(|p| problem.state(p)).collect()
}

/// The three specimens, each with a change of its model file.
fn specimens(change: &dyn Fn(&mut Value)) -> Vec<(&'static str, String)> {
    let coupon = |m: &mut Value| {
        change(m);
        m["experiments"][0]["specimen"]["layup_deg"] = json!([0]);
    };
    vec![
        ("default", changed("openhole.json", change)),
        ("steel", changed("steel-s235.json", change)),
        ("[0] coupon", changed("openhole.json", coupon)),
    ]
}

fn judge(name: &str, certificates: &[Certificate], most: f64) {
    let largest = |of: fn(&Certificate) -> f64| certificates.iter().map(of).fold(0.0, f64::max);
    println!(
        "{name}: {} solutions, {} points, bound {:.1e}, error {:.1e}, effectivity {:.2}",
        certificates[0].solutions,
        certificates.len(),
        largest(|c| c.bound),
        largest(|c| c.error),
        largest(Certificate::effectivity)
    );
    for c in certificates {
        assert!(c.error <= c.bound, "{name}: {c:?}");
        assert!(c.effectivity() < 5.0, "{name}: {c:?}");
        assert!(c.bound <= most, "{name}: {c:?}");
    }
}

fn certified(change: &dyn Fn(&mut Value), count: usize) {
    for (name, file) in specimens(change) {
        let problem = problem(&file);
        let experiment = &*problem.experiment;
        assert!(
            experiment
                .certify(&states(&problem, 1, 1))
                .unwrap()
                .is_empty()
        );
        experiment.span(&states(&problem, 200, 1)).unwrap();
        let certificates = experiment.certify(&states(&problem, count, 2)).unwrap();
        assert_eq!(certificates.len(), count, "{name}");
        judge(name, &certificates, TOLERANCE);
    }
}

#[test]
fn the_bound_holds_over_the_box_and_is_sharp() {
    certified(&set_coarse, 60);
}

#[test]
#[ignore = "1,000 solutions of three specimens on the default mesh, 3 minutes"]
fn the_bound_holds_at_a_thousand_points() {
    certified(&|_| (), 1000);
}

/// Stiffness that varies over the plate and loads that are not along its axis have terms of their own.
#[test]
fn tapers_rings_and_skew_loads_are_spanned() {
    let problem = problem(&coarse());
    let nominal = problem.experiment.scene().setup.clone();
    let plate = Plate::new(&nominal, Density(0.3)).unwrap();
    let at = |count: usize, seed: u64, tapered: bool| {
        let points = spread_over(&problem, count, seed).into_iter().enumerate();
        let test = points.map(|(k, point)| {
            let share = k as f64 / count as f64;
            let mut setup = nominal.clone();
            setup.load = EndLoad {
                axial: 700.0,
                shear: if tapered { 0.0 } else { 30.0 * (share - 0.5) },
                moment: 200.0 * (5.0 * share).sin(),
            };
            setup.profile = if tapered {
                Profile {
                    across: 0.02 * (share - 0.4),
                    along: 0.02 * (7.0 * share).cos(),
                    annulus: None,
                }
            } else {
                let (reach, loss) = (1.5, 0.5 * share);
                Profile {
                    annulus: Some(Annulus { reach, loss }),
                    ..Profile::default()
                }
            };
            let state = problem.state(&point);
            let ply = problem.experiment.scene().material.ply(&state.constants);
            (setup, ply)
        });
        test.collect::<Vec<_>>()
    };
    for tapered in [true, false] {
        plate.span(&at(300, 3, tapered), 1).unwrap();
        let other = at(40, 4, tapered);
        let certificates: Vec<Certificate> = other
            .iter()
            .map(|(setup, ply)| plate.certify(setup, ply).unwrap().unwrap())
            .collect();
        // more of them than pay are not added
        let name = if tapered { "tapers" } else { "rings" };
        judge(name, &certificates, 10.0 * TOLERANCE);
    }
}

/// What a basis does not answer well enough, or not at all, is solved, to the same bits as without one.
#[test]
fn what_a_basis_cannot_answer_is_solved() {
    let problem = problem(&coarse());
    let nominal = problem.experiment.scene().setup.clone();
    let plate = Plate::new(&nominal, Density(0.3)).unwrap();
    let tests: Vec<_> = states(&problem, 60, 5)
        .iter()
        .map(|s| {
            (
                nominal.clone(),
                problem.experiment.scene().material.ply(&s.constants),
            )
        })
        .collect();
    plate.span(&tests, 1).unwrap();
    let within = &tests[7];
    assert!(plate.coordinates(&within.0, &within.1).is_some());
    let far = Ply {
        e2: 20.0 * within.1.e2,
        ..within.1
    };
    let mut larger = nominal.clone();
    larger.morph.hole_size = 1.02;
    let mut nonlinear = nominal.clone();
    nonlinear.shear_cubic = 1e-7;
    for (setup, ply) in [(&nominal, far), (&larger, within.1), (&nonlinear, within.1)] {
        assert!(plate.coordinates(setup, &ply).is_none());
        let [a, b] = [
            plate.solve(setup, &ply).unwrap().nodal,
            plate.solve_full_order(setup, &ply).unwrap().nodal,
        ];
        assert_eq!(a, b);
    }
    // and what it answers differs by less than can be seen
    let answered = plate.solve(&within.0, &within.1).unwrap().nodal;
    let solved = plate.solve_full_order(&within.0, &within.1).unwrap().nodal;
    assert_ne!(answered, solved);
    let largest = answered
        .iter()
        .zip(&solved)
        .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    let size = solved.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    assert!(largest < 1e-7 * size, "{largest:e} of {size:e}");
}

/// The same question twice is the same basis; a wider one makes it grow.
#[test]
fn a_basis_grows_only_where_it_must() {
    let problem = problem(&coarse());
    let experiment = &*problem.experiment;
    let size = || experiment.certify(&states(&problem, 1, 9)).unwrap()[0].solutions;
    experiment.span(&states(&problem, 100, 6)).unwrap();
    let first = size();
    experiment.span(&states(&problem, 100, 6)).unwrap();
    assert_eq!(size(), first);
    let mut wide = states(&problem, 100, 6);
    for state in &mut wide {
        state.constants[1] *= 3.0;
    }
    experiment.span(&wide).unwrap();
    assert_ne!(size(), first);
}

#[test]
fn an_identification_does_not_change_when_every_prediction_is_solved() {
    let [spanned, solved] = [&[][..], &["--full-order"]].map(|extra| identify(&coarse(), extra));
    for name in ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"] {
        let ((a, sd), (b, _)) = (posterior(&spanned, name), posterior(&solved, name));
        assert!((a - b).abs() < 0.02 * sd, "{name}: {a} and {b}, sd {sd}");
    }
    // known at many more draws, and everywhere in the box
    let of = |round: &Value, key: &str| round["surrogate"][key].clone();
    assert_eq!(of(&solved, "truth_draws"), 32);
    assert!(of(&spanned, "truth_draws").as_u64() > Some(1000));
    assert!(of(&solved, "over_the_box").is_null());
    let [rms, max] = ["rms", "max"].map(|k| of(&spanned, "over_the_box")[k].as_f64().unwrap());
    assert!(0.0 < rms && rms < max && max < 100.0, "{rms} and {max} nm");
}
