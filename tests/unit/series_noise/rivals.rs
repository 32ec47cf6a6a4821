//! What follows a law is no noise, noise is no effect, and what a series is too short for.

use super::*;

#[test]
fn what_follows_a_law_does_not_enter_the_noise_and_its_rival_wins() {
    let window = Window::new(40, 2, true);
    for seed in 0..4 {
        let mut truth = Truth {
            scales: vec![1.0, 1.3, 1.0, 1.0, 0.7],
            ..Truth::plain()
        };
        let bare = weighed(&window, &LOADS, &simulated(&window, &truth, 200 + seed));
        for law in [Growth::Constant, Growth::WithLoad] {
            truth.discrepancy = Some((5.0, 4.0, law));
            let all = weighed(&window, &LOADS, &simulated(&window, &truth, 200 + seed));
            for (a, b) in all.noise.spatial.iter().zip(&bare.noise.spatial) {
                assert!(
                    (a.scale2 / b.scale2 - 1.0).abs() < 1e-5,
                    "{} {}",
                    a.scale2,
                    b.scale2
                );
                assert_eq!(a.shape.ratio, b.shape.ratio);
            }
            for (a, b) in all.noise.scales.iter().zip(&bare.noise.scales) {
                assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
            }
            let right = probability(&all, |at| at.rival.is_some_and(|r| r.law == law));
            println!("seed {seed}, {law:?}: P of its rival {right:.6}");
            assert!(right > 0.99);
        }
    }
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn no_rival_wins_over_noise_alone() {
    const SEEDS: u64 = 20;
    let window = Window::new(32, 2, true);
    for smooth in [None, Some((3.0, 5.0))] {
        let truth = Truth {
            smooth,
            ..Truth::plain()
        };
        let mut rivals: Vec<f64> = (0..SEEDS)
            .map(|seed| {
                let all = weighed(&window, &LOADS, &simulated(&window, &truth, 300 + seed));
                probability(&all, |at| at.rival.is_some())
            })
            .collect();
        rivals.sort_by(f64::total_cmp);
        println!(
            "{smooth:?}: P(rival) mean {:.4}, largest {:.4?}",
            mean_sd(&rivals).0,
            &rivals[16..]
        );
        assert!(mean_sd(&rivals).0 < 0.15);
        assert!(rivals.iter().filter(|p| **p > 0.5).count() <= 1);
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let window = Window::new(24, 2, true);
    let truth = Truth {
        smooth: Some((2.0, 4.0)),
        ..Truth::plain()
    };
    let columns = simulated(&window, &truth, 7);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| weighed(&window, &LOADS, &columns))
    });
    assert_eq!(one.noise.scales, three.noise.scales);
    assert_eq!(one.settings.len(), three.settings.len());
    for (a, b) in one.settings.iter().zip(&three.settings) {
        assert_eq!(a.at, b.at);
        assert_eq!(a.log_det.to_bits(), b.log_det.to_bits());
        assert_eq!(a.gram, b.gram);
    }
}

#[test]
fn one_or_two_frames_are_weighed_as_single_fields_are() {
    let window = Window::new(40, 2, true);
    let with = |loads: &[f64], discrepancy, seed| {
        let truth = Truth {
            loads: loads.to_vec(),
            scales: vec![1.0; loads.len()],
            reference: 1.0,
            smooth: None,
            discrepancy,
        };
        weighed(&window, loads, &simulated(&window, &truth, seed))
    };
    // in one frame the reference's noise is its own
    let one = with(&[1.0], None, 1);
    assert!(!one.noise.by_contrasts);
    assert_eq!(one.noise.scales, [1.0]);
    let size = one.noise.spatial[0].scale2 / SD[0].powi(2);
    assert!((size / 2.0 - 1.0).abs() < 0.2, "{size}");
    assert!(one.settings.iter().all(|s| s.at.reference == 0.0));
    assert!(
        one.settings
            .iter()
            .all(|s| s.at.rival.is_none_or(|r| r.law == Growth::Constant))
    );
    assert!(probability(&one, |at| at.rival.is_some()) < 0.5);
    let bent = with(&[1.0], Some((6.0, 8.0, Growth::Constant)), 1);
    assert!(probability(&bent, |at| at.rival.is_some()) > 0.95);

    let two = with(&[1.0, 0.0], None, 2);
    assert!(!two.noise.by_contrasts);
    let size = two.noise.spatial[0].scale2 / SD[0].powi(2);
    assert!((size - 1.0).abs() < 0.25, "{size}");
    // two frames of one load have a contrast
    let same = with(&[1.0, 1.0], None, 2);
    assert!(same.noise.by_contrasts);
    assert!(
        same.settings
            .iter()
            .all(|s| s.at.rival.is_none_or(|r| r.law == Growth::Constant))
    );
    let size = same.noise.spatial[0].scale2 / SD[0].powi(2);
    assert!((size - 1.0).abs() < 0.25, "{size}");
}

#[test]
fn a_series_without_a_subset_and_what_is_refused() {
    let window = Window::new(24, 2, true);
    let rng = &mut Pcg64::seed_from_u64(11);
    let n = window.blocks.len();
    let columns = [0, 1].map(|c: usize| {
        let mut all = explaining(&window, &LOADS, c);
        let count = &window.blocks.count;
        let own = |k: usize| 1.0 / (count[k % n] as f64).sqrt();
        all.push(DVector::from_fn(5 * n, |k, _| SD[c] * own(k) * normal(rng)));
        DMatrix::from_columns(&all)
    });
    let mut frames = Frames {
        blocks: &window.blocks,
        loads: LOADS.to_vec(),
        subset_mm: None,
    };
    let calls = std::sync::atomic::AtomicUsize::new(0);
    let count = || {
        calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    let all = settings(&frames, [&columns[0], &columns[1]], &count).unwrap();
    assert_eq!(calls.into_inner(), steps(&frames));
    let size = all.noise.spatial[0].scale2 * window.blocks.mean_count() / SD[0].powi(2);
    assert!((size - 1.0).abs() < 0.15, "{size}");
    // no reference picture's noise was made
    assert!(probability(&all, |at| at.reference == 0.0) > 0.99);

    frames.loads.push(0.0);
    let error = settings(&frames, [&columns[0], &columns[1]], &|| {}).unwrap_err();
    assert_eq!(error.blame(), Blame::Program);
    let few = Window::new(6, 2, false);
    let columns = simulated(&few, &Truth::plain(), 1);
    frames = Frames {
        blocks: &few.blocks,
        loads: LOADS.to_vec(),
        subset_mm: Some(SUBSET),
    };
    let error = settings(&frames, [&columns[0], &columns[1]], &|| {}).unwrap_err();
    assert_eq!(error.blame(), Blame::Input);
    assert!(
        error
            .to_string()
            .contains("9 blocks in 3 independent contrasts"),
        "{error}"
    );
}
