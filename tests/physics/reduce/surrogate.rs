//! Snapshots of the reduced model.

use plychain::effect::{EFFECTS, Kind};
use plychain::experiment::State;
use plychain::infer::{Model, problem_within};
use plychain::reduce::{Problem, Snapshots, spread_over};

use serde_json::json;

use crate::common::changed;

/// What an effect changes that the reduced basis does not know comes from two solutions on a coarse mesh: snapshots are those of the fine one
/// to far less than a measurement's noise.
#[test]
#[ignore = "slow: run by .ci/run"]
fn what_effects_change_is_taken_from_a_coarse_mesh() {
    let names: Vec<&str> = EFFECTS
        .iter()
        .filter(|e| e.kind() == Kind::Mechanical)
        .map(|e| e.name())
        .collect();
    let mut compared = 0;
    for name in names {
        let file = changed("openhole.json", |m| {
            m["experiments"][0]["effects"] = json!([name])
        });
        let Ok(model) = Model::load(file.as_ref()) else {
            continue;
        };
        let Ok(problem) = problem_within(&model, [[-12.0; 2], [12.0; 2]]) else {
            continue;
        };
        let points = spread_over(&problem, 8, 3);
        let many = spread_over(&problem, 60, 4);
        let bare = many.iter().map(|p| State::new(&p[..4], p[p.len() - 1]));
        problem.experiment.span(&bare.collect::<Vec<_>>()).unwrap();
        let fine = Problem {
            coarse: None,
            ..problem.clone()
        };
        let solved = |problem: &Problem| Snapshots::at(problem, points.clone(), &|| ()).unwrap();
        let [a, b] = [&problem, &fine].map(solved);
        let off_nm: Vec<f64> = (0..2)
            .flat_map(|c| {
                let (a, b) = (&a.seen[c], &b.seen[c]);
                let of = move |j| (0..a.nrows()).map(move |i| 1e6 * (a[(i, j)] - b[(i, j)]).abs());
                (0..a.ncols()).flat_map(of)
            })
            .collect();
        let far = off_nm.iter().filter(|off| **off > 0.2).count();
        let largest = off_nm.iter().fold(0.0_f64, |m, off| m.max(*off));
        println!("{name}: {far} of {}, {largest:.3} nm at most", off_nm.len());
        // in the crescent that a moved hole leaves, a hundredth of the window, each mesh continues its field in its own way
        let most = if name == "hole_offset" { 0.02 } else { 0.002 };
        assert!((far as f64) < most * off_nm.len() as f64, "{name}: {far}");
        compared += 1;
    }
    // all but those of metals, of measured edges and of a third ply
    assert!(compared > 12, "{compared}");
}
