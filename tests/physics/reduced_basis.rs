//! The reduced basis of the finite elements: its bound holds and is sharp, what it answers is what the solver answers, and what it cannot
//! answer is solved.

use nalgebra::Matrix3;
use plychain::experiment::{State, predict};
use plychain::fem::{
    Certificate, EndLoad, Locator, Motion, Plate, Profile, Setup, TOLERANCE, View, span,
};
use plychain::geometry::Density;
use plychain::infer::{Model, problem_within};
use plychain::laminate::{Membrane, Ply};
use plychain::reduce::{Problem, spread_over};
use serde_json::{Value, json};

use crate::common::{changed, coarse, fresh, identify, posterior, set_coarse, succeed};

fn problem(file: &str) -> Problem {
    let model = Model::load(file.as_ref()).unwrap();
    problem_within(&model, [[-5.0; 2], [5.0; 2]], None).unwrap()
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
        "{name}: {} solutions, {} points, bound {:.1e}, error {:.1e}, effectivity {:.2}; at points {:.1e} mm, bound {:.1e} mm, ratio at most {:.3}",
        certificates[0].solutions,
        certificates.len(),
        largest(|c| c.bound),
        largest(|c| c.error),
        largest(Certificate::effectivity),
        largest(|c| c.largest_mm),
        largest(|c| c.bound_mm),
        largest(|c| c.largest_mm / c.bound_mm),
    );
    // what the basis does not hold to within the tolerance is solved in full: the greedy search has seen 200 points of the box
    let beyond = certificates.iter().filter(|c| c.bound > most).count();
    println!("{name}: {beyond} beyond {most:e}");
    assert!(100 * beyond <= certificates.len(), "{name}: {beyond}");
    for c in certificates {
        assert!(c.error <= c.bound, "{name}: {c:?}");
        assert!(c.effectivity() < 5.0, "{name}: {c:?}");
        assert!(c.largest_mm <= c.bound_mm, "{name}: {c:?}");
        // a hundredth of what moire resolves
        assert!(c.bound_mm < 1e-7, "{name}: {c:?}");
    }
}

