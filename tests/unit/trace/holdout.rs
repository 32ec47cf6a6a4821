use plychain::trace::holdout::{DIVISIONS, Scores, gains};

fn scores(regions: [f64; DIVISIONS], steps: Option<&[f64]>) -> Scores {
    Scores {
        regions,
        steps: steps.map(<[f64]>::to_vec),
    }
}

/// Regions that smooth noise leaves silent do not outvote steps that speak.
#[test]
fn what_tells_nothing_does_not_count() {
    let gain = |regions: [f64; DIVISIONS], steps: &[f64]| {
        let none = scores([7.0; DIVISIONS], Some(&vec![3.0; steps.len()]));
        let with = scores(
            regions.map(|gain| 7.0 + gain),
            Some(&steps.iter().map(|gain| 3.0 + gain).collect::<Vec<_>>()),
        );
        gains(&with, &none, true)
    };
    let silent = [-0.002, -0.001, -0.003, -0.002];
    assert!(gain(silent, &[6.8, 8.5, -0.2, 6.3]));
    assert!(!gain(silent, &[-6.8, 2.0, -0.2, -6.3]));
    // one division may be worse, two may not
    assert!(gain([4.0, -1.0, 2.0, 3.0], &[1.0]));
    assert!(!gain([9.0, -1.0, -0.5, 3.0], &[1.0]));
    assert!(!gain([0.0; DIVISIONS], &[0.0]));
    // where nothing tells, more than one loss is too many
    assert!(!gain([0.001, -0.002, 0.003, -0.001], &[0.02]));
}

/// Of an amplitude of a step's own the other steps say nothing.
#[test]
fn steps_count_where_they_tell() {
    let (with, without) = (
        scores([1.0, 1.0, 1.0, -0.5], Some(&[-9.0])),
        scores([0.0; DIVISIONS], Some(&[0.0])),
    );
    assert!(gains(&with, &without, false));
    assert!(!gains(&with, &without, true));
}
