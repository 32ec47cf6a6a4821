//! What is said of draws under the full model.

use plychain::posterior::Importance;
use plychain::posterior::importance::{FAR, spread_out};

#[test]
fn draws_that_are_looked_at_lie_evenly_over_all() {
    const ALL: usize = 1000;
    for count in [6, 12, 24] {
        let mut own: Vec<usize> = (0..count).map(|k| spread_out(k, ALL)).collect();
        own.sort_unstable();
        own.dedup();
        assert_eq!(own.len(), count);
        let gaps = own.windows(2).map(|w| w[1] - w[0]);
        let widest = gaps.max().unwrap_or(0);
        assert!(widest * count < 3 * ALL, "{count}: {widest}");
    }
    assert!((0..200).all(|k| spread_out(k, 3) < 3));
}

#[test]
fn a_shift_that_one_step_cannot_say_is_said_by_its_name() {
    let of = |e2: f64| Importance {
        draws: 12,
        impossible: 0,
        effective: 0.5,
        shift_sd: [("E1_GPa".to_string(), 0.1), ("E2_GPa".to_string(), e2)]
            .into_iter()
            .collect(),
        shift_error_sd: [("E1_GPa".to_string(), 0.02), ("E2_GPa".to_string(), 0.03)]
            .into_iter()
            .collect(),
        corrected: true,
        field_nm: 0.1,
        mesh_error: None,
    };
    assert_eq!(of(-0.2).largest(), Some(("E2_GPa", [-0.2, 0.03])));
    assert_eq!(of(0.05).largest(), Some(("E1_GPa", [0.1, 0.02])));
    assert_eq!(of(-0.2).beyond(FAR), None);
    assert_eq!(of(-0.4).beyond(FAR), Some(("E2_GPa", [-0.4, 0.03])));
}
