//! Steps that contradict each other, and those that only seem to.

use std::fs;

use plychain::error::Blame;
use proptest::prelude::*;
use serde_json::{Value, json};

use super::{Case, csv, field, grid, name, per_newton, wobble};

#[test]
fn a_step_of_another_grid_or_twice_is_refused() {
    let case = Case::written();
    let shifted: Vec<[f64; 2]> = grid().iter().map(|p| [p[0] + 0.1, p[1]]).collect();
    case.write(1, &csv(&shifted, &field(&shifted, 1000.0, 1)));
    case.refused(&["step-02.csv", "another specimen or another grid?"]);
    // the reference step is named where it is the odd one
    let case = Case::written();
    case.write(3, &csv(&shifted, &field(&shifted, 2000.0, 3)));
    case.refused(&["step-04.csv: found 1126 points, 0 of which"]);
    // the same displacements under another name, in other decimals
    let case = Case::written();
    let copy = csv(&grid(), &field(&grid(), 500.0, 0)).replace("0,", "00,");
    case.write(1, &copy);
    case.refused(&["steps[1].file", "step-01.csv", "step-02.csv", "leave one"]);
    // two paths to one file
    let mut case = Case::written();
    let name = format!(
        "../{}/step-01.csv",
        case.folder.path().file_name().unwrap().display()
    );
    case.steps()[4]["file"] = json!(name);
    case.refused(&["steps[4].file", "step-01.csv", "steps[0].file"]);
}

#[test]
fn a_broken_step_is_refused_by_its_file() {
    for (text, words) in [
        ("", "an empty file"),
        ("x_mm,y_mm,u_mm,v_mm\n", "none complete"),
        (
            "x_mm,y_mm,u_mm,v_mm\nNaN,NaN,NaN,NaN\n1,2,NaN,NaN\n",
            "none complete",
        ),
        ("x_mm,y_mm,u_mm,v_mm\n1,2,3,4\n", "at least 24"),
        ("x,y,u,v\n1,2,3,4\n", "columns.x"),
    ] {
        let case = Case::written();
        case.write(2, text);
        case.refused(&["step-03.csv", words]);
    }
    let case = Case::written();
    let holes: String = csv(&grid(), &field(&grid(), 1500.0, 2))
        .lines()
        .enumerate()
        .map(|(k, line)| match k > 300 && k % 5 != 0 {
            true => "NaN,NaN,NaN,NaN\n".to_string(),
            false => format!("{line}\n"),
        })
        .collect();
    case.write(2, &holes);
    case.refused(&["step-03.csv", "leave the step out"]);
    fs::remove_file(case.folder.path().join(name(2))).unwrap();
    case.refused(&["step-03.csv", "readable"]);
}

/// Forces that contradict the fields are refused; forces that are merely odd are said to be.
#[test]
fn shuffled_and_wrong_forces_are_told() {
    let swapped: [&[f64]; 5] = [
        &[1000.0, 500.0, 1500.0, 2000.0, 0.0],
        &[500.0, 2000.0, 1500.0, 1000.0, 0.0],
        &[2000.0, 1500.0, 1000.0, 500.0, 0.0],
        &[0.0, 500.0, 1000.0, 1500.0, 2000.0],
        // ten times too small
        &[500.0, 1000.0, 1500.0, 200.0, 0.0],
    ];
    for forces in swapped {
        let mut case = Case::written();
        case.set_forces(forces);
        case.refused(&[".force_N", "larger force with a smaller strain"]);
    }
    // one of the other sign, and one true among three of the other sign
    let mut case = Case::written();
    case.set_forces(&[500.0, 1000.0, -1500.0, 2000.0, 0.0]);
    case.refused(&["steps[2].force_N", "-1500", "step-04.csv"]);
    let mut case = Case::written();
    case.set_forces(&[-500.0, 1000.0, -1500.0, -2000.0, 0.0]);
    case.refused(&["steps[1].force_N", "1000"]);
    // ten times too large
    let mut case = Case::written();
    case.set_forces(&[500.0, 1000.0, 1500.0, 20_000.0, 0.0]);
    case.refused(&["steps[3].force_N", "step-04.csv", "20000"]);
    let implied = case.read().unwrap_err().to_string();
    assert!(implied.contains("about 2000"), "{implied}");
    // the forces of fewer steps known: the same contradiction
    let mut case = Case::written();
    case.set_forces(&[1000.0, 500.0, 1500.0, 2000.0, 0.0]);
    for k in [2, 4] {
        case.steps()[k]["force_N"] = Value::Null;
    }
    case.refused(&["larger force"]);
    // ... and of one: nothing to contradict
    for k in [1, 3] {
        case.steps()[k]["force_N"] = Value::Null;
    }
    assert_eq!(case.read().unwrap().warnings, Vec::<String>::new());
}

