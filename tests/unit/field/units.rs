//! Units as files write them.

use plychain::field::programs::{FORCE_UNITS, newtons};

/// NIST SP 811, appendix B.8: the kilogram-force is 9.806 65 N, the pound 0.453 592 37 kg, the kip 1000 pounds-force.
#[test]
fn units_of_force_have_their_values() {
    let pound_force = 0.453_592_37 * 9.806_65;
    for (name, value) in FORCE_UNITS {
        let expected = match name {
            "N" => 1.0,
            "daN" => 10.0,
            "kN" => 1e3,
            "kgf" => 9.806_65,
            "lb" | "lbf" => pound_force,
            "kip" | "klbf" => 1e3 * pound_force,
            other => panic!("{other} has no expected value here"),
        };
        assert!((value / expected - 1.0).abs() < 1e-12, "{name}: {value}");
        assert_eq!(newtons(&name.to_uppercase()), Some((name, value)));
    }
    // a millinewton is not read as a meganewton, nor the other way round
    assert_eq!(newtons("mN"), None);
    assert_eq!(newtons("MN"), None);
}
