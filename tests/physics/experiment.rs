//! The one forward model: laws that its predictions keep, its sensitivities, and an experiment in closed form.

use std::path::Path;
use std::sync::Arc;

use plychain::effect::{Acting, EFFECTS, Kind, Scene, force_scale};
use plychain::experiment::series::Solver;
use plychain::experiment::simulate::Truth;
use plychain::experiment::{
    Direction, FieldExperiment, FieldSolver, Gauge, Imaging, Mechanics, MockExperiment,
    Neighbourhood, Places, PointSet, Softening, State, Subsets, gauged, load_response, predict,
    predict_with_gradient, sensitivity,
};
use plychain::fem::Bump;
use plychain::field::SubsetShape;
use plychain::field::matrices::write_matrices;
use plychain::field::rigid::RigidMotion;
use plychain::identify::{inverse_problem, prepare, start};
use plychain::infer::{Model, simulated_field};
use plychain::progress::Silent;

use crate::common::{fresh, root};
use crate::reduce::{scene, small_test};

const CONSTANTS: [f64; 4] = [150.0, 7.9, 0.33, 4.8];

type Field = Vec<[f64; 2]>;

fn experiments() -> Vec<Arc<dyn FieldSolver>> {
    let test = small_test();
    let scene = scene(&test);
    vec![
        Arc::new(MockExperiment::new(
            scene.clone(),
            Gauge::Window,
            test.window,
        )),
        Arc::new(FieldExperiment::new(test, scene).unwrap()),
    ]
}

fn size(field: &Field) -> f64 {
    field.iter().flatten().fold(0.0, |m, u| m.max(u.abs()))
}

fn largest_difference(a: &Field, b: &Field) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

/// Moduli and thickness multiplied by factors of their own.
fn scaled(state: &State, moduli: f64, thickness: f64) -> State {
    let mut scaled = state.clone();
    for k in [0, 1, 3] {
        scaled.constants[k] *= moduli;
    }
    scaled.thickness_mm *= thickness;
    scaled
}

#[test]
fn a_field_is_one_over_thickness_and_moduli_where_every_effect_says_so() {
    for experiment in experiments() {
        let sight = experiment.support();
        for effect in EFFECTS {
            if matches!(effect.kind(), Kind::Additive | Kind::Recorded)
                || effect.why_not(experiment.scene()).is_some()
            {
                continue;
            }
            let amplitude: Vec<f64> = effect
                .parameters()
                .iter()
                .map(|p| p.prior_sd.unwrap())
                .collect();
            let state = State::new(&CONSTANTS, 0.78).with([Acting {
                effect: *effect,
                amplitude,
            }]);
            let (moduli, thickness) = (1.3, 0.9);
            let ratio = load_response(moduli, thickness);
            let here = predict(&*experiment, &state, sight).unwrap().loaded;
            let there = scaled(&state, moduli, thickness);
            let there = predict(&*experiment, &there, sight).unwrap().loaded;
            let expected: Field = here.iter().map(|u| u.map(|u| ratio * u)).collect();
            let error = largest_difference(&there, &expected) / size(&expected);
            let by_elements = experiment.mesh_size()[0] > 0;
            if effect.scales() {
                assert!(error < 1e-9, "{}: {error:e}", effect.name());
            } else if by_elements {
                assert!(error > 1e-5, "{} keeps the law: {error:e}", effect.name());
            }
        }
    }
}

