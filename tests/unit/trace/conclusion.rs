use plychain::trace::conclusion::{size_of, together};

#[test]
fn pairs_are_said_by_what_they_share() {
    let said = |pairs: &[[&str; 2]]| {
        together(
            &pairs
                .iter()
                .map(|p| p.map(String::from))
                .collect::<Vec<_>>(),
        )
    };
    assert_eq!(said(&[["a", "b"]]), "a with b");
    assert_eq!(said(&[["c", "a"], ["a", "b"]]), "a with c or b");
    let many = [["c", "a"], ["a", "b"], ["d", "a"]];
    assert_eq!(said(&many), "a with one of 3 others");
    assert_eq!(said(&[["a", "b"], ["c", "d"]]), "one of 2 pairs of others");
}

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