/// What tests do is no error: compression, unloading on the way, yielding with what stays of it, a large constant and drifting
/// strain of the picture.
#[test]
fn what_happens_in_tests_raises_no_alarm() {
    type Acting<'a> = &'a dyn Fn(usize, f64) -> f64;
    let cases: [(&[f64], Acting); 5] = [
        (&[-500.0, -1000.0, -1500.0], &|_, f| f),
        (&[500.0, 1500.0, 700.0, 2000.0, 0.0], &|_, f| f),
        // yielding: a tenth more at the highest force, which stays
        (&[500.0, 1000.0, 2000.0, 1000.0, 0.0], &|k, f| {
            f + if k >= 2 { 200.0 } else { 0.0 }
        }),
        // a load cell with an error of 2 %
        (&[500.0, 1000.0, 1500.0, 2000.0, 0.0], &|k, f| {
            f * (1.0 + 0.02 * wobble(k, 5))
        }),
        // a dwell at constant force
        (&[2000.0, 1990.0, 1980.0], &|_, f| f),
    ];
    for (forces, acts) in cases {
        let case = Case::new(&forces.iter().map(|f| Some(*f)).collect::<Vec<_>>());
        for (k, &force) in forces.iter().enumerate() {
            let mut u = field(&grid(), acts(k, force), k);
            // towards the camera: the same strain in both directions, as large as the load's
            let zoom = 1e-3 + 1e-3 * k as f64;
            for (u, p) in u.iter_mut().zip(grid()) {
                (0..2).for_each(|c| u[c] += zoom * p[c]);
            }
            case.write(k, &csv(&grid(), &u));
        }
        let warnings = case.read().unwrap().warnings;
        assert!(warnings.is_empty(), "{forces:?}: {warnings:?}");
    }
    // much yielding is said, and no error
    let forces = [500.0, 1000.0, 1500.0, 2000.0];
    let case = Case::new(&forces.map(Some));
    for (k, force) in forces.into_iter().enumerate() {
        let acts = force + [0.0, 0.0, 0.0, 2500.0][k];
        case.write(k, &csv(&grid(), &field(&grid(), acts, k)));
    }
    let warnings = case.read().unwrap().warnings;
    assert!(
        warnings.iter().any(|w| w.contains("yielding")),
        "{warnings:?}"
    );
}

/// A step on the same grid whose field is not that of the others.
#[test]
fn a_step_of_another_specimen_is_refused() {
    let case = Case::written();
    let points = grid();
    let mut u = field(&points, 1500.0, 2);
    for (u, [x, y]) in u.iter_mut().zip(&points) {
        // the perturbation of a hole elsewhere in place of its own
        let (own, other) = (per_newton([*x, *y]), per_newton([x - 6.0, y - 13.0]));
        u[0] += 1500.0 * (other[0] - own[0]);
        u[1] += 1500.0 * (other[1] - own[1]);
    }
    case.write(2, &csv(&points, &u));
    case.refused(&["step-03.csv", "cosine", "another specimen"]);
}

/// A step whose pattern about the hole is larger for its mean strain than in the others.
#[test]
fn a_step_of_a_specimen_with_another_hole_is_refused() {
    let case = Case::written();
    let points = grid();
    let mut u = field(&points, 1000.0, 1);
    for (u, [x, y]) in u.iter_mut().zip(&points) {
        // what the hole adds to the uniform strain, three times, and about as much less of that as it raises the mean
        let own = per_newton([*x, *y]);
        u[0] += 2000.0 * (own[0] + 2.0 * 3e-7 * x);
        u[1] += 2000.0 * (own[1] - 2.0 * 1e-6 * y);
    }
    case.write(1, &csv(&points, &u));
    case.refused(&["step-02.csv", "times as large", "another hole"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn mangled_steps_never_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..30), cut in any::<prop::sample::Index>(), doubled in any::<bool>()) {
        let points: Vec<[f64; 2]> = grid().into_iter().step_by(5).collect();
        let forces = [500.0, 1000.0, 0.0];
        let case = Case::new(&forces.map(Some));
        for (k, force) in forces.into_iter().enumerate() {
            let mut bytes = csv(&points, &field(&points, force, k)).into_bytes();
            if k == 1 {
                for (place, byte) in &edits {
                    let place = place.index(bytes.len());
                    bytes[place] = if byte % 4 > 0 { byte & 0x7f } else { *byte };
                }
                let cut = cut.index(bytes.len());
                if doubled {
                    let piece = bytes[cut..].to_vec();
                    bytes.extend(piece);
                } else if cut % 3 == 0 {
                    bytes.truncate(cut);
                }
            }
            fs::write(case.folder.path().join(name(k)), bytes).unwrap();
        }
        match case.read() {
            Err(error) => prop_assert_eq!(error.blame(), Blame::Input),
            Ok(series) => {
                let finite = series.steps.iter().flat_map(|s| &s.displacement).flatten().all(|u| u.is_finite());
                prop_assert!(finite && series.steps.iter().all(|s| s.displacement.len() == series.field.len()));
            }
        }
    }
}
