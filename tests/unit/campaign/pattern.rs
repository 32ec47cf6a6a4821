use plychain::campaign::pattern::expand;
use plychain::files::natural;

#[test]
fn numbers_are_sorted_by_their_size() {
    let mut names = vec!["c10", "c9", "c09", "b100", "b1.5", "b1.25"];
    names.sort_by(|a, b| natural(a, b));
    assert_eq!(names, ["b1.25", "b1.5", "b100", "c09", "c9", "c10"]);
}

#[test]
fn a_pattern_finds_files_in_folders() {
    let place = tempfile::tempdir().unwrap();
    for name in [
        "a/x-10.csv",
        "a/x-2.csv",
        "b/x-1.csv",
        "b/y.txt",
        "a/.x-3.csv",
        "[c]/x-4.json",
    ] {
        let path = place.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }
    let found = expand(&["*/x-*.csv".into()], place.path(), "data").unwrap();
    let expected = ["a/x-2.csv", "a/x-10.csv", "b/x-1.csv"].map(|n| place.path().join(n));
    assert_eq!(found, expected);
    let found = expand(&["[c]/x-?.json".into()], place.path(), "data").unwrap();
    assert_eq!(found, [place.path().join("[c]/x-4.json")]);
    let none = expand(&["*.json".into()], place.path(), "models").unwrap_err();
    assert!(none.to_string().contains("*.json"), "{none}");
}