fn certified(change: &dyn Fn(&mut Value), count: usize) {
    for (name, file) in specimens(change) {
        let problem = problem(&file);
        let experiment = &*problem.experiment;
        let sight = experiment.support();
        assert!(
            experiment
                .certify(&states(&problem, 1, 1), sight)
                .unwrap()
                .is_empty()
        );
        experiment.span(&states(&problem, 200, 1)).unwrap();
        let certificates = experiment
            .certify(&states(&problem, count, 2), sight)
            .unwrap();
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

/// Points about the hole, none of them a node.
fn lattice() -> Vec<[f64; 2]> {
    let all = (0..12).flat_map(|i| (0..12).map(move |j| [i, j]));
    let places = all.map(|ij| ij.map(|k| -5.43 + 0.97 * f64::from(k)));
    places.filter(|p| p[0].hypot(p[1]) > 2.1).collect()
}

/// The basis of a test, seen from some points of its mesh.
fn view(plate: &Plate, test: &(Setup, Ply), points: &[[f64; 2]], motions: Vec<Motion>) -> View {
    let (setup, ply) = test;
    let mesh = plate.mesh_of(setup).unwrap();
    let observer = Locator::new(&mesh).observe_extended(points);
    let basis = plate.basis_for(setup, ply).unwrap();
    View::new(plate, basis, &mesh, observer, motions).unwrap()
}

/// Nodal values without any order.
fn noise(count: usize, seed: u64) -> Vec<f64> {
    let value = |k: usize| (k as f64 * 12.9898 + seed as f64).sin() * 43_758.545_3;
    (0..count).map(|k| value(k).fract()).collect()
}

/// The gauge as linear functionals is the gauge that predictions have.
#[test]
fn what_a_view_takes_off_is_the_gauge() {
    for held in [false, true] {
        let file = changed("openhole.json", |m| {
            set_coarse(m);
            if held {
                m["experiments"][0]["gauge"] = json!({ "zero_at_mm": [4.1, 0.3] });
            }
        });
        let problem = problem(&file);
        let experiment = &*problem.experiment;
        let points: Vec<[f64; 2]> = lattice();
        let (sight, _) = experiment.locate(&points, &[]);
        assert!(experiment.view(&sight).unwrap().is_none());
        experiment.span(&states(&problem, 40, 1)).unwrap();
        let view = experiment.view(&sight).unwrap().unwrap();
        // the answers of a basis in a state, gauged by the prediction and by the view
        let state = &states(&problem, 1, 3)[0];
        let answer = experiment.coordinates(state).unwrap();
        let seen = view.seen(&view.basis.nodal(&answer));
        let predicted = predict(experiment, state, &sight).unwrap().loaded;
        let size = predicted
            .iter()
            .flatten()
            .fold(0.0_f64, |m, u| m.max(u.abs()));
        for (a, b) in seen.iter().zip(&predicted) {
            for i in 0..2 {
                assert!((a[i] - b[i]).abs() < 1e-10 * size, "{a:?} {b:?}");
            }
        }
        // no error of unit energy shows more than the reach
        let setup = &experiment.scene().setup;
        let plate = Plate::new(setup, Density(0.3)).unwrap();
        for seed in 0..5 {
            let mut nodal = noise(plate.mesh.unknowns(), seed);
            plate.assembly.pin_loads(&mut nodal);
            let energy = view.basis.energy(&plate.assembly, &plate.mesh, &nodal);
            let most = view.seen(&nodal).into_iter().flatten();
            let most = most.fold(0.0_f64, |m, u| m.max(u.abs()));
            assert!(most <= view.reach() * energy, "{most} of {energy}");
        }
    }
}

/// The reach of a bound from the inverse's entries, against one solution for every point: the answer to the unit force that gauges see is
/// the error that shows most there.
#[test]
fn the_reach_of_a_bound_is_that_of_a_unit_force() {
    let problem = problem(&coarse());
    let nominal = problem.experiment.scene().setup.clone();
    let plate = Plate::new(&nominal, Density(0.3)).unwrap();
    let tests: Vec<_> = states(&problem, 40, 5)
        .iter()
        .map(|s| {
            let ply = problem.experiment.scene().material.ply(&s.constants);
            (nominal.clone(), ply)
        })
        .collect();
    span(&plate, &tests, 1).unwrap();
    // the last one lies in the hole, where the field is continued
    let points: Vec<[f64; 2]> = lattice().into_iter().chain([[1.9, 0.3]]).collect();
    let observer = Locator::new(&plate.mesh).observe_extended(&points);
    let n = plate.mesh.unknowns();
    let share = 1.0 / points.len() as f64;
    let motions = || -> Vec<Motion> {
        let shift = |i: usize| {
            let unit = |size: f64| [0, 1].map(|k| if k == i { size } else { 0.0 });
            Motion {
                forces: observer.forces(&vec![unit(share); points.len()], n),
                at: vec![unit(1.0); points.len()],
            }
        };
        vec![shift(0), shift(1)]
    };
    let mean: Matrix3<f64> = tests.iter().map(|(s, p)| s.membrane(p).matrix()).sum();
    let mut factor = plate.factor();
    factor
        .factorise(&Membrane::from(&(mean / tests.len() as f64)))
        .unwrap();
    for with in [false, true] {
        let taken = || if with { motions() } else { Vec::new() };
        let view = view(&plate, &tests[0], &points, taken());
        let motions = taken();
        let mut largest = 0.0_f64;
        for k in 0..points.len() {
            for i in 0..2 {
                let mut at_points = vec![[0.0; 2]; points.len()];
                at_points[k][i] = 1.0;
                let mut force = observer.forces(&at_points, n);
                for motion in &motions {
                    for (f, m) in force.iter_mut().zip(&motion.forces) {
                        *f -= motion.at[k][i] * m;
                    }
                }
                let mut moved = force.clone();
                factor.solve(&mut moved);
                let square: f64 = force.iter().zip(&moved).map(|(f, u)| f * u).sum();
                largest = largest.max(square.sqrt());
                // that response shows itself by just as much
                let energy = view.basis.energy(&plate.assembly, &plate.mesh, &moved);
                let seen = view.seen(&moved)[k][i];
                assert!((seen - energy * square.sqrt()).abs() < 1e-7 * seen);
            }
        }
        let error = (view.reach() / largest - 1.0).abs();
        assert!(error < 1e-8, "{error:e}");
    }
}

/// Stiffness that varies over the plate and loads that are not along its axis have terms of their own.
#[test]
#[ignore = "slow: run by .ci/run"]
fn tapers_and_skew_loads_are_spanned() {
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
                ..EndLoad::default()
            };
            setup.profile = if tapered {
                Profile {
                    across: 0.02 * (share - 0.4),
                    along: 0.02 * (7.0 * share).cos(),
                    damage: None,
                }
            } else {
                Profile::default()
            };
            let state = problem.state(&point);
            let ply = problem.experiment.scene().material.ply(&state.constants);
            (setup, ply)
        });
        test.collect::<Vec<_>>()
    };
    for tapered in [true, false] {
        span(&plate, &at(300, 3, tapered), 1).unwrap();
        let other = at(40, 4, tapered);
        let view = view(&plate, &other[0], &lattice(), Vec::new());
        let certificates: Vec<Certificate> = other
            .iter()
            .map(|(setup, ply)| Certificate::of(&plate, setup, ply, &view).unwrap().unwrap())
            .collect();
        // more of them than pay are not added
        let name = if tapered { "tapers" } else { "skew loads" };
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
    span(&plate, &tests, 1).unwrap();
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
    let size = || {
        let one = states(&problem, 1, 9);
        experiment.certify(&one, experiment.support()).unwrap()[0].solutions
    };
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

/// The default test on a coarse mesh, in full for every prediction or by a basis.
fn solving(full_order: bool) -> String {
    changed("openhole.json", |m| {
        set_coarse(m);
        m["reduced_model"]["full_order"] = full_order.into();
    })
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn an_identification_does_not_change_when_every_prediction_is_solved() {
    let [spanned, solved] = [false, true].map(|full| identify(&solving(full), &[]));
    for name in ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"] {
        let ((a, sd), (b, _)) = (posterior(&spanned, name), posterior(&solved, name));
        assert!((a - b).abs() < 0.02 * sd, "{name}: {a} and {b}, sd {sd}");
    }
}

/// A whole loop, its chains and sensitivities included. What is left is the basis's own error, some ten thousandth of a nanometre.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_loop_does_not_change_when_every_prediction_is_solved() {
    let [spanned, solved] = [false, true].map(|full| {
        let out = fresh("loop");
        let file = solving(full);
        succeed(&["loop", &file, "--quiet", "--out", out.to_str().unwrap()]);
        let text = std::fs::read_to_string(out.join("report.json")).unwrap();
        serde_json::from_str::<Value>(&text).unwrap()
    });
    assert_eq!(spanned["verdict"]["status"], solved["verdict"]["status"]);
    assert_eq!(spanned["verdict"]["effects"], solved["verdict"]["effects"]);
    for name in ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"] {
        let of = |report: &Value, key: &str| {
            // in closed form: what is sampled has a Monte Carlo error
            let last = report["rounds"].as_array().unwrap().last().unwrap();
            let interval = &last["averaged_posterior"][name];
            interval[key].as_f64().unwrap()
        };
        let shift = (of(&spanned, "mean") - of(&solved, "mean")) / of(&solved, "sd");
        assert!(shift.abs() < 1e-3, "{name}: {shift:e} sd");
        let width = of(&spanned, "sd") / of(&solved, "sd") - 1.0;
        assert!(width.abs() < 1e-3, "{name}: {width:e}");
    }
}
