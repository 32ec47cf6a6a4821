//! One table on a terminal, on a page and as CSV: typed cells are written by each renderer in its own way, and by nothing else.

use plychain::report::html;
use plychain::section::{Digits, Document, Piece, Section, Table, TableCell, csv, row, terminal};

fn table() -> Table {
    let rows = [
        row(
            "E1_GPa",
            [
                TableCell::mean_sd(Some((-140.04, 1.2))),
                TableCell::interval([7.84, 0.083, 7.677, 8.004]),
                TableCell::with_unit(-0.5, Digits::Signed(1), "%"),
                TableCell::Probability(0.98765),
                TableCell::Blank,
            ],
        ),
        row(
            "plate & <hole>",
            [
                TableCell::Missing,
                TableCell::Missing,
                TableCell::number(f64::NAN, Digits::Three),
                TableCell::Missing,
                TableCell::Blank,
            ],
        ),
    ];
    let header = ["name", "moments", "interval", "shift", "p", "published"];
    Table::new("constants", header, rows)
}

#[test]
fn a_table_is_aligned_on_a_terminal() {
    let text = terminal(&[Section::new("results")
        .with(table())
        .say("word ".repeat(40))]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[..4], ["", "results", "", "constants"]);
    assert!(lines[6].starts_with(
        "  E1_GPa          -140.0 +- 1.2  7.840 +- 0.083 [7.677, 8.004]  -0.5 %  0.988"
    ));
    assert!(lines[7].starts_with("  plate & <hole>") && lines[7].ends_with("-      -"));
    // a column of blanks is left out, and running text is broken
    assert!(!text.contains("published"));
    let [widest, width] = [5, 6].map(|k| lines[k].chars().count());
    assert_eq!(widest, width, "{text}");
    assert!(lines.iter().all(|line| line.chars().count() <= 100));
}

#[test]
fn a_page_typesets_and_escapes_what_a_table_holds() {
    let document = Document {
        sections: vec![
            Section::new("Results").with(table()),
            Section::new("Nothing").with(Piece::figure("not-drawn")),
        ],
        ..Document::default()
    };
    let page = html(&document, &[]);
    for part in [
        "<caption><span>Constants</span></caption>",
        "\u{2212}140.0 \u{b1} 1.2",
        "\u{2212}0.5 %",
        "plate &amp; &lt;hole&gt;",
        ">\u{2013}</td>",
    ] {
        assert!(page.contains(part), "{part} is missing in {page}");
    }
    assert!(!page.contains("Nothing") && !page.contains("published"));
}

/// A number a column, as it is, and nothing where there is none.
#[test]
fn csv_holds_every_number_whole() {
    let text = String::from_utf8(csv(&table()).unwrap()).unwrap();
    let expected = "name,moments_mean,moments_sd,interval_mean,interval_sd,interval_q2.5,interval_q97.5,shift,p\n\
                    E1_GPa,-140.04,1.2,7.84,0.083,7.677,8.004,-0.5,0.98765\n\
                    plate & <hole>,,,,,,,,\n";
    assert_eq!(text, expected);
}
