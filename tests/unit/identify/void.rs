use plychain::field::DATA_AXES;
use plychain::field::Field;
use plychain::identify::doubts::mistake::Void;

/// Points along a side.
const SIDE: usize = 161;

/// Points of a lattice about a hole, whose centre lies somewhere between them.
fn around(radius_mm: f64, spacing_mm: f64, off: [f64; 2]) -> Field {
    let at = |k: usize, c: usize| spacing_mm * ((k % SIDE) as f64 - 80.0 + off[c]);
    let all = (0..SIDE * SIDE).map(|k| [at(k, 0), at(k / SIDE, 1)]);
    let points: Vec<[f64; 2]> = all.filter(|p| p[0].hypot(p[1]) > radius_mm).collect();
    Field {
        displacement: vec![[0.0; 2]; points.len()],
        points,
        ..Field::empty(DATA_AXES)
    }
}

/// However far apart points are, the hole that left the void is one of those that it allows; and one that is larger by two spacings is not.
#[test]
fn a_void_allows_the_hole_that_left_it() {
    for spacing_mm in [0.1, 0.25, 0.5, 1.0] {
        for off in [[0.0; 2], [0.5; 2], [0.5, 0.0], [0.31, 0.17]] {
            let void = Void::of(&around(3.0, spacing_mm, off)).unwrap();
            let said = format!(
                "{spacing_mm} {off:?}: {} to {}",
                void.least_mm, void.most_mm
            );
            assert!(void.least_mm <= 6.0 && 6.0 <= void.most_mm, "{said}");
            assert!(void.most_mm < 6.0 + 2.0 * spacing_mm, "{said}");
        }
    }
}
