use plychain::campaign::collect::outlying::{MOST_Z, robust_z};

/// A value is judged by the others alone, and by its own sd.
#[test]
fn an_outlier_is_found_and_an_uncertain_value_is_none() {
    let mut values: Vec<[f64; 2]> = (0..9).map(|k| [100.0 + f64::from(k % 3), 0.5]).collect();
    values.push([130.0, 0.5]);
    values.push([130.0, 20.0]);
    let z = robust_z(&values);
    assert!(z[9].unwrap() > 10.0, "{z:?}");
    assert!(z[10].unwrap() < 2.0, "{z:?}");
    assert!(z[..9].iter().all(|z| z.unwrap().abs() < MOST_Z), "{z:?}");
    assert_eq!(robust_z(&values[..4]), [None; 4]);
}
