//! What a run costs: its stages.

use plychain::progress::StageClock;

#[test]
fn stages_are_kept_in_their_order_and_counted() {
    let mut clock = StageClock::default();
    for stage in ["noise", "basis", "noise"] {
        clock.begin(stage);
        clock.end();
    }
    // one that is not ended is ended by the next
    clock.begin("evidence");
    clock.begin("basis");
    clock.end();
    clock.end();
    let costs = clock.costs();
    let found: Vec<(&str, usize)> = costs.iter().map(|c| (&*c.stage, c.times)).collect();
    assert_eq!(
        found,
        [("noise", 2), ("basis", 2), ("evidence", 1), ("all else", 1)]
    );
    for cost in &costs {
        assert!(cost.wall_s >= 0.0, "{cost:?}");
        let known = cost.processor_s.is_some();
        assert_eq!(known, cfg!(target_os = "linux"), "{cost:?}");
    }
}