#[test]
fn sensitivities_are_the_differences_of_predictions() {
    for experiment in experiments() {
        // beside the nodes, where a coarse mesh's gradient jumps, and clear of the hole, across whose edge it is continued
        let lattice = (0..12).flat_map(|i| (0..12).map(move |j| [i, j]));
        let places = lattice.map(|ij| ij.map(|k| -7.43 + 1.31 * f64::from(k)));
        let places: Vec<[f64; 2]> = places.filter(|p| p[0].hypot(p[1]) > 3.0).collect();
        let sight = &experiment.locate(&places, &[]).0;
        let tilted = plychain::effect::find("test", "load_misalignment").unwrap();
        let at = State::new(&CONSTANTS, 0.78).with([Acting {
            effect: tilted,
            amplitude: vec![0.5],
        }]);
        let here = predict_with_gradient(&*experiment, &at, sight).unwrap();
        let moved = |change: &dyn Fn(&mut State, f64), step: f64| -> Field {
            let [high, low] = [step, -step].map(|by| {
                let mut state = at.clone();
                change(&mut state, by);
                predict(&*experiment, &state, sight).unwrap().field
            });
            let pairs = high.iter().zip(&low);
            pairs
                .map(|(a, b)| [0, 1].map(|i| (a[i] - b[i]) / (2.0 * step)))
                .collect()
        };
        let mut checked: Vec<(String, Field, Field)> = Vec::new();
        let mut check = |name: &str, direction, step, expected| {
            let anchor = experiment.anchor(&at, &[1.0]).unwrap();
            let found = sensitivity(
                &*experiment,
                &Neighbourhood {
                    at: &at,
                    here: &here,
                    anchor: anchor.as_ref(),
                },
                sight,
                direction,
                step,
            )
            .unwrap();
            checked.push((name.into(), found, expected));
        };
        let thickness = moved(&|s, by| s.thickness_mm += by, 1e-3);
        check("thickness", Direction::Thickness, 1e-3, thickness);
        let load = moved(&|s, by| s.shift(force_scale(), 0, by), 0.1);
        check("load", Direction::Load, 0.1, load);
        let constant = moved(&|s, by| s.constants[1] += by, 0.01);
        check("E2", Direction::Constant(1), 0.02, constant);
        for effect in EFFECTS {
            if !matches!(effect.kind(), Kind::Additive | Kind::Optical) {
                continue;
            }
            for (k, parameter) in effect.parameters().iter().enumerate() {
                let step = 0.01 * parameter.prior_sd.unwrap_or(1.0);
                let expected = moved(&|s, by| s.shift(*effect, k, by), step);
                let direction = Direction::Amplitude(*effect, k);
                check(parameter.name, direction, step, expected);
            }
        }
        for (name, found, expected) in checked {
            let error = largest_difference(&found, &expected) / size(&expected).max(1e-12);
            assert!(error < 1e-2, "{name}: {error:e}");
        }
    }
}

#[test]
fn an_effect_without_amplitude_does_not_act() {
    let effect = plychain::effect::find("test", "hole_size").unwrap();
    let mut state = State::new(&CONSTANTS, 0.78);
    state.set(effect, vec![2.0]);
    assert_eq!(state.amplitude(effect), [2.0]);
    state.shift(effect, 0, -2.0);
    assert!(state.acting().is_empty());
    assert_eq!(state.amplitude(effect), [0.0]);
}

#[test]
fn the_mock_field_is_compatible_and_continued_exactly() {
    let experiment = &experiments()[0];
    let state = State::new(&CONSTANTS, 0.78);
    let points = [[1.3, -2.0], [7.0, 7.5], [-3.1, 0.2]];
    let sight = PointSet::anywhere(&points, &[]);
    let at_support = experiment
        .look(&state, experiment.support(), false)
        .unwrap();
    let spread = experiment.spread(&at_support.displacement, &sight);
    let look = experiment.look(&state, &sight, true).unwrap();
    assert!(largest_difference(&spread, &look.displacement) < 1e-12 * size(&spread));
    for (k, p) in points.iter().enumerate() {
        for axis in 0..2 {
            let at = |by: f64| {
                let mut q = *p;
                q[axis] += by;
                let there = PointSet::anywhere(&[q], &[]);
                experiment.look(&state, &there, false).unwrap().displacement[0]
            };
            let (high, low) = (at(1e-3), at(-1e-3));
            for i in 0..2 {
                let slope = (high[i] - low[i]) / 2e-3;
                assert!((slope - look.gradient[k][i][axis]).abs() < 1e-9);
            }
        }
    }
}

