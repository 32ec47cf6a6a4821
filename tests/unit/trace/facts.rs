use plychain::trace::facts::{Status, VerdictFacts};

/// All combinations of the facts.
fn all() -> Vec<VerdictFacts> {
    let of = |bits: u32| {
        let bit = |k: u32| bits >> k & 1 == 1;
        VerdictFacts {
            added: bit(0),
            wanted: bit(1),
            structure: bit(2),
            patterns: bit(3),
            undecided: bit(4),
            objections: bit(5),
        }
    };
    (0..64).map(of).collect()
}

/// Noise explains what is left where the status says so, and nowhere else; where it does not, something says what is wrong.
#[test]
fn words_never_contradict_the_status() {
    for facts in all() {
        let words = facts.words().unwrap_or_default();
        let by_noise = words.contains("noise explains");
        let open = facts.status() == Status::Unexplained;
        assert_eq!(by_noise, !open, "{facts:?}: {words}");
        if open {
            // said here, or by what was found
            let said = !words.is_empty() || facts.wanted || facts.patterns;
            assert!(said, "{facts:?}");
        }
        assert_eq!(
            words.contains("Structure"),
            facts.structure,
            "{facts:?}: {words}"
        );
        let asks_for_nothing = words.contains("nothing asks");
        assert!(
            !asks_for_nothing || !(facts.added || facts.undecided || open),
            "{facts:?}: {words}"
        );
    }
}

#[test]
fn a_status_is_open_where_anything_is_left() {
    for facts in all() {
        let left = facts.wanted || facts.structure || facts.patterns || facts.objections;
        let expected = match (left, facts.added) {
            (true, _) => Status::Unexplained,
            (false, true) => Status::Closed,
            (false, false) => Status::NothingMissing,
        };
        assert_eq!(facts.status(), expected);
        // doubt alone leaves no status open
        let sure = VerdictFacts {
            undecided: false,
            ..facts
        };
        assert_eq!(sure.status(), facts.status());
    }
}
