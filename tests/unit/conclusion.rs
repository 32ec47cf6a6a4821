use super::size_of;

#[test]
fn sizes_are_said_in_any_unit() {
    let said = |pairs: &[(&str, f64)]| {
        let pairs = pairs.iter().map(|(n, v)| ((*n).to_string(), *v));
        size_of(&pairs.collect::<Vec<_>>())
    };
    let beta = [("shear_nonlinearity.beta_per_MPa3", -1.234e-7)];
    assert_eq!(said(&beta), "beta_per_MPa3 -1.23e-7");
    let taper = [
        ("thickness_taper.across_percent", -9.1406),
        ("thickness_taper.along_percent", 1.9e-6),
    ];
    assert_eq!(said(&taper), "across_percent -9.14");
}
