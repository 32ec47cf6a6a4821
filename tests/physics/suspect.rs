//! Fields that carry what the dictionary lacks, by tracing alone; `loops` runs whole loops over many more.

use plychain::effect::EFFECTS;
use plychain::infer::Model;
use plychain::trace::{Suspect, Tracing};

use crate::common::coarse;
use crate::tracing::{COARSE_GRID, COARSE_NOISE, TRUTH, measured_with, traced};

/// Effects withheld from the dictionary while they act, at their plausible size, with what is visible of them.
pub const WITHHELD: [(&str, &str); 12] = [
    ("rigid_rotation", "rigid_rotation=100"),
    ("registration_offset", "registration_offset=0.1,-0.06"),
    ("camera_rotation", "camera_rotation=0.5"),
    ("camera_tilt", "camera_tilt=1e-4,-0.5e-4"),
    ("lens_distortion", "lens_distortion=0.3"),
    ("load_misalignment", "load_misalignment=1"),
    ("in_plane_bending", "in_plane_bending=0.2"),
    ("hole_offset", "hole_offset=0.3,0"),
    ("hole_size", "hole_size=2"),
    ("ply_misorientation", "ply_misorientation=1"),
    ("thickness_taper", "thickness_taper=2,1"),
    ("hole_edge_damage", "hole_edge_damage=20"),
];

/// What became of one field.
pub struct Outcome {
    case: String,
    /// Sds by which the quoted intervals miss each constant, those that hold it with their distance from the mean.
    z: Vec<f64>,
    held: usize,
    /// Whether the account is called closed, with which effects.
    closed: bool,
    named: Vec<&'static str>,
}

/// The intervals to quote of a tracing.
fn quoted(last: &Tracing) -> Vec<[f64; 4]> {
    let suspect = Some(&last.suspect).filter(|s| !s.reasons.is_empty());
    let quoted = suspect.map_or_else(|| last.averaged.clone(), Suspect::hull);
    quoted
        .values()
        .map(|i| [i.low, i.high, i.mean, i.sd])
        .collect()
}

fn outcome(withheld: &str, acting: &[&str], seed: u64) -> Outcome {
    let mut model = measured_with(&coarse(), COARSE_GRID, acting, COARSE_NOISE, seed);
    let left = EFFECTS
        .iter()
        .map(|e| e.name())
        .filter(|name| *name != withheld);
    model.experiment_mut().candidates = Some(left.map(String::from).collect());
    of_model(&acting.join(" "), &model)
}

/// What becomes of a measured model.
pub fn of_model(case: &str, model: &Model) -> Outcome {
    let (accepted, last) = traced(model);
    let quoted = quoted(&last);
    Outcome {
        case: case.into(),
        held: quoted
            .iter()
            .zip(TRUTH)
            .filter(|([low, high, ..], t)| (*low..*high).contains(t))
            .count(),
        z: quoted
            .iter()
            .zip(TRUTH)
            .map(|([.., mean, sd], t)| (mean - t) / sd)
            .collect(),
        closed: last.suspect.reasons.is_empty(),
        named: accepted.iter().map(|(name, _)| *name).collect(),
    }
}

/// Visible culprits: so large a share of the intervals holds the truth, none misses by more than 5 sd, and at most a tenth reads closed
/// under a wrong name.
pub fn judge(outcomes: &[Outcome], share: f64) {
    for o in outcomes {
        let z: Vec<String> = o.z.iter().map(|z| format!("{z:+.1}")).collect();
        println!(
            "{:40} held {} z {} closed {} {:?}",
            o.case,
            o.held,
            z.join(" "),
            o.closed,
            o.named
        );
    }
    let held: usize = outcomes.iter().map(|o| o.held).sum();
    let all = 4 * outcomes.len();
    assert!(
        held as f64 >= share * all as f64,
        "{held} of {all} intervals hold the truth"
    );
    let worst = outcomes
        .iter()
        .flat_map(|o| &o.z)
        .fold(0.0_f64, |m, z| m.max(z.abs()));
    assert!(worst < 5.0, "an interval misses by {worst:.1} sd");
    let wrong = outcomes
        .iter()
        .filter(|o| o.closed && !o.named.is_empty())
        .count();
    assert!(
        10 * wrong <= outcomes.len(),
        "{wrong} of {} close under a wrong name",
        outcomes.len()
    );
}

/// Four of the visible culprits.
#[test]
#[ignore = "slow: run by .ci/run"]
fn intervals_hold_the_truth_where_the_culprit_is_withheld() {
    let cases = [
        "camera_rotation",
        "lens_distortion",
        "load_misalignment",
        "hole_edge_damage",
    ];
    let chosen = WITHHELD.iter().filter(|(name, _)| cases.contains(name));
    let outcomes: Vec<Outcome> = chosen
        .zip(800..)
        .map(|((name, case), seed)| outcome(name, &[case], seed))
        .collect();
    // of 16 intervals, 15
    judge(&outcomes, 0.93);
}
