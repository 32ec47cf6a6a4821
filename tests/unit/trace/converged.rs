//! Accounts in turn, and the point midway between two of them.

use plychain::effect::{Acting, EFFECTS, Effect};
use plychain::experiment::State;
use plychain::experiment::series::SeriesState;
use plychain::experiment::series::{Law, Moving};
use plychain::infer::EffectUnderLaw;
use plychain::trace::converged::{is_in_turn, midway};

fn effect(name: &str) -> &'static dyn Effect {
    *EFFECTS.iter().find(|e| e.name() == name).unwrap()
}

fn under(name: &str, law: Option<Law>) -> EffectUnderLaw {
    EffectUnderLaw {
        effect: effect(name),
        law,
    }
}

#[test]
fn accounts_are_in_turn_when_one_returns_after_another() {
    let [a, b, c] = ["shear_nonlinearity", "hole_size", "camera_tilt"].map(|n| under(n, None));
    for (leaders, expected) in [
        (vec![], false),
        (vec![a, b], false),
        (vec![a, a, a], false),
        (vec![a, b, a], true),
        (vec![c, a, b, a], true),
        (vec![a, b, c], false),
        (vec![a, b, b], false),
    ] {
        assert_eq!(is_in_turn(&leaders), expected);
    }
    // another law is another account
    let law = |law| under("camera_tilt", Some(law));
    assert!(!is_in_turn(&[law(Law::Load), b, law(Law::Drift)]));
    assert!(is_in_turn(&[
        law(Law::Load),
        law(Law::Drift),
        law(Law::Load)
    ]));
}

/// Each account's effect at half of its amplitude, the constants at their means, and the same seen from either side.
#[test]
fn midway_is_as_far_from_one_account_as_from_the_other() {
    let state = |constants: [f64; 2], name: &str, amplitude: f64| {
        let acting = Acting {
            effect: effect(name),
            amplitude: vec![amplitude],
        };
        SeriesState::of_one_step(State::new(&constants, 0.8).with([acting]))
    };
    let mut a = state([100.0, 5.0], "shear_nonlinearity", 2.0);
    let mut b = state([110.0, 7.0], "hole_size", -3.0);
    let moving = |amplitude: f64, weight: f64| Moving {
        effect: effect("magnification"),
        weights: vec![weight],
        amplitude: vec![amplitude],
    };
    a.moving = vec![moving(1.0, 1.0), moving(8.0, 0.5)];
    b.moving = vec![moving(3.0, 1.0)];
    for between in [midway(&a, &b), midway(&b, &a)] {
        assert_eq!(between.shared.constants, [105.0, 6.0]);
        let of = |name: &str| between.shared.amplitude(effect(name))[0];
        assert_eq!([of("shear_nonlinearity"), of("hole_size")], [1.0, -1.5]);
        let of = |weight: f64| between.amplitude(effect("magnification"), &[weight])[0];
        assert_eq!([of(1.0), of(0.5)], [2.0, 4.0]);
    }
}