/// The default model with a closed-form specimen.
fn mock_model() -> Model {
    let path = root().join("models/openhole.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace(r#""kind": "field""#, r#""kind": "mock""#);
    assert!(text.contains("mock"));
    Model::parse(&text, Path::new(&path)).unwrap()
}

#[test]
fn a_closed_form_specimen_goes_the_whole_way_to_a_posterior() {
    let mut model = mock_model();
    let truth = Truth {
        constants: CONSTANTS.to_vec(),
        thickness_mm: 0.78,
        effects: Vec::new(),
        noise_nm: 10.0,
        correlation_mm: 0.0,
        grid: 61,
        seed: 3,
    };
    let folder = fresh("mock");
    std::fs::create_dir_all(&folder).unwrap();
    write_matrices(&folder, &simulated_field(&model, &truth).unwrap(), None).unwrap();
    let measurement = model.experiment().measurement.clone().with_path(folder);
    model.experiment_mut().measurement = measurement;
    let prepared = prepare(&model, &Silent).unwrap();
    // two modes a component: the sheet's field is linear in as many combinations of its compliances
    assert!(prepared.modes().unwrap().len() <= 2 * 4);
    let inverse = inverse_problem(&model, prepared, &Silent).unwrap();
    let mode = start(&inverse.posed.density).unwrap();
    let sd = |k: usize| mode.covariance[k * (mode.mode.len() + 1)].sqrt();
    for (k, truth) in CONSTANTS.iter().enumerate() {
        let z = (mode.mode[k] - truth) / sd(k);
        assert!(z.abs() < 4.0, "{}: {z}", model.constants()[k]);
    }
}

/// A plate that is stiffer by one part in all everywhere moves by as much less. Gaussians on a lattice as wide apart as their sd add up to
/// a constant, 2 pi, but for 2 exp(-2 pi^2) of it.
#[test]
fn bumps_of_the_stiffness_add_up_to_a_stiffer_plate() {
    let test = small_test();
    let scene = scene(&test);
    let experiment = FieldExperiment::new(test, scene).unwrap();
    let lattice = (0..9).flat_map(|i| (0..9).map(move |j| [i, j]));
    let places: Vec<[f64; 2]> = lattice
        .map(|ij| ij.map(|k| -7.1 + 1.8 * f64::from(k)))
        .filter(|p| p[0].hypot(p[1]) > 2.2)
        .collect();
    let sight = &experiment.locate(&places, &[]).0;
    let at = State::new(&CONSTANTS, 0.78);
    let anchor = experiment.anchor(&at, &[1.0]).unwrap();
    let apart = 5.0;
    let bumps: Vec<Bump> = (-12..=12)
        .flat_map(|i| (-9..=9).map(move |j| [i, j]))
        .map(|ij| Bump {
            center_mm: ij.map(|k| apart * f64::from(k)),
            sd_mm: apart,
        })
        .collect();
    let softened = |softening| {
        experiment
            .softened(anchor.as_ref(), &at, sight, softening)
            .unwrap()
    };
    let fields = softened(Softening::Bumps(&bumps));
    let plain = experiment.look(&at, sight, false).unwrap().loaded;
    let plain = gauged(Gauge::Window, sight, &plain);
    let error: Field = (0..places.len())
        .map(|k| {
            let sum = |c: usize| fields.iter().map(|f| f[k][c]).sum::<f64>();
            [0, 1].map(|c| sum(c) / std::f64::consts::TAU + plain[k][c])
        })
        .collect();
    assert!(size(&error) < 1e-6 * size(&plain), "{:e}", size(&error));
    // one bump does something of its own
    let one = size(&fields[fields.len() / 2]);
    assert!(one > 1e-2 * size(&plain), "{one:e}");
    assert!(!softened(Softening::NearEdge).is_empty());
}

/// A nonlinearity of no size changes nothing of a series, whatever else acts: what the load adds in closed form (bending out of the plane) is
/// neither lost beside it nor there twice.
#[test]
fn a_nonlinearity_of_no_size_leaves_a_series_as_it_is() {
    let experiment = &experiments()[1];
    let points: Vec<[f64; 2]> = (0..40)
        .map(|k| [4.0 + 0.1 * f64::from(k), -3.0 + 0.15 * f64::from(k)])
        .collect();
    let (sight, inside) = experiment.locate(&points, &[]);
    assert!(inside.iter().all(|i| *i));
    let average = |u: &[[f64; 2]]| u.to_vec();
    let solver = Solver {
        experiment: &**experiment,
        sight: &sight,
        average: &average,
    };
    let act = |name: &str, share: f64| {
        let effect = EFFECTS.iter().find(|e| e.name() == name).unwrap();
        let of = effect.parameters().iter();
        Acting {
            effect: *effect,
            amplitude: of.map(|p| share * p.prior_sd.unwrap()).collect(),
        }
    };
    let plain = State::new(&CONSTANTS, 0.78);
    let bent = plain.clone().with([act("out_of_plane_bending", 1.0)]);
    let both = bent.clone().with([act("shear_nonlinearity", 1e-9)]);
    let loads = [0.5, 1.0];
    let [plain, bent, both] = [plain, bent, both].map(|s| solver.loaded(None, &s, &loads).unwrap());
    let added: Field = bent
        .linear
        .iter()
        .zip(&plain.linear)
        .map(|(a, b)| [a[0] - b[0], a[1] - b[1]])
        .collect();
    assert_eq!(both.linear, bent.linear);
    assert_eq!(both.beyond.len(), loads.len());
    for beyond in &both.beyond {
        println!("{:e} of {:e}", size(beyond), size(&added));
        assert!(size(beyond) < 1e-3 * size(&added));
    }
}

/// A subset that is a third larger than declared, as the finite elements average over it and as the declared one with the effect: what is
/// missed is of fourth order, where all that the larger subset does is of second. (A quadratic shape function leaves the fourth order alone,
/// which elements of this size do not have.)
#[test]
fn a_larger_subset_is_the_declared_one_with_its_effect() {
    let declared = 1.5;
    let seen = |[side_mm, declared_mm]: [f64; 2], percent: f64| -> Field {
        let mut test = small_test();
        test.images = Some(Imaging {
            subsets: Subsets {
                side_mm,
                declared_mm,
                shape: SubsetShape::Affine,
                kept: false,
            },
            camera_distance_mm: None,
            motion: RigidMotion::NONE,
        });
        let scene = Scene {
            fringe_frequency_per_mm: None,
            subset_mm: Some(declared),
            ..scene(&test)
        };
        let experiment = FieldExperiment::new(test, scene).unwrap();
        let lattice = (0..15).flat_map(|i| (0..15).map(move |j| [i, j]));
        let places = lattice.map(|ij| ij.map(|k| -7.0 + f64::from(k)));
        let far = |p: &[f64; 2]| p[0].hypot(p[1]) > 2.0 + declared;
        let places: Vec<[f64; 2]> = places.filter(far).collect();
        let sight = experiment.locate(&places, &[]).0;
        let larger = Acting {
            effect: plychain::effect::find("test", "subset_size").unwrap(),
            amplitude: vec![percent],
        };
        let state = State::new(&CONSTANTS, 0.78).with([larger]);
        predict(&experiment, &state, &sight).unwrap().field
    };
    let [as_declared, larger] = [declared, 2.0].map(|side| seen([side; 2], 0.0));
    let with_effect = seen([declared; 2], 100.0 / 3.0);
    let error = largest_difference(&with_effect, &larger);
    let effect = largest_difference(&as_declared, &larger);
    assert!(error < 0.1 * effect, "{error:e} of {effect:e}");
    // averaged over the larger one, the effect that made it so adds nothing, and none makes it the declared one again
    let found = seen([2.0, declared], 100.0 / 3.0);
    let exact = largest_difference(&found, &larger);
    assert!(exact < 1e-12 * effect, "{exact:e} of {effect:e}");
    let error = largest_difference(&seen([2.0, declared], 0.0), &as_declared);
    assert!(error < 0.1 * effect, "{error:e} of {effect:e}");
}
