use std::sync::Arc;

use nalgebra::DMatrix;
use plychain::files::{Keyed, Stored};

fn back<T: Stored>(value: &T) -> T {
    let mut bytes = Vec::new();
    value.put(&mut bytes);
    let mut from = &bytes[..];
    let found = T::take(&mut from).unwrap();
    assert!(from.is_empty());
    // of less than all bytes there is no value
    assert!(T::take(&mut &bytes[..bytes.len() - 1]).is_none());
    found
}

#[test]
fn values_come_back_to_the_last_bit() {
    let names = vec![
        (String::from("E1_GPa"), vec![0.1, -0.0]),
        (String::new(), vec![]),
    ];
    assert_eq!(back(&names), names);
    let odd = [f64::NAN, f64::INFINITY, -0.0, 5e-324, f64::MAX];
    assert_eq!(back(&odd).map(f64::to_bits), odd.map(f64::to_bits));
    #[cfg(feature = "identify")]
    {
        let matrix = DMatrix::from_fn(3, 2, |i, j| (i * 2 + j) as f64 / 3.0);
        assert_eq!(back(&matrix), matrix);
    }
    let mixed = (
        Some(vec![true, false]),
        (None::<u8>, (7_usize, Arc::new(u64::MAX))),
    );
    assert_eq!(back(&mixed), mixed);
    let keyed: Keyed<f64> = [("b".into(), 1.0), ("a".into(), 2.0)].into_iter().collect();
    assert_eq!(
        back(&keyed).into_iter().collect::<Vec<_>>(),
        keyed.into_iter().collect::<Vec<_>>()
    );
}
