use plychain::campaign::sweep::put;

#[test]
fn keys_are_dotted_or_pointers() {
    let mut file = serde_json::json!({ "a": [{ "b": 1 }] });
    put(&mut file, "a.0.b", &2.into()).unwrap();
    put(&mut file, "/a/0/c", &3.into()).unwrap();
    assert_eq!(file, serde_json::json!({ "a": [{ "b": 2, "c": 3 }] }));
    assert!(put(&mut file, "a.1.b", &4.into()).is_err());
    assert!(put(&mut file, "x.y", &4.into()).is_err());
}
