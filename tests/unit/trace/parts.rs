use plychain::trace::patches::parts::{PatchPart, largest_part};

/// What is left of five frames by block, when each has `of` times a field and noise that no two frames share.
fn left(of: [f64; 5]) -> Vec<[Vec<f64>; 2]> {
    let frames = of.iter().enumerate().map(|(k, size)| {
        [0, 1].map(|c| {
            let block = |b: usize| {
                let field = (0.3 * b as f64 + c as f64).sin();
                let noise = ((7 * b + 3 * c + 1) as f64 * (2.3 + k as f64)).sin();
                size * field + 0.1 * noise
            };
            (0..60).map(block).collect()
        })
    });
    frames.collect()
}

#[test]
fn the_part_that_is_largest_is_told() {
    let loads = [0.25, 0.5, 0.75, 1.0, 0.0];
    let of = |size: [f64; 5]| largest_part(&left(size), &loads, &[1.0; 5]);
    assert_eq!(of(loads), Some(PatchPart::Load));
    assert_eq!(of([1.0; 5]), Some(PatchPart::Common));
    assert_eq!(of([0.0, 0.0, 1.0, 0.0, 0.0]), Some(PatchPart::Own(2)));
    // damage that stays: all loaded pictures have it, by the largest load before
    assert_eq!(of([0.0, 0.5, 0.75, 1.0, 0.0]), Some(PatchPart::Load));
    for t in 0..5 {
        let mut alone = [0.0; 5];
        alone[t] = 1.0;
        assert_eq!(of(alone), Some(PatchPart::Own(t)));
    }
    // of one load nothing tells the specimen from the pictures
    assert_eq!(largest_part(&left([1.0; 5]), &[1.0; 5], &[1.0; 5]), None);
    // nothing is most of what no two pictures share
    assert_eq!(of([0.0; 5]), None);
}
